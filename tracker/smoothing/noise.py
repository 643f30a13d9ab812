"""The noise of boxes, estimated from the recording, and the covariance that follows from it.

Detectors err alike in consecutive frames: a smoother that takes the errors of boxes as independent
averages what does not average. The model of a box of person i in camera c at step k is

    z = h_c(x_k) + η (β_ick + r v) + ς v',   β_(k+1) = exp(-Δt/τ) β_k + w,   Var β = q²

with half height η, white noise v and v', and errors β that persist for a time τ. One model holds
for all cameras: if each camera's noise were estimated from its own residuals, a camera with small
noise would draw positions towards its boxes, leave small residuals, and get a still smaller noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.models import Motion
from tracker.kernels.smoothing.innovations import (
    BoxErrors,
    DeviationMotion,
    Windows,
    log_likelihood,
)
from tracker.smoothing.paths import Paths

# These constants change no position: what is measured is the share of positions within the ellipse
# of 95 % that is reported, 0.926 in the mean of the crowds and of the recordings of
# ``tests/papers/rooms/fusion_constants.md``.
MOST_ROWS = 600
"""Number of rows from which the noise is estimated. Halved or doubled, the share in a recording
changes by at most 0.03 or 0.05, in its mean by less than 0.02."""

WINDOW = 60
"""Most rows of one window. Halved or doubled, the mean share changes by at most 0.012."""

LEAST_ROWS = 50
"""Number of rows that two cameras see below which nothing is estimated."""

COMMON = 1.5
"""κ: variance of the error that all cameras have in common, in that of one camera's persistent
errors and offset: a calibration that is wrong alike in all cameras leaves no trace in their
residuals, only its order of size can be inferred from what cameras differ by. The value is a
correlation of 0.6 between the persistent errors of two cameras. Halved, the share in recordings
falls by 0.05, doubled it rises by 0.03; in crowds it changes by less than 0.01."""

_FARTHEST = 8.0
"""Bound of the persistent errors' part of a covariance, in the variance of one camera's. Halved or
doubled it changes the mean share by 0.002 at most, and without it the share rises by 0.01."""

_WIDE = 1.0
"""Prior standard deviation of a position where the boxes of a step tell nothing, metres. Halved or
doubled it changes no share."""

_DEVIATION, _DEVIATION_VELOCITY = 0.5, 1.0
"""Prior standard deviation of a window's first state around the smoothed one, m and m/s. Halved or
doubled, neither changes a share."""

SHARES = 1e-3, 1.0
"""Bounds of r and q, half heights."""

PIXELS = 0.05, 20.0
"""Bounds of ς, pixels."""

LONGEST = 60.0
"""Bound of τ, seconds; what is forgotten within a step does not persist."""

PROCESS = 0.05, 20.0
"""Bounds of the factor on the process noise."""

_START_TIME, _START_PIXELS = 1.0, 1.0
"""Values of τ, seconds, and ς, pixels, at which the search of the maximum begins."""

_ITERATIONS, _TOLERANCE = 40, 1e-6
"""Largest number of iterations of L-BFGS, and relative change of the likelihood at which it
stops. With half and twice as many iterations no share changes by 0.001."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """The noise of boxes with measurements of size m."""

    white: Float[ndarray, " m"]
    """r: standard deviation of errors without memory, half heights."""
    pixels: float
    """ς: standard deviation of errors without memory, pixels."""
    persistent: Float[ndarray, " m"]
    """q: standard deviation of errors that persist, half heights."""
    time: float
    """τ: the time for which they persist, seconds."""
    process: float
    """Factor on the process noise of the motion model."""

    def variances(self, half_heights: Float[ndarray, " M"]) -> Float[ndarray, "M m"]:
        """R of M boxes, η² (r² + q²) + ς², squared pixels."""
        shares = self.white**2 + self.persistent**2
        return np.asarray(half_heights[:, None] ** 2 * shares + self.pixels**2)


@dataclass(frozen=True, slots=True, eq=False)
class SureBoxes:
    """The L boxes that are surely those of rows of paths, camera after camera."""

    cameras: Int[ndarray, " L"]
    """Index of the camera."""
    rows: Int[ndarray, " L"]
    """Index of the row."""
    residuals: Float[ndarray, "L m"]
    """Measurement less what is expected, pixels."""
    jacobians: Float[ndarray, "L m 3"]
    """Derivative of the measurement by the position, pixels per metre."""
    half_heights: Float[ndarray, " L"]
    """Half height of the expected box, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseSample:
    """Rows of smoothed paths, with N rows in all, and the boxes by which the noise is estimated."""

    paths: Paths
    """The paths."""
    rows: Int[ndarray, " K"]
    """The rows, ascending, as :func:`choose_rows` returns them."""
    seen: SureBoxes
    """The boxes of these rows."""
    motion: Motion
    """The motion model."""
    noise_scales: Float[ndarray, " N"]
    """Factor on the process noise of the step to each row."""
    step_time: float
    """Time between two steps, seconds."""

    @property
    def deviation(self) -> DeviationMotion:
        """The motion of a window's deviation from the smoothed states."""
        variances = np.repeat([_DEVIATION**2, _DEVIATION_VELOCITY**2], 3)
        prior = np.diag(variances[: self.paths.states.shape[1]])
        return DeviationMotion(self.motion.transition, self.motion.noise, prior)

    def windows(self) -> tuple[Windows, Int[ndarray, " O"]]:
        """Arrange rows with their boxes; a window ends with its path or its length.

        Returns:
            The windows, and the box of the sample that each of their boxes is.
        """
        paths, rows, seen = self.paths, self.rows, self.seen
        owners = paths.owners_of(rows)
        within = rows - paths.starts[owners]
        begins = np.append(True, (np.diff(rows) != 1) | (within[1:] % WINDOW == 0))
        order = np.lexsort((seen.cameras, seen.rows))
        order = order[np.isin(seen.rows[order], rows)]
        at = np.searchsorted(rows, seen.rows[order])
        window = np.cumsum(begins)[at]
        # the cameras of each window, from 0
        pairs = window * (seen.cameras.max(initial=0) + 1) + seen.cameras[order]
        distinct, index = np.unique(pairs, return_inverse=True)
        of_window = distinct // (seen.cameras.max(initial=0) + 1)
        slots = index - np.searchsorted(of_window, window)
        drifts = np.zeros((len(rows), paths.states.shape[1]))
        later = np.flatnonzero(~begins)
        before, transition = paths.states[rows[later] - 1], self.motion.transition
        drifts[later] = before @ transition.T - paths.states[rows[later]]
        windows = Windows(
            np.append(np.flatnonzero(begins), len(rows)),
            drifts,
            np.ascontiguousarray(self.noise_scales[rows]),
            np.searchsorted(at, np.arange(len(rows) + 1)),
            slots.astype(np.int64),
            np.ascontiguousarray(seen.residuals[order]),
            np.ascontiguousarray(seen.jacobians[order]),
            np.ascontiguousarray(seen.half_heights[order]),
        )
        return windows, order


