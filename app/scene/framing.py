"""Where to look from, so that all that is to be seen is in the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

BREADTH = 0.4
"""Of a picture's true breadth, from which on it is well seen."""


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where to look from, at what, and how wide."""

    position: Float[ndarray, " 3"]
    look_at: Float[ndarray, " 3"]
    up: Float[ndarray, " 3"]
    fov: float
    """Vertical field of view, radians."""


def overview(
    points: Float[ndarray, "N 3"],
    eyes: Float[ndarray, "C 3"],
    centre: Float[ndarray, " 3"],
    aspect: float,
    fov: float = 0.72,
    elevation: float = 0.56,
    pictures: tuple[Float[ndarray, "C 3"], Float[ndarray, "C 3"]] | None = None,
) -> Pose:
    """A pose outside and above that has all points in the picture.

    Of the directions around, the one is taken that lets it come nearest, where a camera in
    front of the volume counts as if it were a quarter farther, and so does a camera's picture
    that is seen from its edge: of that nothing is to be seen.

    Args:
        points: What must be seen: corners of the volume, the cameras.
        eyes: The cameras' positions.
        centre: Of the volume.
        aspect: Width over height of the picture.
        fov: Vertical field of view, radians.
        elevation: Angle above the floor, radians.
        pictures: Middles of the cameras' pictures and the directions that these face, of length 1.
    """
    around = np.arctan2(eyes[:, 1] - centre[1], eyes[:, 0] - centre[0])
    best: tuple[float, Pose] | None = None
    for azimuth in np.deg2rad(-52.0) + np.arange(24) * np.pi / 12.0:
        pose = _framed(points, centre, aspect, fov, elevation, float(azimuth))
        near = np.max(np.cos(around - azimuth), initial=0.0)
        cost = float(np.linalg.norm(pose.position - pose.look_at)) * (1.0 + 0.25 * near)
        if pictures is not None:
            cost *= 1.0 + 0.25 * edge_on(pose.position, *pictures)
        if best is None or cost < best[0] - 1e-9:
            best = cost, pose
    assert best is not None
    return best[1]


def edge_on(
    position: Float[ndarray, " 3"], middles: Float[ndarray, "C 3"], normals: Float[ndarray, "C 3"]
) -> float:
    """How much the picture that is seen worst is seen from its edge: 1 where it is a line.

    0 where every picture keeps two fifths of its breadth, whether it is seen from before or from
    behind.
    """
    rays = middles - position
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    breadth = np.abs((rays * normals).sum(axis=1))
    return float(np.max(1.0 - breadth / BREADTH, initial=0.0))


def _framed(
    points: Float[ndarray, "N 3"],
    centre: Float[ndarray, " 3"],
    aspect: float,
    fov: float,
    elevation: float,
    azimuth: float,
) -> Pose:
    """The nearest pose in a direction that has all points in the picture."""
    away = np.array(
        [
            np.cos(azimuth) * np.cos(elevation),
            np.sin(azimuth) * np.cos(elevation),
            np.sin(elevation),
        ]
    )
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.cross(away, right)
    tangent = np.tan(fov / 2.0) * 0.94  # a margin at the edges
    across, above, nearer = ((points - centre) @ np.stack([right, up, away], axis=1)).T
    shift_x = shift_y = 0.0
    distance = 1.0
    for _ in range(8):
        wide = np.abs(across - shift_x) / (tangent * aspect) + nearer
        tall = np.abs(above - shift_y) / tangent + nearer
        distance = float(max(wide.max(), tall.max()))
        depth = distance - nearer
        sideways, upright = (across - shift_x) / depth, (above - shift_y) / depth
        shift_x += float(sideways.max() + sideways.min()) * distance / 2.0
        shift_y += float(upright.max() + upright.min()) * distance / 2.0
    target = centre + shift_x * right + shift_y * up
    return Pose(target + distance * away, target, np.array([0.0, 0.0, 1.0]), fov)


def from_above(points: Float[ndarray, "N 3"], aspect: float, fov: float = 0.3) -> Pose:
    """A pose high above that has all points in the picture: nearly a plan, x to the right.

    Args:
        points: What must be seen.
        aspect: Width over height of the picture.
        fov: Vertical field of view, radians; small, so that little is drawn askew.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2.0
    wide, tall = (high - low)[:2] / 2.0 * 1.08  # a margin at the edges
    distance = max(tall, wide / aspect) / np.tan(fov / 2.0)
    eye = np.array([centre[0], centre[1], high[2] + distance])
    return Pose(eye, centre, np.array([0.0, 1.0, 0.0]), fov)
