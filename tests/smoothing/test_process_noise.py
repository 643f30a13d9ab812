"""Who stands is known better than the motion says: how restless each is, by the formula."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests.smoothing.known import PLAIN
from tests.smoothing.measured import PRIOR, STEP, fitted_to, measured
from tracker.filters.models import Motion
from tracker.kernels.smoothing import passes
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import Fitted, process_noise_scales
from tracker.smoothing.tracklets.motion import Ends

SIGMA = 0.03


def learnt(places: list[ndarray], turns: int = 20) -> Fitted:
    """People measured at some places, (T, 3) metres each, and how restless they are."""
    paths, smooth = measured(places, SIGMA)
    noise = Motion.of(PLAIN.fusion, STEP).noise
    found, told = None, np.ones(len(paths.states))
    for _ in range(turns):
        found = smooth(told)
        told = process_noise_scales(paths.starts, found, noise, told, STEP)
    assert found is not None
    return fitted_to(paths, found, told)


def standing(steps: int, x: float, seed: int) -> ndarray:
    """Somebody who stands, as he is measured."""
    return np.array([x, 0.0, 1.0]) + np.random.default_rng(seed).normal(0.0, SIGMA, (steps, 3))


def moving(steps: int, seed: int) -> ndarray:
    """Somebody who moves as the motion model says."""
    motion, rng = Motion.of(PLAIN.fusion, STEP), np.random.default_rng(seed)
    states = [np.array([0.0, 0.0, 1.0, 0.5, 0.0, 0.0])]
    for _ in range(steps - 1):
        driven = rng.multivariate_normal(np.zeros(6), motion.noise)
        states.append(motion.transition @ states[-1] + driven)
    return np.array(states)[:, :3] + rng.normal(0.0, SIGMA, (steps, 3))


def test_who_stands_is_not_restless_and_who_moves_as_stated_is() -> None:
    found = learnt([standing(200, 0.0, 1), moving(200, 2)]).noise_scales
    assert found[:200].max() < 0.2
    # each step counts in full up to twice the mean: a little less than 1
    assert 0.5 < np.median(found[200:]) < 1.2


def test_without_boxes_nothing_is_learnt() -> None:
    motion = Motion.of(PLAIN.fusion, STEP)
    rule = passes.PathMotion(motion.transition, motion.noise, PRIOR)
    starts = np.array([0, 5, 6])
    found = passes.smooth_paths(
        starts, np.zeros((2, 6)), np.zeros((6, 3, 3)), np.zeros((6, 3)), rule, np.ones(6)
    )
    assert_allclose(
        process_noise_scales(starts, found, motion.noise, np.ones(6), STEP), 1.0, atol=1e-6
    )


def test_restlessness_is_the_mean_of_what_drove_the_person() -> None:
    """tr Q⁻¹ (ŵ ŵᵀ + W) / d by the formulas as they are written, of two paths that were taken for
    differently restless, each row's at most twice what it was."""
    before = np.random.default_rng(8).uniform(0.2, 2.0, 12)
    paths, smooth = measured([standing(5, 0.0, 1), moving(7, 2)], SIGMA)
    found, noise = smooth(before), Motion.of(PLAIN.fusion, STEP).noise
    ground = np.ix_([0, 1, 3, 4], [0, 1, 3, 4])
    squares = np.zeros(12)
    for row, s in enumerate(before):
        inverse = np.linalg.inv(found.ahead_covariances[row])
        pull = inverse @ (found.means[row] - found.ahead[row])
        less = inverse - inverse @ found.covariances[row] @ inverse
        drive = s * noise[ground] @ pull[[0, 1, 3, 4]]
        spread = s * noise[ground] - s * noise[ground] @ less[ground] @ (s * noise[ground])
        squares[row] = np.trace(np.linalg.solve(noise[ground], np.outer(drive, drive) + spread))
    squares = np.minimum(squares, 2.0 * 4.0 * before)
    inner = ~np.isin(np.arange(12), [0, 5])
    prior, told = 0.5 * 4.0 / STEP, []
    for row in range(12):
        own = inner & ((np.arange(12) < 5) == (row < 5))
        kept = np.exp(-STEP / 8.0 * np.abs(np.arange(12) - row))[own]
        told.append((prior + kept @ squares[own]) / (prior + 4.0 * kept.sum()))
    assert_allclose(process_noise_scales(paths.starts, found, noise, before, STEP), told, rtol=1e-6)


def test_drives_are_what_they_say() -> None:
    found = measured([standing(5, 0.0, 1), moving(7, 2)], SIGMA)[1](np.ones(12))
    axes = np.array([0, 1, 3, 4])
    noise = Motion.of(PLAIN.fusion, STEP).noise[np.ix_(axes, axes)]
    inverse = np.linalg.inv(found.ahead_covariances)
    pulls = np.einsum("nab,nb->na", inverse, found.means - found.ahead)
    told = np.einsum("na,nb->nab", pulls, pulls) + inverse @ found.covariances @ inverse - inverse
    expected = np.sum(noise * told[:, axes[:, None], axes], axis=(1, 2))
    assert_allclose(passes.drives(found, noise, axes), expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("kept", [0.0, 0.5, 1.0])
def test_sums_around_are_what_they_say(kept: float) -> None:
    starts, values = np.array([0, 4, 4, 7]), np.arange(1.0, 8.0)
    expected = [
        sum(kept ** abs(j - k) * values[j] for j in range(7) if (j < 4) == (k < 4))
        for k in range(7)
    ]
    assert_allclose(passes.sums_around(starts, values, kept), expected)


def test_the_ends_of_a_piece_in_a_chain_are_what_the_rest_of_the_chain_says() -> None:
    """Cut in the middle of a chain: what is before the cut, and what is from it on, put together
    again, is what the whole chain says there."""
    whole = learnt([moving(12, 5)])
    motion, paths = Motion.of(PLAIN.fusion, STEP), whole.paths
    # three pieces: of five steps, of one, of six
    cut = Paths.of(
        [1, 2, 3], [0, 5, 6],
        [paths.states[:5], paths.states[5:6], paths.states[6:]],
        [paths.covariances[:5], paths.covariances[5:6], paths.covariances[6:]],
        6,
    )  # fmt: skip
    own = Fitted(
        cut, np.zeros(12), paths.states, paths.covariances, np.zeros(12), whole.noise_scales
    )
    told = Ends.alone(own, PRIOR).in_chains(cut, whole, np.arange(12), motion)
    for piece, row in ((0, 5), (1, 6)):
        ahead = motion.transition @ told.ends[piece]
        spread = motion.transition @ told.covariances[piece] @ motion.transition.T
        spread += whole.noise_scales[row] * motion.noise
        assert_allclose(ahead, whole.ahead[row], atol=1e-8)
        information = np.linalg.inv(spread) + told.information[piece + 1]
        vector = np.linalg.solve(spread, ahead) + told.vectors[piece + 1]
        assert_allclose(np.linalg.solve(information, vector), paths.states[row], atol=1e-5)
        assert_allclose(np.linalg.inv(information), paths.covariances[row], atol=1e-6)
    nobodys = Ends.alone(own, PRIOR).in_chains(cut, whole, np.full(12, -1), motion)
    assert_allclose(nobodys.ends, Ends.alone(own, PRIOR).ends)
