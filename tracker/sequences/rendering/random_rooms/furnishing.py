"""The interior of a random room: walls with doorways, lamps, furniture, and where people can be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.camera import Camera
from tracker.sequences.rendering.random_rooms.choices import Choices, generator
from tracker.sequences.rendering.rays import BALL, CYLINDER
from tracker.sequences.rendering.walls.interior import (
    DOOR_HEIGHT,
    DOOR_WIDTH,
    WALL,
    Finish,
    Interior,
    Lamp,
    plant,
)

Side = Literal["east", "north", "west", "south"]
SIDES: tuple[Side, ...] = ("east", "north", "west", "south")
_HEADINGS: dict[Side, float] = {
    "east": math.pi, "north": -math.pi / 2.0, "west": 0.0, "south": math.pi / 2.0
}  # fmt: skip
"""Of who looks from a wall into the room."""

HALL = 1.3
"""Depth of the corridor behind a doorway, metres."""
_HALL_LENGTH = 2.6
"""From the doorway's middle to each end of its corridor, metres."""

_PALE = ("#cfd2cc", "#dad2c2", "#d8ccb4", "#e2e2de", "#c6ccd2", "#d9d6e0", "#b9bcb6")
_VIVID = ("#4f7f8f", "#8f4a3f", "#5f7a45", "#c7a445", "#6d5a8a", "#3f4a63")
_SKIN = ("#d3a184", "#dcb096", "#c99674", "#e0b79e", "#a8734f")
_CLOTHING = ("#a83a24", "#2450a8", "#3b4048", "#8a7857", "#2d3a55", "#14786f")
_CLOTHS = ("#4a5560", "#5a5148", "#a8442c", "#7d8b6a", "#c2b59a", "#2f3d5c", "#8c6a7a")
_WOODS = ("#d2cbbd", "#6a4428", "#8a5f3a", "#3d3028", "#b59468")


@dataclass(frozen=True, slots=True)
class Seat:
    """Where somebody can sit: where the feet stand, where the face looks, and how high it is."""

    feet: tuple[float, float]
    heading: float
    height: float = 0.45


@dataclass(frozen=True, slots=True)
class Bed:
    """Where somebody can lie: the middle of the body, and where the crown points."""

    middle: tuple[float, float, float]
    heading: float


@dataclass(frozen=True, slots=True)
class Doorway:
    """The middle of an opening in a wall, and the unit vectors out of the room and along it."""

    middle: tuple[float, float]
    out: tuple[float, float]
    along: tuple[float, float]

    def at(self, out: float, along: float = 0.0) -> tuple[float, float]:
        """A point of the floor so far outside the wall, and so far along it."""
        x, y = (self.middle[i] + out * self.out[i] + along * self.along[i] for i in range(2))
        return x, y


