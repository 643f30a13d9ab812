"""The bodies: a smooth mesh per person, hung on the bones of the gait, and what it wears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tests.rooms.cast.gait import (
    CHEST,
    FOOT,
    FOREARM,
    HEAD,
    PELVIS,
    SHIN,
    STATURE,
    THIGH,
    UPPER_ARM,
)
from tests.rooms.walls.textures import TILE, Look, clothes

SHIRT, SLEEVE, TROUSERS, SKIN, FACE, HAIR, SHOES = range(7)
"""The tiles of a person's texture, side by side."""

# Rings from bottom to top: height, half depth, half width, shift ahead, all in metres
# for a person of 1.75 m, and the share of the second bone.
_TORSO = [
    (0.860, 0.108, 0.160, 0.000, 0.0),
    (0.900, 0.118, 0.172, 0.000, 0.0),
    (0.960, 0.116, 0.168, 0.000, 0.1),
    (1.040, 0.104, 0.154, 0.004, 0.4),
    (1.110, 0.104, 0.156, 0.008, 0.7),
    (1.200, 0.114, 0.170, 0.010, 1.0),
    (1.290, 0.120, 0.182, 0.010, 1.0),
    (1.360, 0.112, 0.190, 0.004, 1.0),
    (1.410, 0.100, 0.188, -0.002, 1.0),
    (1.445, 0.084, 0.160, -0.006, 1.0),
    (1.470, 0.068, 0.110, -0.008, 1.0),
    (1.490, 0.058, 0.070, -0.006, 1.0),
    (1.500, 0.050, 0.056, -0.004, 1.0),
]
_HIPS = [
    (0.790, 0.060, 0.080, -0.005, 0.0),
    (0.830, 0.100, 0.150, -0.004, 0.0),
    (0.880, 0.110, 0.162, -0.002, 0.0),
    (0.940, 0.106, 0.158, 0.000, 0.0),
]
_NECK = [
    (1.455, 0.056, 0.058, -0.012, 0.0),
    (1.500, 0.050, 0.052, -0.004, 0.3),
    (1.545, 0.050, 0.050, 0.004, 1.0),
    (1.580, 0.050, 0.050, 0.010, 1.0),
]
_HEAD = [
    (1.512, 0.012, 0.010, 0.052, 0.0),
    (1.520, 0.046, 0.034, 0.034, 0.0),
    (1.540, 0.072, 0.052, 0.022, 0.0),
    (1.570, 0.088, 0.064, 0.014, 0.0),
    (1.605, 0.096, 0.071, 0.010, 0.0),
    (1.640, 0.099, 0.074, 0.007, 0.0),
    (1.675, 0.098, 0.075, 0.003, 0.0),
    (1.705, 0.088, 0.069, 0.000, 0.0),
    (1.730, 0.064, 0.051, -0.004, 0.0),
    (1.743, 0.030, 0.025, -0.006, 0.0),
    (1.746, 0.004, 0.004, -0.006, 0.0),
]
_THIGH_AND_SHIN = [
    (0.095, 0.052, 0.050, -0.004, 1.0),
    (0.130, 0.056, 0.053, -0.006, 1.0),
    (0.260, 0.062, 0.057, -0.010, 1.0),
    (0.390, 0.064, 0.058, -0.008, 1.0),
    (0.450, 0.062, 0.058, 0.000, 0.85),
    (0.500, 0.064, 0.060, 0.004, 0.5),
    (0.550, 0.068, 0.064, 0.002, 0.15),
    (0.660, 0.078, 0.074, 0.000, 0.0),
    (0.780, 0.088, 0.084, -0.002, 0.0),
    (0.860, 0.094, 0.086, -0.004, 0.0),
    (0.920, 0.090, 0.076, -0.004, 0.0),
    (0.945, 0.050, 0.040, -0.004, 0.0),
]
_ARM = [
    (0.885, 0.030, 0.026, 0.000, 1.0),
    (0.940, 0.034, 0.029, 0.000, 1.0),
    (1.050, 0.041, 0.036, 0.000, 1.0),
    (1.110, 0.042, 0.038, -0.002, 0.8),
    (1.140, 0.043, 0.040, -0.003, 0.5),
    (1.170, 0.044, 0.042, -0.002, 0.2),
    (1.270, 0.050, 0.047, 0.000, 0.0),
    (1.360, 0.056, 0.052, 0.000, 0.0),
    (1.420, 0.058, 0.054, 0.000, 0.0),
    (1.455, 0.042, 0.040, 0.000, 0.0),
    (1.468, 0.012, 0.012, 0.000, 0.0),
]
_HAND = [
    (0.780, 0.010, 0.006, 0.012, 0.0),
    (0.792, 0.028, 0.012, 0.010, 0.0),
    (0.825, 0.036, 0.016, 0.006, 0.0),
    (0.860, 0.036, 0.018, 0.004, 0.0),
    (0.885, 0.026, 0.020, 0.000, 0.0),
    (0.905, 0.024, 0.020, 0.000, 0.0),
]
_SHORT_HAIR = [
    (1.575, 0.020, 0.056, -0.078, 0.0),
    (1.600, 0.050, 0.073, -0.050, 0.0),
    (1.635, 0.068, 0.080, -0.034, 0.0),
    (1.668, 0.086, 0.083, -0.018, 0.0),
    (1.690, 0.104, 0.083, 0.001, 0.0),
    (1.715, 0.100, 0.078, -0.002, 0.0),
    (1.738, 0.078, 0.062, -0.004, 0.0),
    (1.754, 0.042, 0.036, -0.006, 0.0),
    (1.758, 0.004, 0.004, -0.006, 0.0),
]
_LONG_HAIR = [
    (1.395, 0.012, 0.050, -0.088, 0.0),
    (1.420, 0.034, 0.086, -0.078, 0.0),
    (1.480, 0.046, 0.096, -0.062, 0.0),
    (1.550, 0.056, 0.094, -0.050, 0.0),
    (1.620, 0.070, 0.091, -0.036, 0.0),
    (1.668, 0.088, 0.087, -0.019, 0.0),
    (1.694, 0.106, 0.085, 0.000, 0.0),
    (1.718, 0.102, 0.080, -0.002, 0.0),
    (1.742, 0.080, 0.064, -0.004, 0.0),
    (1.758, 0.043, 0.037, -0.006, 0.0),
    (1.762, 0.004, 0.004, -0.006, 0.0),
]
# a shoe is a loft from heel to toe: distance ahead of the ankle, half height, half width, lift
_SHOE = [
    (-0.085, 0.010, 0.014, 0.040, 0.0),
    (-0.078, 0.036, 0.032, 0.044, 0.0),
    (-0.050, 0.050, 0.038, 0.052, 0.0),
    (0.000, 0.054, 0.040, 0.055, 0.0),
    (0.050, 0.042, 0.044, 0.043, 0.0),
    (0.110, 0.032, 0.048, 0.033, 0.0),
    (0.155, 0.026, 0.042, 0.027, 0.0),
    (0.178, 0.014, 0.024, 0.020, 0.0),
    (0.182, 0.004, 0.006, 0.020, 0.0),
]

