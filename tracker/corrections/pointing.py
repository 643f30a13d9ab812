"""A click in a picture as a place in the room."""

from __future__ import annotations

from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections.kinds import CorrectionError
from tracker.geometry.camera import Camera

_FLAT = 0.02
"""Sine of the angle to the floor below which a ray says nothing of how far away somebody is."""

_MISS = 0.5
"""Metres by which the rays of two clicks on one person may miss each other."""


_OFF_FLOOR = 0.3
"""Metres, of a person's height: what is nearer to the floor than this stands on it."""


def ground_under(feet: float | None, *, floor: float, half_height: float) -> float:
    """The height of what a target stands on: the floor, or the air below somebody's head.

    Args:
        feet: Where the target's lower end was found, world metres; None if it was not.
        floor: Height of the floor, world metres.
        half_height: Of the target, metres.
    """
    if feet is None or abs(feet - floor) <= _near_floor(half_height):
        return floor
    return feet


def stands(height: float, *, ground: float, half_height: float) -> bool:
    """Whether a point at a height is one of a target that stands on a ground."""
    margin = _near_floor(half_height)
    return ground - margin <= height <= ground + 2.0 * half_height + margin


def _near_floor(half_height: float) -> float:
    """For a target lower than a person, such as a head, no more than a sixth of it."""
    return min(_OFF_FLOOR, half_height / 3.0)


def foot_on_floor(
    camera: Camera, pixel: tuple[float, float], *, floor: float, half_height: float
) -> Float[ndarray, " 3"]:
    """The middle of a target whose feet are at a pixel.

    Args:
        camera: Whose picture.
        pixel: Where the target meets the floor.
        floor: Height of the floor, world metres.
        half_height: Of the target, metres.

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


def triangulated(points: Many[tuple[Camera, tuple[float, float]]]) -> Float[ndarray, " 3"]:
    """The point nearest to the rays of a pixel in each of two pictures or more.

    It is the least-squares solution of Σ_c |(I − r_c r_cᵀ)(x − o_c)|², of rays r_c from o_c.

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
    # the place lies in the middle, half as far from each of two rays as they are apart
    away = np.linalg.norm(np.einsum("cij,cj->ci", across, place - centres), axis=1)
    miss = 2.0 * float(away.max())
    ahead = np.einsum("ci,ci->c", rays, place - centres)
    if miss > _MISS or (ahead <= 0.0).any():
        raise CorrectionError(
            f"clicks: the pictures show two different points there, {miss:.1f} m apart; click on "
            "the same point of one person"
        )
    return place
