"""What people tell where no file says it: how fast time goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.observed import Rays, upright_rays
from tracker.geometry.consistency.pace import WALKING, pace
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
