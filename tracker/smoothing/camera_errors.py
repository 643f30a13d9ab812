"""Cameras whose boxes err more than those of the others, and by how much each camera is late.

One model of noise holds for the boxes of all cameras (:mod:`tracker.smoothing.noise`): a camera
that is turned, or whose boxes are worse, is not seen in it. Here the noise of each camera is
estimated apart, from what its boxes and those of the others disagree about.

[RM71] Rao, "Estimation of variance and covariance components - MINQUE theory", Journal of
Multivariate Analysis 1(3), 1971.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.kernels.smoothing.innovations import normalised_innovations
from tracker.smoothing.noise import NoiseModel, NoiseSample, SureBoxes, box_errors
from tracker.smoothing.paths import Paths

Quantity = Literal["horizontal", "vertical", "height", "all"]

QUANTITIES: tuple[Quantity, ...] = ("horizontal", "vertical", "height", "all")
"""The errors that are compared: of the boxes' centres along both axes of the picture, of their half
heights, and of the three together. A camera that is turned about one of its axes moves the first or
the second; the boxes of a worse detector err in all."""

FACTOR = 2.0
"""Factor between a camera's standard deviation and that of the others from which it is out of line:
the covariances of positions then give its boxes four times the weight that is theirs."""

FALSE_ALARM = 0.01
"""Probability with which a recording has a camera out of line whose factor is smaller."""

LEAST_CAMERAS = 3
"""Number of cameras below which it is not known which one is out of line."""

LEAST_BLOCKS, MANY_BLOCKS = 10, 30
"""Number of blocks of steps below which the spread of the factors is not estimated, and for which
blocks are as short as need be."""

_COMMON = 0.3
"""Weight of the variance of all cameras in that of one, in the weight of its boxes. The errors of
one camera are taken as independent of the others', but those of calibrations are not: without it
the estimate passes from one camera to another where few see a person at once."""

_LEAST = 0.05
"""Bound of a variance, relative to the common model's; an unbiased estimate may be negative."""

_NOTHING = 1e-6
"""Weight, in boxes, that keeps equations regular and changes no estimate."""

