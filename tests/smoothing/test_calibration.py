"""What a recording says of its own boxes: sizes, offsets, noises, and shifts of marked boxes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests import world
from tests.smoothing.known import CAMERAS, PLAIN, Known, given, known
from tests.smoothing.test_smoother import one_walker
from tests.world import PERSON as HALF_EXTENTS
from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.kernels.kalman import Measurements
from tracker.parameters.values import with_values
from tracker.sequences.sequence import Sequence, Template
from tracker.smoothing import create
from tracker.smoothing.calibration import (
    FEWEST,
    NARROWEST,
    OFFSET_RIDGE,
    RIDGE,
    SIZE_RIDGE,
    WIDEST,
    Calibration,
    Marks,
    free,
    lower,
    shifts,
    upright,
)
from tracker.smoothing.noise import NoiseModel
from tracker.smoothing.paths import Paths
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
    seen = seen._replace(expected=seen.expected._replace(jacobians=derivatives))
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


def test_a_box_that_the_picture_cuts_is_no_witness() -> None:
    """The second stands close below the first camera, which sees a part of the box."""
    scene = known(np.tile([[0.3, 0.2, 0.85], [3.0, 0.4, 0.85]], (12, 1, 1)))
    offset = np.array([0.0, 0.02, 0.03])
    smoother = planted(scene, [offset, offset])
    paths, links = scene.paths(sigma=0.01)
    assert np.count_nonzero(links.cameras == 0) == 24
    found = smoother.learn(paths, links, smoother.uncalibrated(paths))
    assert_allclose(found.offsets[0], offset * 12.0 / (12.0 + OFFSET_RIDGE), atol=1e-9)


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


LOW = 0.2
"""Half heights by which the boxes of every camera lie too low."""

LEARNING = with_values(PLAIN, {"smoothing.learning": True, "smoothing_method": "positions"})


def path_of(whole: Sequence, below: float = 0.0) -> Paths:
    """The true path of the only person, some metres lower."""
    truth = whole.ground_truth
    assert truth is not None
    states = np.hstack([truth.positions - [0.0, 0.0, below], np.zeros_like(truth.positions)])
    return Paths.of([1], [0], [states], [np.tile(1e-4 * np.eye(6), (len(states), 1, 1))], 6)


def cylinder(camera: Camera, place: ndarray) -> ndarray:
    """Left, top, width and height of a round target's bounds, from a fine outline of it."""
    angles = np.linspace(0.0, 2.0 * np.pi, 720)
    ring = HALF_EXTENTS[0] * np.column_stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    up = np.array([0.0, 0.0, HALF_EXTENTS[2]])
    pixels, _ = camera.project(np.concatenate([place + ring - up, place + ring + up]))
    return np.concatenate([pixels.min(axis=0), np.ptp(pixels, axis=0)])


def marked(whole: Sequence, steps: list[int]) -> Sequence:
    """With a box around the person in every camera at some steps, where the person truly is."""
    truth = whole.ground_truth
    assert truth is not None
    templates = tuple(
        Template("one", camera.name, step, cylinder(camera, truth.positions[step]))
        for step in steps
        for camera in CAMERAS
    )
    return replace(whole, templates=templates, digest=f"{whole.digest}-{steps}")


def lowered(scene: Known) -> Known:
    """With every box of the detector lower by its share of its height."""
    seen = []
    for one in scene.seen:
        boxes = one.boxes.copy()
        boxes[:, 1] += LOW * boxes[:, 3]
        seen.append(replace(one, boxes=boxes))
    return replace(scene, seen=seen)


def heights_off(scene: Known, marks: list[int]) -> float:
    """Mean of how far above the truth the smoothed person is, metres."""
    whole = marked(scene.whole, marks) if marks else scene.whole
    fused = scene.fused(np.full((len(scene.places), 1), 3))
    found = create(whole, LEARNING).smooth(scene.views, fused)
    assert found is not None
    assert len(found.frames) == len(scene.places)
    return float((found.means[:, 2] - scene.places[:, 0, 2]).mean())


def test_marked_boxes_take_away_what_all_cameras_err_alike() -> None:
    low = lowered(one_walker())
    plain = heights_off(low, [])
    assert plain < -0.5 * LOW * HALF_EXTENTS[2]
    told = heights_off(low, [6, 12])  # six boxes against a prior of one
    assert abs(told) < 0.35 * abs(plain)


def test_where_the_boxes_lie_right_marked_ones_change_little() -> None:
    scene = one_walker()
    assert abs(heights_off(scene, [6, 12]) - heights_off(scene, [])) < 0.01


