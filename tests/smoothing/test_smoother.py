"""The smoother on any recording: least squares, covariances, symmetries, who is restless."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from scipy.stats import multivariate_normal

from tests import world
from tests.smoothing.known import PLAIN, PRIOR, STEP, Known, backwards, fitted_to, known, measured
from tracker.filters.models import Motion
from tracker.kernels.smoothing import passes
from tracker.smoothing.calibration import FEWEST
from tracker.smoothing.paths import Paths
from tracker.smoothing.smoother import START_SIGMA, Fitted, _step_correlation, process_noise_scales
from tracker.smoothing.tracklets.motion import Ends


def one_walker(steps: int = 20) -> Known:
    """Somebody who walks through the room alone."""
    bend = [(-1.0, 0.2), (0.0, 0.4), (0.9, -0.3)]
    return known(world.walk(bend, [0.0, steps / 20.0, steps / 10.0], 10.0)[:, None])


def test_a_target_without_clutter_is_where_the_least_squares_over_all_boxes_put_it() -> None:
    scene = one_walker(12)
    smoother = scene.smoother()
    paths, links = scene.paths()
    found = smoother.fit(paths, links, iterations=8).paths.states
    motion, steps = smoother.model.motion, smoother.frames
    whiten = np.linalg.inv(np.linalg.cholesky(motion.noise))
    prior = np.concatenate([np.full(3, START_SIGMA), np.full(3, motion.start_velocity)])

    def residuals(unknown: ndarray) -> ndarray:
        states = unknown.reshape(steps, 6)
        # the prior's middle is where the last fit began
        parts = [(states[0] - [*found[0, :3], 0.0, 0.0, 0.0]) / prior]
        for before, after in itertools.pairwise(states):
            parts.append(whiten @ (after - motion.transition @ before))
        for c, camera in enumerate(smoother.cameras):
            own = links.take(links.cameras == c)
            expected = smoother.model.target.expected(smoother.model.cameras[c], states[own.rows])
            measured = camera.measurements(own.boxes)
            for value, box, noise in zip(expected.expected.values, *measured, strict=True):
                parts.append(np.linalg.inv(np.linalg.cholesky(noise)) @ (box - value))
        return np.concatenate(parts)

    best = least_squares(residuals, found.ravel() + 0.01, x_scale="jac", xtol=1e-12).x
    assert_allclose(found[:, :3], best.reshape(steps, 6)[:, :3], atol=2e-5)


def test_looking_back_never_raises_a_covariance() -> None:
    scene = one_walker()
    smoother = scene.smoother()
    paths, links = scene.paths()
    # half of the boxes are missing, at random
    links = links.take(np.random.default_rng(1).random(len(links.rows)) < 0.5)
    fitted = smoother.fit(paths, links, iterations=3)
    after = np.trace(fitted.paths.covariances[:, :3, :3], axis1=1, axis2=2)
    assert (after <= fitted.traces * (1.0 + 1e-9) + 1e-12).all()
    assert after.sum() < 0.9 * fitted.traces.sum()
    assert np.linalg.eigvalsh(fitted.paths.covariances).min() > 0.0


@pytest.mark.parametrize("size", [3, 6])
def test_without_boxes_a_path_is_only_predicted(size: int) -> None:
    rng = np.random.default_rng(0)
    transition = np.eye(size)
    noise, prior = 0.01 * np.eye(size), np.eye(size)
    begin = rng.normal(size=(1, size))
    starts = np.array([0, 5])
    found = passes.smooth_paths(
        starts,
        begin,
        np.zeros((5, 3, 3)),
        np.zeros((5, 3)),
        passes.PathMotion(transition, noise, prior),
        np.ones(5),
    )
    assert_allclose(found.means, np.tile(begin, (5, 1)), atol=1e-12)
    assert_allclose(found.covariances[-1], prior + 4 * noise, atol=1e-12)
    assert not found.fits.any()
    jumps = passes.jumps(
        starts, found.means, found.covariances, found.ahead, found.ahead_covariances
    )
    assert_allclose(jumps, 0.0, atol=1e-9)


def test_a_path_seen_backwards_is_the_same_path() -> None:
    forward = one_walker()
    found = []
    for scene in (forward, backwards(forward)):
        fitted = scene.smoother().fit(*scene.paths(), iterations=5)
        found.append(fitted.paths.states[:, :3])
    # only what is known of the first velocity tells the directions apart
    assert_allclose(found[0][3:-3], found[1][::-1][3:-3], atol=3e-3)


def test_the_stated_sigma_is_the_errors() -> None:
    """NEES of 24 people who move as the motion model says, seen with the noise that is stated:
    three degrees of freedom for a place, and three for a velocity."""
    rng, steps, count = np.random.default_rng(6), 10, 24
    motion = Motion.of(PLAIN.fusion, 0.1)
    root = np.linalg.cholesky(motion.noise)
    states = np.zeros((steps, count, 6))
    states[0, :, :3] = rng.uniform([-1.5, -1.5, 0.8], [1.5, 1.5, 0.9], (count, 3))
    states[0, :, 3:] = PLAIN.fusion.start_velocity * rng.normal(size=(count, 3))
    for step in range(1, steps):
        drive = rng.normal(size=(count, 6)) @ root.T
        states[step] = states[step - 1] @ motion.transition.T + drive
    scene = known(states[:, :, :3], sigma=4.0)
    paths, links = scene.paths()
    found = scene.smoother().fit(paths, links, iterations=4).paths
    off = found.states - states.transpose(1, 0, 2).reshape(-1, 6)
    for part in (slice(0, 3), slice(3, 6)):
        own = off[:, part]
        solved = np.linalg.solve(found.covariances[:, part, part], own[..., None])[..., 0]
        squares = (own * solved).sum(axis=1).reshape(count, steps)
        # of one person's rows, which err alike, the first, one in the middle and the last
        for row in (0, 5, 9):
            assert squares[:, row].mean() == pytest.approx(3.0, abs=4.0 * np.sqrt(6.0 / count))


def test_half_the_trust_in_a_box_is_half_its_information() -> None:
    """A box that is a path's with probability a counts with a times its information."""
    scene = one_walker(6)
    paths, links = scene.paths()
    half = replace(links, shares=np.full(len(links.shares), 0.5))
    found = scene.smoother().fit(paths, half, iterations=3).paths
    seen = [replace(one, sigmas=np.sqrt(2.0) * one.sigmas) for one in scene.seen]
    same = replace(scene, seen=seen).smoother().fit(paths, links, iterations=3).paths
    assert_allclose(found.states, same.states, atol=1e-6)
    assert_allclose(found.covariances, same.covariances, atol=1e-6)


