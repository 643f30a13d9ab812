"""Conversion of clicks in images to positions in the room."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections.kinds import CorrectionError
from tracker.geometry.camera import Camera

_FLAT = 0.02
"""Sine of the angle between a ray and the floor below which the distance is undetermined: 1.1°, at
which a camera 3 m high sees the floor at 150 m."""

_MISS = 0.5
"""Largest distance between the rays of two clicks on one person, metres."""

_OFF_FLOOR = 0.3
"""Largest height above the floor of the lower end of a target that stands on the floor, metres."""


def ground_under(feet: float | None, *, floor: float, half_height: float) -> float:
    """The height at which the lower end of a target is: the floor, or above it for heads.

    Args:
        feet: Estimated height of the target's lower end, world metres; None if unknown.
        floor: Height of the floor, world metres.
        half_height: Half height of the target, metres.
    """
    if feet is None or abs(feet - floor) <= _near_floor(half_height):
        return floor
    return feet


def stands(height: float, *, ground: float, half_height: float) -> bool:
    """Whether a point at a height may lie on a target whose lower end is at ``ground``.

    Args:
        height: Height of the point, world metres.
        ground: Height of the target's lower end, world metres.
        half_height: Half height of the target, metres.
    """
    margin = _near_floor(half_height)
    return ground - margin <= height <= ground + 2.0 * half_height + margin


def _near_floor(half_height: float) -> float:
    """The tolerance of heights, metres: at most a sixth of the target's height."""
    return min(_OFF_FLOOR, half_height / 3.0)


def foot_on_floor(
    camera: Camera, pixel: tuple[float, float], *, floor: float, half_height: float
) -> Float[ndarray, " 3"]:
    """The centre of a target whose feet are at a pixel, world metres.

    Args:
        camera: The calibrated camera of the image.
        pixel: Point at which the target meets the floor, pixels.
        floor: Height of the floor, world metres.
        half_height: Half height of the target, metres.

    Raises:
        CorrectionError: If the pixel does not show the floor.
    """
    ray, centre = camera.back_project(np.array([pixel]))[0], camera.centre
    if not ray[2] < -_FLAT or centre[2] <= floor:
        raise CorrectionError(
            f"clicks: {camera.name} does not show the floor at ({pixel[0]:.0f}, {pixel[1]:.0f}); "
            "click on the feet, or on the same point in two pictures"
        )
    place: Float[ndarray, " 3"] = centre + ray * ((floor - centre[2]) / ray[2])
    place[2] += half_height
    return place


def triangulate(points: Many[tuple[Camera, tuple[float, float]]]) -> Float[ndarray, " 3"]:
    """Triangulate the point nearest to the rays of pixels in two or more images, world metres.

    It is the least-squares solution of Σ_c |(I − r_c r_cᵀ)(x − o_c)|², of rays r_c from o_c.

    Args:
        points: Camera and pixel of each ray.

    Raises:
        CorrectionError: If the rays are nearly parallel, or miss each other.
    """
    if len(points) < 2:
        raise CorrectionError("clicks: expected one on the feet, or one in each of two pictures")
    centres = np.array([camera.centre for camera, _ in points])
    rays = np.array([camera.back_project(np.array([pixel]))[0] for camera, pixel in points])
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    total = across.sum(axis=0)
    if np.linalg.cond(total) > 1.0 / _FLAT**2:
        raise CorrectionError(
            "clicks: the two pictures look from the same side; click in another one"
        )
    place: Float[ndarray, " 3"] = np.linalg.solve(total, np.einsum("cij,cj->i", across, centres))
    # the point nearest to two rays is at half their distance from each
    away = np.linalg.norm(np.einsum("cij,cj->ci", across, place - centres), axis=1)
    miss = 2.0 * float(away.max())
    ahead = np.einsum("ci,ci->c", rays, place - centres)
    if miss > _MISS or (ahead <= 0.0).any():
        raise CorrectionError(
            f"clicks: the pictures show two different points there, {miss:.1f} m apart; click on "
            "the same point of one person"
        )
    return place
