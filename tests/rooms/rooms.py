"""The three built-in rooms: their furniture, doors and cameras, and what is tracked in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tests.rooms.cast.casts import CROSSING, MEETING, THREE, Person
from tests.rooms.walls.interior import Decor
from tracker.geometry.camera import Camera

VOLUME_MINIMUM = np.array([-1.5, -1.5, 0.0])
VOLUME_MAXIMUM = np.array([1.5, 1.5, 2.0])
TARGET_HALF_EXTENTS = np.array([0.17, 0.17, 0.36])
"""What is tracked: head and torso, as an upright box from the crown down to the hips.

A head alone is 12 pixels wide in these pictures and all heads look alike; head
and torso are about 30 by 55 pixels in the middle of the room, and the clothes
tell the people apart.
"""


@dataclass(frozen=True, slots=True)
class Opening:
    """A door is open from one step to another, and swings for 16 steps before and after."""

    first: float
    last: float


@dataclass(frozen=True, slots=True)
class RoomSpec:
    """A built-in scene."""

    name: str
    description: str
    frames: int
    people: tuple[Person, ...]
    decor: Decor
    back_door: float
    """x of the middle of the door in the far wall."""
    front_door: float
    """y of the middle of the door in the right wall."""
    back_openings: tuple[Opening, ...]
    front_openings: tuple[Opening, ...]


def _camera(
    name: str, centre: tuple[float, float, float], target: tuple[float, float, float], focal: float
) -> Camera:
    place = np.array(centre)
    ahead = np.array(target) - place
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation: Float[ndarray, "3 3"] = np.stack([right, np.cross(ahead, right), ahead])
    # rounded as in the file, so that the pictures are of exactly the camera that is written
    rotation = np.round(rotation, 10)
    intrinsics = np.array([[focal, 0.0, 180.4], [0.0, focal * 1.01, 142.7], [0.0, 0.0, 1.0]])
    return Camera(
        name,
        (360, 288),
        intrinsics,
        rotation,
        np.round(-rotation @ place, 10),
        np.array([-0.16, 0.035, 0.0006, -0.0004, 0.0]),
    )


CAMERAS = (
    _camera("cam1", (-1.72, -3.25, 2.45), (0.30, 0.0, 0.86), 262.0),
    _camera("cam2", (1.72, -3.15, 2.40), (-0.32, 0.05, 0.84), 264.0),
    _camera("cam3", (-1.95, 1.45, 2.45), (0.30, -0.55, 0.86), 250.0),
)
"""Two over the near corners, and by option a third in the far left one."""

ROOMS: dict[str, RoomSpec] = {
    spec.name: spec
    for spec in (
        RoomSpec(
            "room24-2p",
            "rendered room: two people cross and stop to talk",
            1500,
            CROSSING,
            Decor(
                walls="#cfd2cc",
                accent="#b7a68c",
                floor="tiles",
                floor_colour="#a39c90",
                rug=None,
                armchair="#4a5560",
                cushion="#c7c2b4",
                cabinet="#d2cbbd",
                seed=24,
                daylight=0.4,
            ),
            0.0,
            0.10,
            (Opening(66, 96), Opening(1396, 1420)),
            (Opening(16, 46),),
        ),
        RoomSpec(
            "room35-2p",
            "rendered room: two people meet twice, in checks and pink",
            1500,
            MEETING,
            Decor(
                walls="#dad2c2",
                accent="#a9b098",
                floor="wood",
                floor_colour="#7a5636",
                rug=("#6d6f76", "#c9c4b6"),
                armchair="#5a5148",
                cushion="#d8c9a8",
                cabinet="#6a4428",
                seed=35,
                daylight=1.2,
                console=False,
            ),
            -0.35,
            0.20,
            (Opening(36, 66),),
            (Opening(126, 156),),
        ),
        RoomSpec(
            "room44-3p",
            "rendered room: three people, long occlusions, an armchair in one's colours",
            1500,
            THREE,
            Decor(
                walls="#d8ccb4",
                accent="#8f9fa6",
                floor="wood",
                floor_colour="#9a7046",
                rug=("#8d8778", "#cfc8b6"),
                armchair="#a8442c",
                cushion="#d9a98a",
                cabinet="#8a5f3a",
                seed=3,
            ),
            -0.20,
            -0.05,
            (Opening(119, 150), Opening(222, 252)),
            (Opening(74, 105), Opening(1400, 1424)),
        ),
    )
}
