"""The shape of bodies and the height of people, by boxes of cylinders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.stats import chi2

from tests import world
from tests.random_rooms import random_room
from tests.smoothing.known import Known, given, known
from tracker.geometry.camera import Camera
from tracker.kernels.boxes import body_shifts
from tracker.runs.pipeline import compute, default_parameters
from tracker.smoothing.bodies import (
    BodyPriors,
    BoxTops,
    RowBoxes,
    estimate_bodies,
    standing_heights,
)
from tracker.smoothing.calibration import upright
from tracker.smoothing.noise import LEAST_ROWS, NoiseModel
from tracker.smoothing.paths import Paths

HALF = float(world.PERSON[2])
PRIORS = BodyPriors(0.3, 0.03, 0.1)
ROUND = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
CIRCLE = np.column_stack([np.cos(ROUND), np.sin(ROUND), np.zeros(720)])


def bounds(camera: Camera, place: ndarray, radius: float) -> ndarray:
    """Horizontal centre, top and bottom of a cylinder in the image, by its rims."""
    ends = [place + radius * CIRCLE + [0.0, 0.0, side * HALF] for side in (-1.0, 1.0)]
    pixels, _ = camera.project(np.concatenate(ends))
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    return np.array([(low[0] + high[0]) / 2.0, low[1], high[1]])


@pytest.mark.parametrize("camera", [*world.ring(3), *world.ring(1, distortion=world.BARREL)])
def test_the_bounds_of_a_thin_body_are_those_of_its_rims(camera: Camera) -> None:
    for place in np.array([[0.2, 0.1, HALF], [1.2, -0.9, HALF], [-1.0, 1.1, HALF]]):
        states = np.array([[*place, 0.0, 0.0, 0.0]])
        found = body_shifts(states, HALF, 0.02, camera.calibration)[0]
        beside = bounds(camera, place, 0.02) - bounds(camera, place, 0.0)
        assert_allclose(found[:3], beside, atol=0.04 * abs(beside[2]))
        middle, head = camera.project(place + np.outer([0.0, 1.0], [0.0, 0.0, HALF]))[0]
        assert found[3] == pytest.approx(head[0] - middle[0], abs=0.15 * abs(found[3]) + 0.5)


def test_each_of_several_bodies_has_the_bounds_that_it_has_alone() -> None:
    camera = world.ring(3)[0]
    places = [[0.2, 0.1, HALF], [1.2, -0.9, 1.1 * HALF], [-1.0, 1.1, HALF]]
    states = np.column_stack([places, np.zeros((3, 3))])
    alone = [body_shifts(states[j : j + 1], HALF, 0.2, camera.calibration)[0] for j in range(3)]
    assert len(np.unique(alone, axis=0)) == 3
    assert_allclose(body_shifts(states, HALF, 0.2, camera.calibration), alone, atol=1e-9)


def test_behind_the_lens_there_are_no_bounds() -> None:
    camera = world.look_at("one", (4.0, 0.0, 2.0))
    states = np.array([[9.0, 0.0, HALF], [0.0, 0.0, HALF]])
    found = body_shifts(states, HALF, 0.2, camera.calibration)
    assert not found[0].any()
    assert (found[1, 1:3] * [-1.0, 1.0] > 1.0).all()


def rows_of(
    rng: np.random.Generator,
    radius: float,
    level: float,
    *,
    cameras: int = 4,
    rows: int = 400,
    noise: float = 0.01,
) -> RowBoxes:
    """Boxes of two people, at places that are not known, with offsets and sizes besides."""
    found = RowBoxes.none(np.repeat([0, 1], rows // 2), cameras, 3)
    found.jacobians[:] = rng.normal(size=found.jacobians.shape)
    found.edges[:] = rng.uniform(0.3, 0.9, found.edges.shape) * [-1.0, 1.0]
    found.levels[:] = rng.normal(0.0, 0.1, found.levels.shape)
    found.there[:] = 1.0
    aside = rng.normal(0.0, 0.3, (rows, 3))
    offsets = rng.normal(0.0, PRIORS.offset, (cameras, 3)) * [0.0, 1.0, 1.0]
    sizes = np.array([0.08, -0.05])[found.owners]
    found.residuals[:] = np.einsum("kcpa,ka->kcp", found.jacobians, aside) + offsets
    found.residuals[:] += sizes[:, None, None] * upright(3)
    found.residuals[:, :, 1:] += radius * found.edges
    found.residuals[:, :, 0] += level * found.levels
    found.residuals[:] += rng.normal(0.0, noise, found.residuals.shape)
    return found


@pytest.mark.parametrize(("radius", "level"), [(0.15, 0.2), (0.25, -0.1), (0.0, 0.0)])
def test_radius_and_level_are_found_whatever_the_places_offsets_and_sizes(
    radius: float, level: float
) -> None:
    seen = rows_of(np.random.default_rng(3), radius, level)
    found = estimate_bodies(seen, upright(3), 2, 1.0, PRIORS)
    assert found.radius == pytest.approx(radius, abs=0.03)
    assert found.level_sigma == pytest.approx(abs(level), abs=0.15)
    # what the radius explains, offsets and sizes do no longer
    assert_allclose(found.offsets[:, 0], 0.0)
    mean = found.offsets.mean(axis=0) + found.sizes.mean() * upright(3)
    assert_allclose(mean[1:], -radius * seen.edges.mean(axis=(0, 1)), atol=0.3 * radius + 0.01)


def test_dependent_rows_say_less_and_one_camera_nothing() -> None:
    rng = np.random.default_rng(4)
    seen = rows_of(rng, 0.15, 0.0)
    sure, unsure = (estimate_bodies(seen, upright(3), 2, share, PRIORS) for share in (1.0, 0.05))
    assert 0.0 < sure.radius_sigma < unsure.radius_sigma < PRIORS.radius
    alone = replace(seen, there=seen.there * [1.0, 0.0, 0.0, 0.0])
    found = estimate_bodies(alone, upright(3), 2, 1.0, PRIORS)
    assert (found.radius, found.radius_sigma) == (0.0, pytest.approx(PRIORS.radius))
    assert not found.offsets.any()
    assert not found.sizes.any()


def test_a_radius_is_not_negative() -> None:
    found = estimate_bodies(
        rows_of(np.random.default_rng(5), -0.1, 0.0), upright(3), 2, 1.0, PRIORS
    )
    assert found.radius == 0.0
    assert not found.offsets.any()


def cylinders(radius: float, steps: int = 120) -> Known:
    """Three who walk to and fro off the middle, whose boxes are bounds of cylinders."""
    cameras, fps = world.ring(4), 12.0
    ends = [((-1.6, -1.2), (1.5, -1.4)), ((1.6, 1.5), (-1.4, 1.2)), ((1.7, -0.8), (1.2, 1.0))]
    times = [0.0, steps / 2.0 / fps, steps / fps]
    places = world.together(
        *(world.walk([begin, end, begin], times, fps) for begin, end in ends), steps=steps
    )
    scene = known(places, cameras=cameras, sigma=1.0, seed=2, fps=fps)
    for seen, camera in zip(scene.seen, cameras, strict=True):
        for box, frame, person in zip(seen.boxes, seen.frames, seen.people, strict=True):
            place = places[frame, person]
            moved = bounds(camera, place, radius) - bounds(camera, place, 1e-9)
            box[[0, 1, 3]] += moved[0], (moved[1] + moved[2]) / 2.0, (moved[2] - moved[1]) / 2.0
    return replace(scene, whole=world.sequence(cameras, places, scene.seen, fps=fps))


@pytest.mark.parametrize("radius", [0.0, 0.18])
def test_the_radius_of_walkers_is_found_and_positions_gain_by_it(radius: float) -> None:
    scene = cylinders(radius)
    smoother = scene.smoother()
    paths, links = scene.paths(sigma=0.1)
    fitted = smoother.fit(paths, links, 3).paths
    before = smoother.learn(fitted, links, smoother.uncalibrated(fitted))
    fitted = smoother.fit(fitted, links, 2, before).paths
    found = smoother.with_bodies(fitted, links, before)
    assert found.radius == pytest.approx(radius, abs=0.03)
    if radius == 0.0:
        return
    errors = [
        np.abs(smoother.fit(fitted, links, 2, learnt).paths.states[:, :2] - paths.states[:, :2])
        for learnt in (before, found)
    ]
    assert errors[1].mean() < 0.95 * errors[0].mean()

    # positions stay, and their ellipses hold the places
    kept = smoother.fit(fitted, links, 2, before)
    states = kept.paths.states.copy()
    reported = smoother.reported(kept, links, before)
    assert reported is not None
    np.testing.assert_array_equal(kept.paths.states, states)
    off = states[:, :2] - paths.states[:, :2]
    squares = [
        np.einsum("ni,nij,nj->n", off, np.linalg.inv(own[:, :2, :2]), off)
        for own in (kept.paths.covariances, reported.covariances)
    ]
    stated, held = ((own < chi2.ppf(0.95, 2)).mean() for own in squares)
    assert stated < 0.9 < held


@pytest.mark.parametrize(
    ("steps", "share", "bodies", "noise"),
    [
        (LEAST_ROWS, 1.0, True, True), (LEAST_ROWS - 1, 1.0, False, False),
        (LEAST_ROWS, 0.9, False, True), (LEAST_ROWS, 0.5, False, False),
    ],
)  # fmt: skip
def test_bodies_and_noise_are_estimated_from_rows_that_two_cameras_surely_see(
    steps: int, share: float, bodies: bool, noise: bool
) -> None:
    scene = known(world.stand((0.3, 0.2), steps)[:, None], cameras=world.ring(2))
    smoother, (paths, links) = scene.smoother(), scene.paths(sigma=0.1)
    fitted, learnt = smoother.fit(paths, links, 2), smoother.uncalibrated(paths)
    less = replace(links, shares=np.full(len(links.shares), share))
    assert (smoother.with_bodies(fitted.paths, less, learnt) is not learnt) == bodies
    assert (smoother.reported(fitted, less, learnt) is not None) == noise


def test_radius_and_level_are_those_of_one_least_squares_fit_of_everything() -> None:
    """The fit is of rows' places, radius, level, offsets and sizes at once, with their priors."""
    seen, independent = rows_of(np.random.default_rng(7), 0.15, 0.2, cameras=3, rows=40), 0.7
    seen.there[::5, 1] = 0.0
    seen.there[3] = [1.0, 0.0, 0.0]  # of one camera alone nothing is taken
    found = estimate_bodies(seen, upright(3), 2, independent, PRIORS)
    there = seen.there * (seen.there.sum(axis=1) >= 2.0)[:, None]
    values = seen.residuals[there > 0.0]
    variances = np.maximum(((values - values.mean(axis=0)) ** 2).mean(axis=0), 1e-6)
    rows, unknown = [], 2 + 6 + 2
    for k, c in zip(*np.nonzero(there), strict=True):
        for number in range(3):
            row = np.zeros(3 * 40 + unknown + 1)
            row[3 * k : 3 * k + 3] = seen.jacobians[k, c, number]
            if number:
                row[120] = seen.edges[k, c, number - 1]
                row[122 + 2 * c + number - 1] = 1.0
            else:
                row[121] = seen.levels[k, c]
            row[128 + seen.owners[k]] = upright(3)[number]
            row[-1] = seen.residuals[k, c, number]
            rows.append(np.sqrt(independent / variances[number]) * row)
    sigmas = [PRIORS.radius, 0.3, *[PRIORS.offset] * 6, *[PRIORS.size] * 2]
    design = np.array(rows)
    precision = design[:, :-1].T @ design[:, :-1]
    precision += np.diag([*[1e-6] * 120, *(1.0 / np.square(sigmas))])
    covariance = np.linalg.inv(precision)
    best = covariance @ design[:, :-1].T @ design[:, -1]
    assert found.radius == pytest.approx(best[120], rel=1e-3)
    assert found.radius_sigma == pytest.approx(np.sqrt(covariance[120, 120]), rel=1e-3)
    level = np.hypot(best[121], np.sqrt(covariance[121, 121]))
    assert found.level_sigma == pytest.approx(level, rel=1e-3)
    # what the radius moves in all others, where it alone is added
    rest = np.delete(np.arange(130), 120)
    moved = -np.linalg.solve(precision[np.ix_(rest, rest)], precision[rest, 120]) * best[120]
    assert_allclose(found.sizes, moved[-2:], rtol=1e-3, atol=1e-6)
    offsets = moved[121:127].reshape(3, 2)
    shift = (best[120] * seen.edges + offsets).mean(axis=2)
    offsets -= (shift * there).sum() / there.sum()
    assert_allclose(found.offsets[:, 1:], offsets, rtol=1e-3, atol=1e-6)