_PARTS = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.0, -0.5, 0.5]])
"""From horizontal centre, top and bottom to the quantities."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraErrors:
    """How far the boxes of C cameras are out of line, and how late they are."""

    factors: Float[ndarray, "C 4"]
    """Standard deviation of each quantity's errors, in the median of the other cameras'; NaN where
    it is not estimated."""
    least: Float[ndarray, "C 4"]
    """Lower confidence bound of the factors, such that with :data:`FALSE_ALARM` any of them is
    above the true factor."""
    delays: Float[ndarray, " C"]
    """Delay of each camera relative to the mean of all, seconds, positive where it shows an event
    later than the others; NaN where it is not estimated."""
    delay_sigmas: Float[ndarray, " C"]
    """Standard deviation of the delays, seconds."""

    def of(self, camera: int, quantity: Quantity) -> float:
        """The factor of a camera, by index, and a quantity."""
        return float(self.factors[camera, QUANTITIES.index(quantity)])

    @property
    def out_of_line(self) -> tuple[int, Quantity] | None:
        """Index of the camera that is most out of line, and in which quantity; None for none.

        A camera with a wrong pose displaces the estimated positions, and by them the residuals of
        the other cameras: so only the worst one is returned.
        """
        beyond = np.where(self.least > FACTOR, self.factors, -np.inf)
        if not len(beyond) or not np.isfinite(beyond).any():
            return None
        camera = int(beyond.max(axis=1).argmax())
        single = beyond[camera, : len(_PARTS)]
        if not np.isfinite(single).any():
            return camera, "all"
        return camera, QUANTITIES[int(single.argmax())]


def estimate_camera_errors(
    sample: NoiseSample, noise: NoiseModel, offsets: Float[ndarray, "C m"]
) -> CameraErrors:
    """Estimate each camera's errors, and its delay.

    Args:
        sample: The boxes by which the noise was estimated.
        noise: The noise of all cameras together.
        offsets: b, the offset of each camera's boxes that was subtracted from the residuals, half
            heights.
    """
    seen = sample.seen
    whole = replace(
        seen, residuals=seen.residuals + seen.half_heights[:, None] * offsets[seen.cameras]
    )
    factors, least = _factors(sample.paths, whole, noise, len(offsets), sample.step_time)
    return CameraErrors(factors, least, *_delays(sample, noise, len(offsets)))


def _factors(
    paths: Paths, seen: SureBoxes, noise: NoiseModel, cameras: int, step_time: float
) -> tuple[Float[ndarray, "C 4"], Float[ndarray, "C 4"]]:
    """Estimate the factors, and their lower confidence bounds.

    With the errors e = M z of the boxes of a row, in units of the common model, after the best
    position is subtracted, M = I − H(HᵀH)⁻¹Hᵀ, the expectation of e_i² is Σ_j M_ij² v_j: linear
    equations for the variances v, whose sums over all rows have an unbiased solution [RM71]_. Those
    of single quantities are shrunk towards the common variance. The spread is that of the estimates
    without each of the blocks of steps (jackknife), which are twice as long as errors persist if
    there are enough of them.
    """
    from scipy.special import stdtrit  # a server starts without

    unknown = np.full((cameras, len(QUANTITIES)), np.nan)
    sums, squares = _equations(paths, seen, noise, cameras, step_time)
    if (
        cameras < LEAST_CAMERAS
        or len(sums) < LEAST_BLOCKS
        or not sums.sum(axis=(0, 2)).reshape(cameras, -1).any(axis=1).all()
    ):
        return unknown, unknown
    logs = _log_factors(sums.sum(axis=0)[None], squares.sum(axis=0)[None], cameras)[0]
    without = _log_factors(sums.sum(axis=0) - sums, squares.sum(axis=0) - squares, cameras)
    blocks = len(sums)
    spread = np.sqrt((blocks - 1) / blocks * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
    quantile = float(stdtrit(blocks - 1, 1.0 - FALSE_ALARM / logs.size))
    return np.exp(logs), np.exp(logs - quantile * spread)


def _equations(
    paths: Paths, seen: SureBoxes, noise: NoiseModel, cameras: int, step_time: float
) -> tuple[Float[ndarray, "B P P"], Float[ndarray, "B P"]]:
    """The equations of the P = 3C variances, summed over each of B blocks of steps."""
    parts, unknowns = len(_PARTS), cameras * len(_PARTS)
    rows, place = np.unique(seen.rows, return_inverse=True)
    sigmas = np.sqrt(noise.variances(seen.half_heights)[:, :parts] @ (_PARTS**2).T)
    errors = np.zeros((len(rows), cameras, parts))
    errors[place, seen.cameras] = seen.residuals[:, :parts] @ _PARTS.T / sigmas
    slopes = np.zeros((len(rows), cameras, parts, 3))
    slopes[place, seen.cameras] = _PARTS @ seen.jacobians[:, :parts] / sigmas[:, :, None]
    there = np.zeros((len(rows), cameras, parts))
    there[place, seen.cameras] = 1.0
    several = there[:, :, 0].sum(axis=1) >= 2.0
    rows, there = rows[several], there[several].reshape(-1, unknowns)
    slopes = slopes[several].reshape(-1, unknowns, 3)
    errors = errors[several].reshape(-1, unknowns)
    across = np.swapaxes(slopes, 1, 2)
    information = across @ slopes + np.eye(3) * _NOTHING
    rest = there[:, :, None] * np.eye(unknowns) - slopes @ np.linalg.solve(information, across)
    left = (rest @ errors[:, :, None])[:, :, 0]
    # bounded, so that an error that never ends, as that of a calibration, leaves enough blocks
    length = max(2, min(round(2.0 * noise.time / step_time), len(rows) // MANY_BLOCKS))
    owners = paths.owners_of(rows)
    number = np.column_stack([owners, (rows - paths.starts[owners]) // length])
    _, block = np.unique(number, axis=0, return_inverse=True)
    size = int(block.max(initial=-1)) + 1
    sums, squares = np.zeros((size, unknowns, unknowns)), np.zeros((size, unknowns))
    np.add.at(sums, block, rest**2)
    np.add.at(squares, block, left**2)
    return sums, squares


def _log_factors(
    sums: Float[ndarray, "B P P"], squares: Float[ndarray, "B P"], cameras: int
) -> Float[ndarray, "B C 4"]:
    """Solve the equations of the variances, and compare each camera's with the others'.

    Returns:
        The logarithm of the factor on the standard deviation, for each of B sets of equations.
    """
    parts = len(_PARTS)
    shape = -1, cameras, parts
    weights = sums.sum(axis=2)
    common = squares.reshape(shape).sum(axis=1) / weights.reshape(shape).sum(axis=1)
    # without one block of steps a camera may have no rows: its variance is the common one
    prior = _COMMON * weights + _NOTHING
    shrunk = np.linalg.solve(
        sums + prior[:, :, None] * np.eye(cameras * parts),
        (squares + prior * np.tile(common, (1, cameras)))[:, :, None],
    )
    of_cameras = sums.reshape(-1, cameras, parts, cameras, parts).sum(axis=(2, 4))
    of_all = np.linalg.solve(
        of_cameras + _NOTHING * np.eye(cameras),
        (squares.reshape(shape).sum(axis=2) + _NOTHING * common.mean(axis=1)[:, None])[:, :, None],
    )
    found = np.concatenate([shrunk.reshape(shape), of_all], axis=2)
    logs = np.log(np.maximum(found, _LEAST))
    others = [np.median(np.delete(logs, camera, axis=1), axis=1) for camera in range(cameras)]
    return np.asarray(0.5 * (logs - np.stack(others, axis=1)))


def _delays(
    sample: NoiseSample, noise: NoiseModel, cameras: int
) -> tuple[Float[ndarray, " C"], Float[ndarray, " C"]]:
    """Estimate the delay of each camera, and its standard deviation, by the innovation likelihood.

    A camera that is late by o shows a person who moves with velocity v where the person was, and
    its boxes have the residual −H v o. The innovations are linear in all o, so that least squares
    give the maximum of the likelihood and its curvature. Of all clocks together nothing is known:
    their mean is 0.
    """
    unknown, seen, states = np.full(cameras, np.nan), sample.seen, sample.paths.states
    if states.shape[1] < 6 or np.bincount(seen.cameras, minlength=cameras).min() == 0:
        return unknown, unknown
    step_time, deviation = sample.step_time, sample.deviation
    errors = box_errors(noise, step_time)
    behind = step_time * np.einsum("lpa,la->lp", seen.jacobians, states[seen.rows, 3:6])
    windows, order = sample.windows()
    added = np.zeros((*windows.residuals.shape, cameras))
    added[np.arange(len(order)), :, seen.cameras[order]] = behind[order]
    found = normalised_innovations(windows, deviation, errors, added)
    slope, curvature = -found[:, 1:].T @ found[:, 0], found[:, 1:].T @ found[:, 1:]
    free = np.eye(cameras) - 1.0 / cameras
    inverse = np.linalg.pinv(free @ curvature @ free, rcond=1e-6, hermitian=True)
    variances = np.diagonal(inverse)
    if (variances <= 0.0).any():
        return unknown, unknown  # where people stand still, nothing shows a delay
    sigmas = step_time * np.sqrt(np.maximum(variances, 0.0))
    return np.asarray(step_time * inverse @ free @ slope), np.asarray(sigmas)


def significant_deviations(cameras: int) -> float:
    """The number of standard deviations from which a delay of any of C cameras counts."""
    from scipy.special import ndtri  # a server starts without

    return float(-ndtri(FALSE_ALARM / (2.0 * cameras)))