@pytest.mark.parametrize("precision", [1e5, 1e7, 1e9])
@pytest.mark.parametrize("step", [1 / 60, 0.5])
def test_boxes_however_precise_leave_covariances_positive(step: float, precision: float) -> None:
    rng = np.random.default_rng(7)
    motion = Motion.of(PLAIN.fusion, step)
    rule = passes.PathMotion(motion.transition, motion.noise, np.diag([100.0] * 3 + [0.5] * 3))
    for _ in range(20):
        rows, place = 30, rng.uniform(-3.0, 3.0, 3)
        information = np.zeros((rows, 3, 3))
        for row in np.flatnonzero(rng.random(rows) < 0.7):
            for _ in range(int(rng.integers(1, 3))):  # each camera knows nothing along its ray
                ray = rng.normal(size=3)
                ray /= np.linalg.norm(ray)
                information[row] += precision * (np.eye(3) - np.outer(ray, ray))
        begin = np.append(place + rng.normal(size=3), np.zeros(3))
        found = passes.smooth_paths(
            np.array([0, rows]), begin[None], information, information @ place, rule,
            np.full(rows, 10.0 ** rng.uniform(-3.0, 0.0)),
        )  # fmt: skip
        assert np.linalg.eigvalsh(found.covariances).min() > 0.0
        assert_allclose(found.means[:, :3], np.tile(place, (rows, 1)), atol=1.0)


