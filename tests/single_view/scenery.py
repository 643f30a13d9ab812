"""Boxes of a detector, and pictures: foreground by hand, a room with furniture, a shaken camera."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy import ndarray

from tests import world
from tracker import single_view
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.parameters.values import with_values
from tracker.sequences.sequence import Sequence
from tracker.single_view.association_matrix.track_transfer import (
    Situation,
    advance,
    object_histograms,
)
from tracker.single_view.pictures.foreground import Blobs, blobs
from tracker.single_view.protocol import ViewEvent, ViewResult

CAMERA = world.ring(1)[0]

ANYWHERE = {"detection_boxes.room_tolerance": 100.0}
"""No box contradicts the room."""


def detected(
    steps: Many[Any], scores: Many[float] = (), *, camera: Camera = CAMERA, fps: float = 10.0
) -> Sequence:
    """One camera's boxes, centre and half sizes, step by step; their scores in the same order."""
    boxes = np.array([box for step in steps for box in step], dtype=float).reshape(-1, 4)
    frames = np.repeat(np.arange(len(steps)), [len(step) for step in steps])
    seen = world.Boxes(frames, boxes, np.ones_like(boxes), np.zeros_like(frames), len(steps))
    whole = world.sequence((camera,), np.full((len(steps), 0, 3), np.nan), [seen], fps=fps)
    if not len(scores):
        return whole
    found = replace(seen.detections(), scores=np.array(scores, dtype=float))
    return replace(whole, views=(replace(whole.views[0], detections=found),))


def run(name: str, whole: Sequence, **changes: Any) -> list[ViewResult]:
    """Every step of a method that looks at no pictures; changes of its own parameters, or of
    others by their whole keys."""
    values = {key if "." in key else f"{name}.{key}": value for key, value in changes.items()}
    if name == "jpda":
        values["jpda.measurements"] = "detections"
    parameters = with_values(RunParameters(), ANYWHERE | values)
    made = single_view.create(name, whole, 0, parameters, None)  # type: ignore[arg-type]
    state, results = made.start(), []
    for step in range(whole.frames):
        state, result = made.step(state, step, None, np.random.default_rng(step))
        results.append(result)
    return results


def normal(offset: ndarray, covariance: ndarray) -> float:
    """N(offset; 0, covariance)."""
    square = offset @ np.linalg.solve(covariance, offset)
    return float(np.exp(-0.5 * square) / np.sqrt(np.linalg.det(2.0 * np.pi * covariance)))


SKIN = (30.0, 60.0, 170.0)


def empty_room(height: int = 96, width: int = 128) -> ndarray:
    """Walls from dark to light with a few pieces of furniture."""
    rng = np.random.default_rng(0)
    ramp = np.linspace(40, 210, width)[None, :, None] * np.array([0.9, 1.0, 1.05])
    room = np.broadcast_to(ramp, (height, width, 3)).copy()
    for _ in range(12):
        x, y = rng.integers(0, width - 30), rng.integers(0, height - 30)
        room[y : y + 25, x : x + 20] = rng.uniform(20, 230, 3)
    return cv2.GaussianBlur(room, (0, 0), 1.0)


def photograph(room: ndarray, gain: float = 1.0, noise: float = 1.5, seed: int = 0) -> ndarray:
    """The room as a camera with noise and its own exposure shows it."""
    seen = room * gain + np.random.default_rng(seed).normal(0.0, noise, room.shape)
    return np.clip(np.rint(seen), 0, 255).astype(np.uint8)


def with_person(room: ndarray, x: int, y: int = 30) -> ndarray:
    """Somebody in front of it."""
    peopled = room.copy()
    cv2.ellipse(peopled, (x, y), (9, 14), 0, 0, 360, SKIN, -1)
    return peopled


def person_mask(x: int, y: int = 30) -> ndarray:
    """Where that person is, as truth values."""
    return with_person(np.zeros_like(empty_room()), x, y).any(axis=2)


def clip(gains: ndarray) -> list[ndarray]:
    """Somebody walks through the picture; no picture is empty."""
    room = empty_room()
    return [photograph(with_person(room, 10 + 4 * k), gain, seed=k) for k, gain in enumerate(gains)]


