"""The innovation likelihood of box errors of which a part persists, compiled.

The errors of a person's boxes in one camera are white noise and a part β that persists: a
first-order autoregressive process. A Kalman filter whose state is augmented by β of every camera
makes the innovations white; their likelihood is that of the noise (Bar-Shalom, Li, Kirubarajan,
"Estimation with Applications to Tracking and Navigation", Wiley 2001, section 8.2).

The gradient of the likelihood is that of reverse differentiation: the recursion is run backwards
with the adjoints of mean and covariance, for about the price of a second pass whatever the number
of parameters (Griewank, Walther, "Evaluating Derivatives", SIAM 2008, chapter 3).
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


class LogLikelihood(NamedTuple):
    """A log likelihood, and its derivatives by the noise."""

    value: float
    """The log likelihood."""
    gradient: BoxErrors
    """The derivatives by each number of the noise."""


class _Window(NamedTuple):
    """One window's Kalman filter, with R sets of residuals, U updates and a state of size n."""

    means: ndarray
    """(R, n), deviation and persistent errors."""
    covariance: ndarray
    """(n, n), their covariance."""
    gains: ndarray
    """(U, n), P h of each update."""
    variances: ndarray
    """(U,), innovation variances s."""
    innovations: ndarray
    """(U, R), innovations ν."""
    predicted: ndarray
    """(K, n), the first means before the updates of each row."""
    covariances: ndarray
    """(K, n, n), the covariances before the updates of each row."""


@kernel
def _state_size(windows: Windows, window: int) -> int:
    """The size of a window's state."""
    begin, end = windows.starts[window], windows.starts[window + 1]
    cameras = 0
    for box in range(windows.boxes[begin], windows.boxes[end]):
        cameras = max(cameras, windows.slots[box] + 1)
    return int(windows.drifts.shape[1] + windows.residuals.shape[1] * cameras)


@kernel
def _begin(windows: Windows, window: int, motion: DeviationMotion, errors: BoxErrors,
           sets: int) -> _Window:  # fmt: skip
    """Begin the filter of a window."""
    d, m = windows.drifts.shape[1], windows.residuals.shape[1]
    begin, end = windows.starts[window], windows.starts[window + 1]
    size = _state_size(windows, window)
    updates = m * (windows.boxes[end] - windows.boxes[begin])
    covariance = np.zeros((size, size))
    covariance[:d, :d] = motion.prior
    for a in range(d, size):
        covariance[a, a] = errors.persistent[(a - d) % m] ** 2
    return _Window(
        np.zeros((sets, size)), covariance, np.empty((updates, size)), np.empty(updates),
        np.empty((updates, sets)), np.empty((end - begin, size)),
        np.empty((end - begin, size, size)),
    )  # fmt: skip


@kernel
def _carry(
    found: _Window, drift: ndarray, scale: float, motion: DeviationMotion, errors: BoxErrors
) -> None:
    """Predict deviation and persistent errors one step ahead, in place."""
    means, covariance = found.means, found.covariance
    d, m, size = len(drift), len(errors.white), len(covariance)
    transition, kept = motion.transition, errors.kept
    half, moved = np.zeros((d, size)), np.zeros(d)
    for s in range(len(means)):
        for a in range(d):
            moved[a] = drift[a] if s == 0 else 0.0
            for b in range(d):
                moved[a] += transition[a, b] * means[s, b]
        means[s, :d] = moved
        for a in range(d, size):
            means[s, a] *= kept
    for a in range(d):
        for b in range(d):
            if transition[a, b] != 0.0:
                for c in range(size):
                    half[a, c] += transition[a, b] * covariance[b, c]
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
        for b in range(d, size):
            covariance[a, b] *= kept * kept
        covariance[a, a] += (1.0 - kept * kept) * errors.persistent[(a - d) % m] ** 2


@kernel
def _update(
    found: _Window, update: int, residuals: ndarray, jacobian: ndarray, at: int,
    half_height: float, noise: float,
) -> None:  # fmt: skip
    """Update by one number of one box, in place.

    Args:
        found: The filter.
        update: Index of the update in the window.
        residuals: (R,), the number's residual in each set.
        jacobian: (3,), its derivative by the position.
        at: Index of its persistent error in the state.
        half_height: Derivative by that error.
        noise: Variance of its white noise.
    """
    means, covariance, gain = found.means, found.covariance, found.gains[update]
    size = len(gain)
    for a in range(size):
        gain[a] = half_height * covariance[at, a]
    for axis in range(3):
        for a in range(size):
            gain[a] += jacobian[axis] * covariance[axis, a]
    variance = noise + half_height * gain[at]
    for axis in range(3):
        variance += jacobian[axis] * gain[axis]
    found.variances[update] = variance
    for s in range(len(means)):
        innovation = residuals[s] - half_height * means[s, at]
        for axis in range(3):
            innovation -= jacobian[axis] * means[s, axis]
        found.innovations[update, s] = innovation
        for a in range(size):
            means[s, a] += gain[a] * (innovation / variance)
    for a in range(size):
        share = gain[a] / variance
        for b in range(size):
            covariance[a, b] -= share * gain[b]


