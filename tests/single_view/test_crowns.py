"""Targets hang from the tops of a mask's pieces, with the size that the camera says."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy import ndarray

from tests import world
from tests.world import SMALL_CAMERAS as CAMERAS
from tests.world import SMALL_ROOM as ROOM
from tracker.parameters.groups.jpda import JpdaParams
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.jpda.crowns import TargetSizes, crowns

NUMBERS = JpdaParams()

HALF = np.array([0.17, 0.17, 0.36])
"""Head and torso."""
CAMERA = CAMERAS[0]


@pytest.fixture(scope="module")
def sizes() -> TargetSizes:
    return TargetSizes(CAMERA, ROOM, HALF, NUMBERS.height_sigmas)


def standing(*places: tuple[float, float], height: float = 1.0) -> tuple[ndarray, ndarray]:
    """The mask of people on the floor, all of them, and the boxes of their heads and torsos."""
    positions = np.array([(x, y, height) for x, y in places])
    boxes, seen = upright_boxes(CAMERA, positions, HALF)
    assert seen.all()
    mask = np.zeros(CAMERA.image_size[::-1], dtype=np.uint8)
    for x, y, half_x, half_y in boxes:
        neck = y - 0.5 * half_y
        cv2.ellipse(mask, (round(x), round(y - 0.62 * half_y)),
                    (round(0.5 * half_x), round(0.38 * half_y)), 0, 0, 360, 1, -1)  # fmt: skip
        cv2.rectangle(mask, (round(x - 0.9 * half_x), round(neck)),
                      (round(x + 0.9 * half_x), round(y + 2.4 * half_y)), 1, -1)  # fmt: skip
    return mask, boxes


def compare(found: ndarray, boxes: ndarray) -> None:
    """Every person once, nobody else."""
    assert len(found) == len(boxes)
    for box in boxes:
        apart = np.abs((found[:, :2] - box[:2]) / box[2:]).max(axis=1)
        nearest = found[apart.argmin()]
        assert apart.min() < 0.35
        np.testing.assert_allclose(nearest[2:] / box[2:], 1.0, atol=0.25)


def test_one_person_is_found_from_the_crown_down(sizes: TargetSizes) -> None:
    for place in ((0.0, 0.0), (-0.8, 0.6), (0.9, -0.4)):
        mask, boxes = standing(place)
        found = crowns(mask, sizes, 40, NUMBERS)
        compare(found.boxes, boxes)
        assert found.inside[0] > 0.6
        assert found.pieces[0, 3] > 1.5 * found.boxes[0, 3], "the piece shows the legs too"


def test_two_in_one_piece_are_two(sizes: TargetSizes) -> None:
    mask, boxes = standing((-0.1, 0.1), (0.12, -0.12))
    assert cv2.connectedComponents(mask)[0] == 2, "one piece, and the background"
    compare(crowns(mask, sizes, 40, NUMBERS).boxes, boxes)


def test_a_crack_across_a_person_makes_nobody_new(sizes: TargetSizes) -> None:
    mask, boxes = standing((0.0, 0.0))
    row = round(boxes[0, 1] - 0.45 * boxes[0, 3])
    mask[row : row + 3] = 0
    compare(crowns(mask, sizes, 40, NUMBERS).boxes, boxes)


def test_what_is_higher_than_people_come_in_is_nobody() -> None:
    walked = TargetSizes(CAMERA, ROOM, HALF, NUMBERS.height_sigmas)
    anything = TargetSizes(CAMERA, Room(ROOM.minimum, ROOM.maximum), HALF, NUMBERS.height_sigmas)
    mask, _ = standing((1.3, 1.3), height=1.85)  # the entrances are at 1 m, give or take 0.15
    assert len(crowns(mask, anything, 40, NUMBERS).boxes) == 1
    assert len(crowns(mask, walked, 40, NUMBERS).boxes) == 0


@pytest.mark.parametrize("filled", [False, True])
def test_an_empty_mask_and_a_full_one_show_nobody(sizes: TargetSizes, filled: bool) -> None:
    mask = np.full(CAMERA.image_size[::-1], filled, dtype=np.uint8)
    found = crowns(mask, sizes, 40, NUMBERS)
    assert found.boxes.shape == (0, 4)
    assert found.pieces.shape == (0, 4)


def body(width: float) -> tuple[ndarray, ndarray]:
    """The mask of a standing person whose parts are ``width`` times as wide, and the whole box."""
    whole = np.array([0.3, 0.3, 0.85])
    boxes, seen = upright_boxes(CAMERA, np.array([[0.0, 0.0, 0.85]]), whole)
    assert seen.all()
    (x, y, half_x, half_y), mask = boxes[0], np.zeros(CAMERA.image_size[::-1], dtype=np.uint8)
    pixels = half_x / 0.3  # per metre
    for top, bottom, across in ((0.0, 0.13, 0.17), (0.13, 0.47, 0.32), (0.47, 1.0, 0.18)):
        rows = [round(y + (2.0 * share - 1.0) * half_y) for share in (top, bottom)]
        half = max(0.5, width * across * pixels / 2.0)
        cv2.rectangle(mask, (round(x - half), rows[0]), (round(x + half), rows[1]), 1, -1)
    return mask, boxes


@pytest.mark.parametrize("entrances", [True, False])
def test_a_whole_body_need_not_fill_its_box_but_its_outline(entrances: bool) -> None:
    doors = world.volume(1.5, 2.0, [(0.0, 1.4, 0.85)], (0.25, 0.25, 0.05)).entrances
    room = Room(ROOM.minimum, ROOM.maximum, doors if entrances else ())
    sizes = TargetSizes(CAMERA, room, np.array([0.3, 0.3, 0.85]), NUMBERS.height_sigmas)
    mask, boxes = body(1.0)
    found = crowns(mask, sizes, 40, NUMBERS)
    compare(found.boxes, boxes)
    assert found.inside[0] > 0.7
    slim, _ = body(0.75)  # seen from the side
    assert len(crowns(slim, sizes, 40, NUMBERS).boxes) == 1
    pole, _ = body(0.2)
    assert len(crowns(pole, sizes, 10, NUMBERS).boxes) == 0
