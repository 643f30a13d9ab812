"""The compiled loops before any camera: bodies moved and lit, and the shadows they throw.

Arrays in, arrays out, without the interpreter's lock. Colours are linear red, green, blue.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tests.rooms.compiling import kernel


class Surface(NamedTuple):
    """The V vertices of an upright body, as in ``Body``."""

    vertices: ndarray
    """(V, 3), metres."""
    normals: ndarray
    """(V, 3)."""
    bones: ndarray
    """(V, 2), which each follows."""
    shares: ndarray
    """(V,), of the second bone."""
    openness: ndarray
    """(V,), to the light."""


class Skeleton(NamedTuple):
    """The B bones of a body in F frames."""

    rest: ndarray
    """(B, 3), joints of the upright body, metres."""
    rotations: ndarray
    """(F, B, 3, 3)."""
    joints: ndarray
    """(F, B, 3), metres."""


class Placed(NamedTuple):
    """Bodies as they stand in F frames."""

    world: ndarray
    """(F, V, 3), metres."""
    light: ndarray
    """(F, V, 3), red, green, blue."""


@kernel
def place_bodies(surface: Surface, skeleton: Skeleton, lamps: ndarray, ambient: ndarray) -> Placed:
    """Move a body's vertices with its bones and light them.

    Each vertex follows up to two bones, blended linearly; light is the sum over
    the lamps, softened as for a source of some size, and an ambient part that
    changes from the floor's glow below to the ceiling's above.

    Args:
        surface: Of the upright body.
        skeleton: Its bones in every frame.
        lamps: (L, 9): position, direction, and power by colour.
        ambient: (2, 3): light from below and from above.
    """
    vertices, normals, bones = surface.vertices, surface.normals, surface.bones
    shares, openness = surface.shares, surface.openness
    rest, rotations, joints = skeleton.rest, skeleton.rotations, skeleton.joints
    frames = rotations.shape[0]
    size = vertices.shape[0]
    world = np.empty((frames, size, 3))
    light = np.empty((frames, size, 3), dtype=np.float32)
    place = np.empty(3)
    normal = np.empty(3)
    for f in range(frames):
        for v in range(size):
            for i in range(3):
                place[i] = 0.0
                normal[i] = 0.0
            for k in range(2):
                weight = shares[v] if k == 1 else 1.0 - shares[v]
                if weight == 0.0:
                    continue
                bone = bones[v, k]
                for i in range(3):
                    moved = joints[f, bone, i]
                    turned = 0.0
                    for j in range(3):
                        moved += rotations[f, bone, i, j] * (vertices[v, j] - rest[bone, j])
                        turned += rotations[f, bone, i, j] * normals[v, j]
                    place[i] += weight * moved
                    normal[i] += weight * turned
            length = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2) + 1e-12
            for i in range(3):
                normal[i] /= length
                world[f, v, i] = place[i]
            up = 0.5 + 0.5 * normal[2]
            for c in range(3):
                light[f, v, c] = openness[v] * (ambient[0, c] * (1.0 - up) + ambient[1, c] * up)
            for n in range(lamps.shape[0]):
                tx = lamps[n, 0] - place[0]
                ty = lamps[n, 1] - place[1]
                tz = lamps[n, 2] - place[2]
                distance2 = tx * tx + ty * ty + tz * tz
                distance = math.sqrt(distance2)
                facing = (normal[0] * tx + normal[1] * ty + normal[2] * tz) / distance
                facing = max(0.0, (facing + 0.15) / 1.15)
                leaving = -(lamps[n, 3] * tx + lamps[n, 4] * ty + lamps[n, 5] * tz) / distance
                if leaving <= 0.0:
                    continue
                reached = facing * leaving / (distance2 + 0.05) * (0.35 + 0.65 * openness[v])
                for c in range(3):
                    light[f, v, c] += lamps[n, 6 + c] * reached
    return Placed(world, light)


@kernel
def floor_shadows(
    balls: ndarray, lamps: ndarray, rows: int, columns: int, origin: ndarray, cell: float
) -> ndarray:
    """The share of light that reaches the floor under people made of balls.

    Each ball throws, for each lamp, a round shadow around the point where the
    line from the lamp through the ball meets the floor, wider and paler the
    higher the ball; and under it a dark spot where it comes near the floor.

    Args:
        balls: (F, N, 4): centre and radius; radius 0 for none.
        lamps: (L, 4): position, and the share of the floor's light that it gives.
        rows, columns: Size of the floor's grid.
        origin: (2,), x and y of the first cell, metres.
        cell: Size of a cell, metres.

    Returns:
        (F, rows, columns), 1 where nobody takes any light.
    """
    frames = balls.shape[0]
    field = np.ones((frames, rows, columns), dtype=np.float32)
    for f in range(frames):
        for n in range(balls.shape[1]):
            x, y, z, radius = balls[f, n]
            if radius == 0.0:
                continue
            z = max(z, radius)
            for lamp in range(lamps.shape[0] + 1):
                if lamp < lamps.shape[0]:
                    stretch = z / (lamps[lamp, 2] - z)
                    cx = x + (x - lamps[lamp, 0]) * stretch
                    cy = y + (y - lamps[lamp, 1]) * stretch
                    width = radius * (1.0 + stretch) * 0.8 + 0.20 * stretch
                    ratio = radius * (1.0 + stretch) / width
                    depth = lamps[lamp, 3] * min(0.95, 1.05 * ratio * ratio)
                else:
                    cx, cy = x, y
                    width = 0.9 * radius + 0.6 * z
                    depth = 0.62 * (radius / (radius + z)) ** 1.1
                if depth < 0.004:
                    continue
                reach = 2.2 * width
                first_column = max(0, int((cx - reach - origin[0]) / cell))
                last_column = min(columns - 1, int((cx + reach - origin[0]) / cell) + 1)
                first_row = max(0, int((cy - reach - origin[1]) / cell))
                last_row = min(rows - 1, int((cy + reach - origin[1]) / cell) + 1)
                for row in range(first_row, last_row + 1):
                    dy = origin[1] + row * cell - cy
                    for column in range(first_column, last_column + 1):
                        dx = origin[0] + column * cell - cx
                        s = (dx * dx + dy * dy) / (reach * reach)
                        if s < 1.0:
                            field[f, row, column] *= 1.0 - depth * (1.0 - s) ** 3
    return field
