"""The shape of bodies: boxes of cylinders among boxes that are expected of axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.stats import chi2

from tests import world
from tests.smoothing.known import Known, known
from tracker.geometry.camera import Camera
from tracker.kernels.boxes import body_shifts
from tracker.smoothing.bodies import BodyPriors, RowBoxes, estimate_bodies
from tracker.smoothing.calibration import upright

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
