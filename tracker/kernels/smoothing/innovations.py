"""The innovation likelihood of box errors of which a part persists, compiled.

The errors of a person's boxes in one camera are white noise and a part β that persists: a
first-order autoregressive process. A Kalman filter whose state is augmented by β of every camera
makes the innovations white; their likelihood is that of the noise (Bar-Shalom, Li, Kirubarajan,
"Estimation with Applications to Tracking and Navigation", Wiley 2001, section 8.2).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel, pixel_kernel


class Windows(NamedTuple):
    """Stretches of paths, K rows in all, and the O boxes of these rows."""

    starts: ndarray
    """(W + 1,), index of each window's first row."""
    drifts: ndarray
    """(K, d), F m - m': what the motion model does not explain of the step to each row."""
    noise_scales: ndarray
    """(K,), factor on the process noise of the step to each row."""
    boxes: ndarray
    """(K + 1,), index of each row's first box."""
    slots: ndarray
    """(O,), index of the box's camera among those of its window."""
    residuals: ndarray
    """(O, m), measurement less what is expected at the row's state, pixels."""
    jacobians: ndarray
    """(O, m, 3), derivative of the measurement by the position, pixels per metre."""
    half_heights: ndarray
    """(O,), half height of the expected box, pixels."""


class BoxErrors(NamedTuple):
    """The noise of boxes, for one step."""

    white: ndarray
    """r (m,): standard deviation of errors without memory, half heights."""
    pixels: float
    """ς: standard deviation of the same, pixels."""
    persistent: ndarray
    """q (m,): standard deviation of errors that persist, half heights."""
    kept: float
    """exp(-Δt/τ): share of a persistent error that is left after one step."""
    process: float
    """Factor on the process noise."""


class DeviationMotion(NamedTuple):
    """The motion of a state's deviation."""

    transition: ndarray
    """F (d, d)."""
    noise: ndarray
    """Q (d, d), of one step."""
    prior: ndarray
    """(d, d), covariance of the first deviation of a window."""


@kernel
def _carry(
    mean: ndarray, covariance: ndarray, size: int, drift: ndarray, scale: float,
    motion: DeviationMotion, errors: BoxErrors, half: ndarray,
) -> None:  # fmt: skip
    """Predict deviation and persistent errors one step ahead, in place."""
    d, m = len(drift), len(errors.white)
    transition, kept = motion.transition, errors.kept
    moved = drift.copy()
    for a in range(d):
        for b in range(d):
            moved[a] += transition[a, b] * mean[b]
        for c in range(size):
            half[a, c] = 0.0
            for b in range(d):
                if transition[a, b] != 0.0:
                    half[a, c] += transition[a, b] * covariance[b, c]
    mean[:d] = moved
    for a in range(d):
        for b in range(d):
            total = scale * errors.process * motion.noise[a, b]
            for c in range(d):
                if transition[b, c] != 0.0:
                    total += half[a, c] * transition[b, c]
            covariance[a, b] = total
        for c in range(d, size):
            covariance[a, c] = kept * half[a, c]
            covariance[c, a] = covariance[a, c]
    for a in range(d, size):
        mean[a] *= kept
        for b in range(d, size):
            covariance[a, b] *= kept * kept
        covariance[a, a] += (1.0 - kept * kept) * errors.persistent[(a - d) % m] ** 2


@kernel
def _update(
    mean: ndarray, covariance: ndarray, size: int, gain: ndarray,
    residual: float, jacobian: ndarray, at: int, half_height: float, noise: float,
) -> float:  # fmt: skip
    """Update by one number of one box, in place.

    Returns:
        The log likelihood of its innovation.
    """
    innovation = residual - half_height * mean[at]
    for axis in range(3):
        innovation -= jacobian[axis] * mean[axis]
    for a in range(size):
        gain[a] = half_height * covariance[a, at]
        for axis in range(3):
            gain[a] += jacobian[axis] * covariance[a, axis]
    variance = noise + half_height * gain[at]
    for axis in range(3):
        variance += jacobian[axis] * gain[axis]
    for a in range(size):
        share = gain[a] / variance
        mean[a] += share * innovation
        for b in range(size):
            covariance[a, b] -= share * gain[b]
    return float(-0.5 * (math.log(2.0 * math.pi * variance) + innovation * innovation / variance))


@pixel_kernel
def log_likelihood(windows: Windows, motion: DeviationMotion, errors: BoxErrors) -> float:
    """Log likelihood of the innovations of all windows.

    Args:
        windows: Residuals and derivatives of the boxes.
        motion: Of the deviation from the states at which these were computed.
        errors: The noise.
    """
    d, m = windows.drifts.shape[1], len(errors.white)
    most = d + m * (1 + (windows.slots.max() if len(windows.slots) else 0))
    mean, gain = np.zeros(most), np.zeros(most)
    covariance, half = np.zeros((most, most)), np.zeros((d, most))
    total = 0.0
    for w in range(len(windows.starts) - 1):
        begin, end = windows.starts[w], windows.starts[w + 1]
        own = windows.slots[windows.boxes[begin] : windows.boxes[end]]
        size = d + m * (1 + (own.max() if len(own) else -1))
        mean[:] = 0.0
        covariance[:] = 0.0
        covariance[:d, :d] = motion.prior
        for a in range(d, size):
            covariance[a, a] = errors.persistent[(a - d) % m] ** 2
        for row in range(begin, end):
            if row > begin:
                _carry(mean, covariance, size, windows.drifts[row], windows.noise_scales[row],
                       motion, errors, half)  # fmt: skip
            for box in range(windows.boxes[row], windows.boxes[row + 1]):
                tall = windows.half_heights[box]
                for p in range(m):
                    noise = (tall * errors.white[p]) ** 2 + errors.pixels**2
                    at = d + m * windows.slots[box] + p
                    total += _update(
                        mean, covariance, size, gain, windows.residuals[box, p],
                        windows.jacobians[box, p], at, tall, noise,
                    )  # fmt: skip
    return total