def choose_rows(paths: Paths, counts: Int[ndarray, " N"]) -> Int[ndarray, " K"] | None:
    """Choose the rows from which the noise is estimated: windows that are spread over the paths.

    Args:
        paths: Paths with N rows.
        counts: The number of cameras that see each row.

    Returns:
        Ascending rows, at most about :data:`MOST_ROWS`; None if fewer than :data:`LEAST_ROWS`
        rows of all are seen by two cameras.
    """
    double = np.concatenate([[0], np.cumsum(counts >= 2)])
    if double[-1] < LEAST_ROWS:
        return None
    begins = [np.arange(*ends, WINDOW) for ends in pairwise(paths.starts.tolist())]
    first = np.concatenate(begins)
    last = np.append(first[1:], len(counts))
    lengths = last - first
    seen = double[last] - double[first]
    usable = np.flatnonzero((2 * seen >= lengths) & (lengths > 1))
    if lengths[usable].sum() < LEAST_ROWS:
        usable = np.flatnonzero((seen > 0) & (lengths > 1))
    order = usable[np.argsort(-lengths[usable], kind="stable")]
    wanted = int(np.searchsorted(np.cumsum(lengths[order]), MOST_ROWS)) + 1
    long = order[lengths[order] == WINDOW]
    if len(long) > wanted:
        order = long[np.linspace(0, len(long) - 1, wanted).astype(int)]
    chosen = np.sort(order[:wanted])
    return np.concatenate([np.arange(first[w], last[w]) for w in chosen])


