"""What people tell, where no file says it: how their world lies, and how fast time goes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.agreement.observed import Rays, rays_of
from tracker.agreement.pace import WALKING, pace
from tracker.camera import Camera
from tracker.checks.reading import pose, upright
from tracker.checks.readings import Meaning
from tracker.formats.pieces import RawCamera
from tracker.importing.finding.geometry import LEVEL, horizon, leaning
from tracker.importing.finding.times import USUAL_RATE
from tracker.sequences.sequence import Detections


def lean_of(meaning: Meaning, cameras: Sequence[RawCamera]) -> tuple[float, float]:
    """How people stand in a world that is not level; 0, 0 where it is as level as can be told.

    Boxes alone lean in cameras that are rolled. So a second witness must say the same, and is
    what is taken, being the more exact one: the plane in which people were, or the cameras' level.
    """
    agreed = meaning.best.consensus
    to_world = upright(meaning.reading.up)
    rise = to_world @ agreed.rise / agreed.height
    if rise[2] > np.cos(np.radians(LEVEL)):
        return 0.0, 0.0
    level = horizon([pose(camera, meaning.reading) for camera in cameras])
    across = _across((agreed.feet + agreed.rises / 2.0) @ to_world.T, rise, agreed.height)
    for witness in (across, None if level is None else to_world @ level):
        if witness is not None and witness @ rise > np.cos(np.radians(2.0 * LEVEL)):
            return leaning(witness)
    return 0.0, 0.0


def _across(
    middles: Float[ndarray, "N 3"], rise: Float[ndarray, " 3"], height: float
) -> Float[ndarray, " 3"] | None:
    """The normal of the plane in which the middles of people lie; None where they lie in none."""
    for _ in range(5):
        centred = middles - np.median(middles, axis=0)
        _, lengths, axes = np.linalg.svd(centred, full_matrices=False)
        off = np.abs(centred @ axes[2])
        middles = middles[off <= 3.0 * np.median(off)]
    spread = lengths / np.sqrt(len(centred))
    if spread[1] < 0.3 * height or spread[1] < 4.0 * spread[2]:
        return None
    return np.asarray(axes[2] * np.sign(axes[2] @ rise))


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
        rays_of((own or nothing).frames, (own or nothing).boxes, camera)
        for camera, own in zip(cameras, detections, strict=True)
    ]
