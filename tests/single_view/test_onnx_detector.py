"""A detection network: every layout of outputs, the way into its picture and back, bad files."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray
from onnx import TensorProto, helper

from tests import world
from tests.single_view.networks import answering, pooling, sized
from tests.single_view.test_scenes import truth
from tests.world import surveillance as look_at
from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.gaps import gaps
from tracker.runs.run import stage_keys
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import with_detector
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence
from tracker.single_view.onnx import layouts
from tracker.single_view.onnx.file import Port, ports_of
from tracker.single_view.onnx.layouts import proposals
from tracker.single_view.onnx.network import Network, Settings, _own

SIZE = (64, 64)
"""Of the networks' pictures: 64 + 16 + 4 cells in YOLO's three grids."""
CELLS = 84

PERSON, OTHER = (32.0, 30.0, 20.0, 40.0), (12.0, 50.0, 8.0, 10.0)
"""Centre and size in the network's picture, of who is to be found and of something else."""
CORNERS = (22.0, 10.0, 42.0, 50.0)


def yolo_8(people: float = 0.9, logits: bool = False) -> ndarray:
    """(1, 4 + 3, N): a person twice, and something of class 2."""
    table = np.zeros((1, 7, CELLS), np.float32)
    if logits:
        table[:, 4:] = -9.0
    table[0, :, 3] = *PERSON, people, 0.1, 0.0
    table[0, :, 4] = 32.5, 30.0, 20.0, 40.0, people - 0.2, 0.1, 0.0
    table[0, :, 9] = *OTHER, 0.1, 0.0, 0.95
    return table


def yolo_5() -> ndarray:
    """(1, 3 N, 5 + 2) with objectness: what is surely an object need be no person."""
    table = np.zeros((1, 3 * CELLS, 7), np.float32)
    table[0, 3] = *PERSON, 0.95, 0.9, 0.1
    table[0, 9] = *OTHER, 1.0, 0.05, 0.95
    table[0, 20] = *OTHER, 0.1, 0.99, 0.0
    return table


def end_to_end() -> ndarray:
    """(1, K, 6): corners, score, class; and rows of zeros."""
    table = np.zeros((1, 30, 6), np.float32)
    table[0, 0] = *CORNERS, 0.9, 0.0
    table[0, 1] = 8.0, 45.0, 16.0, 55.0, 0.95, 7.0
    return table


def yolo_7_end_to_end() -> ndarray:
    """(K, 7): picture, corners, class, score."""
    table = np.zeros((2, 7), np.float32)
    table[0] = 0.0, *CORNERS, 0.0, 0.9
    table[1] = 0.0, 8.0, 45.0, 16.0, 55.0, 3.0, 0.95
    return table


def shares(box: tuple[float, ...]) -> list[float]:
    return [value / 64.0 for value in box]


def rt_detr() -> ndarray:
    """(1, N, 4 + C), boxes as shares of the picture."""
    table = np.zeros((1, 30, 50), np.float32)
    table[0, 2, :4], table[0, 2, 4] = shares(PERSON), 0.9
    table[0, 5, :4], table[0, 5, 20] = shares(OTHER), 0.95
    return table


def detr(count: int, person: int, nothing: int | None) -> dict[str, ndarray]:
    """Logits and boxes; with or without a class for nothing."""
    logits = np.full((1, 25, count), -8.0, np.float32)
    boxes = np.full((1, 25, 4), 0.5, np.float32)
    if nothing is not None:
        logits[..., nothing] = 8.0
        logits[0, 2, nothing] = -8.0
    logits[0, 2, person], boxes[0, 2] = 4.0, shares(PERSON)
    return {"logits": logits, "pred_boxes": boxes}


def named() -> dict[str, ndarray]:
    """Labels, boxes in pixels and scores."""
    boxes = np.zeros((1, 6, 4), np.float32)
    boxes[0, 0], boxes[0, 1] = CORNERS, (8.0, 45.0, 16.0, 55.0)
    labels = np.array([[0, 5, 3, 3, 3, 3]], np.float32)
    return {"labels": labels, "boxes": boxes, "scores": np.array([[0.9, 0.95, 0, 0, 0, 0]])}


def tensorflow() -> dict[str, ndarray]:
    """Of TensorFlow's object detection API: rows first, classes from 1."""
    boxes = np.zeros((1, 6, 4), np.float32)
    boxes[0, 0] = shares((10.0, 22.0, 50.0, 42.0))
    return {
        "detection_boxes": boxes,
        "detection_classes": np.array([[1, 2, 2, 2, 2, 2]], np.float32),
        "detection_scores": np.array([[0.9, 0.0, 0, 0, 0, 0]], np.float32),
    }


def ssd() -> ndarray:
    """(1, 1, N, 7): picture, class from 1, score, corners as shares."""
    table = np.zeros((1, 1, 4, 7), np.float32)
    table[0, 0, 0] = 0.0, 1.0, 0.9, *shares(CORNERS)
    table[0, 0, 1] = 0.0, 15.0, 0.95, 0.1, 0.1, 0.2, 0.2
    table[0, 0, 2, 0] = -1.0
    return table


