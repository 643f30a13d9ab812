"""What a camera measures of targets, and what it should: the measurement model, compiled."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels.boxes import expected_boxes
from tracker.kernels.compilation import kernel
from tracker.kernels.linear_algebra import factorise, solve

_SIGMA_POINTS = 6
"""Of a 3D position: its axes at ±√3 standard deviations, each with 1/6 of the weight."""


@kernel
def measured_boxes(
    boxes: ndarray, variances: ndarray, transform: ndarray, products: ndarray
) -> tuple[ndarray, ndarray]:
    """Boxes as measurements z = T b, and their noise T diag(σ²) Tᵀ.

    Args:
        boxes: b (M, 4).
        variances: σ² (M, 4).
        transform: T (m, 4).
        products: (4, m²), what each variance adds to each entry of the noise.

    Returns:
        (M, m) and (M, m, m).
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
    return values, noises


@kernel
def expected_measurements(
    states: ndarray,
    covariances: ndarray,
    unscented: bool,
    half_height: float,
    half_width: float,
    low_half_height: float,
    low_half_width: float,
    low_noise: ndarray,
    size: int,
    image_size: tuple[int, int],
    rotation: ndarray,
    translation: ndarray,
    intrinsics: ndarray,
    distortion: ndarray,
    nearest_depth: float,
    largest_radius: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray]:
    """What a camera should measure of each target: upright, and lying or bent.

    Args:
        states: (J, d), position first, world metres.
        covariances: (J, d, d); they count where ``unscented`` says so.
        unscented: Whether the projection's bend over a state's uncertainty counts.
        half_height: Of the upright target, metres, as ``half_width``.
        low_half_height: Of one who lies or bends, as ``low_half_width``.
        low_noise: (m, m), how far his box may be off, for one pixel of the upright box's half
            height; (0, 0) where nobody lies.
        size: As the further ones, of :func:`tracker.kernels.boxes.expected_boxes`.

    Returns:
        Upright: (J, m) values, (J, m, d) derivatives, (J, m, m) what the bend adds to the noise
        or (0, m, m) for nothing, (J, 4) boxes, (J,) depths, (J,) whether there is anything to
        see. Low: (J, m) values, infinite where there is nothing to see, (J, m, d) derivatives
        and (J, m, m) noise; or none of each.
    """
    values, jacobians, boxes, depths, valid = expected_boxes(
        states, half_height, half_width, size, image_size, rotation, translation, intrinsics,
        distortion, nearest_depth, largest_radius,
    )  # fmt: skip
    low = len(states) if len(low_noise) > 0 else 0
    low_values, low_jacobians, _, _, low_valid = expected_boxes(
        states[:low], low_half_height, low_half_width, size, image_size, rotation, translation,
        intrinsics, distortion, nearest_depth, largest_radius,
    )  # fmt: skip
    low_spreads = np.empty((low, size, size))
    for j in range(low):
        if not low_valid[j]:
            low_values[j] = np.inf  # beyond every gate
        scale = max((boxes[j, 3] - boxes[j, 1]) / 2.0, 1.0)
        low_spreads[j] = scale * scale * low_noise
    spreads = np.zeros((len(states) if unscented else 0, size, size))
    if unscented:
        points, offsets = _sigma_points(states, covariances)
        drawn, _, _, _, ahead = expected_boxes(
            points, half_height, half_width, size, image_size, rotation, translation, intrinsics,
            distortion, nearest_depth, largest_radius,
        )  # fmt: skip
        for j in range(len(states)):
            own = slice(_SIGMA_POINTS * j, _SIGMA_POINTS * (j + 1))
            if valid[j] and ahead[own].all():
                _regress(drawn[own], offsets[own], covariances[j], values[j], jacobians[j],
                         spreads[j])  # fmt: skip
    return (
        values, jacobians, spreads, boxes, depths, valid, low_values, low_jacobians, low_spreads,
    )  # fmt: skip


@kernel
def _sigma_points(states: ndarray, covariances: ndarray) -> tuple[ndarray, ndarray]:
    """The unscented points χ of each position, (6 J, 3), and their offsets χ − m."""
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
    return points, offsets


@kernel
def _regress(
    drawn: ndarray,
    offsets: ndarray,
    covariance: ndarray,
    value: ndarray,
    jacobian: ndarray,
    spread: ndarray,
) -> None:
    """The statistical linear regression over one state's uncertainty, into the last three.

        ẑ = Σ w h(χ),  H = [Σ w (h(χ) − ẑ)(χ − m)ᵀ] P⁻¹,
        Ω = Σ w (h(χ) − ẑ)(h(χ) − ẑ)ᵀ − H P Hᵀ

    Args:
        drawn: h(χ) (6, m).
        offsets: χ − m (6, 3).
        covariance: (d, d), of which the position P counts.
        value: ẑ (m,).
        jacobian: H (m, d).
        spread: Ω (m, m).
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
