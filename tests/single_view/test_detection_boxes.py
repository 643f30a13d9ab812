"""An outside detector's boxes pass as they are, with the trust that the parameters state."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine import synthetic
from tests.engine.painted import corner_box
from tracker import single_view
from tracker.camera import Camera
from tracker.parameters import DetectionBoxParams, RunParameters
from tracker.sequences.sequence import Detections, Sequence, View
from tracker.single_view.box_sizes import BoxSizes, entrance_boxes, upright_boxes
from tracker.single_view.none import DetectionBoxes

BOXES = np.array([[10.0, 20.0, 30.0, 60.0], [100.0, 50.0, 8.0, 16.0], [5.0, 5.0, 4.0, 4.0]])


def sequence_of(detections: Detections | None) -> Sequence:
    base = synthetic.sequence([], 3)
    return Sequence(
        name="boxes",
        folder=base.folder,
        fps=25.0,
        frames=3,
        room=base.room,
        target_half_extents=base.target_half_extents,
        views=(View(base.cameras[0], detections=detections),),
    )


def test_boxes_scores_and_sigmas() -> None:
    detections = Detections(np.array([0, 0, 2]), BOXES, np.array([0.9, 0.3, 1.0]))
    trust = DetectionBoxParams(
        score_threshold=0.3,
        room_tolerance=100.0,
        centre_sigma=0.2,
        size_sigma=0.1,
        width_sigma=0.2,
        pixel_sigma=0.0,
    )
    method = DetectionBoxes(sequence_of(detections), 0, RunParameters(detection_boxes=trust))
    rng = np.random.default_rng(0)
    results = [method.step(method.start(), frame, None, rng)[1] for frame in range(3)]
    assert [len(result.boxes) for result in results] == [2, 0, 1]
    np.testing.assert_array_equal(results[0].boxes, [[25, 50, 15, 30], [104, 58, 4, 8]])
    np.testing.assert_array_equal([corner_box(box) for box in results[0].boxes], BOXES[:2])
    np.testing.assert_array_equal(results[0].weights, [0.9, 0.3])
    np.testing.assert_allclose(results[0].sigmas[0], [6.0, 6.0, 3.0, 3.0])
    floor = RunParameters(detection_boxes=trust.model_copy(update={"pixel_sigma": 8.0}))
    noisy = DetectionBoxes(sequence_of(detections), 0, floor).step(None, 0, None, rng)[1]
    np.testing.assert_allclose(noisy.sigmas[0], np.hypot([6.0, 6.0, 3.0, 3.0], 8.0))
    half = RunParameters(detection_boxes={"score_threshold": 0.5})
    strict = DetectionBoxes(sequence_of(detections), 0, half)
    assert len(strict.step(None, 0, None, rng)[1].boxes) == 1


def test_a_camera_without_detections_says_what_to_do() -> None:
    with pytest.raises(ValueError, match="has no detections; name a CSV file"):
        DetectionBoxes(sequence_of(None), 0, RunParameters())


def test_the_methods_are_made_by_name() -> None:
    from tracker.sequences.pictures.frames import FrameReader

    detections = Detections(np.array([0]), BOXES[:1], np.ones(1))
    sequence = sequence_of(detections)
    with FrameReader(sequence) as reader:
        method = single_view.create("none", sequence, 0, RunParameters(), reader)
    assert isinstance(method, DetectionBoxes)


def camera() -> Camera:
    return synthetic.CAMERAS[0]


def test_an_upright_box_spans_the_targets_height_and_width() -> None:
    plain = synthetic.look_at("plain", (0.0, -4.0, 1.0), distortion=np.zeros(5))
    boxes, visible = upright_boxes(plain, np.array([[0.0, 0.0, 1.0]]), np.array([0.2, 0.2, 0.5]))
    assert visible.all()
    focal_x, focal_y = plain.intrinsics[0, 0], plain.intrinsics[1, 1]
    np.testing.assert_allclose(boxes[0, 2:], [0.2 * focal_x / 4.0, 0.5 * focal_y / 4.0])
    np.testing.assert_allclose(boxes[0, :2], plain.intrinsics[:2, 2])


def test_sizes_are_those_of_targets_in_the_room() -> None:
    sizes = BoxSizes.of(camera(), synthetic.ROOM, synthetic.HALF_EXTENTS)
    rng = np.random.default_rng(0)
    positions = rng.uniform([-1.4, -1.4, 0.3], [1.4, 1.4, 1.9], (300, 3))
    boxes, visible = upright_boxes(camera(), positions, synthetic.HALF_EXTENTS)
    boxes = boxes[visible]
    assert sizes.contains(boxes[:, :2]).mean() > 0.98
    assert np.all(boxes[:, 2:] > 0.95 * sizes.smallest)
    assert np.all(boxes[:, 2:] < 1.05 * sizes.largest)
    drawn, possible = sizes.draw(boxes[:, :2], rng)
    # at one place of the picture the depth is open, but not by more than the room's depth
    assert np.all(drawn[possible] / boxes[possible, 2:] < 2.5)
    assert np.all(drawn[possible] / boxes[possible, 2:] > 0.4)
    nothing, none = sizes.draw(np.zeros((0, 2)), rng)
    assert nothing.shape == (0, 2)
    assert none.shape == (0,)


def test_entrances_become_boxes_where_they_are_seen() -> None:
    births = entrance_boxes(camera(), synthetic.ROOM, synthetic.HALF_EXTENTS, 0.1)
    assert births.size == 2
    expected, _ = upright_boxes(
        camera(), np.array([e.position for e in synthetic.ENTRANCES]), synthetic.HALF_EXTENTS
    )
    assert np.abs((births.means - expected)[:, :2] / expected[:, 2:]).max() < 1.0
    assert np.linalg.eigvalsh(births.covariances).min() > 0.0
    np.testing.assert_array_equal(births.weights, 0.1)