@kernel
def _filter(
    windows: Windows, window: int, residuals: ndarray, motion: DeviationMotion, errors: BoxErrors
) -> _Window:
    """Filter one window.

    Args:
        windows: All windows.
        window: Index of the window.
        residuals: (O, m, R), R sets of residuals, of which the first has the windows' drifts.
        motion: The motion of the deviation from the states at which these were computed.
        errors: The noise.
    """
    d, m = windows.drifts.shape[1], len(errors.white)
    found = _begin(windows, window, motion, errors, residuals.shape[2])
    begin, end = windows.starts[window], windows.starts[window + 1]
    update = 0
    for row in range(begin, end):
        if row > begin:
            _carry(found, windows.drifts[row], windows.noise_scales[row], motion, errors)
        found.predicted[row - begin] = found.means[0]
        found.covariances[row - begin] = found.covariance
        for box in range(windows.boxes[row], windows.boxes[row + 1]):
            tall = windows.half_heights[box]
            for p in range(m):
                noise = (tall * errors.white[p]) ** 2 + errors.pixels**2
                at = d + m * windows.slots[box] + p
                _update(found, update, residuals[box, p], windows.jacobians[box, p], at, tall,
                        noise)  # fmt: skip
                update += 1
    return found


@kernel
def _update_back(
    found: _Window, update: int, jacobian: ndarray, at: int, half_height: float,
    mean: ndarray, covariance: ndarray,
) -> float:  # fmt: skip
    """Turn the adjoints after an update into those before it, in place.

    With g = P h, s = R + h g, ν = z − h m the update is m' = m + g ν / s, P' = P − g gᵀ / s.

    Returns:
        The derivative of the log likelihood by the noise R.
    """
    gain, variance = found.gains[update], found.variances[update]
    innovation = found.innovations[update, 0]
    size = len(gain)
    along = np.zeros(size)
    for b in range(size):
        for a in range(size):
            along[a] += gain[b] * covariance[b, a]
    shift, bend = 0.0, 0.0
    for a in range(size):
        shift += mean[a] * gain[a]
        bend += along[a] * gain[a]
    of_innovation = (shift - innovation) / variance
    of_variance = -0.5 / variance
    of_variance += (0.5 * innovation * innovation - shift * innovation + bend) / variance**2
    for a in range(size):  # the adjoint of g, halved: it goes into both sides of P
        along[a] = 0.5 * (mean[a] * innovation - 2.0 * along[a]) / variance
    along[at] += 0.5 * of_variance * half_height
    mean[at] -= half_height * of_innovation
    for axis in range(3):
        along[axis] += 0.5 * of_variance * jacobian[axis]
        mean[axis] -= jacobian[axis] * of_innovation
    for a in range(size):
        covariance[at, a] += half_height * along[a]
        covariance[a, at] += half_height * along[a]
    for axis in range(3):
        for a in range(size):
            covariance[axis, a] += jacobian[axis] * along[a]
            covariance[a, axis] += jacobian[axis] * along[a]
    return float(of_variance)