# balls along the upright body that take ambient light from each other's parts
_OCCLUDERS = np.array(
    [[0.0, 0.0, z, r] for z, r in ((0.92, 0.14), (1.08, 0.13), (1.22, 0.15), (1.35, 0.14))]
    + [[0.0, 0.0, 1.64, 0.10], [0.0, 0.0, 1.52, 0.05]]
    + [[0.0, s * 0.215, z, 0.045] for s in (-1, 1) for z in (0.84, 0.95, 1.05, 1.16, 1.28, 1.38)]
    + [[0.0, s * 0.09, z, 0.065] for s in (-1, 1) for z in (0.2, 0.34, 0.48, 0.62, 0.76)]
)


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A closed mesh of an upright person, facing along x, to be moved by bones."""

    vertices: Float[ndarray, "V 3"]
    normals: Float[ndarray, "V 3"]
    texture_points: Float[ndarray, "V 2"]
    """Column and row in :attr:`texture`."""
    bones: Int[ndarray, "V 2"]
    shares: Float[ndarray, " V"]
    """Share of the second bone."""
    openness: Float[ndarray, " V"]
    """Share of the ambient light that the body's other parts let through."""
    triangles: Int[ndarray, "T 3"]
    texture: Float[ndarray, "H W 3"]
    """Linear red, green, blue reflectance."""


