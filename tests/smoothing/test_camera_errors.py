"""Cameras that are out of line are named, right ones are not, and clocks are found by the boxes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests.random_rooms import random_room
from tests.smoothing.test_noise import STEP, TRUE, motion_of, simulated
from tracker.io.checks import check
from tracker.runs.camera_notes import camera_notes
from tracker.runs.fitting import default_parameters
from tracker.runs.pipeline import compute
from tracker.sequences.sequence import Detections
from tracker.smoothing.camera_errors import (
    FACTOR,
    CameraErrors,
    estimate_camera_errors,
    significant_deviations,
)
from tracker.smoothing.noise import NoiseModel, NoiseSample, SureBoxes
from tracker.smoothing.paths import Paths

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


def test_of_two_cameras_none_is_out_of_line() -> None:
    paths, seen = noisier(0, 1, 5.0)
    two = np.flatnonzero(seen.cameras < 2)
    few = SureBoxes(
        seen.cameras[two], seen.rows[two], seen.residuals[two], seen.jacobians[two],
        seen.half_heights[two],
    )  # fmt: skip
    found = errors_of(paths, few, offsets=NO_OFFSETS[:2])
    assert np.isnan(found.factors).all()
    assert found.out_of_line is None


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


def test_notes_name_a_late_camera_and_one_that_is_out_of_line() -> None:
    late = random_room(1, cameras=4, people=3, steps=120, late=(0.0, 0.0, 0.12, 0.0))
    run = compute(late, default_parameters(late))
    (note,) = camera_notes(run)
    name = late.views[2].camera.name
    assert f'camera "{name}" is 0.' in note
    assert " steps) late" in note
    assert run.smoothed is not None
    assert run.smoothed.cameras is not None
    assert run.smoothed.cameras.delays[2] == pytest.approx(0.09, rel=0.3)
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
