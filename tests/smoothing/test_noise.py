"""The noise of boxes, the covariance that follows from it, and cameras that are out of line."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from tests.random_rooms import random_room
from tests.smoothing.test_boundaries import standing
from tracker.filters.models import Motion, constant_velocity
from tracker.io.checks import check
from tracker.kernels.smoothing.innovations import (
    BoxErrors,
    DeviationMotion,
    Windows,
    log_likelihood,
    normalised_innovations,
)
from tracker.runs.camera_notes import camera_notes
from tracker.runs.fitting import default_parameters
from tracker.runs.pipeline import compute
from tracker.sequences.sequence import Detections, Sequence
from tracker.smoothing.camera_errors import (
    FACTOR,
    CameraErrors,
    estimate_camera_errors,
    significant_deviations,
)
from tracker.smoothing.noise import (
    COMMON,
    LEAST_ROWS,
    MOST_ROWS,
    WINDOW,
    NoiseModel,
    NoiseSample,
    PersistentErrors,
    SureBoxes,
    choose_rows,
    common_variance,
    estimate_noise,
)
from tracker.smoothing.paths import Paths

STEP = 0.1
NUMBERS = 3


def paths_of(*lengths: int, dimension: int = 6) -> Paths:
    """Paths of some lengths that stand at the origin."""
    found = Paths.blank(range(len(lengths)), [0] * len(lengths), lengths, dimension)
    found.states[:], found.covariances[:] = 0.0, np.eye(dimension)
    return found


def motion_of(sigma: float = 0.5) -> Motion:
    return Motion(*constant_velocity(np.full(3, sigma), STEP, 100.0), 1.0)


def jacobians_of(angle: float, pixels: float) -> ndarray:
    """Derivative of centre, top and bottom of a camera at an angle, with pixels per metre."""
    across = [-math.sin(angle), math.cos(angle), 0.0]
    ahead = 0.15 * np.array([math.cos(angle), math.sin(angle), 0.0])
    return pixels * np.array([across, ahead - [0.0, 0.0, 1.0], -ahead - [0.0, 0.0, 1.0]])


def simulated(seed: int, noise: NoiseModel, rows: int, cameras: int = 4) -> tuple[Paths, SureBoxes]:
    """Walks of 60 steps around paths at rest, and boxes with white and persistent errors."""
    rng = np.random.default_rng(seed)
    motion, kept = motion_of(), math.exp(-STEP / noise.time)
    paths = paths_of(*[60] * (rows // 60))
    parts = []
    for own in map(paths.rows_of, range(len(paths.labels))):
        state = np.zeros(6)
        errors = noise.persistent * rng.standard_normal((cameras, NUMBERS))
        for row in range(own.start, own.stop):
            state = motion.transition @ state + rng.multivariate_normal(np.zeros(6), motion.noise)
            fresh = rng.standard_normal(errors.shape)
            errors = kept * errors + math.sqrt(1.0 - kept**2) * noise.persistent * fresh
            for camera in range(cameras):
                half = rng.uniform(20.0, 120.0)
                jacobian = jacobians_of(1.3 * camera + 0.4, half / 0.85)
                white = half * noise.white * rng.standard_normal(NUMBERS)
                white += noise.pixels * rng.standard_normal(NUMBERS)
                parts.append(
                    (camera, row, jacobian @ state[:3] + half * errors[camera] + white, jacobian,
                     half)
                )  # fmt: skip
    return paths, SureBoxes(*(np.array(column) for column in zip(*parts, strict=True)))


TRUE = NoiseModel(np.array([0.02, 0.03, 0.04]), 2.0, np.array([0.05, 0.03, 0.04]), 1.0, 1.0)


def estimates(seeds: range) -> ndarray:
    """r, ς, q, τ and the factor on Q, the median of some simulations of 600 rows."""
    found = []
    for seed in seeds:
        paths, seen = simulated(seed, TRUE, 600)
        rows, scales = np.arange(600), np.ones(600)
        one = estimate_noise(NoiseSample(paths, rows, seen, motion_of(), scales, STEP))
        found.append([*one.white, one.pixels, *one.persistent, one.time, one.process])
    return np.asarray(np.median(found, axis=0))


@pytest.mark.parametrize("seeds", [range(3), pytest.param(range(20), marks=pytest.mark.long)])
def test_the_noise_of_simulated_boxes_is_found(seeds: range) -> None:
    *shares, time, process = estimates(seeds)
    assert_allclose(shares, [*TRUE.white, TRUE.pixels, *TRUE.persistent], rtol=0.15)
    assert_allclose([time, process], [TRUE.time, TRUE.process], rtol=0.3)


def test_the_likelihood_is_that_of_all_boxes_together() -> None:
    """It is the density of the joint normal distribution of all residuals of a window."""
    rng = np.random.default_rng(5)
    motion, prior = motion_of(), np.diag([0.3, 0.2, 0.4, 1.0, 0.5, 0.8])
    errors = BoxErrors(np.array([0.02, 0.05, 0.03]), 1.5, np.array([0.06, 0.02, 0.04]), 0.8, 1.7)
    scales, drifts = np.array([1.0, 0.5, 2.0]), rng.normal(size=(3, 6)) * 0.1
    boxes, slots = np.array([0, 2, 3, 5]), np.array([0, 1, 1, 0, 1])
    half = rng.uniform(20.0, 80.0, 5)
    jacobians = rng.normal(size=(5, NUMBERS, 3)) * 50.0
    residuals = rng.normal(size=(5, NUMBERS)) * 10.0
    windows = Windows(np.array([0, 3]), drifts, scales, boxes, slots, residuals, jacobians, half)
    found = log_likelihood(windows, DeviationMotion(motion.transition, motion.noise, prior), errors)

    means, covariance = [np.zeros(6)], prior
    spreads = {(0, 0): prior}
    for k in (1, 2):
        means.append(motion.transition @ means[-1] + drifts[k])
        covariance = motion.transition @ covariance @ motion.transition.T
        covariance = covariance + errors.process * scales[k] * motion.noise
        spreads[k, k] = covariance
        for j in range(k):
            spreads[k, j] = motion.transition @ spreads[k - 1, j]
            spreads[j, k] = spreads[k, j].T
    rows = np.repeat(np.arange(3), np.diff(boxes))
    mean = np.concatenate([jacobians[o] @ means[rows[o]][:3] for o in range(5)])
    joint = np.block([
        [jacobians[a] @ spreads[rows[a], rows[b]][:3, :3] @ jacobians[b].T for b in range(5)]
        for a in range(5)
    ])  # fmt: skip
    for a in range(5):
        for b in range(5):
            if slots[a] == slots[b]:
                kept = errors.kept ** abs(int(rows[a]) - int(rows[b]))
                part = half[a] * half[b] * kept * np.diag(errors.persistent**2)
                joint[3 * a : 3 * a + 3, 3 * b : 3 * b + 3] += part
    joint += block_diag(*(np.diag((h * errors.white) ** 2 + errors.pixels**2) for h in half))
    assert_allclose(found.value, multivariate_normal(mean, joint).logpdf(residuals.ravel()))
    twice = windows._replace(
        starts=np.array([0, 3, 6]), drifts=np.tile(drifts, (2, 1)), noise_scales=np.tile(scales, 2),
        boxes=np.append(boxes, 5 + boxes[1:]), slots=np.tile(slots, 2),
        residuals=np.tile(residuals, (2, 1)), jacobians=np.tile(jacobians, (2, 1, 1)),
        half_heights=np.tile(half, 2),
    )  # fmt: skip
    deviation = DeviationMotion(motion.transition, motion.noise, prior)
    assert_allclose(log_likelihood(twice, deviation, errors).value, 2.0 * found.value)


def random_windows(seed: int) -> tuple[Windows, DeviationMotion, BoxErrors]:
    """Two windows of 4 and 3 rows, with boxes of up to three cameras, and some noise."""
    rng = np.random.default_rng(seed)
    motion = motion_of()
    prior = np.diag(rng.uniform(0.2, 1.0, 6))
    counts = np.array([2, 0, 3, 1, 3, 2, 1])
    boxes = np.append(0, np.cumsum(counts))
    slots = np.concatenate([np.sort(rng.permutation(3)[:count]) for count in counts])
    total = int(counts.sum())
    half = rng.uniform(20.0, 80.0, total)
    windows = Windows(
        np.array([0, 4, 7]), rng.normal(size=(7, 6)) * 0.1, rng.uniform(0.5, 2.0, 7), boxes,
        slots, rng.normal(size=(total, NUMBERS)) * 10.0,
        rng.normal(size=(total, NUMBERS, 3)) * 50.0, half,
    )  # fmt: skip
    errors = BoxErrors(np.array([0.02, 0.05, 0.03]), 1.5, np.array([0.06, 0.02, 0.04]), 0.8, 1.7)
    return windows, DeviationMotion(motion.transition, motion.noise, prior), errors


def test_the_gradient_of_the_likelihood_is_that_of_finite_differences() -> None:
    windows, motion, errors = random_windows(8)
    numbers = np.array(
        [*errors.white, errors.pixels, *errors.persistent, errors.kept, errors.process]
    )

    def value(numbers: ndarray) -> float:
        moved = BoxErrors(numbers[:3], numbers[3], numbers[4:7], numbers[7], numbers[8])
        return float(log_likelihood(windows, motion, moved).value)

    slopes = log_likelihood(windows, motion, errors).gradient
    found = [*slopes.white, slopes.pixels, *slopes.persistent, slopes.kept, slopes.process]
    steps = np.diag(1e-5 * numbers)
    expected = [
        (value(numbers + step) - value(numbers - step)) / (2.0 * step.sum()) for step in steps
    ]
    assert_allclose(found, expected, rtol=1e-5)


def test_what_is_added_to_residuals_is_added_to_the_innovations() -> None:
    windows, motion, errors = random_windows(9)
    added = np.random.default_rng(10).normal(size=(*windows.residuals.shape, 2))
    found = normalised_innovations(windows, motion, errors, added)
    at = np.array([0.3, -2.0])
    moved = windows._replace(residuals=windows.residuals + added @ at)
    squares = np.square(found[:, 0]).sum() - np.square(found @ [1.0, *at]).sum()
    before, after = (log_likelihood(each, motion, errors).value for each in (windows, moved))
    assert_allclose(after - before, 0.5 * squares)


def test_rows_are_windows_that_two_cameras_see() -> None:
    paths = paths_of(2000, 30, 500)
    counts = np.full(2530, 2)
    counts[1000:2000] = 1
    rows = choose_rows(paths, counts)
    assert rows is not None
    assert MOST_ROWS <= len(rows) <= MOST_ROWS + WINDOW
    assert (np.diff(rows) > 0).all()
    assert (counts[rows] == 2).mean() > 0.9
    assert set(paths.owners_of(rows).tolist()) == {0, 2}  # of both long paths
    assert choose_rows(paths, np.ones(2530, dtype=int)) is None
    few = np.zeros(2530, dtype=int)
    few[: LEAST_ROWS - 1] = 2
    assert choose_rows(paths, few) is None
    few[LEAST_ROWS - 1] = 2
    assert choose_rows(paths, few) is not None


def test_a_path_of_a_single_row_tells_nothing_of_the_noise() -> None:
    spans = [(1, 0, 59, 0.0), (2, 3, 3, 2.0), (3, 5, 6, 4.0)]
    rows = choose_rows(standing(*spans), np.full(63, 2))
    assert rows is not None
    assert rows.tolist() == [*range(60), 61, 62]


@pytest.mark.parametrize(
    ("windows", "chosen"),
    [
        ([(60, 30), (60, 29)], [0]),
        ([(LEAST_ROWS, LEAST_ROWS), (60, 29)], [0]),
        # where too few rows are left, whatever two cameras see at all is used
        ([(LEAST_ROWS - 1, LEAST_ROWS - 1), (60, 29)], [0, 1]),
        ([(60, 25), (60, 25), (1, 1), (60, 0)], [0, 1]),
    ],
)
def test_windows_of_which_two_cameras_see_half_are_chosen(
    windows: list[tuple[int, int]], chosen: list[int]
) -> None:
    """A window is given as its rows, and in how many of them two cameras see the person."""
    paths = paths_of(*[length for length, _ in windows])
    counts = np.concatenate([np.where(np.arange(length) < seen, 2, 1) for length, seen in windows])
    rows = choose_rows(paths, counts)
    assert rows is not None
    assert np.unique(paths.owners_of(rows)).tolist() == chosen


def test_what_does_not_average_is_considered() -> None:
    """G Q_β Gᵀ of the boxes of a step, of two cameras that see it."""
    noise = replace(TRUE, pixels=1.0)
    paths = paths_of(3, 2)
    angles, halves = (0.3, 1.7), (50.0, 80.0)
    errors = PersistentErrors(noise, 5, 0.85)
    every = [jacobians_of(angle, half / 0.85) for angle, half in zip(angles, halves, strict=True)]
    for camera, (jacobian, half) in enumerate(zip(every, halves, strict=True)):
        errors.add(
            SureBoxes(np.array([camera]), np.array([1]), np.zeros((1, 3)), jacobian[None],
                      np.array([half]))
        )  # fmt: skip
    h = np.concatenate(every)
    inverse = np.diag(np.concatenate([1.0 / noise.variances(np.array([one]))[0] for one in halves]))
    lasting = np.diag(np.concatenate([(one * noise.persistent) ** 2 for one in halves]))
    unit = (noise.persistent[0] * 0.85) ** 2
    gain = np.linalg.inv(h.T @ inverse @ h + np.eye(3) / (8.0 * unit)) @ h.T @ inverse
    expected = gain @ lasting @ gain.T
    assert np.trace(expected) < 8.0 * unit
    found = errors.covariances(paths)
    # rows without boxes are as those beside them, and another path's are not
    assert_allclose(found, [expected] * 3 + [np.zeros((3, 3))] * 2, atol=1e-18)


def test_a_poor_view_is_bounded() -> None:
    noise, paths = replace(TRUE, pixels=0.0), paths_of(1)
    errors = PersistentErrors(noise, 1, 0.85)
    jacobian = jacobians_of(0.3, 60.0)
    jacobian[1:, :2] = 0.0  # nothing tells how far away somebody is
    errors.add(
        SureBoxes(np.array([0]), np.array([0]), np.zeros((1, 3)), jacobian[None], np.ones(1))
    )
    unit = (noise.persistent[0] * 0.85) ** 2
    assert 0.0 < np.trace(errors.covariances(paths)[0]) <= 8.0 * unit * (1.0 + 1e-12)


def test_the_shape_of_bodies_is_considered_as_one_error_of_all_cameras() -> None:
    """(G δ)(G δ)ᵀ of horizontal centres, a third of it for the rims."""
    noise, paths, halves = TRUE, paths_of(1), np.array([50.0, 80.0])
    every = np.array([jacobians_of(0.3, 60.0), jacobians_of(1.7, 90.0)])
    weights = 1.0 / noise.variances(halves)
    information = np.einsum("cpa,cp,cpb->ab", every, weights, every) + np.eye(3)
    offs = np.array([3.0, -2.0]), np.array([1.0, 4.0])
    gains = [
        np.linalg.solve(information, np.einsum("c,ca,c->a", off, every[:, 0], weights[:, 0]))
        for off in offs
    ]
    plain, errors = PersistentErrors(noise, 1, 0.85), PersistentErrors(noise, 1, 0.85)
    for camera, (half, jacobian) in enumerate(zip(halves, every, strict=True)):
        seen = SureBoxes(
            np.array([camera]), np.array([0]), np.zeros((1, 3)), jacobian[None], np.array([half])
        )
        plain.add(seen)
        errors.add(seen)
        errors.add_bodies(seen, offs[0][[camera]], offs[1][[camera]])
    expected = np.outer(gains[0], gains[0]) / 3.0 + np.outer(gains[1], gains[1])
    assert_allclose((errors.covariances(paths) - plain.covariances(paths))[0], expected)


def test_what_cameras_have_in_common_is_as_large_as_what_they_differ_by() -> None:
    offsets = np.array([[0.03, 0.5, 0.5], [-0.04, 0.5, 0.5]])
    expected = COMMON * (0.05**2 + (0.03**2 + 0.04**2) / 2.0) * 0.85**2
    assert_allclose(common_variance(TRUE, offsets, 0.85), expected)


def covered(sequence: Sequence, *, smoothed: bool) -> float:
    """Share of true positions within the 95 % ellipse on the floor of the track nearest to them."""
    run = compute(sequence, default_parameters(sequence))
    truth = sequence.ground_truth
    assert truth is not None
    assert run.smoothed is not None
    if smoothed:
        found = run.smoothed
        frames, places, spreads = found.frames, found.means[:, :2], found.covariances[:, :2, :2]
    else:
        tracks = run.filtered
        frames, places = tracks.frames, tracks.positions[:, :2]
        spreads = tracks.sigmas[:, :2, None] ** 2 * np.eye(2)
        spreads[:, [0, 1], [1, 0]] = tracks.covariances_xy[:, None]
    within = []
    for frame, place in zip(truth.frames, truth.positions[:, :2], strict=True):
        rows = np.flatnonzero(frames == frame)
        gaps = place - places[rows]
        if len(rows) and np.linalg.norm(gaps, axis=1).min() < 0.5:
            nearest = int(np.linalg.norm(gaps, axis=1).argmin())
            square = gaps[nearest] @ np.linalg.solve(spreads[rows[nearest]], gaps[nearest])
            within.append(square < 5.99)
    assert len(within) > 0.8 * len(truth.frames)
    return float(np.mean(within))


def displaced(sequence: Sequence, seed: int) -> Sequence:
    """The same with the calibration of cameras off by some centimetres."""
    rng = np.random.default_rng(seed)
    views = []
    for view in sequence.views:
        camera = view.camera
        centre = camera.centre + rng.normal(0.0, 0.04, 3)
        moved = replace(camera, translation=-camera.rotation @ centre)
        views.append(replace(view, camera=moved))
    return replace(sequence, views=tuple(views), digest=f"{sequence.digest} displaced")


@pytest.mark.full
@pytest.mark.parametrize("smoothed", [True, False])
def test_ellipses_hold_the_truth_where_calibrations_are_off(*, smoothed: bool) -> None:
    seeds = (71, 72, 73)
    rooms = [random_room(seed, cameras=4, people=3, steps=150) for seed in seeds]
    shares = [
        covered(displaced(room, seed), smoothed=smoothed)
        for room, seed in zip(rooms, seeds, strict=True)
    ]
    assert np.mean(shares) > 0.9


def test_a_sample_is_cut_into_windows_with_the_boxes_of_their_rows() -> None:
    """By going through the rows one after another."""
    rng = np.random.default_rng(4)
    paths = paths_of(2 * WINDOW + 5, 30)
    paths.states[:] = rng.normal(size=paths.states.shape)
    rows = np.array([*range(WINDOW + 10), *range(WINDOW + 15, 2 * WINDOW + 5),
                     *range(2 * WINDOW + 5, 2 * WINDOW + 30)])  # fmt: skip
    boxes = rng.permutation([(c, r) for c in range(3) for r in range(2 * WINDOW + 35)
                             if rng.random() < 0.6])  # fmt: skip
    count = len(boxes)
    seen = SureBoxes(
        boxes[:, 0], boxes[:, 1], rng.normal(size=(count, 3)), rng.normal(size=(count, 3, 3)),
        rng.uniform(20.0, 80.0, count),
    )  # fmt: skip
    scales, motion = rng.uniform(0.5, 2.0, len(paths.states)), motion_of()
    sample = NoiseSample(paths, rows, seen, motion, scales, STEP)
    windows, order = sample.windows()
    starts = [
        k for k, row in enumerate(rows.tolist())
        if k == 0 or rows[k - 1] != row - 1 or row in (WINDOW, 2 * WINDOW, 2 * WINDOW + 5)
    ]  # fmt: skip
    assert windows.starts.tolist() == [*starts, len(rows)]
    assert_allclose(windows.noise_scales, scales[rows])
    names: dict[tuple[int, int], int] = {}
    for k, row in enumerate(rows.tolist()):
        expected = np.zeros(6)
        if k not in starts:
            expected = motion.transition @ paths.states[row - 1] - paths.states[row]
        assert_allclose(windows.drifts[k], expected)
        own = order[windows.boxes[k] : windows.boxes[k + 1]]
        assert sorted(own.tolist()) == np.flatnonzero(seen.rows == row).tolist()
        window = int(np.searchsorted(starts, k, side="right"))
        for place, box in enumerate(own.tolist(), int(windows.boxes[k])):
            slot = int(windows.slots[place])
            assert 0 <= slot < 3
            assert names.setdefault((window, int(seen.cameras[box])), slot) == slot
            assert_allclose(windows.residuals[place], seen.residuals[box])
            assert_allclose(windows.jacobians[place], seen.jacobians[box])
            assert windows.half_heights[place] == seen.half_heights[box]
    assert len({(window, slot) for (window, _), slot in names.items()}) == len(names)
    assert_allclose(np.diag(sample.deviation.prior), [0.25] * 3 + [1.0] * 3)


NO_OFFSETS = np.zeros((4, 3))


def errors_of(
    paths: Paths, seen: SureBoxes, noise: NoiseModel = TRUE, offsets: ndarray = NO_OFFSETS
) -> CameraErrors:
    """The errors of the cameras of some simulated boxes."""
    rows, scales = np.arange(len(paths.states)), np.ones(len(paths.states))
    sample = NoiseSample(paths, rows, seen, motion_of(), scales, STEP)
    return estimate_camera_errors(sample, noise, offsets)


def noisier(seed: int, camera: int, factor: float) -> tuple[Paths, SureBoxes]:
    """Simulated boxes of which those of one camera have the same errors, larger by a factor."""
    paths, seen = simulated(seed, TRUE, 600)
    worse = replace(
        TRUE,
        white=factor * TRUE.white,
        persistent=factor * TRUE.persistent,
        pixels=factor * TRUE.pixels,
    )
    _, other = simulated(seed, worse, 600)
    own = seen.cameras == camera
    return paths, replace(seen, residuals=np.where(own[:, None], other.residuals, seen.residuals))


def test_cameras_that_err_alike_are_in_line() -> None:
    named = 0
    for seed in range(12):
        found = errors_of(*simulated(seed, TRUE, 600))
        assert_allclose(found.factors, 1.0, atol=0.5)
        assert (found.least < found.factors).all()
        named += found.out_of_line is not None
    assert named == 0


@pytest.mark.parametrize("camera", range(4))
def test_a_camera_with_three_times_the_noise_is_named(camera: int) -> None:
    # the walks of both simulations are the same, for the errors only have another scale
    found = errors_of(*noisier(camera, camera, 3.0))
    assert found.out_of_line is not None
    assert found.out_of_line[0] == camera
    assert found.of(camera, "all") == pytest.approx(3.0, rel=0.2)
    # of one that errs half as much as the bound it is not known
    assert errors_of(*noisier(camera, camera, 0.5 + FACTOR / 2.0)).out_of_line is None


def test_errors_of_heights_are_none_across_the_picture() -> None:
    paths, seen = noisier(0, 1, 3.0)
    _, usual = simulated(0, TRUE, 600)
    residuals = seen.residuals.copy()
    residuals[:, 0] = usual.residuals[:, 0]
    found = errors_of(paths, replace(seen, residuals=residuals))
    assert found.factors[1, 0] == pytest.approx(1.0, abs=0.25)
    assert found.factors[1, 1:].min() > 1.8


def test_a_camera_that_is_turned_up_is_named_also_by_its_known_offset() -> None:
    paths, seen = simulated(1, TRUE, 600)
    aside = np.array([0.0, 0.3, 0.3])
    own = (seen.cameras == 2)[:, None]
    moved = seen.residuals + own * seen.half_heights[:, None] * aside
    found = errors_of(paths, replace(seen, residuals=moved))
    assert found.out_of_line == (2, "vertical")
    offsets = NO_OFFSETS.copy()
    offsets[2] = aside
    same = errors_of(paths, seen, offsets=offsets)
    assert_allclose(same.factors, found.factors)


def test_delays_are_found_by_the_likelihood() -> None:
    late = np.array([0.06, -0.1, 0.04, 0.0])
    paths, seen = simulated(3, TRUE, 600)
    rng = np.random.default_rng(4)
    velocities = rng.normal(0.0, 1.0, (len(paths.states) // 20, 3)).repeat(20, axis=0)
    velocities[:, 2] = 0.0
    states = paths.states.copy()
    states[:, 3:6] = velocities
    # the states themselves stay: a path that is not followed is a deviation without drift
    behind = np.einsum("lpa,la->lp", seen.jacobians, velocities[seen.rows])
    moved = replace(seen, residuals=seen.residuals - late[seen.cameras, None] * behind)
    moving = paths.with_states(states, paths.covariances)
    none, found = errors_of(moving, seen), errors_of(moving, moved)
    # the likelihood is quadratic: what was put in comes out whole, less what all have in common
    assert_allclose(found.delays - none.delays, late - late.mean(), atol=1e-6)
    assert_allclose(found.delay_sigmas, none.delay_sigmas)
    assert (np.abs(none.delays) < 3.5 * none.delay_sigmas).all()
    assert (none.delay_sigmas < 0.02).all()


def test_without_movement_no_delay_is_known() -> None:
    found = errors_of(*simulated(0, TRUE, 600))
    assert np.isnan(found.delays).all()
    assert np.isnan(found.delay_sigmas).all()


@pytest.mark.parametrize(
    ("cameras", "steps", "known"), [(2, 600, False), (3, 600, True), (3, 20, True), (3, 18, False)]
)
def test_of_two_cameras_or_in_few_steps_none_is_out_of_line(
    cameras: int, steps: int, known: bool
) -> None:
    paths, seen = noisier(0, 1, 5.0)
    # two cameras see the person at a time; of few steps two are a block
    own = np.flatnonzero((seen.cameras < cameras) & (seen.rows < steps))
    if cameras > 2:
        own = own[seen.cameras[own] != seen.rows[own] % cameras]
    few = SureBoxes(
        seen.cameras[own], seen.rows[own], seen.residuals[own], seen.jacobians[own],
        seen.half_heights[own],
    )  # fmt: skip
    found = errors_of(paths, few, offsets=NO_OFFSETS[:cameras])
    assert np.isfinite(found.factors).all() == known
    assert known or found.out_of_line is None


@pytest.mark.parametrize(("bound", "named"), [(FACTOR, None), (FACTOR + 1e-9, (1, "horizontal"))])
def test_a_camera_is_out_of_line_from_its_lower_bound_on(
    bound: float, named: tuple[int, str] | None
) -> None:
    least = np.ones((3, 4))
    least[1, 0] = bound
    assert CameraErrors(2.0 * least, least, *np.zeros((2, 3))).out_of_line == named


@pytest.mark.parametrize(("cameras", "normal"), [(1, 2.5758), (4, 3.0233)])
def test_the_bound_of_delays_counts_cameras_and_both_sides(cameras: int, normal: float) -> None:
    assert significant_deviations(cameras) == pytest.approx(normal, abs=1e-3)


def test_notes_say_where_a_camera_lost_frames_as_the_check_says_it() -> None:
    sequence = random_room(5, cameras=4, fps=10.0, steps=300, people=3)
    view = sequence.views[2]
    own = view.detections
    assert own is not None
    frames = own.frames - 12 * (own.frames >= 162)
    kept = (own.frames < 150) | (own.frames >= 162)
    lost = replace(view, detections=Detections(frames[kept], own.boxes[kept], own.scores[kept]))
    views = (*sequence.views[:2], lost, *sequence.views[3:])
    sequence = replace(sequence, views=views)
    found = [one.sentence for one in check(sequence) if "lost about" in one.sentence]
    assert found
    notes = camera_notes(compute(sequence, default_parameters(sequence)))
    assert [note for note in notes if "lost about" in note] == found
    assert not any(" early" in note for note in notes)


def test_notes_name_no_delay_of_which_the_check_says_that_it_is_none() -> None:
    late = random_room(1, cameras=4, people=3, steps=120, late=(0.0, 0.0, 0.1, 0.0))
    (same,) = (one for one in check(late) if one.name == "cameras show the same moments")
    assert same.status == "good"
    assert camera_notes(compute(late, default_parameters(late))) == []


def test_notes_name_a_late_camera_and_one_that_is_out_of_line() -> None:
    late = random_room(1, cameras=4, people=3, steps=120, late=(0.0, 0.0, 0.25, 0.0))
    run = compute(late, default_parameters(late))
    (note,) = camera_notes(run)
    name = late.views[2].camera.name
    assert f'camera "{name}" is 0.' in note
    assert " steps) late" in note
    assert note.count("camera ") == 1
    assert [remedy.camera for one in check(late) for remedy in one.remedies] == [name]
    assert run.smoothed is not None
    assert run.smoothed.cameras is not None
    assert run.smoothed.cameras.delays[2] == pytest.approx(0.19, rel=0.4)
    factors = np.ones((4, 4))
    factors[1, 3] = 2.6
    odd = replace(run.smoothed.cameras, factors=factors, least=0.9 * factors)
    run.smoothed = replace(run.smoothed, cameras=odd)
    first, second = camera_notes(run)
    assert f'camera "{late.views[1].camera.name}" are out of line' in first
    assert "2.6 times" in first
    assert second == note
    run.smoothed = None
    assert camera_notes(run) == []