STEP = 0.1
HALF_HEIGHT, FLOOR = 0.9, 0.3
EACH = 0.04
"""Standard deviation of the top of one box, metres."""


def noise(white: float, persistent: float, time: float = 1.0) -> NoiseModel:
    each = np.array([0.0, white, 0.0])
    lasting = np.array([0.0, persistent, 0.0])
    return NoiseModel(each, 0.0, lasting, time, 1.0)


def estimate(
    tops: list[np.ndarray], model: NoiseModel, offsets: tuple[float, ...] = (0.0,)
) -> tuple[np.ndarray, np.ndarray]:
    """Heights of people whose tops are given row by row, NaN where there is no box."""
    lengths = [len(one) for one in tops]
    rows, every = sum(lengths), np.concatenate(tops)
    paths = Paths.of(
        list(range(len(tops))), [0] * len(tops), [np.zeros((k, 3)) for k in lengths],
        [np.tile(np.eye(3), (k, 1, 1)) for k in lengths], 3,
    )  # fmt: skip
    shown = np.flatnonzero(np.isfinite(every))
    assert rows == len(every)
    seen = BoxTops(shown, every[shown], np.full(len(shown), EACH**2))
    return standing_heights(
        paths, seen, model, np.array(offsets),
        half_height=HALF_HEIGHT, floor=FLOOR, step_time=STEP,
    )  # fmt: skip


