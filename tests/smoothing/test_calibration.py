"""What a recording says of its own boxes: planted sizes, offsets and noises are found again."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tests.smoothing.known import CAMERAS, Known, given, known
from tracker.kernels.kalman import Measurements
from tracker.smoothing.calibration import (
    FEWEST,
    NARROWEST,
    OFFSET_RIDGE,
    SIZE_RIDGE,
    WIDEST,
    Calibration,
    free,
)
from tracker.smoothing.noise import NoiseModel
from tracker.smoothing.smoother import Smoother

U, W = np.array([0.0, -1.0, 1.0]), np.array([0.0, 1.0, 1.0])


def standing(steps: int, sigma: float = 1.0) -> Known:
    """Two who stand in the middle of all pictures."""
    return known(np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (steps, 1, 1)), sigma=sigma)


def planted(scene: Known, shares: list[ndarray]) -> Smoother:
    """The boxes are where the people should give them, off by so many half heights, of each of
    two people."""
    smoother = scene.smoother()
    paths, links = scene.paths()
    for c, camera in enumerate(smoother.cameras):
        own = links.take(links.cameras == c)
        seen = smoother.model.target.expected(CAMERAS[c], paths.states[own.rows])
        half = (seen.boxes[:, 3:] - seen.boxes[:, 1:2]) / 2.0
        values = seen.values + half * np.array(shares)[paths.owners[own.rows]]
        smoother.cameras[c] = given(camera, own.boxes, values)
    return smoother


def test_a_number_of_a_box_is_free_where_it_moves_along_any_axis() -> None:
    ways = np.array(list(itertools.product([0.0, -1e-3], repeat=3)))
    derivatives = np.hstack([ways, np.ones_like(ways)])[:, None]
    seen = standing(2).smoother().model.target.expected(CAMERAS[0], np.zeros((8, 6)))
    seen = replace(seen, expected=seen.expected._replace(jacobians=derivatives))
    assert free(seen)[:, 0].tolist() == [False] + [True] * 7


def test_the_shift_is_a_share_of_the_half_height_but_of_what_the_edge_holds_fast() -> None:
    smoother = standing(2).smoother()
    learnt = Calibration(
        np.array([0.1, -0.05]), np.arange(9.0).reshape(3, 3) / 100.0, np.ones(3),
        np.array([0.02, 0.04]),
    )  # fmt: skip
    states = np.array([[0.3, 0.2, 0.85, 0, 0, 0], [4.0, 0.4, 0.85, 0, 0, 0]])
    seen = smoother.model.target.expected(CAMERAS[0], states)
    half = (seen.boxes[:, 3] - seen.boxes[:, 1]) / 2.0
    people = np.array([1, 0])
    found = learnt.shift(0, people, seen)
    first = learnt.offsets[0] - 0.05 * U + 0.04 * W
    second = learnt.offsets[0] + 0.1 * U + 0.02 * W
    assert_allclose(found[0], half[0] * first)
    # of who stands close below the camera only the middle and what is in the picture moves
    inside = (seen.values[1] > 0.0) & (seen.values[1] < CAMERAS[0].image_size[1] - 1)
    inside[0] = True
    assert not inside.all()
    assert_allclose(found[1], half[1] * second * inside)
    assert_allclose(learnt.shift(1, people, seen)[0] - found[0], half[0] * 0.03)
    swapped = learnt.of_people(people)
    assert swapped.sizes.tolist() == [-0.05, 0.1]
    assert swapped.shifts.tolist() == [0.04, 0.02]
    noisy = replace(learnt, noises=np.array([1.0, 2.0, 3.0]))
    own = smoother.cameras[1].measurements(slice(None))
    assert_allclose(noisy.measured(1, own).noises, 4.0 * own.noises)


def test_offsets_and_sizes_are_means_drawn_to_nothing_by_their_priors() -> None:
    """Twelve steps, so that nothing is learnt of the noise."""
    offset = np.array([0.05, -0.02, 0.03])
    scene = standing(12)
    smoother = planted(scene, [offset + 0.1 * U, offset - 0.1 * U])
    paths, links = scene.paths(sigma=0.01)
    found = smoother.learn(paths, links, smoother.uncalibrated(paths))
    expected = offset * 24.0 / (24.0 + OFFSET_RIDGE)
    assert_allclose(found.offsets, np.tile(expected, (3, 1)), atol=1e-9)
    rest = (offset - expected) @ U / 2.0
    assert_allclose(found.sizes, np.array([0.1 + rest, rest - 0.1]) * 36.0 / (36.0 + SIZE_RIDGE))
    assert_allclose(found.noises, 1.0)
    # what is known of the sizes is no offset
    known_sizes = replace(smoother.uncalibrated(paths), sizes=np.array([0.1, -0.1]))
    assert_allclose(smoother.learn(paths, links, known_sizes).offsets, found.offsets, atol=1e-9)


@pytest.mark.parametrize(("off", "tells"), [(0.39, True), (0.41, False)])
def test_a_box_of_another_posture_is_no_witness(off: float, tells: bool) -> None:
    scene = standing(3)
    smoother = planted(scene, [np.array([0.0, off, 0.0])] * 2)
    paths, links = scene.paths(sigma=0.01)
    found = smoother.learn(paths, links, smoother.uncalibrated(paths))
    assert (found.offsets[:, 1] > 0.0).tolist() == [tells] * 3


@pytest.mark.parametrize(("share", "tells"), [(0.9, False), (0.9 + 1e-9, True)])
def test_a_box_that_is_hardly_somebodys_is_no_witness(share: float, tells: bool) -> None:
    scene = standing(3)
    smoother = planted(scene, [np.array([0.0, 0.1, 0.0])] * 2)
    paths, links = scene.paths(sigma=0.01)
    less = replace(links, shares=np.full(len(links.shares), share))
    assert smoother.learn(paths, less, smoother.uncalibrated(paths)).offsets.any() == tells


@pytest.mark.parametrize("steps", [FEWEST - 1, FEWEST])
def test_noise_is_learnt_from_enough_boxes(steps: int) -> None:
    scene = known(world.stand((0.3, 0.2), steps)[:, None], sigma=2.0)
    stated = replace(scene, seen=[replace(o, sigmas=2.0 * o.sigmas) for o in scene.seen])
    paths, links = scene.paths(sigma=0.001)
    smoother = stated.smoother()
    found = smoother.learn(paths, links, smoother.uncalibrated(paths)).noises
    assert ((found != 1.0) == (steps >= FEWEST)).all()


@pytest.mark.parametrize(("factor", "found"), [(0.5, 0.5), (0.05, NARROWEST), (2.0, WIDEST)])
def test_the_noise_is_that_of_the_boxes_as_a_factor_of_what_is_stated(
    factor: float, found: float
) -> None:
    scene = known(np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (100, 1, 1)), sigma=2.0 * factor)
    stated = replace(scene, seen=[replace(o, sigmas=o.sigmas / factor) for o in scene.seen])
    paths, links = scene.paths(sigma=1e-4)
    smoother = stated.smoother()
    learnt = smoother.learn(paths, links, smoother.uncalibrated(paths))
    assert_allclose(learnt.noises, found, rtol=0.15)


def test_the_error_of_the_path_itself_adds_to_the_noise_and_boxes_that_err_alike_too() -> None:
    scene = known(np.tile([[0.3, 0.2, 0.85], [-0.6, 0.5, 0.85]], (100, 1, 1)), sigma=0.4)
    wide = replace(scene, seen=[replace(o, sigmas=0.0 * o.sigmas + 4.0) for o in scene.seen])
    smoother = wide.smoother()
    paths, links = scene.paths(sigma=1e-4)
    plain = smoother.learn(paths, links, smoother.uncalibrated(paths)).noises
    loose, _ = scene.paths(sigma=0.01)
    found = smoother.learn(loose, links, smoother.uncalibrated(paths)).noises
    assert (found > plain).all()
    # every box of a person as the one before: wrong for as long as they are
    first = [np.repeat(o.boxes[:2][None], 100, axis=0).reshape(-1, 4) for o in scene.seen]
    alike = replace(wide, seen=[replace(o, boxes=b) for o, b in zip(wide.seen, first, strict=True)])
    same = alike.smoother()
    assert (same.learn(paths, links, same.uncalibrated(paths)).noises > 1.5 * plain).all()


def test_with_the_noise_of_the_recording_a_box_is_as_exact_as_it_is_small() -> None:
    noise = NoiseModel(np.array([0.02, 0.03, 0.04]), 2.0, np.array([0.05, 0.03, 0.01]), 1.0, 1.0)
    values = np.array([[9.0, 100.0, 160.0], [9.0, 100.0, 101.0]])
    learnt = replace(Calibration.none(1, 3, 3), noise=noise)
    found = learnt.measured(1, Measurements(values, np.ones((2, 3, 3))))
    assert found.values is values
    shares = noise.white**2 + noise.persistent**2
    for own, half in zip(found.noises, (30.0, 1.0), strict=True):  # a pixel at least
        assert_allclose(own, np.diag(half**2 * shares + 4.0))
