"""The shifts of boxes that marked boxes show: a shift in all cameras is no height of a person."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests.smoothing.known import CAMERAS, PLAIN, Known, given
from tests.smoothing.test_smoother_properties import one_walker
from tests.world import PERSON as HALF_EXTENTS
from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.parameters.values import with_values
from tracker.sequences.sequence import Sequence, Template
from tracker.smoothing import create
from tracker.smoothing.calibration import RIDGE, Calibration, Marks, lower, shifts, upright
from tracker.smoothing.paths import Paths

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