@pytest.mark.parametrize("standing", [1.0, 0.15])
def test_who_sits_for_most_of_the_time_has_the_height_of_standing(standing: float) -> None:
    rng = np.random.default_rng(3)
    tops = FLOOR + np.where(np.arange(2000) < standing * 2000, 1.75, 1.25)
    heights, sigmas = estimate([tops + rng.normal(0.0, EACH, 2000)], noise(0.04, 0.001))
    assert heights[0] == pytest.approx(1.75, abs=0.012)
    assert 0.0 < sigmas[0] < 0.01


def test_people_are_apart_and_one_without_boxes_has_none() -> None:
    one, other = np.full(50, FLOOR + 1.6), np.full(70, FLOOR + 1.9)
    one[::3] = np.nan
    heights, sigmas = estimate([one, np.full(20, np.nan), other], noise(0.04, 0.001))
    assert heights == pytest.approx([1.6, np.nan, 1.9], nan_ok=True)
    assert np.isnan(sigmas).tolist() == [False, True, False]


def test_errors_that_persist_do_not_average() -> None:
    """Of K rows σ is as of K independent errors, or as of one in twice the time they persist."""
    tops = [np.full(400, FLOOR + 1.7)]
    white = estimate(tops, noise(0.05, 1e-9))[1][0]
    assert white == pytest.approx(EACH / np.sqrt(400.0), rel=1e-3)
    brief = estimate(tops, noise(1e-9, 1e-6, time=2.0))[1][0]
    assert brief == pytest.approx(EACH * np.sqrt(2.0 * 2.0 / 40.0), rel=1e-3)
    whole = estimate(tops, noise(1e-9, 1e-6, time=60.0))[1][0]
    assert whole == pytest.approx(EACH, rel=1e-3), "never more than that of a row"