def estimate_noise(sample: NoiseSample) -> NoiseModel:
    """Maximise the innovation likelihood of white and persistent errors of boxes.

    Args:
        sample: The boxes by which the noise is estimated.
    """
    from scipy.optimize import minimize  # half a second that a server starts without

    windows, _ = sample.windows()
    size, step_time, deviation = windows.residuals.shape[1], sample.step_time, sample.deviation

    def model_of(logarithms: ndarray) -> NoiseModel:
        values = np.exp(logarithms)
        white, persistent = values[:size], values[size + 1 : -2]
        return NoiseModel(
            white, float(values[size]), persistent, float(values[-2]), float(values[-1])
        )

    def cost(logarithms: ndarray) -> tuple[float, ndarray]:
        noise = model_of(logarithms)
        errors = box_errors(noise, step_time)
        found = log_likelihood(windows, deviation, errors)
        slopes = found.gradient
        # the derivative of exp(-Δt/τ) by log τ
        of_time = slopes.kept * errors.kept * step_time / noise.time
        by_value = np.array([*slopes.white, slopes.pixels, *slopes.persistent])
        by_value *= np.array([*noise.white, noise.pixels, *noise.persistent])
        return -found.value, -np.array([*by_value, of_time, slopes.process * noise.process])

    shares = np.square(windows.residuals / windows.half_heights[:, None]).mean(axis=0)
    each = np.clip(np.sqrt(shares / 2.0), 2.0 * SHARES[0], SHARES[1] / 2.0)
    start = np.log([*each, _START_PIXELS, *each, max(_START_TIME, step_time), 1.0])
    limits = [SHARES] * size + [PIXELS] + [SHARES] * size + [(step_time, LONGEST), PROCESS]
    bounds = [(math.log(low), math.log(high)) for low, high in limits]
    found = minimize(
        cost,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": _ITERATIONS, "ftol": _TOLERANCE},
    )
    return model_of(found.x)


def box_errors(noise: NoiseModel, step_time: float) -> BoxErrors:
    """Convert a noise model to that of one step, as the likelihood takes it."""
    kept = float(np.exp(-step_time / noise.time))
    return BoxErrors(noise.white, noise.pixels, noise.persistent, kept, noise.process)


