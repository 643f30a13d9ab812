"""The two doors: a leaf each, closed but for the moments when somebody passes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.rooms.cast.people import Body
from tests.rooms.walls.interior import DOOR_HEIGHT, DOOR_WIDTH
from tests.rooms.walls.textures import TILE, door_leaf

if TYPE_CHECKING:
    from tests.rooms.rooms import Opening

_SWING = 16.0
"""Steps that a leaf takes to open or close."""
_THICKNESS = 0.04


def leaf() -> Body:
    """A leaf along the x axis from its hinge at the origin, both sides in small squares.

    The squares are small because straight lines are bent by the lens model only
    at the vertices.
    """
    columns, rows = 10, 18
    width, height = DOOR_WIDTH - 0.03, DOOR_HEIGHT - 0.025
    x, z = np.meshgrid(np.linspace(0.0, width, columns), np.linspace(0.008, height, rows))
    u, v = x / width, 1.0 - z / height
    points = np.stack([u * (TILE - 3) + 1.5, v * (TILE - 3) + 1.5], axis=2).reshape(-1, 2)
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    front = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    half = _THICKNESS / 2.0
    vertices, normals, triangles = [], [], []
    for number, sign in enumerate((-1.0, 1.0)):
        vertices.append(np.stack([x, np.full_like(x, sign * half), z], axis=2).reshape(-1, 3))
        normals.append(np.tile([0.0, sign, 0.0], (rows * columns, 1)))
        turned = front if sign < 0.0 else front[:, ::-1]
        triangles.append(turned + number * rows * columns)
    count = 2 * rows * columns
    # the narrow edges at the lock and above
    for near, far, normal in (
        (index[:, -1], index[:, -1] + rows * columns, [1.0, 0.0, 0.0]),
        (index[-1, ::-1], index[-1, ::-1] + rows * columns, [0.0, 0.0, 1.0]),
    ):
        sides = np.concatenate(vertices)
        vertices.append(np.concatenate([sides[near], sides[far]]))
        normals.append(np.tile(normal, (2 * len(near), 1)))
        i = count + np.arange(len(near) - 1)
        j = i + len(near)
        strip = np.concatenate(
            [np.stack([i, j, j + 1], axis=1), np.stack([i, j + 1, i + 1], axis=1)]
        )
        triangles.append(strip)
        count += 2 * len(near)
    size = count
    edge_points = np.full((size - 2 * rows * columns, 2), 4.0)
    return Body(
        np.concatenate(vertices),
        np.concatenate(normals).astype(float),
        np.concatenate([points, points, edge_points]),
        np.zeros((size, 2), dtype=np.int32),
        np.zeros(size),
        np.full(size, 0.85),
        np.concatenate(triangles).astype(np.int32),
        door_leaf(),
    )


def leaf_hinge(door: str, middle: float, wall: float) -> tuple[ndarray, float, float]:
    """Hinge, and the leaf's angle when closed and when open, for a door at ``middle``.

    Both leaves open into the room, away from the people's way.
    """
    half = DOOR_WIDTH / 2.0 - 0.015
    if door == "back":  # hinge on the left, the leaf swings towards the cameras
        return np.array([middle - half, wall + 0.035, 0.0]), 0.0, -0.56 * np.pi
    return np.array([wall + 0.035, middle + half, 0.0]), -0.5 * np.pi, -0.98 * np.pi


def leaf_angle(
    frames: int, closed: float, opened: float, openings: tuple[Opening, ...]
) -> Float[ndarray, " F"]:
    """The angle of a leaf at every step, swinging smoothly."""
    steps = np.arange(frames, dtype=float)
    share = np.zeros(frames)
    for opening in openings:
        rise = np.clip((steps - opening.first + _SWING) / _SWING, 0.0, 1.0)
        fall = np.clip((opening.last + _SWING - steps) / _SWING, 0.0, 1.0)
        both = np.minimum(rise, fall)
        share = np.maximum(share, both * both * (3.0 - 2.0 * both))
    return closed + (opened - closed) * share