def ssd_by_class() -> dict[str, ndarray]:
    """Boxes and scores of more than a thousand places; the first class is nothing."""
    boxes = np.full((1, 1200, 4), 0.01, np.float32)
    scores = np.zeros((1, 1200, 3), np.float32)
    scores[0, :, 0] = 1.0
    boxes[0, 7], scores[0, 7] = shares(CORNERS), (0.05, 0.9, 0.05)
    return {"boxes": boxes, "scores": scores}


def centre_net() -> dict[str, ndarray]:
    """A peak of the first of three classes, and its lower neighbour."""
    heat, wh = np.zeros((1, 3, 16, 16), np.float32), np.zeros((1, 2, 16, 16), np.float32)
    offset = np.zeros((1, 2, 16, 16), np.float32)
    heat[0, 0, 7, 8], heat[0, 0, 7, 9], heat[0, 2, 2, 2] = 0.9, 0.8, 0.95
    wh[0, :, 7, 8] = 5.0, 10.0
    offset[0, :, 7, 8] = 0.0, 0.5
    return {"hm": heat, "wh": wh, "reg": offset}


def nano_det() -> dict[str, ndarray]:
    """A person in the cell at row 3, column 4 of stride 8; where another class is likelier, none.

    A distance of 1.75 strides lies between bins 1 and 2, with three quarters of the latter.
    """
    outputs = {}
    for stride, cells in ((8, 64), (16, 16), (32, 4)):
        outputs[f"cls_pred_stride_{stride}"] = np.zeros((1, cells, 3), np.float32)
        outputs[f"dis_pred_stride_{stride}"] = np.full((1, cells, 16), -30.0, np.float32)
    outputs["cls_pred_stride_16"][0, 5] = 0.8, 0.81, 0.0
    cell = 3 * 8 + 4
    outputs["cls_pred_stride_8"][0, cell] = 0.9, 0.1, 0.2
    for side, (corner, centre) in enumerate(zip(CORNERS, (36.0, 28.0) * 2, strict=True)):
        distance = abs(corner - centre) / 8.0
        lower = int(distance)
        upper = outputs["dis_pred_stride_8"][0, cell, 4 * side + lower : 4 * side + lower + 2]
        with np.errstate(divide="ignore"):
            upper[:] = np.log([lower + 1.0 - distance, distance - lower]).clip(-30.0)
    return outputs


LAYOUTS: dict[str, Mapping[str, ndarray]] = {
    "YOLOv8": {"output0": yolo_8()},
    "YOLOv8 with masks": {"output0": yolo_8(), "output1": np.zeros((1, 32, 16, 16))},
    "YOLOv5": {"output0": yolo_5()},
    "end to end": {"output0": end_to_end()},
    "YOLOv7 end to end": {"output": yolo_7_end_to_end()},
    "RT-DETR, one table": {"output0": rt_detr()},
    "RT-DETR, logits": detr(80, 0, None),
    "DETR": detr(92, 1, 91),
    "labels": named(),
    "TensorFlow": tensorflow(),
    "SSD": {"detection_out": ssd()},
    "SSD by class": ssd_by_class(),
    "CenterNet": centre_net(),
    "NanoDet": nano_det(),
}


def test_lists_of_any_length_and_without_names() -> None:
    nobody = {"labels": np.zeros(0), "boxes": np.zeros((0, 4)), "scores": np.zeros(0)}
    assert len(proposals(nobody, SIZE).scores) == 0
    # where people are all that is seen, their class is 0 in every row
    two = np.array([CORNERS, (8.0, 45.0, 16.0, 55.0)])
    people = {"12": two, "14": np.zeros(2), "13": np.array([0.9, 0.4])}
    np.testing.assert_allclose(proposals(people, SIZE).scores, [0.9, 0.4])


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_person_is_found_in_every_layout(name: str) -> None:
    found = proposals(LAYOUTS[name], SIZE)
    best = int(np.argmax(found.scores))
    assert 0.8 < found.scores[best] < 1.0
    np.testing.assert_allclose(found.corners[best], CORNERS, atol=1e-4)
    assert (found.scores > 0.35).sum() == (2 if name.startswith("YOLOv8") else 1)


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_passes_through_opencv(name: str, tmp_path: Path) -> None:
    network = Network(answering(tmp_path / "model.onnx", LAYOUTS[name]), Settings())
    assert network.size_for(640, 480) == SIZE
    found = network.detect(np.zeros((64, 64, 3), np.uint8))
    assert len(found.boxes) == 1
    np.testing.assert_allclose(found.boxes[0], [21.5, 9.5, 20.0, 40.0], atol=0.02)


