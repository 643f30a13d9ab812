"""What people tell where no file says it: how fast time goes, and how large a reconstruction is
whose unit is arbitrary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.observed import Rays, upright_rays
from tracker.geometry.consistency.pace import WALKING, pace
from tracker.io.conventions.sizes import USUAL_HEIGHTS
from tracker.io.importing.finding.times import USUAL_RATE
from tracker.sequences.sequence import Detections


def rate_of(
    cameras: Sequence[Camera], detections: Sequence[Detections | None]
) -> tuple[float, str]:
    """Steps a second where no file says it, and how that is known.

    Who goes half a metre from one step to the next would run at 25 steps a second; who goes
    little may as well be slow.
    """
    way = pace(cameras, rays_of_all(cameras, detections))
    if way is None or WALKING / way > USUAL_RATE / 2.0:
        return USUAL_RATE, "as usual"
    fps = WALKING / way
    rounded = max(0.5, round(fps) if fps >= 3.0 else round(2.0 * fps) / 2.0)
    return rounded, f"by people who go {way:.2f} m from step to step"


def rays_of_all(cameras: Sequence[Camera], detections: Sequence[Detections | None]) -> list[Rays]:
    """The rays of every camera's boxes, none of a camera that has no boxes."""
    nothing = Detections(np.zeros(0, dtype=np.int64), np.zeros((0, 4)), np.zeros(0))
    return [
        upright_rays((own or nothing).frames, (own or nothing).boxes, camera)
        for camera, own in zip(cameras, detections, strict=True)
    ]


PERSON = USUAL_HEIGHTS[0]
"""Metres: the usual stature of people who stand."""

AS_STANDING = (
    f"as if people stood, {PERSON} m tall; where they sit, or boxes show a part of them, give the "
    "metres in one unit"
)
"""What is told where nothing but boxes says how large people are."""

_FASTEST = 1.5 * WALKING
"""Metres a second: most people do not go faster indoors, so they are smaller than was taken."""

_SLOWEST = 0.6 * WALKING
"""Who goes slower may stand about, or be larger."""


def paced(
    cameras: Sequence[Camera], detections: Sequence[Detections | None], fps: float
) -> tuple[float, str]:
    """By how much the world is too small or large, where people were taken to stand.

    Boxes of seated people, of heads with shoulders or of heads are taken for people of 1.70 m:
    the room is too large then by as much, and its people run.

    Args:
        cameras: In the unit in which boxes are :data:`PERSON` tall, z up.
        detections: By step.
        fps: Steps a second.

    Returns:
        The factor for all lengths, and why.
    """
    way = pace(cameras, rays_of_all(cameras, detections))
    if way is None or way * fps < _SLOWEST:
        return 1.0, AS_STANDING
    speed = way * fps
    if speed < _FASTEST:
        return 1.0, f"so that people are {PERSON} m tall and walk {speed:.1f} m/s"
    tall = min(USUAL_HEIGHTS, key=lambda own: abs(np.log(speed * own / PERSON / WALKING)))
    speed *= tall / PERSON
    return tall / PERSON, (
        f"so that people walk {speed:.1f} m/s; boxes are then {tall:g} m tall, of a part "
        "of them or of people who sit"
    )


def resized(cameras: Sequence[Camera], factor: float) -> list[Camera]:
    """The cameras of a world so many times as large."""
    return [replace(camera, translation=factor * camera.translation) for camera in cameras]
