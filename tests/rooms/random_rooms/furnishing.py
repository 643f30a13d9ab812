"""The furniture of a random room: along the walls, a table in the middle, seats and beds."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tests.rooms.random_rooms.choices import Choices, generator
from tests.rooms.random_rooms.shell import SIDES, Bed, Furnished, Seat, Side, length, near_camera
from tests.rooms.rays import BALL, CYLINDER
from tests.rooms.walls.interior import DOOR_WIDTH, Finish, plant
from tracker.geometry.camera import Camera

_HEADINGS: dict[Side, float] = {
    "east": math.pi, "north": -math.pi / 2.0, "west": 0.0, "south": math.pi / 2.0
}  # fmt: skip
"""Of who looks from a wall into the room."""
_CLOTHS = ("#4a5560", "#5a5148", "#a8442c", "#7d8b6a", "#c2b59a", "#2f3d5c", "#8c6a7a")
_WOODS = ("#d2cbbd", "#6a4428", "#8a5f3a", "#3d3028", "#b59468")


def furnish_randomly(room: Furnished, choices: Choices, cameras: Sequence[Camera]) -> None:
    """Put furniture into a room; nothing tall stands before a camera.

    Args:
        room: Empty; it is filled.
        choices: What it must hold.
        cameras: Where they hang.
    """
    rng = generator(choices.seed, 8)
    if choices.table:
        _table(room, rng)
    _along_the_walls(room, choices, cameras, rng)
    if choices.behaviours.count("lies") > len(room.beds):
        _mat(room, rng)


def _table(room: Furnished, rng: np.random.Generator) -> None:
    wood = Finish("veneer", str(rng.choice(_WOODS)), seed=3, gloss=0.25)
    cloth = Finish("fabric", str(rng.choice(_CLOTHS)), seed=8)
    steel = Finish("plain", "#55575a")
    cx, cy = rng.uniform(-0.12, 0.12, 2) * room.half
    a, b = 0.7, 0.4
    box = room.interior.box
    box((cx - a, cy - b, 0.71), (cx + a, cy + b, 0.745), wood)
    for x in (cx - a + 0.05, cx + a - 0.10):
        for y in (cy - b + 0.05, cy + b - 0.10):
            box((x, y, 0.0), (x + 0.05, y + 0.05, 0.71), wood)
    for sign in (-1.0, 1.0):
        for x in (cx - 0.36, cx + 0.36):
            y = cy + sign * (b + 0.22)
            box((x - 0.21, y - 0.21, 0.41), (x + 0.21, y + 0.21, 0.455), cloth)
            back = y + sign * 0.22
            box((x - 0.20, back - 0.02, 0.5), (x + 0.20, back + 0.02, 0.9), cloth)
            for dx in (-0.18, 0.18):
                for dy in (-0.18, 0.18):
                    box((x + dx - 0.015, y + dy - 0.015, 0.0),
                        (x + dx + 0.015, y + dy + 0.015, 0.41), steel)  # fmt: skip
            heading = -sign * math.pi / 2.0
            room.seats.append(Seat((x, y - sign * 0.36), heading, 0.455))
    room.obstacles.append((cx - a, cy - b - 0.45, cx + a, cy + b + 0.45))


def _mat(room: Furnished, rng: np.random.Generator) -> None:
    """A mattress on the floor for who has no bed."""
    for _ in range(60):
        x, y = rng.uniform(-1.0, 1.0, 2) * (np.array(room.half) - 1.2)
        corners = np.array([[x + a, y + b] for a in (-0.9, 0.0, 0.9) for b in (-0.4, 0.4)])
        if room.free(corners, 0.05).all():
            break
    else:
        return
    cloth = Finish("fabric", str(rng.choice(_CLOTHS)), seed=12)
    room.interior.box((x - 1.0, y - 0.42, 0.0), (x + 1.0, y + 0.42, 0.12), cloth)
    room.beds.append(Bed((x, y, 0.12), 0.0 if rng.random() < 0.5 else math.pi))
    room.obstacles.append((x - 1.0, y - 0.42, x + 1.0, y + 0.42))


def _along_the_walls(
    room: Furnished, choices: Choices, cameras: Sequence[Camera], rng: np.random.Generator
) -> None:
    wanted: list[str] = ["mirror"] * choices.mirror + ["screen"] * choices.screen
    wanted += ["moving plant"] * choices.plant
    sitters = sum(b in ("sits", "rises") for b in choices.behaviours) - len(room.seats)
    wanted += ["armchair"] * max(0, sitters)
    wanted += ["bed"] * min(2, choices.behaviours.count("lies"))
    extra = ["bookcase", "cabinet", "sofa", "desk", "plant", "picture", "armchair", "window"]
    wanted += [str(w) for w in rng.choice(extra, size=4 + int(rng.integers(0, 4)))]
    widths = {"mirror": 0.8, "screen": 1.3, "moving plant": 0.5, "armchair": 0.8, "bed": 2.1,
              "bookcase": 1.0, "cabinet": 0.95, "sofa": 1.7, "desk": 1.25, "plant": 0.5,
              "picture": 0.8, "window": 1.3}  # fmt: skip
    taken: list[tuple[Side, float, float]] = []
    for doorway in room.doorways:
        side = SIDES[round(math.atan2(doorway.out[1], doorway.out[0]) / (math.pi / 2)) % 4]
        along = doorway.middle[0] if side in ("north", "south") else doorway.middle[1]
        taken.append((side, along, 0.5 * DOOR_WIDTH + 0.25))
    for kind in wanted:
        for _ in range(25):
            side = SIDES[int(rng.integers(0, 4))]
            reach = length(room, side) - 0.5 * widths[kind] - 0.85
            if reach <= 0.0:
                continue
            along = float(rng.uniform(-reach, reach))
            if any(s == side and abs(along - a) < w + 0.5 * widths[kind] for s, a, w in taken):
                continue
            if near_camera(room, side, along, cameras, 0.5 * widths[kind] + 0.45):
                continue
            taken.append((side, along, 0.5 * widths[kind] + 0.05))
            _put(room, kind, side, along, choices.seed, rng)
            break


def _put(
    room: Furnished, kind: str, side: Side, middle: float, seed: int, rng: np.random.Generator
) -> None:
    """One piece of furniture with its back to a wall."""
    wood = Finish("veneer", str(rng.choice(_WOODS)), seed=seed + 2, gloss=0.25)
    cloth = Finish("fabric", str(rng.choice(_CLOTHS)), seed=seed + 4)
    dark, white = Finish("plain", "#1d1e20", gloss=0.4), Finish("plain", "#e6e2da")

    def box(a: float, b: float, near: float, far: float, low: float, high: float,
            finish: Finish) -> None:  # fmt: skip
        room.place(side, (middle + a, middle + b), (near, far), (low, high), finish)

    depth, half = 0.0, 0.0
    match kind:
        case "armchair" | "sofa":
            half, depth = (0.38, 0.78) if kind == "armchair" else (0.82, 0.78)
            box(-half, half, 0.02, 0.72, 0.10, 0.40, cloth)
            box(-half, half, 0.02, 0.20, 0.10, 0.86, cloth)
            for edge in (-half, half - 0.13):
                box(edge, edge + 0.13, 0.02, 0.74, 0.10, 0.58, cloth)
            box(-half + 0.14, half - 0.14, 0.2, 0.70, 0.40, 0.45, cloth)
            for shift in (0.0,) if kind == "armchair" else (-0.36, 0.36):
                feet = room.world(side, middle + shift, 0.86)
                room.seats.append(Seat(feet, _HEADINGS[side]))
        case "bed":
            half, depth = 1.05, 0.95
            box(-1.05, 1.05, 0.03, 0.93, 0.0, 0.28, wood)
            box(-1.02, 1.02, 0.05, 0.91, 0.28, 0.46, cloth)
            box(-1.0, -0.6, 0.18, 0.78, 0.46, 0.54, Finish("fabric", "#dcd8cc", seed=5))
            box(-1.05, -1.01, 0.03, 0.93, 0.0, 0.8, wood)
            x, y = room.world(side, middle, 0.48)
            # the crown to the pillow, at the low end of the wall's axis
            heading = math.pi if side in ("north", "south") else -math.pi / 2.0
            room.beds.append(Bed((x, y, 0.48), heading))
        case "bookcase":
            half, depth = 0.48, 0.32
            box(-0.48, 0.48, 0.0, 0.30, 0.0, 1.86, wood)
            books = Finish("books", "#7a5230", seed=seed + 3)
            for shelf in range(5):
                low = 0.08 + 0.355 * shelf
                box(-0.44, 0.44, 0.295, 0.315, low, low + 0.32, books)
        case "cabinet":
            half, depth = 0.45, 0.44
            box(-0.45, 0.45, 0.0, 0.42, 0.05, 0.82, wood)
            box(-0.42, 0.42, 0.0, 0.38, 0.0, 0.05, dark)
            x, y = room.world(side, middle + 0.2, 0.2)
            vase = Finish("plain", str(rng.choice(["#3f6a73", "#a05a3a", "#d8d4c8"])))
            room.interior.round(BALL, (x, y, 0.92), (0.08, 0.08, 0.10), vase)
        case "desk":
            half, depth = 0.6, 0.65
            box(-0.6, 0.6, 0.02, 0.62, 0.71, 0.745, wood)
            for edge in (-0.58, 0.54):
                box(edge, edge + 0.04, 0.04, 0.60, 0.0, 0.71, dark)
            box(-0.27, 0.27, 0.16, 0.18, 0.84, 1.17, Finish("screen", "#2b5f88", glow=0.25))
            box(-0.02, 0.02, 0.17, 0.19, 0.745, 0.9, dark)
        case "screen":
            half, depth = 0.62, 0.42
            box(-0.6, 0.6, 0.02, 0.40, 0.0, 0.48, wood)
            box(-0.58, 0.58, 0.08, 0.12, 0.58, 1.24, dark)
            box(-0.1, 0.1, 0.08, 0.2, 0.48, 0.60, dark)
            room.screen = (side, middle, 0.128, 0.91, 0.54)
        case "mirror":
            box(-0.42, 0.42, 0.0, 0.018, 0.30, 1.95, wood)
            box(-0.38, 0.38, 0.0, 0.022, 0.34, 1.91, Finish("mirror", "#ffffff"))
            x, y = room.world(side, middle, 0.022)
            room.mirror = (side, y if side in ("north", "south") else x)
        case "plant" | "moving plant":
            half, depth = 0.2, 0.45
            x, y = room.world(side, middle, 0.26)
            if kind == "plant":
                plant(room.interior, x, y, seed)
            else:
                pot = Finish("plain", str(rng.choice(["#8d8a84", "#a0643f", "#3c4a50"])))
                room.interior.round(CYLINDER, (x, y, 0.17), (0.15, 0.15, 0.17), pot)
                room.plant = (x, y)
        case "window":
            outside = Finish("outside", "#dfe8ee", seed=seed, glow=1.3)
            box(-0.6, 0.6, 0.0, 0.012, 0.95, 2.05, outside)
            for edge in (-0.63, -0.02, 0.58):
                box(edge, edge + 0.05, 0.0, 0.03, 0.92, 2.08, white)
            for edge in (0.91, 2.04):
                box(-0.63, 0.63, 0.0, 0.035, edge, edge + 0.05, white)
        case _:
            box(-0.36, 0.36, 0.0, 0.02, 1.2, 1.75, dark)
            art = Finish("picture", "#88a0b0", seed=seed + int(rng.integers(0, 90)))
            box(-0.33, 0.33, 0.0, 0.024, 1.23, 1.72, art)
    if depth:
        room.occupy(side, (middle - half, middle + half), depth)