@pytest.mark.parametrize("size", [(64, 64), (96, 32), (32, 128)])
def test_nano_det_against_plain_loops(size: tuple[int, int]) -> None:
    """Every cell where the class is the best: its box by the expected distances, [LWW20]."""
    rng = np.random.default_rng(7)
    outputs, expected = {}, []
    for stride in (8, 16, 32):
        across, down = size[0] // stride, size[1] // stride
        classes = rng.uniform(size=(1, across * down, 4)).astype(np.float32)
        sides = rng.normal(0.0, 2.0, (1, across * down, 4 * 7)).astype(np.float32)
        outputs[f"dis_pred_stride_{stride}"] = sides
        outputs[f"cls_pred_stride_{stride}"] = classes
        for row in range(down):
            for column in range(across):
                cell = row * across + column
                if int(classes[0, cell].argmax()) != 2:
                    continue
                distances = []
                for side in range(4):
                    weights = [float(np.exp(v)) for v in sides[0, cell, 7 * side : 7 * side + 7]]
                    mean = sum(n * w for n, w in enumerate(weights)) / sum(weights)
                    distances.append(stride * mean)
                x, y = (column + 0.5) * stride, (row + 0.5) * stride
                left, top, right, bottom = distances
                corners = [x - left, y - top, x + right, y + bottom]
                expected.append([*corners, classes[0, cell, 2]])
    found = proposals(outputs, size, 2)
    rows = np.array(expected).reshape(-1, 5)
    assert len(rows) > 3
    np.testing.assert_allclose(found.corners, rows[:, :4], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(found.scores, rows[:, 4])
    assert not found.suppressed


def test_boxes_without_scores_are_of_no_layout() -> None:
    boxes = np.zeros((1, 300, 4), np.float32)
    assert layouts._boxes_and_scores({"boxes": boxes}, SIZE, 0) is None


def test_nano_det_has_no_stride_of_0() -> None:
    outputs = nano_det()
    expected = proposals(outputs, SIZE)
    outputs["cls_pred_stride_0"] = np.zeros((1, 4, 3), np.float32)
    outputs["dis_pred_stride_0"] = np.zeros((1, 4, 16), np.float32)
    np.testing.assert_array_equal(proposals(outputs, SIZE).corners, expected.corners)


def test_nano_det_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="stride 8 have 64 and 64 rows; expected 96, one for each"):
        proposals(nano_det(), (96, 64))


def test_another_class_is_asked_for() -> None:
    found = proposals({"output0": yolo_8()}, SIZE, 2)
    assert found.scores.max() == pytest.approx(0.95)
    with pytest.raises(ValueError, match="tells 3 classes apart, and class 80 is asked for"):
        proposals({"output0": yolo_8()}, SIZE, 80)
    with pytest.raises(ValueError, match="tells 3 classes apart, and class 3 is asked for"):
        proposals({"output0": yolo_8()}, SIZE, 3)


def test_scores_may_be_logits() -> None:
    found = proposals({"output0": yolo_8(2.0, logits=True)}, SIZE)
    assert found.scores.max() == pytest.approx(1.0 / (1.0 + np.exp(-2.0)), rel=1e-5)


def test_an_unknown_layout_is_named_with_its_shapes() -> None:
    with pytest.raises(ValueError, match=r"its outputs features \(1, 512\) are of no known layout"):
        proposals({"features": np.zeros((1, 512))}, SIZE)


# ── which layout it is, by its sizes


def table_of(rows: int, columns: int, seed: int = 1) -> ndarray:
    """Numbers between 0 and 1, boxes of 10 pixels and more."""
    table = np.random.default_rng(seed).uniform(0.0, 1.0, (1, rows, columns)).astype(np.float32)
    return table


@pytest.mark.parametrize(("rows", "columns"), [(1000, 8), (300, 84), (1, 9)])
def test_queries_of_one_table_are_people_by_themselves(rows: int, columns: int) -> None:
    table = table_of(rows, columns)
    found = proposals({"out": table}, (320, 320))
    assert found.suppressed
    np.testing.assert_allclose(found.scores, table[0, :, 4])
    half = table[0, :, 2:4] / 2.0
    corners = np.concatenate([table[0, :, :2] - half, table[0, :, :2] + half], axis=1)
    np.testing.assert_allclose(found.corners, 320.0 * corners, rtol=1e-4, atol=1e-3)


def test_a_table_of_another_grid_is_told_by_which_side_is_longer() -> None:
    table = table_of(1001, 1002)
    found = proposals({"out": table}, (320, 320))
    assert not found.suppressed
    np.testing.assert_allclose(found.scores, table[0, 4])
    for rows, columns in ((1002, 1001), (1001, 8), (2000, 2000)):
        with pytest.raises(ValueError, match="of no known layout"):
            proposals({"out": table_of(rows, columns)}, (320, 320))
    # the grid of YOLO with 80 classes and objectness, and with one class
    grid = 40 * 40 + 20 * 20 + 10 * 10
    of_one = table_of(5, grid)
    np.testing.assert_allclose(proposals({"out": of_one}, (320, 320)).scores, of_one[0, 4])
    with_objects = table_of(grid, 6)
    found = proposals({"out": with_objects}, (320, 320))
    np.testing.assert_allclose(found.scores, with_objects[0, :, 4] * with_objects[0, :, 5])
    assert not found.suppressed
    (three,) = (proposals({"out": table_of(3 * grid, 85)}, (320, 320)),)
    assert len(three.scores) == 3 * grid