@kernel
def _carry_back(
    found: _Window, row: int, scale: float, motion: DeviationMotion, errors: BoxErrors,
    mean: ndarray, covariance: ndarray, persistent: ndarray,
) -> tuple[float, float]:  # fmt: skip
    """Turn the adjoints after a prediction into those before it, in place.

    Args:
        found: The filter.
        row: Index of the row in the window.
        scale: Factor on the process noise of the step to it.
        motion: The motion.
        errors: The noise.
        mean: (n,), adjoint of the mean.
        covariance: (n, n), adjoint of the covariance.
        persistent: (m,), receives the derivatives by q.

    Returns:
        The derivatives by what is kept and by the factor on the process noise.
    """
    after, mean_after = found.covariances[row], found.predicted[row]
    d, m, size = len(motion.transition), len(errors.white), len(mean)
    transition, kept = motion.transition, errors.kept
    of_kept, of_process = 0.0, 0.0
    for a in range(d):
        for b in range(d):
            of_process += scale * motion.noise[a, b] * covariance[a, b]
        for b in range(d, size):
            of_kept += 2.0 * covariance[a, b] * after[a, b]
    for a in range(d, size):
        of_kept += mean[a] * mean_after[a]
        for b in range(d, size):
            of_kept += 2.0 * covariance[a, b] * after[a, b]
        q = errors.persistent[(a - d) % m]
        of_kept -= 2.0 * covariance[a, a] * q * q
        persistent[(a - d) % m] += 2.0 * (1.0 - kept * kept) * q * covariance[a, a]
    moved, half = np.zeros(d), np.zeros((d, size))
    for b in range(d):
        for a in range(d):
            if transition[b, a] != 0.0:
                moved[a] += transition[b, a] * mean[b]
                for c in range(size):
                    half[a, c] += transition[b, a] * covariance[b, c]
    mean[:d] = moved
    for a in range(d):
        for b in range(d):
            covariance[a, b] = 0.0
            for c in range(d):
                if transition[c, b] != 0.0:
                    covariance[a, b] += half[a, c] * transition[c, b]
        for c in range(d, size):
            covariance[a, c] = kept * half[a, c]
            covariance[c, a] = covariance[a, c]
    for a in range(d, size):
        mean[a] *= kept
        for b in range(d, size):
            covariance[a, b] *= kept * kept
    return of_kept / kept, of_process


@pixel_kernel
def log_likelihood(windows: Windows, motion: DeviationMotion, errors: BoxErrors) -> LogLikelihood:
    """Compute the log likelihood of the innovations of all windows, and its gradient.

    Args:
        windows: Residuals and derivatives of the boxes.
        motion: The motion of the deviation from the states at which these were computed.
        errors: The noise.
    """
    d, m = windows.drifts.shape[1], len(errors.white)
    residuals = windows.residuals.reshape(len(windows.residuals), m, 1)
    white, persistent = np.zeros(m), np.zeros(m)
    total, pixels, kept, process = 0.0, 0.0, 0.0, 0.0
    for w in range(len(windows.starts) - 1):
        begin, end = windows.starts[w], windows.starts[w + 1]
        found = _filter(windows, w, residuals, motion, errors)
        for update in range(len(found.variances)):
            variance, innovation = found.variances[update], found.innovations[update, 0]
            total -= 0.5 * (math.log(2.0 * math.pi * variance) + innovation**2 / variance)
        size = found.means.shape[1]
        mean, covariance = np.zeros(size), np.zeros((size, size))
        update = len(found.variances)
        for row in range(end - 1, begin - 1, -1):
            for box in range(windows.boxes[row + 1] - 1, windows.boxes[row] - 1, -1):
                tall = windows.half_heights[box]
                for p in range(m - 1, -1, -1):
                    update -= 1
                    at = d + m * windows.slots[box] + p
                    by_noise = _update_back(
                        found, update, windows.jacobians[box, p], at, tall, mean, covariance
                    )
                    white[p] += 2.0 * tall**2 * errors.white[p] * by_noise
                    pixels += 2.0 * errors.pixels * by_noise
            if row > begin:
                by_kept, by_process = _carry_back(
                    found, row - begin, windows.noise_scales[row], motion, errors, mean,
                    covariance, persistent,
                )  # fmt: skip
                kept += by_kept
                process += by_process
        for a in range(d, size):
            p = (a - d) % m
            persistent[p] += 2.0 * errors.persistent[p] * covariance[a, a]
    return LogLikelihood(total, BoxErrors(white, pixels, persistent, kept, process))


@pixel_kernel
def normalised_innovations(
    windows: Windows, motion: DeviationMotion, errors: BoxErrors, added: ndarray
) -> ndarray:
    """Compute the innovations of all windows in their standard deviations, which are linear in
    the residuals.

    Args:
        windows: Residuals and derivatives of the boxes.
        motion: The motion of the deviation from the states at which these were computed.
        errors: The noise.
        added: (O, m, R), R sets of what may be added to the residuals.

    Returns:
        (O m, R + 1), the innovations of the windows' residuals, and what each set adds to them.
    """
    count, m = windows.residuals.shape
    residuals = np.empty((count, m, 1 + added.shape[2]))
    residuals[:, :, 0] = windows.residuals
    residuals[:, :, 1:] = added
    result = np.empty((count * m, 1 + added.shape[2]))
    place = 0
    for w in range(len(windows.starts) - 1):
        found = _filter(windows, w, residuals, motion, errors)
        for update in range(len(found.variances)):
            for s in range(result.shape[1]):
                result[place, s] = found.innovations[update, s] / math.sqrt(found.variances[update])
            place += 1
    return result