class _Loft:
    """Collects the parts of a mesh."""

    def __init__(self) -> None:
        self.parts: list[tuple[ndarray, ...]] = []
        self.count = 0

    def add(
        self,
        rings: list[tuple[float, float, float, float, float]],
        tile: int,
        bones: tuple[int, int],
        *,
        around: int,
        aside: float = 0.0,
        slant: tuple[float, float, float] | None = None,
        squareness: float = 2.0,
        lying: bool = False,
    ) -> None:
        """One tube of rings, closed by its narrow ends.

        Args:
            rings: As in the tables above.
            tile: Which cloth it is covered with.
            bones: The bone at the first share 0 and that at share 1.
            around: Number of vertices around.
            aside: Shift to the left, metres.
            slant: Instead of ``aside``: shift at the bottom, at the top, and the
                height between which it is interpolated down to the lowest ring.
            squareness: Exponent of the rings' superellipse; 2 is an ellipse.
            lying: Rings stand across the x axis (a shoe) instead of across z.
        """
        table = np.array(rings)
        angle = np.linspace(-np.pi, np.pi, around + 1)
        unit = np.stack([np.cos(angle), np.sin(angle)])
        unit = np.sign(unit) * np.abs(unit) ** (2.0 / squareness)
        along, first, second, shift = (table[:, i : i + 1] for i in range(4))
        if lying:
            x = np.broadcast_to(along, (len(table), around + 1))
            z, y = shift + first * unit[0], second * unit[1]
        else:
            x, y = shift + first * unit[0], second * unit[1]
            z = np.broadcast_to(along, x.shape)
        offset = np.full_like(along, aside)
        if slant is not None:
            low, high, top = slant
            offset = low + (high - low) * np.clip(
                (along - along.min()) / (top - along.min()), 0.0, 1.0
            )
        grid = np.stack([x, y + offset, z], axis=2)
        across = np.concatenate([grid[:, -2:-1], grid, grid[:, 1:2]], axis=1)
        tangent = across[:, 2:] - across[:, :-2]
        normal = np.cross(tangent, np.gradient(grid, axis=0))
        if lying:
            normal = -normal
        normal /= np.linalg.norm(normal, axis=2, keepdims=True) + 1e-12
        rows, columns = grid.shape[:2]
        u = np.broadcast_to(np.linspace(0.0, 1.0, columns), (rows, columns))
        length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(table[:, 0]), 1e-3))])
        v = np.broadcast_to(1.0 - (length / length[-1])[:, None], (rows, columns))
        points = np.stack([(u * (TILE - 3)) + 1.5 + tile * TILE, v * (TILE - 3) + 1.5], axis=2)
        index = self.count + np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
        triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2)
        triangles = triangles.reshape(-1, 3)
        if lying:
            triangles = triangles[:, ::-1]
        share = np.broadcast_to(table[:, 4:5], (rows, columns))
        self.parts.append(
            (
                grid.reshape(-1, 3),
                normal.reshape(-1, 3),
                points.reshape(-1, 2),
                np.broadcast_to(bones, (rows * columns, 2)),
                share.reshape(-1),
                triangles,
            )
        )
        self.count += rows * columns


def build(look: Look) -> Body:
    """The body of one person in rest pose, scaled to the person's height, in its clothes."""
    loft = _Loft()
    loft.add(_TORSO, SHIRT, (PELVIS, CHEST), around=20, squareness=2.4)
    loft.add(_HIPS, TROUSERS, (PELVIS, PELVIS), around=16, squareness=2.3)
    loft.add(_NECK, SKIN, (CHEST, HEAD), around=10)
    loft.add(_HEAD, FACE, (HEAD, HEAD), around=18, squareness=2.15)
    hair = _LONG_HAIR if look.long_hair else _SHORT_HAIR
    loft.add(hair, HAIR, (HEAD, HEAD), around=16, squareness=2.15)
    nose = [(1.590, 0.010, 0.008, 0.108, 0.0), (1.600, 0.018, 0.012, 0.108, 0.0)]
    nose += [(1.618, 0.012, 0.008, 0.106, 0.0), (1.640, 0.004, 0.004, 0.102, 0.0)]
    loft.add(nose, SKIN, (HEAD, HEAD), around=8)
    for side, sign in enumerate((1.0, -1.0)):
        ear = [(1.595, 0.006, 0.005, -0.004, 0.0), (1.610, 0.014, 0.009, -0.004, 0.0)]
        ear += [(1.635, 0.018, 0.010, -0.006, 0.0), (1.652, 0.006, 0.004, -0.006, 0.0)]
        loft.add(ear, SKIN, (HEAD, HEAD), around=8, aside=sign * 0.075)
        loft.add(
            _ARM,
            SLEEVE,
            (UPPER_ARM[side], FOREARM[side]),
            around=12,
            slant=(sign * 0.226, sign * 0.182, 1.42),
        )
        loft.add(_HAND, SKIN, (FOREARM[side], FOREARM[side]), around=8, aside=sign * 0.226)
        loft.add(_THIGH_AND_SHIN, TROUSERS, (THIGH[side], SHIN[side]), around=12, aside=sign * 0.09)
        loft.add(_SHOE, SHOES, (FOOT[side], FOOT[side]), around=10, aside=sign * 0.09, lying=True)
    columns = [np.concatenate(column) for column in zip(*loft.parts, strict=True)]
    vertices, normals, points, bones, shares, triangles = columns
    toward = _OCCLUDERS[None, :, :3] - vertices[:, None]
    squared = np.sum(toward**2, axis=2)
    facing = np.sum(toward * normals[:, None], axis=2) / np.sqrt(squared)
    outside = squared > (_OCCLUDERS[:, 3] * 1.02) ** 2
    covered = np.where(outside, np.maximum(facing, 0.0) * _OCCLUDERS[:, 3] ** 2 / squared, 0.0)
    openness = np.exp(-1.1 * covered.sum(axis=1))
    build_up = np.array([look.build, look.build, 1.0])
    return Body(
        vertices * (look.stature / STATURE) * build_up,
        normals,
        points,
        bones.astype(np.int32),
        shares,
        openness,
        triangles.astype(np.int32),
        clothes(look),
    )