@dataclass(slots=True)
class Furnished:
    """A furnished room."""

    half: tuple[float, float]
    """Half width and half depth between the walls, metres."""
    interior: Interior
    accent: str
    """Colour of the walls."""
    doorways: list[Doorway] = field(default_factory=list)
    seats: list[Seat] = field(default_factory=list)
    beds: list[Bed] = field(default_factory=list)
    obstacles: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Low x, low y, high x, high y of what nobody walks through."""
    mirror: tuple[Side, float] | None = None
    """The wall that a mirror hangs on, and the plane of its glass."""
    screen: tuple[Side, float, float, float, float] | None = None
    """Wall, middle along it, distance from it, height of the middle, half width of a screen."""
    plant: tuple[float, float] | None = None
    """Where a pot stands whose plant moves."""

    def world(self, side: Side, along: float, out: float) -> tuple[float, float]:
        """A point so far along a wall from its middle, and so far out from it into the room."""
        x, y = self.half
        return {
            "north": (along, y - out),
            "south": (along, out - y),
            "east": (x - out, along),
            "west": (out - x, along),
        }[side]

    def free(self, points: Float[ndarray, "N 2"], margin: float = 0.3) -> Bool[ndarray, " N"]:
        """Whether nothing stands within a margin of each point of the floor."""
        inside = np.all(np.abs(points) < np.array(self.half) - margin, axis=1)
        for low_x, low_y, high_x, high_y in self.obstacles:
            low, high = np.array([low_x, low_y]) - margin, np.array([high_x, high_y]) + margin
            inside &= ~np.all((points > low) & (points < high), axis=1)
        return np.asarray(inside)

    def place(
        self, side: Side, along: tuple[float, float], out: tuple[float, float],
        height: tuple[float, float], finish: Finish,
    ) -> None:  # fmt: skip
        """A box before a wall: from where to where along it, out from it, and up."""
        first, second = self.world(side, along[0], out[0]), self.world(side, along[1], out[1])
        self.interior.box(
            (min(first[0], second[0]), min(first[1], second[1]), height[0]),
            (max(first[0], second[0]), max(first[1], second[1]), height[1]),
            finish,
        )

    def occupy(self, side: Side, along: tuple[float, float], depth: float) -> None:
        """Nobody walks where this piece of furniture stands."""
        first, second = self.world(side, along[0], 0.0), self.world(side, along[1], depth)
        self.obstacles.append(
            (min(first[0], second[0]), min(first[1], second[1]),
             max(first[0], second[0]), max(first[1], second[1]))
        )  # fmt: skip


def furnish_randomly(choices: Choices, cameras: Sequence[Camera], shirt: str) -> Furnished:
    """The room of some choices; nothing stands before a camera.

    Args:
        choices: Of the room.
        cameras: Where they hang.
        shirt: What the first person wears, the walls' colour where they are of clothing.
    """
    rng = generator(choices.seed, 1)
    palettes = {"pale": _PALE, "vivid": _VIVID, "skin": _SKIN, "clothing": (shirt, *_CLOTHING[:1])}
    colours = palettes[choices.walls]
    accent = colours[0] if choices.walls == "clothing" else str(rng.choice(colours))
    half = (choices.width / 2.0, choices.depth / 2.0)
    room = Furnished(half, Interior(), accent)
    room.interior.low = (-half[0] - 0.15, -half[1] - 0.15)
    room.interior.high = (half[0] + 0.15, half[1] + 0.15)
    _shell(room, choices, cameras, rng)
    _lights(room, choices, rng)
    if choices.table:
        _table(room, rng)
    _along_the_walls(room, choices, cameras, rng)
    if choices.behaviours.count("lies") > len(room.beds):
        _mat(room, rng)
    return room


def _length(room: Furnished, side: Side) -> float:
    """Half the length of a wall."""
    return room.half[0] if side in ("north", "south") else room.half[1]


def _near_camera(
    room: Furnished, side: Side, along: float, cameras: Sequence[Camera], reach: float
) -> bool:
    x, y = room.world(side, along, 0.2)
    return any(math.hypot(c.centre[0] - x, c.centre[1] - y) < reach for c in cameras)


def _shell(
    room: Furnished, choices: Choices, cameras: Sequence[Camera], rng: np.random.Generator
) -> None:
    (x, y), top = room.half, choices.ceiling
    wide = max(x, y) + HALL + _HALL_LENGTH
    kind = str(rng.choice(["wood", "tiles", "plain", "wood"]))
    floors = ("#a39c90", "#7a5636", "#9a7046", "#5d5a58", "#8d8778", "#b8b0a0", "#4d5a66")
    gloss = 0.5 if kind == "tiles" else 0.3 if kind == "wood" else 0.0
    ground = Finish(kind, str(rng.choice(floors)), seed=choices.seed, gloss=gloss)
    hall, white = Finish("plaster", "#b9b1a4", seed=5), Finish("plain", "#e6e2da")
    solid = room.interior.box
    solid((-wide, -wide, -0.2), (wide, wide, 0.0), ground)
    solid((-wide, -wide, top), (wide, wide, top + 0.2), Finish("ceiling", "#e4e2dc"))
    sides = list(rng.permutation(len(SIDES)))
    doors = int(rng.integers(1, 3))
    plaster = Finish("plaster", room.accent, seed=choices.seed)
    other = Finish("plaster", str(rng.choice(_PALE)), seed=choices.seed + 1)
    for number, index in enumerate(sides):
        side = SIDES[index]
        end = _length(room, side) + WALL
        finish = plaster if choices.walls != "pale" or number % 2 else other
        gap = None
        for _ in range(12):
            if len(room.doorways) >= doors:
                break
            middle = float(rng.uniform(-1.0, 1.0)) * (end - 0.5 * DOOR_WIDTH - 0.4)
            if not _near_camera(room, side, middle, cameras, 0.9):
                gap = middle
                break
        spans = [(-end, end)]
        if gap is not None:
            low, high = gap - DOOR_WIDTH / 2.0, gap + DOOR_WIDTH / 2.0
            spans = [(-end, low), (high, end)]
            room.place(side, (low, high), (-WALL, 0.0), (DOOR_HEIGHT, top), finish)
            for edge in (low, high):
                frame = (edge - 0.05, edge + 0.05)
                room.place(side, frame, (-WALL - 0.015, 0.015), (0.0, DOOR_HEIGHT + 0.05), white)
            above = (DOOR_HEIGHT - 0.02, DOOR_HEIGHT + 0.06)
            room.place(side, (low, high), (-WALL - 0.015, 0.015), above, white)
            first, last = gap - _HALL_LENGTH, gap + _HALL_LENGTH
            deep = -WALL - HALL
            room.place(side, (first, last), (deep - 0.1, deep), (0.0, top), hall)
            for edge in (first, last):
                room.place(side, (edge - 0.05, edge + 0.05), (deep, -WALL), (0.0, top), hall)
            place = room.world(side, gap, -0.6 * HALL)
            room.interior.lamps.append(
                Lamp((*place, top - 0.05), (0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, -1.0),
                     (0.8, 0.74, 0.62), outdoors=True)
            )  # fmt: skip
            inner, outer = np.array(room.world(side, gap, 0.0)), np.array(room.world(side, gap, -1))
            out = outer - inner
            room.doorways.append(
                Doorway((inner[0], inner[1]), (out[0], out[1]), (abs(out[1]), abs(out[0])))
            )
            room.occupy(side, (low, high), 0.0)
        for first, last in spans:
            room.place(side, (first, last), (-WALL, 0.0), (0.0, top), finish)
            if last - first > 0.2:
                room.place(side, (first, last), (0.0, 0.015), (0.0, 0.08), white)


def _lights(room: Furnished, choices: Choices, rng: np.random.Generator) -> None:
    x, y = room.half
    top = choices.ceiling
    tint = np.array(
        [(1.0, 0.97, 0.90), (1.0, 0.88, 0.70), (0.95, 1.0, 1.06)][int(rng.integers(0, 3))]
    )
    # the light of a square metre of floor is the same in every room; the camera exposes for it
    columns, rows = (1, 1) if choices.shadows == "hard" else (1 + (x > 3.0), 1 + (y > 2.4))
    power = 0.55 * (2.0 * x * y + 6.0) / (columns * rows) ** 0.7 * tint / 2.2
    size = 0.09 if choices.shadows == "hard" else 0.55
    shift = rng.uniform(-0.5, 0.5, 2) * [x, y] if choices.shadows == "hard" else np.zeros(2)
    panel, rim = Finish("plain", "#ffffff", glow=2.2), Finish("plain", "#b8b6b0")
    for column in range(columns):
        for row in range(rows):
            cx = shift[0] + (2.0 * (column + 0.5) / columns - 1.0) * x
            cy = shift[1] + (2.0 * (row + 0.5) / rows - 1.0) * y
            a, b = size, max(0.09, 0.5 * size)
            room.interior.box((cx - a - 0.03, cy - b - 0.03, top - 0.012),
                              (cx + a + 0.03, cy + b + 0.03, top + 0.05), rim)  # fmt: skip
            room.interior.box((cx - a, cy - b, top - 0.02), (cx + a, cy + b, top + 0.04), panel)
            room.interior.lamps.append(
                Lamp((cx, cy, top - 0.035), (a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, -1.0),
                     (power[0], power[1], power[2]))
            )  # fmt: skip


def shade_lamps(interior: Interior) -> Float[ndarray, "L 4"]:
    """The room's lamps as they throw shadows on the floor: position and share of its light."""
    lamps = [lamp for lamp in interior.lamps if not lamp.outdoors]
    share = 0.88 if len(lamps) == 1 else 0.9 / len(lamps)
    return np.array([[*lamp.centre, share] for lamp in lamps])


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
            reach = _length(room, side) - 0.5 * widths[kind] - 0.85
            if reach <= 0.0:
                continue
            along = float(rng.uniform(-reach, reach))
            if any(s == side and abs(along - a) < w + 0.5 * widths[kind] for s, a, w in taken):
                continue
            if _near_camera(room, side, along, cameras, 0.5 * widths[kind] + 0.45):
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
