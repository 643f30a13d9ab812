"""Cameras that are rolled: boxes lie along the picture's sides, people do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.mistakes import MISTAKES
from tests.random_rooms import random_room
from tracker.geometry.camera import Camera
from tracker.geometry.consistency.standing import ends, sides, turn_of
from tracker.io.checks import check
from tracker.io.checks.boxes import judge_boxes
from tracker.sequences.sequence import Detections, Sequence, View


def _ellipsoid(half: ndarray) -> ndarray:
    """Points on the surface of an upright person."""
    across, up = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(-np.pi / 2, np.pi / 2, 13))
    ball = np.stack([np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), np.sin(up)], axis=-1)
    return np.asarray(ball.reshape(-1, 3) * half)


def _boxes(camera: Camera, middles: ndarray, half: ndarray) -> tuple[ndarray, ndarray]:
    """Left, top, width, height of what is seen of people, and who is in front of the lens."""
    points = (middles[:, None] + _ellipsoid(half)).reshape(-1, 3)
    pixels, valid = camera.project(points)
    pixels = pixels.reshape(len(middles), -1, 2)
    there = valid.reshape(len(middles), -1).all(axis=1)
    low, high = pixels.min(axis=1), pixels.max(axis=1)
    size = np.array(camera.image_size)
    there &= (low > 0.0).all(axis=1) & (high < size - 1.0).all(axis=1)
    return np.concatenate([low, high - low], axis=1), there


def rolled_room(seed: int, degrees: float) -> Sequence:
    """A random room whose cameras are rolled, with the boxes of people as ellipsoids."""
    room = random_room(seed, cameras=3, people=4, steps=150)
    rng = np.random.default_rng(seed)
    truth = room.ground_truth
    assert truth is not None
    roll = np.radians(degrees)
    turn = np.array(
        [[np.cos(roll), np.sin(roll), 0], [-np.sin(roll), np.cos(roll), 0], [0, 0, 1.0]]
    )
    half = np.array([0.25, 0.25, 0.85])
    views = []
    for view in room.views:
        own = view.camera
        camera = replace(own, rotation=turn @ own.rotation, translation=turn @ own.translation)
        boxes, there = _boxes(camera, truth.positions, half)
        there &= rng.random(len(there)) > 0.08
        boxes = boxes[there]
        boxes += 0.02 * boxes[:, 3:] * rng.standard_normal(boxes.shape)
        detections = Detections(truth.frames[there], boxes, np.ones(len(boxes)))
        views.append(View(camera, detections=detections))
    return replace(room, views=tuple(views))


@pytest.mark.full
@pytest.mark.parametrize("degrees", [0.0, 90.0, -90.0, 180.0, 25.0])
@pytest.mark.parametrize("seed", [11, 12])
def test_rolled_cameras_raise_no_alarm(seed: int, degrees: float) -> None:
    room = rolled_room(seed, degrees)
    assert [str(each) for each in check(room) if each.status == "warning"] == []
    told = judge_boxes(room)
    assert told is not None
    assert told.given.consensus.height == pytest.approx(1.7, rel=0.03)


@pytest.mark.full
@pytest.mark.parametrize("degrees", [90.0, 180.0, 25.0])
@pytest.mark.parametrize("name", [name for name in MISTAKES if name != "counted from 1"])
def test_mistakes_are_named_in_rolled_cameras(name: str, degrees: float) -> None:
    make, remedy = MISTAKES[name]
    found = check(make(rolled_room(11, degrees)))
    assert [str(r) for each in found if each.status == "warning" for r in each.remedies] == [remedy]


@pytest.mark.parametrize("height", [0.3, 1.5, 3.0])
@pytest.mark.parametrize("roll", [0.0, 30.0, 90.0])
def test_ends_of_an_ellipsoid_are_found_in_its_box(height: float, roll: float) -> None:
    """From below, level and above, to a thirtieth of its length; the box's sides are not that."""
    angle = np.radians(roll)
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0],
                     [0, 0, 1.0]])  # fmt: skip
    centre, target = np.array([0.0, -4.0, height]), np.array([0.0, 0.0, 0.9])
    ahead = (target - centre) / np.linalg.norm(target - centre)
    level = np.stack([[1.0, 0, 0], np.cross(ahead, [1.0, 0, 0]), ahead])
    rotation = turn @ level
    k = np.array([[700.0, 0, 640], [0, 700.0, 480], [0, 0, 1]])
    camera = Camera("cam", (1280, 960), k, rotation, -rotation @ centre, np.zeros(5))
    half = np.array([0.25, 0.25, 0.85])
    for place in ([0.0, 0.0, 0.85], [0.9, 0.5, 0.85], [-0.8, 1.0, 0.85]):
        middle = np.array(place)
        boxes, _ = _boxes(camera, middle[None], half)
        heads, feet, told = ends(boxes, camera, rotation[:, 2])
        assert told.all()
        for ray, z in ((heads[0], 0.85), (feet[0], -0.85)):
            true = rotation @ (middle + np.array([0, 0, z]) - centre)
            away = np.linalg.norm(true)
            off = away * np.linalg.norm(ray - true / away)
            assert off < 1.7 / 30.0


def test_sides_and_turns_count_alike() -> None:
    box = np.array([[10.0, 20.0, 30.0, 60.0]])
    for up, head in (
        ((0, -1), (25, 20)),
        ((1, 0), (40, 50)),
        ((0, 1), (25, 80)),
        ((-1, 0), (10, 50)),
    ):
        heads, feet = sides(box, turn_of(np.array([*up, 0.1])))
        np.testing.assert_allclose(heads[0], head)
        np.testing.assert_allclose((heads + feet)[0] / 2.0, [25, 50])


def test_a_camera_that_looks_straight_down_is_not_rolled() -> None:
    assert turn_of(np.array([0.0, 0.0, -1.0])) == 0