@pytest.mark.parametrize(
    ("names", "labels", "scores"),
    [
        (("bboxes", "labels", "scores"), [1.0, 2.0], [0.9, 0.4]),  # classes from 1
        (("boxes", "class_ids", "confidence"), [0.0, 2.0], [0.9, 0.4]),
        (("1", "2", "3"), [0.0, 2.0], [0.9, 0.4]),  # the whole numbers, of which one is above 1
        (("1", "3", "2"), [0.0, 2.0], [1.0, 0.0]),
        (("1", "2", "3"), [0.0, 7.0], [1.0, 1.0]),
        # either may be of whole numbers up to 1
        (("boxes", "labels", "3"), [0.0, 1.0], [1.0, 1.0]),
        (("boxes", "classes", "3"), [0.0, 1.0], [1.0, 1.0]),
    ],
)
@pytest.mark.parametrize("first", ["labels", "scores"])
def test_lists_are_known_by_their_names_or_their_numbers(
    names: tuple[str, str, str], labels: list[float], scores: list[float], first: str
) -> None:
    lists = {names[1]: np.array(labels), names[2]: np.array(scores)}
    if first == "scores":
        lists = dict(reversed(lists.items()))
    boxes = np.array([CORNERS, (8.0, 45.0, 16.0, 55.0)])
    found = proposals({**lists, names[0]: boxes}, SIZE)
    np.testing.assert_allclose(found.scores, scores[:1])
    np.testing.assert_allclose(found.corners, [CORNERS], rtol=1e-6)
    assert found.suppressed


@pytest.mark.parametrize(
    "lists",
    [
        {"2": [0.0, 1.0], "3": [1.0, 1.0]},  # which are the labels?
        {"class_scores": [0.3, 1.0], "areas": [5.2, 1.5]},
    ],
)
def test_lists_that_may_be_either_are_of_no_layout(lists: dict[str, list[float]]) -> None:
    boxes = np.array([CORNERS, (8.0, 45.0, 16.0, 55.0)])
    with pytest.raises(ValueError, match="of no known layout"):
        proposals({"boxes": boxes, **{name: np.array(own) for name, own in lists.items()}}, SIZE)


@pytest.mark.parametrize(
    ("low", "high", "logits"), [(0.0, 1.0, False), (-1e-3, 1.0, True), (0.0, 1.001, True)]
)
def test_scores_below_0_or_above_1_are_logits(low: float, high: float, logits: bool) -> None:
    table = table_of(300, 84)
    table[0, :2, 4] = low, high
    expected = 1.0 / (1.0 + np.exp(-table[0, :, 4])) if logits else table[0, :, 4]
    found = proposals({"out": table}, (320, 320))
    np.testing.assert_allclose(found.scores, expected, rtol=1e-5)


def test_only_the_first_pictures_rows_of_a_list_count() -> None:
    alone = np.array([[*CORNERS, 0.8, 0.0]])  # one row, and no picture
    np.testing.assert_allclose(proposals({"out": alone}, SIZE).scores, [0.8])
    table = yolo_7_end_to_end()
    table[1] = 1.0, *CORNERS, 0.0, 0.8
    np.testing.assert_allclose(proposals({"out": table}, SIZE).scores, [0.9])
    several = ssd()
    several[0, 0, 3] = -1.0, 1.0, 0.7, *shares(CORNERS)
    np.testing.assert_allclose(proposals({"out": several}, SIZE).scores, [0.9])


@pytest.mark.parametrize(
    ("rows", "count", "person", "suppressed"),
    [
        (1000, 80, 0, True), (1000, 91, 1, True), (1000, 90, 0, True), (1000, 92, 1, True),
        (1001, 80, 1, False), (1001, 1, 0, False), (1001, 2, 1, False),
    ],
)  # fmt: skip
def test_boxes_beside_scores_are_queries_or_places(
    rows: int, count: int, person: int, suppressed: bool
) -> None:
    scores, boxes = table_of(rows, count), table_of(rows, 4, 2)
    found = proposals({"a": scores, "b": boxes}, SIZE)
    assert found.suppressed is suppressed
    expected = scores[0]
    if count == 92:  # the last one is nothing
        powers = np.exp(expected)
        expected = (powers / powers.sum(axis=1, keepdims=True))[:, :-1]
    np.testing.assert_allclose(found.scores, expected[:, person], rtol=1e-5)
    corners = boxes[0]
    if suppressed:
        half = corners[:, 2:] / 2.0
        corners = np.concatenate([corners[:, :2] - half, corners[:, :2] + half], axis=1)
    np.testing.assert_allclose(found.corners, 64.0 * corners, rtol=1e-4, atol=1e-3)


@pytest.mark.parametrize(("largest", "factor"), [(1.5, 64.0), (1.6, 1.0)])
def test_what_is_hardly_larger_than_one_is_a_share_of_the_picture(
    largest: float, factor: float
) -> None:
    table = end_to_end()
    table[0, :, :4] = 0.0
    table[0, 0, :4] = 0.1, 0.2, largest, 0.9
    found = proposals({"out": table}, (64, 64)).corners[0]
    np.testing.assert_allclose(found, factor * table[0, 0, :4], rtol=1e-6)