PIECE_SIZE = (80, 200)
COLOURS = 8

PUBLISHED = AssociationMatrixParams(
    overlap="boxes", output="objects", confirmation_steps=1, join_gap=0.0
)

Rectangle = tuple[int, int, int, int, int]
"""left, top, width, height, colour."""


def draw(rectangles: Many[Rectangle]) -> tuple[Blobs, ndarray]:
    """The pieces, and the bin of every pixel; later rectangles hide earlier ones."""
    mask, bins = np.zeros(PIECE_SIZE, np.uint8), np.zeros(PIECE_SIZE, np.uint16)
    for left, top, width, height, colour in rectangles:
        mask[top : top + height, left : left + width] = 1
        bins[top : top + height, left : left + width] = colour
    return blobs(mask, 1), bins


def person(
    left: int, colour: int, *, top: int = 20, width: int = 10, height: int = 30
) -> Rectangle:
    """Somebody."""
    return left, top, width, height, colour


def play(
    steps: Many[Many[Rectangle]],
    parameters: AssociationMatrixParams = PUBLISHED,
    situation: Situation | None = None,
) -> tuple[Situation, list[list[ViewEvent]]]:
    """Every step in turn: the last situation, and what happened at each step."""
    situation = situation or Situation.start()
    told = []
    for rectangles in steps:
        seen, bins = draw(rectangles)
        histograms = object_histograms(bins, seen.owners, seen.size, COLOURS)
        situation, events = advance(situation, seen, histograms, parameters)
        told.append(events)
    return situation, told


def labels_by_place(situation: Situation) -> list[tuple[int, ...]]:
    """Whom the objects show, from left to right."""
    return [one.labels for one in sorted(situation.objects, key=lambda one: one.box[0])]


SIZE = (320, 240)
MIDDLE = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])


def scene(rng: np.random.Generator) -> ndarray:
    """Furniture: rectangles of all greys, a little larger than a picture of it."""
    room = np.full((SIZE[1] + 60, SIZE[0] + 60, 3), 128, dtype=np.uint8)
    for _ in range(80):
        x, y = rng.integers(0, [SIZE[0], SIZE[1]]) + rng.integers(0, 60, 2)
        w, h = rng.integers(8, 70, 2)
        colour = rng.integers(30, 225, 3).tolist()
        cv2.rectangle(room, (int(x), int(y)), (int(x + w), int(y + h)), colour, -1)
    return np.asarray(cv2.GaussianBlur(room, (0, 0), 1.0))


def taken(room: ndarray, moved: ndarray, rng: np.random.Generator, light: float = 1.0) -> ndarray:
    """What a camera sees that is shifted and turned so, with somebody before the scene."""
    cos, sin = np.cos(moved[2]), np.sin(moved[2])
    turn = np.array([[cos, -sin], [sin, cos]])
    matrix = np.column_stack([turn, MIDDLE - turn @ MIDDLE + moved[:2] - turn @ [30.0, 30.0]])
    picture = cv2.warpAffine(room, matrix, SIZE, flags=cv2.INTER_CUBIC).astype(float)
    x, y = rng.integers([20, 40], [SIZE[0] - 80, 100])
    picture[y : y + 130, x : x + 50] = rng.integers(0, 255, 3)
    bands = 1.0 + 0.1 * np.sin(np.arange(SIZE[1]) / 30.0 + rng.uniform(0.0, 6.0))
    picture *= light * bands[:, None, None]
    noise = rng.normal(0.0, 2.0, picture.shape)
    return np.asarray(np.clip(picture + noise, 0.0, 255.0), dtype=np.uint8)


def shaken(
    rng: np.random.Generator, sigma: float, count: int = 32
) -> tuple[list[ndarray], ndarray]:
    room = scene(rng)
    moved = rng.normal(0.0, 1.0, (count, 3)) * [sigma, sigma, 0.001 * sigma]
    lights = rng.uniform(0.7, 1.3, count)
    return [taken(room, *each) for each in zip(moved, [rng] * count, lights, strict=True)]
