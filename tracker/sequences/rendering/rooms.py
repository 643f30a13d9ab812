"""The three built-in rooms: who walks where, what they wear, where the cameras hang."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.camera import Camera
from tracker.sequences.rendering.interior import Decor
from tracker.sequences.rendering.paths import Facing
from tracker.sequences.rendering.textures import Look

VOLUME_MINIMUM = np.array([-1.5, -1.5, 0.0])
VOLUME_MAXIMUM = np.array([1.5, 1.5, 2.0])
TARGET_HALF_EXTENTS = np.array([0.17, 0.17, 0.36])
"""What is tracked: head and torso, as an upright box from the crown down to the hips.

A head alone is 12 pixels wide in these pictures and all heads look alike; head
and torso are about 30 by 55 pixels in the middle of the room, and the clothes
tell the people apart.
"""


@dataclass(frozen=True, slots=True)
class Person:
    """One person of a scene."""

    look: Look
    waypoints: tuple[tuple[float, float, float], ...]
    """Step, x and y; in the corridor behind a door before coming in."""
    facings: tuple[Facing, ...] = ()


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

_RED = Look(1.80, "#a83a24", "zip", "#d8d2c4", "#26324a", "#1c1a19", "#2a1c14", "#d3a184")
_BLUE = Look(
    1.78, "#2450a8", "stripes", "#dfe5ee", "#8a7857", "#5a3a26", "#5c4026", "#dcb096", build=1.1
)
_GREEN = Look(
    1.66, "#3f8f3a", "plain", "#e0d8a0", "#2b2b30", "#e8e4da", "#4a2c1a", "#e0b79e", long_hair=True
)
_YELLOW = Look(1.75, "#d9a821", "plain", "#ffffff", "#3b4048", "#1c1a19", "#1d1714", "#a8734f")
_PURPLE = Look(
    1.68, "#6a3a8c", "band", "#d9cbe6", "#2d3a55", "#5b5b5f", "#3a2416", "#dcb096", long_hair=True
)
_TEAL = Look(1.83, "#14786f", "checks", "#d8e8e2", "#42372e", "#3a2a1e", "#8a6a42", "#e0b79e")
_PINK = Look(
    1.70, "#c24a78", "plain", "#f0d0dc", "#23262e", "#1c1a19", "#2a1c14", "#c99674", long_hair=True
)

# room44-3p: entries at 99, 144 and 247; 2 and 3 in line with both cameras at 264-295;
# 1 before an armchair of its own colours, as camera 2 sees it, at 600-700; at 809
# camera 1, person 1 and person 3 in a line, and camera 2, person 2 and person 1
_THREE = (
    Person(
        _RED,
        (
            (68, 2.52, -0.05),
            (78, 2.44, -0.05),
            (98.5, 1.5, -0.05),
            (111, 0.93, -0.08),
            (150, -0.45, -0.50),
            (190, -1.15, -0.15),
            (225, -1.20, 0.05),
            (290, -1.20, -0.05),
            (335, -0.55, -0.95),
            (385, 0.75, -1.00),
            (425, 1.15, -0.20),
            (468, 0.75, 0.65),
            (515, -0.10, 0.85),
            (560, -0.25, 0.10),
            (600, 0.40, -0.85),
            (632, -0.22, -1.12),
            (662, -0.28, -1.13),
            (705, -1.00, -0.75),
            (742, -1.10, 0.05),
            (775, -0.45, 0.25),
            (800, -0.02, 0.10),
            (818, 0.20, 0.00),
            (860, 0.95, -0.30),
            (910, 1.05, 0.55),
            (955, 0.35, 1.00),
            (1005, -0.75, 0.95),
            (1055, -1.20, 0.20),
            (1105, -0.80, -0.75),
            (1155, 0.15, -1.10),
            (1205, 0.95, -0.90),
            (1255, 1.15, 0.10),
            (1300, 0.35, 0.45),
            (1345, -0.10, -0.05),
            (1385, 0.70, -0.08),
            (1404, 1.5, -0.05),
            (1424, 2.44, -0.05),
            (1434, 2.52, -0.05),
        ),
        (Facing(222, 292, -0.2, 0.7), Facing(630, 664, 1.4, -2.0)),
    ),
    Person(
        _BLUE,
        (
            (113, -0.20, 2.52),
            (123, -0.20, 2.44),
            (143.5, -0.20, 1.50),
            (156, -0.20, 0.93),
            (190, 0.60, 0.30),
            (230, 0.45, 0.10),
            (258, -0.18, 0.545),
            (298, -0.18, 0.545),
            (335, 0.55, 0.10),
            (380, 0.35, -0.30),
            (430, -0.05, -1.00),
            (480, -0.70, -0.95),
            (530, -1.20, -0.20),
            (575, -1.10, 0.60),
            (622, -0.40, 1.10),
            (680, 0.45, 1.10),
            (722, 1.15, 0.70),
            (765, 1.05, -0.25),
            (800, 0.36, -0.36),
            (818, 0.29, -0.48),
            (860, -0.40, -0.90),
            (910, -1.15, -0.40),
            (955, -1.10, 0.45),
            (1005, -0.20, 0.30),
            (1050, 0.55, 0.60),
            (1100, 1.20, 0.95),
            (1145, 1.00, 0.10),
            (1200, 0.20, -0.30),
            (1250, -0.70, -0.80),
            (1300, -1.20, -0.10),
            (1350, -0.65, 0.80),
            (1400, 0.25, 1.00),
            (1450, 0.85, 0.45),
            (1500, 0.70, -0.30),
        ),
        (Facing(256, 300, -0.20, 1.0),),
    ),
    Person(
        _GREEN,
        (
            (216, -0.20, 2.52),
            (226, -0.20, 2.44),
            (246.5, -0.20, 1.50),
            (256, -0.20, 1.07),
            (263, -0.20, 0.96),
            (297, -0.20, 0.96),
            (330, -0.90, 0.80),
            (375, -1.20, 0.05),
            (420, -0.60, -0.25),
            (470, 0.30, -0.25),
            (520, 1.10, -0.60),
            (570, 1.25, 0.05),
            (620, 1.20, 0.25),
            (660, 1.10, 0.10),
            (700, 0.50, -0.05),
            (745, 0.10, 0.80),
            (800, 0.36, 0.72),
            (818, 0.50, 0.60),
            (860, -0.05, 0.95),
            (905, -0.55, 0.20),
            (950, -0.25, -0.70),
            (1000, 0.60, -0.90),
            (1050, 1.20, -0.45),
            (1100, 0.45, -0.10),
            (1150, -0.30, 0.60),
            (1200, -0.90, 0.95),
            (1250, -0.20, 0.95),
            (1300, 0.65, 1.15),
            (1350, 1.20, 0.85),
            (1385, 1.15, -0.65),
            (1420, 0.70, -1.05),
            (1460, -0.10, -1.10),
            (1500, -0.90, -0.80),
        ),
        (Facing(258, 296, -0.17, 0.4),),
    ),
)

_CROSSING = (
    Person(
        _YELLOW,
        (
            (10, 2.52, 0.10),
            (20, 2.44, 0.10),
            (40.5, 1.5, 0.10),
            (53, 0.93, 0.10),
            (95, -0.50, 0.40),
            (140, -1.15, -0.20),
            (185, -0.60, -0.95),
            (240, 0.60, -0.80),
            (285, 1.15, 0.00),
            (330, 0.50, 0.60),
            (400, 0.45, 0.62),
            (450, -0.60, 0.95),
            (500, -1.20, 0.30),
            (560, -0.20, -0.30),
            (620, 0.95, -0.85),
            (670, 1.10, 0.10),
            (730, 0.10, 0.55),
            (790, -0.95, 0.85),
            (840, -1.15, -0.10),
            (900, -0.35, -1.05),
            (960, 0.75, -0.60),
            (1010, 0.80, 0.30),
            (1080, 0.75, 0.35),
            (1130, 0.00, 0.90),
            (1180, -0.90, 0.60),
            (1240, -0.80, -0.60),
            (1300, 0.30, -0.80),
            (1350, 1.15, -0.30),
            (1400, 0.60, 0.50),
            (1450, -0.30, 0.60),
            (1500, -0.90, -0.10),
        ),
        (Facing(325, 402, -0.2, 0.2), Facing(1010, 1082, 0.0, 0.0)),
    ),
    Person(
        _PURPLE,
        (
            (60, 0.00, 2.52),
            (70, 0.00, 2.44),
            (90.5, 0.00, 1.50),
            (103, 0.00, 0.93),
            (145, 0.60, 0.10),
            (190, 0.90, -0.70),
            (240, -0.10, -0.20),
            (290, -0.95, 0.20),
            (335, -0.10, 0.25),
            (400, -0.05, 0.22),
            (450, 0.85, -0.40),
            (500, 0.30, -1.10),
            (560, -0.75, -0.75),
            (620, -0.60, 0.20),
            (670, 0.20, 0.95),
            (730, 1.10, 0.75),
            (790, 0.75, -0.35),
            (840, 0.20, -0.30),
            (900, -0.75, 0.30),
            (960, -0.40, 0.95),
            (1010, 0.15, 0.10),
            (1080, 0.10, 0.00),
            (1130, 0.90, -0.60),
            (1180, 0.40, -1.10),
            (1240, 0.10, -0.10),
            (1300, 0.50, 0.70),
            (1350, -0.05, 0.95),
            (1390, 0.00, 1.15),
            (1400, 0.00, 1.50),
            (1420, 0.00, 2.44),
            (1430, 0.00, 2.52),
        ),
        (Facing(333, 402, 0.5, 0.62), Facing(1008, 1082, 0.8, 0.3)),
    ),
)

_MEETING = (
    Person(
        _TEAL,
        (
            (30, -0.35, 2.52),
            (40, -0.35, 2.44),
            (60.5, -0.35, 1.50),
            (73, -0.35, 0.93),
            (120, 0.50, 0.20),
            (170, 1.10, -0.60),
            (230, 0.00, -1.05),
            (290, -1.00, -0.60),
            (340, -1.10, 0.30),
            (400, -0.25, 0.35),
            (470, -0.22, 0.30),
            (520, 0.70, 0.80),
            (570, 1.20, 0.20),
            (630, 0.40, -0.50),
            (690, -0.70, -0.30),
            (740, -1.15, 0.60),
            (800, -0.15, 0.95),
            (850, 0.85, 0.60),
            (900, 1.05, -0.40),
            (960, 0.00, -0.55),
            (1030, 0.00, -0.50),
            (1080, -0.90, -0.90),
            (1130, -1.15, 0.10),
            (1190, -0.30, 0.70),
            (1250, 0.75, 0.30),
            (1300, 0.90, -0.70),
            (1360, -0.20, -0.90),
            (1420, -1.00, -0.20),
            (1500, -0.60, 0.80),
        ),
        (Facing(398, 472, 0.3, 0.0), Facing(958, 1032, -0.3, -0.1)),
    ),
    Person(
        _PINK,
        (
            (120, 2.52, 0.20),
            (130, 2.44, 0.20),
            (150.5, 1.5, 0.20),
            (163, 0.93, 0.20),
            (210, -0.40, 0.30),
            (260, -0.80, 0.85),
            (310, 0.20, 0.90),
            (360, 0.95, 0.20),
            (400, 0.35, 0.00),
            (470, 0.32, -0.02),
            (520, -0.40, -0.70),
            (570, -1.15, -0.20),
            (630, -0.50, 0.60),
            (690, 0.45, 0.40),
            (740, 1.15, -0.30),
            (800, 0.40, -1.00),
            (850, -0.60, -0.80),
            (900, -1.00, 0.10),
            (960, -0.35, 0.05),
            (1030, -0.38, 0.00),
            (1080, 0.35, 0.60),
            (1130, 1.05, 0.80),
            (1190, 0.90, -0.30),
            (1250, 0.00, -0.50),
            (1300, -0.95, -0.40),
            (1350, -0.70, 0.70),
            (1420, 0.50, 0.60),
            (1500, 1.00, -0.20),
        ),
        (Facing(398, 472, -0.25, 0.35), Facing(958, 1032, 0.0, -0.55)),
    ),
)

ROOMS: dict[str, RoomSpec] = {
    spec.name: spec
    for spec in (
        RoomSpec(
            "room24-2p",
            "rendered room: two people cross and stop to talk, tiled floor, little daylight",
            1500,
            _CROSSING,
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
            "rendered room: two people meet twice and hide each other in turn",
            1500,
            _MEETING,
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
            "rendered room: three people, hidden in both cameras at 264-295, and an armchair"
            " in person 1's colours behind it in camera 2 at 600-700",
            1500,
            _THREE,
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
