"""A random room before its furniture: walls with doorways, lamps, and where people can be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.rooms.random_rooms.choices import Choices, generator
from tests.rooms.walls.interior import DOOR_HEIGHT, DOOR_WIDTH, WALL, Finish, Interior, Lamp
from tracker.geometry.camera import Camera

Side = Literal["east", "north", "west", "south"]
SIDES: tuple[Side, ...] = ("east", "north", "west", "south")

HALL = 1.3
"""Depth of the corridor behind a doorway, metres."""
_HALL_LENGTH = 2.6
"""From the doorway's middle to each end of its corridor, metres."""

_OVERHEAD = 2.0
"""Metres: nobody stands right before a camera that hangs lower."""
_ASIDE = 0.7

_PALE = ("#cfd2cc", "#dad2c2", "#d8ccb4", "#e2e2de", "#c6ccd2", "#d9d6e0", "#b9bcb6")
_VIVID = ("#4f7f8f", "#8f4a3f", "#5f7a45", "#c7a445", "#6d5a8a", "#3f4a63")
_SKIN = ("#d3a184", "#dcb096", "#c99674", "#e0b79e", "#a8734f")
_CLOTHING = ("#a83a24", "#2450a8", "#3b4048", "#8a7857", "#2d3a55", "#14786f")


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


def build_shell(choices: Choices, cameras: Sequence[Camera], shirt: str) -> Furnished:
    """The empty room of some choices.

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
    for camera in cameras:
        x, y, height = camera.centre
        if height < _OVERHEAD:
            room.obstacles.append((x - _ASIDE, y - _ASIDE, x + _ASIDE, y + _ASIDE))
    _shell(room, choices, cameras, rng)
    _lights(room, choices, rng)
    return room


def length(room: Furnished, side: Side) -> float:
    """Half the length of a wall."""
    return room.half[0] if side in ("north", "south") else room.half[1]


def near_camera(
    room: Furnished, side: Side, along: float, cameras: Sequence[Camera], reach: float
) -> bool:
    """Whether a camera hangs within a distance of a place before a wall."""
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
        end = length(room, side) + WALL
        finish = plaster if choices.walls != "pale" or number % 2 else other
        gap = None
        for _ in range(12):
            if len(room.doorways) >= doors:
                break
            middle = float(rng.uniform(-1.0, 1.0)) * (end - 0.5 * DOOR_WIDTH - 0.4)
            if not near_camera(room, side, middle, cameras, 0.9):
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