def test_what_all_boxes_have_in_common_stays() -> None:
    """κ (q² + b²) h² with κ = 1.5, however long the track."""
    tops = [np.full(100_000, FLOOR + 1.7)]
    sigma = estimate(tops, noise(0.03, 0.04), offsets=(0.02, -0.02))[1][0]
    common = 1.5 * (0.04**2 + 0.02**2) * HALF_HEIGHT**2
    assert sigma == pytest.approx(np.sqrt(common), rel=0.01)


def test_heights_are_those_of_the_people_in_the_room() -> None:
    """Of people between 1.56 and 1.84 m, of whom the target's size says 1.7."""
    room = random_room(3, cameras=3, people=3, steps=120)
    tracks = compute(room, default_parameters(room)).tracks
    truth = room.ground_truth
    assert truth is not None
    heights = {}
    for track in np.unique(tracks.ids):
        rows = np.flatnonzero(tracks.ids == track)
        assert len(np.unique(tracks.heights[rows])) == 1, "one of a track"
        at = truth.at(int(tracks.frames[rows[0]]))
        apart = np.linalg.norm(truth.positions[at] - tracks.positions[rows[0]], axis=1)
        person = at.start + int(apart.argmin())
        heights[int(truth.ids[person])] = (
            tracks.heights[rows[0]], tracks.sigma_heights[rows[0]], 2.0 * truth.positions[person, 2]
        )  # fmt: skip
    assert len(heights) == 3
    assert np.ptp([true for *_, true in heights.values()]) > 0.05
    for height, sigma, true in heights.values():
        assert height == pytest.approx(true, abs=0.02)
        assert abs(height - true) < 4.0 * sigma
        assert sigma < 0.02