@pytest.mark.parametrize("below", [-0.02, 0.03])
def test_a_shift_is_what_the_marked_boxes_say_drawn_to_nothing(below: float) -> None:
    whole = marked(one_walker().whole, [10])
    found = shifts(Marks.of(whole), CAMERAS, HALF_EXTENTS, path_of(whole, below))
    marks = len(CAMERAS)
    share = below / HALF_EXTENTS[2] * marks / (marks + RIDGE)
    assert_allclose(found, [share], rtol=0.03)


def test_a_marked_box_elsewhere_or_of_somebody_lying_tells_nothing() -> None:
    whole = marked(one_walker().whole, [10])
    path = path_of(whole, 0.03)
    boxes = Marks.of(whole).boxes
    for change in ([2.1, 0.0, 1.0, 1.0], [0.0, 0.8, 1.0, 1.0], [0.0, 0.0, 2.0, 0.4]):
        aside = boxes * [1.0, 1.0, *change[2:]]
        aside[:, :2] += change[:2] * boxes[:, 2:]
        other = replace(Marks.of(whole), boxes=aside)
        assert not shifts(other, CAMERAS, HALF_EXTENTS, path).any()
    late = replace(Marks.of(whole), steps=np.full(len(boxes), 10_000))
    assert not shifts(late, CAMERAS, HALF_EXTENTS, path).any()
    assert shifts(Marks.of(whole), CAMERAS, HALF_EXTENTS, path).all()


@pytest.mark.parametrize(("turn", "tells"), [(20.0, True), (90.0, False)])
def test_a_camera_on_its_side_tells_nothing_of_heights(turn: float, tells: bool) -> None:
    whole = one_walker().whole
    path, place = path_of(whole, 0.03), path_of(whole).states[10, :3]
    upright, angle = CAMERAS[0], np.deg2rad(turn)
    roll = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    rolled = replace(
        upright, rotation=roll @ upright.rotation, translation=roll @ upright.translation
    )
    box = Boxes.from_left_top(cylinder(rolled, place)[None]).centred
    marks = Marks(np.array([10]), np.array([0]), box)
    assert shifts(marks, [rolled], HALF_EXTENTS, path).any() == tells


def test_the_nearest_of_two_people_is_the_one_who_was_marked() -> None:
    whole = marked(one_walker().whole, [10])
    own, higher = path_of(whole, 0.03), path_of(whole, -0.045)
    both = Paths.of(
        [1, 2], [0, 0], [higher.states, own.states], [own.covariances, own.covariances], 6
    )
    found = shifts(Marks.of(whole), CAMERAS, HALF_EXTENTS, both)
    assert found[0] == 0.0
    assert found[1] > 0.0


def test_the_calibration_lowers_top_and_bottom_and_keeps_the_height() -> None:
    scene = one_walker()
    smoother = scene.smoother()
    path, _ = scene.paths()
    target = smoother.model.target
    learnt = replace(Calibration.none(1, len(CAMERAS), target.size), shifts=np.array([LOW]))
    seen = target.expected(CAMERAS[0], path.states[:1], path.covariances[:1])
    shift = learnt.shift(0, np.zeros(1, dtype=int), seen)
    half = (seen.boxes[0, 3] - seen.boxes[0, 1]) / 2.0
    assert_allclose(shift, [[0.0, LOW * half, LOW * half]])
    for size in (3, 4):
        assert lower(size) @ upright(size) == 0.0


def test_what_is_known_of_the_shift_is_not_learnt_again_as_an_offset() -> None:
    scene = one_walker()
    smoother, path = scene.smoother(), path_of(scene.whole)
    _, links = scene.paths()
    nothing = smoother.uncalibrated(path)
    known = replace(nothing, shifts=np.array([LOW]))
    for c, camera in enumerate(smoother.cameras):
        own = links.take(links.cameras == c)
        seen = smoother.model.target.expected(CAMERAS[c], path.states[own.rows])
        values = seen.values + known.shift(c, np.zeros(len(own.rows), dtype=int), seen)
        smoother.cameras[c] = given(camera, own.boxes, values)
    assert smoother.learn(path, links, nothing).offsets[:, 1:].min() > 0.01
    assert_allclose(smoother.learn(path, links, known).offsets, 0.0, atol=1e-12)


def test_marks_are_the_templates_of_cameras_that_are_there() -> None:
    whole = marked(one_walker().whole, [3])
    strange = Template("one", "elsewhere", 3, np.array([1.0, 2.0, 3.0, 4.0]))
    marks = Marks.of(replace(whole, templates=(*whole.templates, strange)))
    assert marks.cameras.tolist() == [0, 1, 2]
    assert_allclose(Boxes(marks.boxes).left_top, [one.box for one in whole.templates])
    assert Marks.of(one_walker().whole).boxes.shape == (0, 4)
