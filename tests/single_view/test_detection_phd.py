"""A GM-PHD filter on a detector's boxes, and which boxes contradict the room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.engine.standing import CAMERAS, HALF_EXTENTS, ROOM, empty_room, line, watch
from tracker import single_view
from tracker.fusion.target_model import TargetModel
from tracker.parameters import RunParameters
from tracker.sequences.sequence import Detections, Room, Sequence, View
from tracker.single_view.detection_phd import DetectionPhd
from tracker.single_view.detector_boxes import meets, standing_between
from tracker.single_view.none import DetectionBoxes
from tracker.single_view.protocol import ViewResult

STEPS = 60


def recorded(
    paths: list[ndarray], *, clutter_rate: float = 0.0, clutter_score: float = 1.0, seed: int = 0
) -> Sequence:
    """What the first camera's detector wrote of people; false boxes have their own score."""
    places = np.stack(paths, axis=1) if paths else np.full((STEPS, 1, 3), np.nan)
    frames, boxes, scores = [], [], []
    for rate, score, number in ((0.0, 1.0, seed), (clutter_rate, clutter_score, seed + 1)):
        people = places if rate == 0.0 else np.full_like(places, np.nan)
        for step, views in enumerate(watch(people, clutter_rate=rate, seed=number)):
            for x, y, half_width, half_height in views[0].boxes:
                frames.append(step)
                boxes.append([x - half_width, y - half_height, 2 * half_width, 2 * half_height])
                scores.append(score)
    order = np.argsort(frames, kind="stable")
    detections = Detections(
        np.array(frames, dtype=np.int64)[order],
        np.array(boxes).reshape(-1, 4)[order],
        np.array(scores)[order],
    )
    whole = empty_room(10.0, CAMERAS[:1], STEPS)
    return replace(whole, views=(View(CAMERAS[0], detections=detections),))


def filtered(whole: Sequence, **changes: object) -> list[ViewResult]:
    """Every step of the filter."""
    method = DetectionPhd(whole, 0, RunParameters(detection_phd=changes))
    state, results = method.start(), []
    for frame in range(whole.frames):
        state, result = method.step(state, frame, None, np.random.default_rng(0))
        results.append(result)
    return results


WALK = line([(-1.0, -1.0), (0.5, 1.0)], [0, STEPS / 10], 10.0)
STAND = line([(1.0, -1.2), (1.0, -1.2)], [0, STEPS / 10], 10.0)


def test_people_are_followed_in_the_picture() -> None:
    results = filtered(recorded([WALK, STAND]))
    model = TargetModel(HALF_EXTENTS, "box")
    labels: list[set[int]] = [set(), set()]
    for step in range(5, STEPS):
        expected = model.expected(CAMERAS[0], np.stack([WALK[step], STAND[step]])).boxes
        centres = (expected[:, :2] + expected[:, 2:]) / 2.0
        result = results[step]
        distances = np.linalg.norm(result.estimates[None, :, :2] - centres[:, None], axis=2)
        assert (distances.min(axis=1) < 20.0).mean() >= 0.5
        for person, row in enumerate(distances):
            if row.min() < 20.0:
                labels[person].add(int(result.estimate_labels[row.argmin()]))
    assert [len(names) for names in labels] == [1, 1]
    assert labels[0] != labels[1]


def test_what_is_believed_goes_on_and_clutter_does_not() -> None:
    whole = recorded([WALK], clutter_rate=2.0, seed=3)
    results = filtered(whole)
    measured = sum(len(result.measurements) for result in results)
    handed_on = sum(len(result.boxes) for result in results)
    assert measured > 1.5 * STEPS
    assert 0.9 * STEPS < handed_on < 1.2 * STEPS
    for result in results[5:]:
        assert len(result.boxes) == len(result.weights) == len(result.labels) == len(result.sigmas)
        assert (result.weights > 0.5).all()


def test_a_low_score_makes_clutter_likelier() -> None:
    # a box that stays where it is, with a poor score: a coat on a hook
    whole = recorded([STAND])
    view = whole.views[0]
    assert view.detections is not None
    poor = replace(view.detections, scores=np.full(len(view.detections.scores), 0.05))
    dubious = replace(whole, views=(replace(view, detections=poor),))
    first = [
        next(i for i, r in enumerate(filtered(s, score_clutter=5.0)) if len(r.estimates))
        for s in (whole, dubious)
    ]
    assert first[1] >= first[0]
    weights = [filtered(s, score_clutter=5.0)[first[0]].estimate_weights for s in (whole, dubious)]
    assert weights[0].sum() > weights[1].sum()
    assert not any(len(r.measurements) for r in filtered(dubious, score_threshold=0.1))


