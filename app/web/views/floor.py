"""The grid on the floor as each camera sees it: a wrong calibration puts it elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from app import models
from app.models.floor import Line
from app.scene.geometry import grid_cell
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Room, Sequence

PIECES = 25
"""A cell is projected at so many places of each of its lines: a lens bends them."""
NEAR = 0.3
"""Metres in front of a camera below which nothing is drawn."""
OFF = 0.5
"""How far beside its picture a line goes on, of the picture's size."""
TOLERANCE = 0.25
"""Pixels by which a line that is told may differ from the line that is meant."""


def floor_of(sequence: Sequence) -> models.Floor:
    """The grid of the room's floor in the picture of every camera.

    Each line is z = the floor, at whole multiples of the cell in world metres, from one edge of
    the room to the other, projected through pose, intrinsics and lens.
    """
    room, cell = sequence.room, grid_cell(sequence.room)
    grid, edges = _grid(room, cell), _edges(room, cell)
    return models.Floor(
        cell=cell,
        height=float(room.minimum[2]),
        cameras=[
            models.CameraFloor(
                lines=[line for way in grid for line in _seen(camera, way)],
                edges=[line for way in edges for line in _seen(camera, way)],
            )
            for camera in sequence.cameras
        ],
    )


def _grid(room: Room, cell: float) -> list[Float[ndarray, "P 3"]]:
    low, high = room.minimum, room.maximum
    ways = []
    for axis in (0, 1):
        first, last = np.floor(low[axis] / cell) + 1, np.ceil(high[axis] / cell) - 1
        for number in np.arange(first, last + 1):
            ends = np.array([low, high])
            ends[:, axis], ends[:, 2] = number * cell, low[2]
            ways.append(_way(ends[0], ends[1], cell))
    return ways


def _edges(room: Room, cell: float) -> list[Float[ndarray, "P 3"]]:
    (x0, y0, z), (x1, y1, _) = room.minimum, room.maximum
    corners = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    return [_way(corners[i], corners[(i + 1) % 4], cell) for i in range(4)]


def _way(
    start: Float[ndarray, " 3"], end: Float[ndarray, " 3"], cell: float
) -> Float[ndarray, "P 3"]:
    count = max(2, round(float(np.linalg.norm(end - start)) / cell * PIECES) + 1)
    return np.linspace(start, end, count)


def _seen(camera: Camera, way: Float[ndarray, "P 3"]) -> Iterator[Line]:
    """The parts of a line that come into a picture, with as few points as will do."""
    pixels, valid = camera.project(way)
    size = np.array(camera.image_size)
    ahead = camera.to_camera(way)[:, 2] > NEAR
    beside = np.abs(pixels - size / 2.0) < (0.5 + OFF) * size
    kept = valid & ahead & beside.all(axis=1)
    for part in np.split(np.arange(len(way)), np.flatnonzero(np.diff(kept)) + 1):
        if not kept[part[0]] or len(part) < 2:
            continue
        points = pixels[part].astype(np.float32)[:, None]
        fewer = np.asarray(cv2.approxPolyDP(points, TOLERANCE, closed=False))[:, 0]
        yield [(round(x, 1), round(y, 1)) for x, y in fewer.tolist()]