def test_peaks_of_a_map_are_the_highest_of_nine_and_two_hundred_at_most() -> None:
    rng = np.random.default_rng(3)
    heat, extent, offset = rng.random((1, 2, 60, 80)), *rng.random((2, 1, 2, 60, 80))
    found = proposals({"hm": heat, "wh": extent, "off": offset}, (320, 240), 1)
    peaks = [
        (heat[0, 1, y, x], y, x)
        for y, x in np.ndindex(60, 80)
        if heat[0, 1, y, x] >= heat[0, 1, max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].max()
    ]
    peaks = sorted(peaks, reverse=True)
    assert len(peaks) > 200
    assert len(found.scores) == 200
    for (score, y, x), own, corners in zip(peaks, found.scores, found.corners, strict=False):
        assert own == pytest.approx(score, rel=1e-5)
        centre = np.array([x, y]) + offset[0, :, y, x]
        half = extent[0, :, y, x] / 2.0
        expected = 4.0 * np.concatenate([centre - half, centre + half])
        np.testing.assert_allclose(corners, expected, rtol=1e-3, atol=1e-3)
    assert found.suppressed
    for name in ("off", "reg"):
        same = proposals({"hm": heat, name: offset, "wh": extent}, (320, 240), 1)
        np.testing.assert_array_equal(same.corners, found.corners)
    with pytest.raises(ValueError, match="of no known layout"):
        proposals({"hm": heat[..., 1:], "wh": extent, "off": offset}, (320, 240))


# ── into the network's picture and back ──────────────────────────────────────


