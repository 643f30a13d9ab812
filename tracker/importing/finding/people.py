"""What people tell, where no file says it: how their world lies, and how fast time goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tracker.agreement.observed import Rays, rays_of
from tracker.agreement.pace import WALKING, pace
from tracker.camera import Camera
from tracker.checks.reading import upright
from tracker.checks.readings import Meaning
from tracker.importing.finding.times import USUAL_RATE
from tracker.sequences.sequence import Detections

LEVEL = 6.0
"""Degrees: a world that leans less is taken to be level. Boxes tell no better: cameras that look
down see the top of a head before its middle."""


def lean_of(meaning: Meaning) -> tuple[float, float]:
    """How people stand in a world that is not level; 0, 0 where it is as level as can be told.

    Two things must say the same: boxes stand along it, and where people were lies across it. The
    second is what is taken, being the more exact one; boxes alone lean in cameras that are rolled.
    """
    agreed = meaning.best.consensus
    to_world = upright(meaning.reading.up)
    rise = to_world @ agreed.rise / agreed.height
    middles = (agreed.feet + agreed.rises / 2.0) @ to_world.T
    for _ in range(5):
        centred = middles - np.median(middles, axis=0)
        _, lengths, axes = np.linalg.svd(centred, full_matrices=False)
        off = np.abs(centred @ axes[2])
        middles = middles[off <= 3.0 * np.median(off)]
    normal = axes[2] * np.sign(axes[2] @ rise)
    spread = lengths / np.sqrt(len(centred))
    is_floor = spread[1] > 0.3 * agreed.height and spread[1] > 4.0 * spread[2]
    same = float(normal @ rise) > np.cos(np.radians(2.0 * LEVEL))
    leans = max(normal[2], rise[2]) < np.cos(np.radians(LEVEL))
    return (float(normal[0]), float(normal[1])) if is_floor and same and leans else (0.0, 0.0)


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
    nothing = Detections(np.zeros(0, dtype=np.int64), np.zeros((0, 4)), np.zeros(0))
    return [
        rays_of((own or nothing).frames, (own or nothing).boxes, camera)
        for camera, own in zip(cameras, detections, strict=True)
    ]