def test_long_recordings_are_smoothed_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows, steps and boxes seven at a time instead of all at once."""
    scene = known(np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (60, 1, 1)), sigma=2.0)

    def everything() -> list[ndarray]:
        smoother, (paths, links) = scene.smoother(), scene.paths(sigma=0.1)
        fitted = smoother.fit(paths, links, 2)
        shared = smoother.associate(fitted.paths)
        learnt = smoother.learn(fitted.paths, shared.links, smoother.uncalibrated(paths))
        reported = smoother.reported(fitted, shared.links, learnt)
        assert reported is not None
        heights = smoother.heights(fitted.paths, shared.links, reported.learnt, reported.noise)
        order = np.lexsort((shared.links.boxes, shared.links.rows, shared.links.cameras))
        links = shared.links.take(order)
        return [
            fitted.paths.states, fitted.odds, shared.chances, shared.missed, shared.hidden_by,
            links.rows, links.boxes, links.shares, learnt.offsets, learnt.noises,
            reported.covariances, *heights,
        ]  # fmt: skip

    whole = everything()
    monkeypatch.setattr("tracker.smoothing.smoother._AT_ONCE", 7)
    for found, expected in zip(everything(), whole, strict=True):
        assert_allclose(found, expected, rtol=1e-5, atol=1e-9)


def test_boxes_far_from_what_their_paths_expect_tell_nothing_of_the_noise() -> None:
    """Tracks of false boxes have links, and none of them is near its path."""
    scene = known(np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (60, 1, 1)), sigma=2.0)
    smoother, (paths, links) = scene.smoother(), scene.paths(sigma=0.1)
    fitted, learnt = smoother.fit(paths, links, 2), smoother.uncalibrated(paths)
    found = smoother.reported(fitted, links, learnt)
    assert found is not None
    assert np.isfinite(found.noise.white).all()
    raised = fitted.paths.states + np.eye(6)[2] * 2.0
    away = replace(fitted, paths=replace(fitted.paths, states=raised))
    assert smoother.reported(away, links, learnt) is None


def test_a_newcomer_is_anywhere_in_the_room_and_as_fast_as_newcomers_are() -> None:
    """The prior is wide, and its density at its middle stands for one over the room's volume."""
    smoother = one_walker().smoother()
    prior, motion = smoother.prior, smoother.model.motion
    assert_allclose(np.diag(prior), [START_SIGMA**2] * 3 + [motion.start_velocity**2] * 3)
    density = multivariate_normal(np.zeros(3), prior[:3, :3]).pdf(np.zeros(3))
    assert np.exp(-smoother.log_place) == pytest.approx(density * 4.4 * 4.4 * 2.2)


def test_errors_of_one_step_and_the_next_correlate_within_a_path() -> None:
    rng = np.random.default_rng(2)
    rows = np.delete(np.arange(150), [20, 21, 90])
    owners = np.repeat([0, 1], 75)
    residuals = rng.normal(size=(len(rows), 3))
    residuals[1:] += 0.6 * residuals[:-1]
    pairs = [
        (k, m)
        for k, m in itertools.product(range(len(rows)), repeat=2)
        if rows[m] == rows[k] + 1 and owners[rows[m]] == owners[rows[k]]
    ]
    one, other = (residuals[list(side)].ravel() for side in zip(*pairs, strict=True))
    expected = one @ other / np.sqrt((one @ one) * (other @ other))
    mixed = rng.permutation(len(rows))
    found = _step_correlation(rows[mixed], owners, residuals[mixed])
    assert found == pytest.approx(expected)
    assert _step_correlation(rows, owners, -np.ones((len(rows), 3))) == 0.95
    assert _step_correlation(rows, owners, (-1.0) ** rows[:, None]) == 0.0
    assert _step_correlation(rows[:20], owners, np.ones((20, 3))) == 0.0  # of too few
    assert _step_correlation(rows, owners, np.zeros((len(rows), 3))) == 0.0
    few = np.arange(FEWEST + 1)
    assert _step_correlation(few, np.zeros(200, dtype=int), np.ones((FEWEST + 1, 1))) > 0.0
    assert _step_correlation(few[1:], np.zeros(200, dtype=int), np.ones((FEWEST, 1))) == 0.0


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
