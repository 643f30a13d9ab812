"""The measurement model, compiled: measured boxes, and the expected boxes of targets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.boxes import expected_boxes
from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.lens import Calibration
from tracker.kernels.linear_algebra import factorise, solve

_SIGMA_POINTS = 6
"""Number of sigma points of a 3D position: at ±√3 standard deviations along each axis of the
Cholesky factor, with the weight 1/6 each. This is the cubature rule of degree three for n = 3
(Arasaratnam, Haykin, "Cubature Kalman filters", IEEE Transactions on Automatic Control 54(6),
2009), the unscented transform with κ = 0."""


class Target(NamedTuple):
    """A target of known size, upright or in another posture: lying, crouching, bent."""

    half_height: float
    """Half height of the upright target, metres."""
    half_width: float
    """Half width of the upright target, metres."""
    size: int
    """m, size of a measurement: see :func:`tracker.kernels.boxes.expected_boxes`."""
    unscented: bool
    """Whether the nonlinearity of the projection is handled by the unscented transform."""
    posture_half_height: float
    """Half height in the other posture, metres."""
    posture_half_width: float
    """Half width in the other posture, metres."""
    posture_noise: ndarray
    """(m, m), noise covariance of the box in the other posture, for one pixel of the upright box's
    half height; (0, 0) where there is no other posture."""
    posture_drift: ndarray
    """D (d, d), covariance of the change of a state with the posture."""
    posture_share: float
    """ε, share of the boxes that show the other posture, 0 … 1."""


class ExpectedBoxes(NamedTuple):
    """The predicted measurements of J targets in a camera."""

    expected: Expected
    """The values are centre (x, y), or horizontal centre, top, bottom (and width), in pixels,
    infinite in the other posture where invalid; the Jacobians are pixels per metre, and zero for
    velocities; the spreads are the noise added by the nonlinearity of the projection, squared
    pixels, one for each state or none. The same is given for the second posture, lying or bent,
    where it is modelled."""
    boxes: ndarray
    """(J, 4) left, top, right, bottom of the upright targets, not clipped, pixels."""
    depths: ndarray
    """(J,), distance from the lens, metres."""
    valid: ndarray
    """(J,), whether middle, head and foot lie in front of the lens."""

    @property
    def values(self) -> ndarray:
        """Predicted measurement of each upright target (J, m), pixels."""
        return self.expected.values

    @property
    def jacobians(self) -> ndarray:
        """Derivative of the values by the state (J, m, d), pixels per metre."""
        return self.expected.jacobians

    @property
    def spreads(self) -> ndarray:
        """Noise added by the nonlinearity (K, m, m), squared pixels; K is J or 0."""
        return self.expected.spreads


class _SigmaPoints(NamedTuple):
    """The sigma points of J positions."""

    points: ndarray
    """χ (6 J, 3), world metres."""
    offsets: ndarray
    """χ − m (6 J, 3), metres."""


@kernel
def measured_boxes(
    boxes: ndarray, variances: ndarray, transform: ndarray, products: ndarray
) -> Measurements:
    """Convert boxes to measurements z = T b, with noise T diag(σ²) Tᵀ.

    Args:
        boxes: b (M, 4), centre and half sizes, pixels.
        variances: σ² (M, 4), squared pixels.
        transform: T (m, 4), matrix from a box to the components of a measurement.
        products: (4, m²), coefficient of each variance in each entry of the noise.
    """
    count, size = len(boxes), len(transform)
    values = np.zeros((count, size))
    noises = np.zeros((count, size, size))
    for i in range(count):
        for part in range(4):
            for a in range(size):
                values[i, a] += transform[a, part] * boxes[i, part]
                for b in range(size):
                    noises[i, a, b] += variances[i, part] * products[part, a * size + b]
    return Measurements(values, noises)


@kernel
def expected_measurements(
    states: ndarray, covariances: ndarray, target: Target, camera: Calibration
) -> ExpectedBoxes:
    """Predict the measurement of each target: upright, and in the other posture.

    Args:
        states: (J, d), position first, world metres.
        covariances: (J, d, d) covariances, which are used for an unscented target.
        target: Sizes and postures of the target.
        camera: Image size, lens and pose of the camera.
    """
    size = target.size
    seen = expected_boxes(states, target.half_height, target.half_width, size, camera)
    others = len(states) if len(target.posture_noise) > 0 else 0
    posture = expected_boxes(
        states[:others], target.posture_half_height, target.posture_half_width, size, camera
    )
    posture_spreads = np.empty((others, size, size))
    for j in range(others):
        if not posture.valid[j]:
            posture.values[j] = np.inf  # beyond every gate
        scale = max((seen.boxes[j, 3] - seen.boxes[j, 1]) / 2.0, 1.0)
        posture_spreads[j] = scale * scale * target.posture_noise
    spreads = np.zeros((len(states) if target.unscented else 0, size, size))
    if target.unscented:
        sigma = _sigma_points(states, covariances)
        drawn = expected_boxes(sigma.points, target.half_height, target.half_width, size, camera)
        for j in range(len(states)):
            own = slice(_SIGMA_POINTS * j, _SIGMA_POINTS * (j + 1))
            if seen.valid[j] and drawn.valid[own].all():
                _regress(
                    drawn.values[own], sigma.offsets[own], covariances[j],
                    seen.values[j], seen.jacobians[j], spreads[j],
                )  # fmt: skip
    return ExpectedBoxes(
        Expected(
            seen.values,
            seen.jacobians,
            spreads,
            posture.values,
            posture.jacobians,
            posture_spreads,
            target.posture_drift,
            target.posture_share,
        ),
        seen.boxes,
        seen.depths,
        seen.valid,
    )


@kernel
def _sigma_points(states: ndarray, covariances: ndarray) -> _SigmaPoints:
    """Compute the sigma points of each position."""
    count = len(states)
    offsets = np.empty((_SIGMA_POINTS * count, 3))
    points = np.empty((_SIGMA_POINTS * count, 3))
    lower = np.zeros((3, 3))
    for j in range(count):
        factorise(covariances[j, :3, :3], lower)
        for k in range(_SIGMA_POINTS):
            sign = np.sqrt(3.0) if k < 3 else -np.sqrt(3.0)
            for a in range(3):
                offset = sign * lower[a, k % 3]
                offsets[_SIGMA_POINTS * j + k, a] = offset
                points[_SIGMA_POINTS * j + k, a] = states[j, a] + offset
    return _SigmaPoints(points, offsets)


@kernel
def _regress(
    drawn: ndarray,
    offsets: ndarray,
    covariance: ndarray,
    value: ndarray,
    jacobian: ndarray,
    spread: ndarray,
) -> None:
    """Compute the statistical linear regression over one state's uncertainty ([LBS02]), in place.

        ẑ = Σ w h(χ),  H = [Σ w (h(χ) − ẑ)(χ − m)ᵀ] P⁻¹,
        Ω = Σ w (h(χ) − ẑ)(h(χ) − ẑ)ᵀ − H P Hᵀ

    Args:
        drawn: h(χ) (6, m), measurements of the sigma points.
        offsets: χ − m (6, 3), offsets of the sigma points from the mean, metres.
        covariance: (d, d), of which the part P of the position is used.
        value: ẑ (m,), receives the mean.
        jacobian: H (m, d), receives the regression matrix in its first three columns.
        spread: Ω (m, m), receives the covariance of the residual.

    [LBS02] Lefebvre, Bruyninckx, De Schutter, IEEE Transactions on Automatic Control 47(8), 2002.
    """
    size = drawn.shape[1]
    cross = np.zeros((size, 3))
    for p in range(size):
        value[p] = drawn[:, p].mean()
    for k in range(_SIGMA_POINTS):
        for p in range(size):
            for a in range(3):
                cross[p, a] += (drawn[k, p] - value[p]) * offsets[k, a] / _SIGMA_POINTS
    lower = np.zeros((3, 3))
    factorise(covariance[:3, :3], lower)
    for p in range(size):
        solve(lower, cross[p], jacobian[p, :3])
    for p in range(size):
        for q in range(p + 1):
            total = 0.0
            for k in range(_SIGMA_POINTS):
                total += (drawn[k, p] - value[p]) * (drawn[k, q] - value[q]) / _SIGMA_POINTS
            for a in range(3):
                total -= jacobian[p, a] * cross[q, a]
            spread[p, q] = total
            spread[q, p] = total