class PersistentErrors:
    """The part of covariances of positions that does not average over time.

    It is the covariance of a filter that *considers* errors which it does not estimate (Schmidt,
    "Application of State-Space Methods to Navigation Problems", Advances in Control Systems 3,
    1966), of each step alone, and that of the errors which all cameras have in common:

        G Q_β Gᵀ + κ (q_x² + b_x²) h² I,   G = (Σ Hᵀ R⁻¹ H)⁻¹ Hᵀ R⁻¹

    with the mean square b_x² of the cameras' offsets. The unknown shape of bodies, by which
    horizontal centres are off by δ in all cameras at once, does not average either: it adds
    (G δ)(G δ)ᵀ, or a third of it where the error is evenly distributed between 0 and δ.
    """

    def __init__(self, noise: NoiseModel, rows: int, half_height: float) -> None:
        """Begin without boxes.

        Args:
            noise: The noise.
            rows: N, the number of rows of the paths.
            half_height: h, of the target, metres.
        """
        self._noise = noise
        self._unit = (noise.persistent[0] * half_height) ** 2
        self._information = np.zeros((rows, 3, 3))
        self._spread = np.zeros((rows, 3, 3))
        self._rims, self._levels = np.zeros((rows, 3)), np.zeros((rows, 3))

    def add(self, seen: SureBoxes) -> None:
        """Add boxes of one camera, of each row at most one."""
        squares = seen.half_heights[:, None] ** 2
        weighted = seen.jacobians / self._noise.variances(seen.half_heights)[:, :, None]
        self._information[seen.rows] += np.swapaxes(seen.jacobians, 1, 2) @ weighted
        persistent = (squares * self._noise.persistent**2)[:, :, None] * weighted
        self._spread[seen.rows] += np.swapaxes(weighted, 1, 2) @ persistent

    def add_bodies(
        self, seen: SureBoxes, rims: Float[ndarray, " L"], levels: Float[ndarray, " L"]
    ) -> None:
        """Add the uncertainty due to the shape of bodies, of the boxes of one camera.

        Args:
            seen: The boxes.
            rims: Distance between the horizontal centre of a cylinder and that of its axis, pixels;
                the centre of a body that is narrower at head and feet lies between both.
            levels: Standard deviation of the horizontal centre due to the unknown level at which
                bodies are widest, pixels.
        """
        lateral = seen.jacobians[:, 0] / self._noise.variances(seen.half_heights)[:, :1]
        self._rims[seen.rows] += rims[:, None] * lateral
        self._levels[seen.rows] += levels[:, None] * lateral

    def covariances(self, paths: Paths) -> Float[ndarray, "N 3 3"]:
        """Compute the covariance of each row; one without boxes has that of the nearest of its
        path."""
        found = np.zeros_like(self._spread)
        has = np.flatnonzero(np.trace(self._spread, axis1=1, axis2=2) > 0.0)
        # where the boxes tell nothing of a direction, a weak prior keeps the inverse finite
        prior = np.eye(3) / (_FARTHEST * self._unit)
        inverse = np.linalg.inv(self._information[has] + prior)
        own = inverse @ self._spread[has] @ inverse
        trace = np.trace(own, axis1=1, axis2=2)
        found[has] = own * np.minimum(1.0, _FARTHEST * self._unit / trace)[:, None, None]
        inverse = np.linalg.inv(self._information[has] + np.eye(3) / _WIDE**2)
        for sums, share in ((self._rims, 1.0 / 3.0), (self._levels, 1.0)):
            aside = inverse @ sums[has, :, None]
            found[has] += share * aside @ np.swapaxes(aside, 1, 2)
        nearest = _nearest(has, paths)
        return np.asarray(found[nearest])


def common_variance(noise: NoiseModel, offsets: Float[ndarray, "C m"], half_height: float) -> float:
    """Compute the variance along x and y of errors that all cameras have in common, square metres.

    It is κ (q_x² + b_x²) h², with the mean square b_x² of the cameras' offsets and κ of
    :data:`COMMON`.

    Args:
        noise: The noise of the boxes.
        offsets: b, the offset of each camera's boxes, half heights.
        half_height: h, of the target, metres.
    """
    between = noise.persistent[0] ** 2 + np.mean(offsets[:, 0] ** 2)
    return float(COMMON * between * half_height**2)


def _nearest(has: Int[ndarray, " K"], paths: Paths) -> Int[ndarray, " N"]:
    """The nearest of some rows in each row's path; the row itself where its path has none."""
    rows, owners = np.arange(len(paths.states)), paths.owners
    if not len(has):
        return rows
    places = np.searchsorted(has, rows)
    sides = np.stack([has[np.maximum(places - 1, 0)], has[np.minimum(places, len(has) - 1)]])
    gaps = np.where(owners[sides] == owners, np.abs(sides - rows), len(rows))
    nearest = np.where(gaps[0] < gaps[1], sides[0], sides[1])
    return np.where(gaps.min(axis=0) < len(rows), nearest, rows)