@pytest.mark.parametrize("picture", [(128, 64), (64, 128), (32, 48), (200, 200)])
def test_boxes_come_back_from_the_letterbox(picture: tuple[int, int], tmp_path: Path) -> None:
    """A box of the network's picture lies at the same place of the scaled one in its middle."""
    network = Network(answering(tmp_path / "model.onnx", {"output0": end_to_end()}), Settings())
    height, width = picture
    found = network.detect(np.zeros((height, width, 3), np.uint8))
    scale = min(64 / width, 64 / height)
    inner = round(width * scale), round(height * scale)
    shift = np.array([(64 - inner[0]) // 2, (64 - inner[1]) // 2] * 2)
    corners = (np.array(CORNERS) - shift) / np.tile([inner[0] / width, inner[1] / height], 2) - 0.5
    corners = np.clip(corners, -0.5, np.array([width, height] * 2) - 0.5)
    np.testing.assert_allclose(found.boxes[0, :2], corners[:2], atol=1e-4)
    np.testing.assert_allclose(found.boxes[0, 2:], corners[2:] - corners[:2], atol=1e-4)


def test_it_sees_what_is_in_the_picture(tmp_path: Path) -> None:
    """A network that finds red: colours are not exchanged, and places agree."""
    network = Network(pooling(tmp_path / "model.onnx"), Settings())
    picture = np.zeros((64, 32, 3), np.uint8)
    picture[16:24, 8:16, 2] = 255  # red, at half the size rows 8 to 11, columns 4 to 7
    found = network.detect(picture)
    assert found.scores[0] == pytest.approx(1.0, abs=0.02)
    (left, top, width, height) = found.boxes[0]
    assert (left + width / 2.0, top + height / 2.0) == pytest.approx((11.5, 19.5), abs=0.1)
    assert (width, height) == pytest.approx((24.0, 40.0), abs=0.1)
    picture[..., 0], picture[..., 2] = picture[..., 2].copy(), 0
    assert len(network.detect(picture).boxes) == 0


def test_sizes_that_are_left_open_and_channels_last(tmp_path: Path) -> None:
    path = tmp_path / "model.onnx"
    answering(path, {"output0": yolo_8()}, open_sizes=True)
    assert Network(path, Settings(side=96)).size_for(50, 50) == (96, 96)
    answering(path, {"output0": yolo_8()}, channels_last=True)
    network = Network(path, Settings())
    assert network.size_for(640, 480) == SIZE
    assert len(network.detect(np.zeros((64, 64, 3), np.uint8)).boxes) == 1


@pytest.mark.parametrize(
    ("picture", "side", "expected"),
    [
        ((1920, 1080), 416, (416, 256)),  # 234 rows, rounded up to whole cells
        ((1088, 1920), 416, (256, 416)),
        ((800, 600), 640, (640, 480)),
        ((1000, 10), 416, (416, 32)),
        ((100, 100), 0, (640, 640)),
    ],
)
def test_open_sizes_are_in_the_pictures_proportions(
    picture: tuple[int, int], side: int, expected: tuple[int, int], tmp_path: Path
) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": end_to_end()}, open_sizes=True)
    network = Network(path, Settings(side=side))
    assert network.size_for(*picture) == expected
    # a box of the network's picture, in the picture that is scaled into its middle
    found = network.detect(np.zeros((picture[1], picture[0], 3), np.uint8))
    scale = min(expected[0] / picture[0], expected[1] / picture[1])
    inner = np.maximum(1, np.round(np.array(picture) * scale))
    shift = (np.array(expected) - inner) // 2
    corners = (np.array(CORNERS).reshape(2, 2) - shift) / (inner / picture) - 0.5
    corners = np.clip(corners, -0.5, np.array(picture) - 0.5)
    np.testing.assert_allclose(found.boxes[0, :2], corners[0], atol=1e-3)
    np.testing.assert_allclose(found.boxes[0, 2:], corners[1] - corners[0], atol=1e-3)


@pytest.mark.parametrize("kind", [TensorProto.INT64, TensorProto.FLOAT])
def test_a_network_that_asks_for_the_size_is_told_it(kind: int, tmp_path: Path) -> None:
    found = Network(sized(tmp_path / "m.onnx", kind), Settings()).detect(
        np.zeros((32, 32, 3), np.uint8)
    )
    np.testing.assert_allclose(found.boxes, [[7.5, 7.5, 16.0, 16.0]], atol=1e-4)


@pytest.mark.parametrize(
    ("values", "mean"),
    [
        ("file", 0.4),
        ("unit", 0.4),
        ("bytes", 102.0),
        ("signed", -0.2),
        ("imagenet", -0.2159),
        ("imagenet_bgr", -0.2159),
    ],
)
def test_what_a_pictures_bytes_become(values: str, mean: float, tmp_path: Path) -> None:
    """The score of the answer is the mean of what the network is given."""
    table = end_to_end()
    table[0, 0, 4] = 1.0
    network = Network(
        answering(tmp_path / "m.onnx", {"out": table}, score_is={"out": (0, 0, 4)}),
        Settings(values=values, score=0.0),  # type: ignore[arg-type]
    )
    outputs = network._forward(network._fed(np.full((64, 64, 3), 102, np.uint8)), SIZE)
    assert outputs["out"][0, 0, 4] == pytest.approx(1.0 + mean, abs=2e-3)


def test_blue_comes_first_where_the_network_wants_it(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"output0": end_to_end()})
    blue = np.zeros((64, 64, 3), np.uint8)
    blue[..., 0] = 255
    fed = Network(path, Settings(values="imagenet_bgr"))._fed(blue)[0].mean(axis=(1, 2))
    # NanoDet's own means and deviations, in bytes: blue, green, red
    means, deviations = np.array([103.53, 116.28, 123.675]), np.array([57.375, 57.12, 58.395])
    np.testing.assert_allclose(fed, ([255.0, 0.0, 0.0] - means) / deviations, rtol=1e-4)


def test_score_and_overlap(tmp_path: Path) -> None:
    path = answering(tmp_path / "model.onnx", {"output0": yolo_8()})
    dark = np.zeros((64, 64, 3), np.uint8)
    assert len(Network(path, Settings(score=0.95)).detect(dark).boxes) == 0
    assert (
        len(Network(path, Settings()).with_settings(Settings(score=0.95)).detect(dark).boxes) == 0
    )
    both = Network(path, Settings(overlap=0.98)).detect(dark)
    np.testing.assert_allclose(both.scores, [0.9, 0.7], atol=1e-5)


def test_boxes_are_sorted_by_score_within_the_picture_and_of_half_a_pixel_at_least(
    tmp_path: Path,
) -> None:
    table = np.zeros((1, 30, 6), np.float32)
    rows = [
        (-20.0, 10.0, 30.0, 50.0, 0.5, 0.0), (40.0, 10.0, 90.0, 50.0, 1.2, 0.0),
        (10.0, 10.0, 10.4, 50.0, 0.9, 0.0), (10.0, 10.0, 10.6, 50.0, 0.35, 0.0),
        (10.0, 10.0, 10.6, 50.0, 0.34, 0.0), (np.nan, 10.0, 20.0, 50.0, 0.9, 0.0),
        (10.0, 40.0, 30.0, 40.4, 0.9, 0.0), (70.0, 10.0, 90.0, 50.0, 0.9, 0.0),
        (8.0, 9.0, 10.0, 70.0, 0.6, 0.0),
    ]  # fmt: skip
    table[0, : len(rows)] = rows
    table[0, 20:, :4] = 64.0  # in pixels
    path = answering(tmp_path / "m.onnx", {"out": table})
    found = Network(path, Settings()).detect(np.zeros((64, 64, 3), np.uint8))
    np.testing.assert_allclose(found.scores, [1.0, 0.6, 0.5, 0.35])
    np.testing.assert_allclose(
        found.boxes,
        [[39.5, 9.5, 24.0, 40.0], [7.5, 8.5, 2.0, 55.0], [-0.5, 9.5, 30.0, 40.0],
         [9.5, 9.5, 0.6, 40.0]],
        atol=1e-5,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("side", "values", "expected"),
    [("2048", "bytes", (2048, "bytes")), ("2049", "signed", (640, "signed")),
     ("0", "nothing", (640, "unit")), ("1", "", (1, "unit")), ("4.5", "unit", (640, "unit"))],
)  # fmt: skip
def test_what_a_file_says_of_its_pictures_counts_if_it_can_be(
    side: str, values: str, expected: tuple[int, str]
) -> None:
    assert _own({"input_side": side, "pixel_values": values}) == expected
    assert _own({}) == (640, "unit")


# ── files that are no such networks ──────────────────────────────────────────


def test_a_network_without_a_known_answer_is_told_when_it_is_run(tmp_path: Path) -> None:
    path = answering(tmp_path / "classes.onnx", {"probabilities": np.zeros((1, 1000))})
    with pytest.raises(ValueError, match=r"classes\.onnx cannot be used: its outputs probab"):
        Network(path, Settings()).detect(np.zeros((64, 64, 3), np.uint8))


def port(*shape: int) -> Port:
    return Port("images", TensorProto.FLOAT, shape)


def test_a_network_takes_one_picture_of_three_channels(tmp_path: Path) -> None:
    network = Network(answering(tmp_path / "m.onnx", {"a": yolo_8()}), Settings())
    for shape in ((1, 3, 64, 64), (0, 3, 0, 0), (1, 64, 64, 3), (1, 3, 3, 3)):
        assert network._picture_port((port(1, 2), port(*shape))) == port(*shape)
    with pytest.raises(ValueError, match="takes 2 pictures at a time"):
        network._picture_port((port(2, 3, 64, 64),))
    for shape in ((1, 4, 64, 64), (3, 64, 64), (1, 64, 3, 64)):
        with pytest.raises(ValueError, match=r"takes no picture: expected an input"):
            network._picture_port((port(*shape),))


@pytest.mark.parametrize(
    ("shape", "side", "expected"),
    [((1, 3, 96, 0), 128, (128, 96)), ((1, 3, 0, 96), 0, (96, 640)),
     ((1, 0, 96, 3), 128, (96, 128)), ((1, 3, 64, 32), 128, (32, 64))],
)  # fmt: skip
def test_a_side_that_is_left_open_is_as_long_as_is_asked(
    shape: tuple[int, ...], side: int, expected: tuple[int, int], tmp_path: Path
) -> None:
    network = Network(answering(tmp_path / "m.onnx", {"a": yolo_8()}), Settings(side=side))
    network._picture = port(*shape)
    assert network.size_for(1000, 700) == expected


def test_a_file_is_read_up_to_its_largest_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = answering(tmp_path / "m.onnx", {"a": yolo_8()})
    size = path.stat().st_size
    monkeypatch.setattr("tracker.sequences.detectors.MOST_BYTES", size)
    assert Network(path, Settings()).size_for(9, 9) == SIZE
    monkeypatch.setattr("tracker.sequences.detectors.MOST_BYTES", size - 1)
    with pytest.raises(ValueError, match=r"cannot be read \(it has 0 MB, expected at most 2,048"):
        Network(path, Settings())


def test_inputs_and_outputs_are_read_from_the_file(tmp_path: Path) -> None:
    path = answering(tmp_path / "m.onnx", {"a": np.zeros((1, 6, 84))}, open_sizes=True)
    ports = ports_of(path.read_bytes())
    assert [(p.name, p.shape) for p in ports.inputs] == [("images", (1, 3, 0, 0))]
    assert [(p.name, p.shape) for p in ports.outputs] == [("a", (1, 6, 84))]
    # a size of -1, of ten bytes, is as open as one with a name
    port = helper.make_tensor_value_info("b", TensorProto.FLOAT, [-1, 84])
    model = helper.make_model(helper.make_graph([], "open", [port], [port]))
    assert ports_of(model.SerializeToString()).outputs[0].shape == (0, 84)
    for inputs, outputs in (([port], []), ([], [port])):
        model = helper.make_model(helper.make_graph([], "half", inputs, outputs))
        with pytest.raises(ValueError, match="without inputs or outputs"):
            ports_of(model.SerializeToString())


# ── as a method ──────────────────────────────────────────────────────────────

STEPS = 6
RED = (60.0, 70.0, 200.0)


def red_head(folder: Path, camera: Camera, model: Path) -> Sequence:
    """Somebody in red who walks; and the network that finds red."""
    paths = world.together(np.linspace([-0.5, 0.0, 1.2], [0.5, 0.0, 1.2], STEPS))
    whole = world.sequence(
        (camera,), paths, fps=25.0, room=world.SMALL_ROOM, half_extents=world.HEAD
    )
    picture = world.painted((camera,), paths, [(RED, RED)], half_extents=world.HEAD)
    return with_detector(read_sequence(world.folder(folder, whole, picture)), model)


def parameters(**more: float) -> RunParameters:
    values = {f"onnx_detector.{name}": value for name, value in more.items()}
    anywhere = {"detection_boxes.room_tolerance": 100.0}
    return with_values(RunParameters(), {"single_view": "onnx_detector", **anywhere, **values})


def test_what_it_finds_is_tracked_in_full_pixels(tmp_path: Path) -> None:
    model = pooling(tmp_path / "model.onnx", 256)
    sequence = red_head(tmp_path / "level", look_at("level", (0.0, -4.0, 1.2)), model)
    run = pipeline.compute(sequence, parameters(score_threshold=0.25))
    for step, (view,) in enumerate(run.views):
        (box,) = truth(sequence, step)
        distances = np.linalg.norm(view.measurements[:, :2] - box[:2], axis=1)
        assert distances.min() < 0.6 * box[3]


def test_a_rolled_camera_is_looked_at_upright(tmp_path: Path) -> None:
    """The same room through a camera on its side: the same boxes, turned.

    The network's boxes are higher than wide; in the rolled picture they must be wider.
    """
    model = pooling(tmp_path / "model.onnx", 256)
    level = look_at("cam", (0.0, -4.0, 1.2), distortion=np.zeros(5))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    width, height = level.image_size
    fx, fy = level.intrinsics[0, 0], level.intrinsics[1, 1]
    cx, cy = level.intrinsics[0, 2], level.intrinsics[1, 2]
    rolled = replace(
        level,
        image_size=(height, width),
        intrinsics=np.array([[fy, 0.0, height - 1.0 - cy], [0.0, fx, cx], [0.0, 0.0, 1.0]]),
        rotation=quarter @ level.rotation,
        translation=quarter @ level.translation,
    )
    plain = red_head(tmp_path / "plain", level, model)
    turned = tmp_path / "turned"
    turned.mkdir()
    for path in plain.views[0].images:
        picture = cv2.imread(str(path))
        cv2.imwrite(str(turned / path.name), cv2.rotate(picture, cv2.ROTATE_90_CLOCKWISE))
    images = tuple(turned / path.name for path in plain.views[0].images)
    view = replace(plain.views[0], camera=rolled, images=images)
    on_its_side = replace(plain, views=(view,), digest="rolled")
    values = parameters(score_threshold=0.25)
    upright, sideways = (pipeline.compute(s, values).views for s in (plain, on_its_side))
    assert sum(len(step[0].measurements) for step in upright) >= STEPS
    for (a,), (b,) in zip(upright, sideways, strict=True):
        expected = np.column_stack(
            [
                height - 1.0 - a.measurements[:, 1],
                a.measurements[:, 0],
                a.measurements[:, 3],
                a.measurements[:, 2],
            ]
        )
        # a cell of the heat map is 6 pixels, and its peaks are where the noise is
        apart = np.abs(expected[:, None, :2] - b.measurements[None, :, :2]).max(axis=2)
        assert apart.min(axis=0).max() < 13.0
        assert (b.measurements[:, 2] > b.measurements[:, 3]).all()


def test_every_second_picture_is_seen(tmp_path: Path) -> None:
    """Steps between are without a frame, which is no missing picture; the others are as before."""
    model = pooling(tmp_path / "model.onnx", 256)
    sequence = red_head(tmp_path / "level", look_at("level", (0.0, -4.0, 1.2)), model)
    values = parameters(score_threshold=0.25)
    whole = pipeline.compute(sequence, values)
    half = pipeline.compute(sequence, with_values(values, {"onnx_detector.every": 2}))
    for step, ((a,), (b,)) in enumerate(zip(whole.views, half.views, strict=True)):
        assert b.blind == bool(step % 2)
        if not b.blind:
            assert len(b.boxes)
            np.testing.assert_array_equal(a.boxes, b.boxes)
        else:
            assert not len(b.boxes)
    assert gaps(half) == []
    keys = [stage_keys(sequence, p, 0)["single_view"] for p in (values, half.parameters)]
    assert keys[0] != keys[1]


def test_it_sees_the_full_picture(tmp_path: Path) -> None:
    """However the other methods' pictures are reduced, its boxes are the same."""
    model = pooling(tmp_path / "model.onnx", 256)
    sequence = red_head(tmp_path / "level", look_at("level", (0.0, -4.0, 1.2)), model)
    values = parameters(score_threshold=0.25)
    reduced = with_values(values, {"pictures.lines": 120})
    for one, other in zip(
        pipeline.compute(sequence, values).views,
        pipeline.compute(sequence, reduced).views,
        strict=True,
    ):
        np.testing.assert_array_equal(one[0].measurements, other[0].measurements)
    assert stage_keys(sequence, values, 0) == stage_keys(sequence, reduced, 0)


def test_what_is_kept_depends_on_the_models_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, same, other = (tmp_path / f"{name}.onnx" for name in ("one", "same", "other"))
    answering(one, {"output0": yolo_8()})
    answering(same, {"output0": yolo_8()})
    answering(other, {"output0": yolo_8(0.8)})
    sequence = red_head(tmp_path / "pictures", look_at("cam", (0.0, -4.0, 1.2)), one)
    keys = [
        stage_keys(with_detector(sequence, path), parameters(), 0)["single_view"]
        for path in (one, same, other)
    ]
    assert keys[0] == keys[1] != keys[2]
    colours = RunParameters(single_view="colour_phd")
    assert stage_keys(sequence, colours, 0) == stage_keys(
        with_detector(sequence, other), colours, 0
    )
    with pytest.raises(SequenceError, match=r"nowhere\.onnx cannot be read"):
        with_detector(sequence, tmp_path / "nowhere.onnx")
    # a file that cannot be a network is not read to its end for that
    monkeypatch.setattr("tracker.sequences.detectors.MOST_BYTES", one.stat().st_size - 1)
    with pytest.raises(SequenceError, match=r"one\.onnx cannot be read \(it has 0 MB"):
        with_detector(sequence, one)


@pytest.mark.full
def test_the_command_writes_boxes_that_a_sequence_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from app.command import main as cli
    from tests.rooms import render

    render("room24-2p", tmp_path / "room", frames=3)
    model = answering(tmp_path / "model.onnx", {"output0": end_to_end()})
    out = tmp_path / "boxes"
    command = ["detect", str(tmp_path / "room"), "--model", str(model), "-o", str(out)]
    assert cli.main(command) == 0
    assert "cam1 3" in capsys.readouterr().err
    with (out / "cam2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["frame"]) for row in rows] == [0, 1, 2]
    boxes = np.array([[float(row[k]) for k in ("left", "top", "width", "height")] for row in rows])
    # 360 x 288 as the network's 64 x 64: the picture is 51 lines high there, 6 from the top
    np.testing.assert_allclose(
        Boxes.from_left_top(boxes).centred[0, :2], [180.0 - 0.5, 24.0 * 360 / 64 - 0.5], atol=4.0
    )
    model.write_bytes(b"no network")
    assert cli.main(command) == 1
    told = capsys.readouterr().err
    assert "model.onnx cannot be used: it is not an ONNX model; name a network" in told