def test_estimates_go_on_where_asked() -> None:
    for result in filtered(recorded([WALK]), output="estimates")[5:]:
        assert_array_equal(result.boxes, result.estimates)
        assert_array_equal(result.labels, result.estimate_labels)
        assert (result.sigmas > 0.0).all()


def test_nobody_and_no_boxes() -> None:
    for result in filtered(recorded([])):
        assert result.boxes.shape == result.estimates.shape == result.measurements.shape == (0, 4)


def test_the_method_is_made_by_name() -> None:
    made = single_view.create(
        "detection_phd",
        recorded([WALK]),
        0,
        RunParameters(),
        None,  # type: ignore[arg-type]
    )
    assert isinstance(made, DetectionPhd)
    with pytest.raises(ValueError, match="has no detections; name a CSV file"):
        DetectionPhd(empty_room(10.0), 0, RunParameters())


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.integers(0, 3))
def test_a_box_tells_where_its_target_stands(x: float, y: float, camera: int) -> None:
    place = np.array([[x, y, 0.85]])
    corners = TargetModel(HALF_EXTENTS, "box").expected(CAMERAS[camera], place).boxes
    boxes = np.concatenate([corners[:, :2] + corners[:, 2:], corners[:, 2:] - corners[:, :2]], 1)
    near, far = standing_between(CAMERAS[camera], boxes / 2.0, HALF_EXTENTS[2], np.zeros(1))
    assert_allclose(near, far)
    assert_allclose(near, place, atol=0.12)
    near, far = standing_between(CAMERAS[camera], boxes / 2.0, HALF_EXTENTS[2], np.full(1, 0.2))
    lens = CAMERAS[camera].centre
    assert np.linalg.norm(near - lens) < np.linalg.norm(place - lens) < np.linalg.norm(far - lens)


@pytest.mark.full
@given(st.integers(0, 10_000), st.floats(0.0, 1.0))
def test_a_way_meets_the_room_where_some_point_of_it_does(seed: int, margin: float) -> None:
    rng = np.random.default_rng(seed)
    room = Room(np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 2.0]))
    starts, ends = rng.uniform(-4, 4, (2, 20, 3))
    ends[:5, 0] = starts[:5, 0]  # along a pair of walls
    ends[5] = starts[5]
    points = starts + np.linspace(0, 1, 2001)[:, None, None] * (ends - starts)
    inside = room.contains(points.reshape(-1, 3), margin).reshape(2001, 20).any(axis=0)
    wider = room.contains(points.reshape(-1, 3), margin + 0.01).reshape(2001, 20).any(axis=0)
    found = meets(room, starts, ends, margin)
    assert (found | ~inside).all()
    assert (wider | ~found).all()


def test_a_box_that_contradicts_the_room_is_shown_and_not_used() -> None:
    corners = TargetModel(HALF_EXTENTS, "box").expected(CAMERAS[0], WALK[:1]).boxes[0]
    good = np.array([corners[0], corners[1], *(corners[2:] - corners[:2])])
    giant = np.array([400.0, 20.0, 300.0, 760.0])  # as near as the lens allows
    dwarf = np.array([640.0, 300.0, 4.0, 10.0])  # far beyond the room
    detections = Detections(np.zeros(3, dtype=np.int64), np.stack([good, giant, dwarf]), np.ones(3))
    whole = replace(
        empty_room(10.0, CAMERAS[:1], 1), views=(View(CAMERAS[0], detections=detections),)
    )
    parameters = RunParameters(detection_boxes={"room_tolerance": 0.3})
    _, result = DetectionBoxes(whole, 0, parameters).step(None, 0, None, np.random.default_rng(0))
    assert len(result.boxes) == 1
    assert len(result.measurements) == 3
    assert result.information["boxes outside the room"] == 2.0
    wide = RunParameters(detection_boxes={"room_tolerance": 100.0})
    _, everything = DetectionBoxes(whole, 0, wide).step(None, 0, None, np.random.default_rng(0))
    assert len(everything.boxes) == 3
    assert ROOM.contains(WALK[:1]).all()