def test_a_height_is_where_the_tops_of_boxes_are_but_for_what_cameras_and_marks_explain() -> None:
    """Boxes as they are expected, their tops moved by what is known of each camera and person, and
    by the persons' own heights."""
    places = np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (12, 1, 1))
    scene = known(places, sigma=1.0)
    smoother, (paths, links) = scene.smoother(), scene.paths(sigma=0.01)
    offsets, marks, taller = np.array([0.03, -0.01, 0.05]), [0.02, -0.04], [0.08, -0.1]
    for c, camera in enumerate(smoother.cameras):
        own = links.take(links.cameras == c)
        seen = smoother.model.target.expected(
            smoother.model.cameras[c], paths.states[own.rows], paths.covariances[own.rows]
        )
        half = (seen.boxes[:, 3] - seen.boxes[:, 1]) / 2.0
        values, who = seen.values.copy(), paths.owners[own.rows]
        values[:, 1] += half * (offsets[c] - offsets.mean() + np.array(marks)[who])
        values[:, 1] += seen.jacobians[:, 1, 2] * np.array(taller)[who]
        smoother.cameras[c] = given(camera, own.boxes, values)
    learnt = replace(smoother.uncalibrated(paths), shifts=np.array(marks))
    learnt.offsets[:, 1] = offsets
    model = NoiseModel(np.full(3, 0.02), 1.0, np.full(3, 0.01), 1.0, 1.0)
    heights, sigmas = smoother.heights(paths, links, learnt, model)
    assert_allclose(heights, 1.7 + np.array(taller), atol=1e-6)
    # of rows that agree: white and lasting errors of a box, and of where the person stands
    low = np.linalg.norm(sigmas)
    loose = paths.with_states(paths.states, 100.0 * paths.covariances)
    assert np.linalg.norm(smoother.heights(loose, links, learnt, model)[1]) > low
    none = replace(links, shares=np.full(len(links.shares), 0.5))
    assert np.isnan(smoother.heights(paths, none, learnt, model)[0]).all()
