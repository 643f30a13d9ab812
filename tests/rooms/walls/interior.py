"""What stands in a rendered room: walls with doors and a window, lamps, furniture, as solids."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray

from tests.rooms.rays import BALL, BOX, CYLINDER

LEFT, RIGHT, NEAR, FAR, CEILING = -2.1, 2.1, -3.45, 1.8, 2.7
"""The room's inner faces, metres."""
WALL = 0.12
"""Thickness of a wall, metres."""
DOOR_HEIGHT, DOOR_WIDTH = 2.05, 0.9


@dataclass(frozen=True, slots=True)
class Finish:
    """How the surface of a solid looks."""

    kind: str
    """A painter of ``background.py``."""
    colour: str
    second: str = "#000000"
    seed: int = 0
    glow: float = 0.0
    """Light that it gives off itself."""
    gloss: float = 0.0
    """Share of mirrored light at grazing view."""


@dataclass(frozen=True, slots=True)
class Solid:
    """A box, ball or cylinder, turned about the vertical and then tilted about its own axes."""

    kind: int
    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    finish: Finish
    yaw: float = 0.0
    tilt: float = 0.0
    """Radians about the own y axis."""

    def rotation(self) -> ndarray:
        """From the own axes to the world."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        e, d = math.cos(self.tilt), math.sin(self.tilt)
        about_z = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        about_y = np.array([[e, 0.0, d], [0.0, 1.0, 0.0], [-d, 0.0, e]])
        return np.asarray(about_z @ about_y)


@dataclass(frozen=True, slots=True)
class Lamp:
    """A flat light source."""

    centre: tuple[float, float, float]
    first: tuple[float, float, float]
    """Half of one side, a vector in metres."""
    second: tuple[float, float, float]
    direction: tuple[float, float, float]
    power: tuple[float, float, float]
    """Irradiance by colour that the whole lamp gives one metre below it."""
    outdoors: bool = False
    """Whether it lights a corridor and not the room."""


@dataclass(frozen=True, slots=True)
class Decor:
    """The choices that tell one room from another."""

    walls: str
    accent: str
    """Colour of the far wall."""
    floor: str
    """wood or tiles."""
    floor_colour: str
    rug: tuple[str, str] | None
    armchair: str
    cushion: str
    cabinet: str
    seed: int
    daylight: float = 1.0
    bookcase: bool = True
    console: bool = True


@dataclass(slots=True)
class Interior:
    """All solids and lamps of a room."""

    solids: list[Solid] = field(default_factory=list)
    lamps: list[Lamp] = field(default_factory=list)
    low: tuple[float, float] = (-math.inf, -math.inf)
    high: tuple[float, float] = (RIGHT + 0.15, FAR + 0.15)
    """x and y beyond which there are only corridors, with little of the room's light."""

    def box(
        self,
        low: tuple[float, float, float],
        high: tuple[float, float, float],
        finish: Finish,
        *,
        yaw: float = 0.0,
    ) -> None:
        """A box by its corners, turned about its own upright axis."""
        centre = tuple((a + b) / 2.0 for a, b in zip(low, high, strict=True))
        half = tuple((b - a) / 2.0 for a, b in zip(low, high, strict=True))
        self.solids.append(
            Solid(BOX, (centre[0], centre[1], centre[2]), (half[0], half[1], half[2]), finish, yaw)
        )

    def round(
        self,
        kind: int,
        centre: tuple[float, float, float],
        half: tuple[float, float, float],
        finish: Finish,
        *,
        yaw: float = 0.0,
        tilt: float = 0.0,
    ) -> None:
        """A ball or a cylinder."""
        self.solids.append(Solid(kind, centre, half, finish, yaw, tilt))


def furnish(decor: Decor, back_door: float, front_door: float) -> Interior:
    """The room: the back door in the far wall at x, the front door in the right wall at y."""
    room = Interior()
    _shell(room, decor, back_door, front_door)
    _lights(room, decor)
    _furniture(room, decor)
    return room


def _shell(room: Interior, decor: Decor, back_door: float, front_door: float) -> None:
    plaster = Finish("plaster", decor.walls, seed=decor.seed)
    accent = Finish("plaster", decor.accent, seed=decor.seed + 1)
    hall = Finish("plaster", "#b9b1a4", seed=5)
    white = Finish("plain", "#e6e2da")
    ground = Finish(decor.floor, decor.floor_colour, seed=decor.seed, gloss=0.5)
    room.box((-4.5, -4.0, -0.2), (4.5, 4.0, 0.0), ground)
    room.box((-4.5, -4.0, CEILING), (4.5, 4.0, CEILING + 0.2), Finish("ceiling", "#e4e2dc"))
    room.box((LEFT - WALL, NEAR - WALL, 0.0), (LEFT, FAR, CEILING), plaster)
    room.box((LEFT, NEAR - WALL, 0.0), (RIGHT, NEAR, CEILING), plaster)
    half = DOOR_WIDTH / 2.0
    far, outer = FAR, FAR + WALL
    a, b = back_door - half, back_door + half
    c, d = 0.80, 1.72  # the window
    room.box((LEFT - WALL, far, 0.0), (a, outer, CEILING), accent)
    room.box((a, far, DOOR_HEIGHT), (b, outer, CEILING), accent)
    room.box((b, far, 0.0), (c, outer, CEILING), accent)
    room.box((c, far, 0.0), (d, outer, 1.0), accent)
    room.box((c, far, 2.12), (d, outer, CEILING), accent)
    room.box((d, far, 0.0), (RIGHT + WALL, outer, CEILING), accent)
    e, f = front_door - half, front_door + half
    room.box((RIGHT, NEAR - WALL, 0.0), (RIGHT + WALL, e, CEILING), plaster)
    room.box((RIGHT, e, DOOR_HEIGHT), (RIGHT + WALL, f, CEILING), plaster)
    room.box((RIGHT, f, 0.0), (RIGHT + WALL, FAR, CEILING), plaster)
    # corridors behind the doors
    room.box((-2.3, 3.2, 0.0), (2.0, 3.3, CEILING), hall)
    room.box((-2.4, outer, 0.0), (-2.3, 3.3, CEILING), hall)
    room.box((1.9, outer, 0.0), (2.0, 3.3, CEILING), hall)
    room.box((3.5, -2.2, 0.0), (3.6, 1.9, CEILING), hall)
    room.box((RIGHT + WALL, -2.3, 0.0), (3.6, -2.2, CEILING), hall)
    room.box((RIGHT + WALL, 1.8, 0.0), (3.6, 1.9, CEILING), hall)
    # frames
    w, out, lip = 0.06, 0.02, 0.012
    beyond = RIGHT + WALL + lip
    room.box((a - w, far - out, 0.0), (a + lip, outer + lip, DOOR_HEIGHT + w), white)
    room.box((b - lip, far - out, 0.0), (b + w, outer + lip, DOOR_HEIGHT + w), white)
    room.box((a, far - out, DOOR_HEIGHT - lip), (b, outer + lip, DOOR_HEIGHT + w), white)
    room.box((RIGHT - out, e - w, 0.0), (beyond, e + lip, DOOR_HEIGHT + w), white)
    room.box((RIGHT - out, f - lip, 0.0), (beyond, f + w, DOOR_HEIGHT + w), white)
    room.box((RIGHT - out, e, DOOR_HEIGHT - lip), (beyond, f, DOOR_HEIGHT + w), white)
    # skirting boards
    room.box((LEFT, NEAR, 0.0), (LEFT + 0.015, FAR, 0.09), white)
    room.box((LEFT, far - 0.015, 0.0), (a - w, far, 0.09), white)
    room.box((b + w, far - 0.015, 0.0), (RIGHT, far, 0.09), white)
    room.box((RIGHT - 0.015, NEAR, 0.0), (RIGHT, e - w, 0.09), white)
    room.box((RIGHT - 0.015, f + w, 0.0), (RIGHT, FAR, 0.09), white)
    # the window: the view outside, a frame with a bar, a sill, a half-drawn blind
    outside = Finish("outside", "#dfe8ee", seed=decor.seed, glow=1.5 * decor.daylight)
    room.box((c, outer - 0.02, 1.0), (d, outer, 2.12), outside)
    middle = (c + d) / 2.0
    for left, right in ((c, c + 0.05), (middle - 0.025, middle + 0.025), (d - 0.05, d)):
        room.box((left, far + 0.03, 1.0), (right, outer - 0.02, 2.12), white)
    room.box((c, far + 0.03, 1.0), (d, outer - 0.02, 1.05), white)
    room.box((c - 0.06, far - 0.10, 0.965), (d + 0.06, far + 0.05, 1.0), white)
    room.box((c, far + 0.01, 1.84), (d, far + 0.03, 2.12), Finish("slats", "#d8d4ca"))
    room.box((0.95, far - 0.09, 0.18), (1.62, far - 0.01, 0.82), Finish("ribs", "#dcdad4"))


def _lights(room: Interior, decor: Decor) -> None:
    panel = Finish("plain", "#ffffff", glow=2.2)
    rim = Finish("plain", "#b8b6b0")
    for y in (-1.75, 0.35):
        room.box((-0.62, y - 0.32, CEILING - 0.012), (0.62, y + 0.32, CEILING + 0.05), rim)
        room.box((-0.6, y - 0.3, CEILING - 0.015), (0.6, y + 0.3, CEILING + 0.04), panel)
        room.lamps.append(
            Lamp(
                (0.0, y, CEILING - 0.03),
                (0.6, 0.0, 0.0),
                (0.0, 0.3, 0.0),
                (0.0, 0.0, -1.0),
                (2.05, 1.98, 1.84),
            )
        )
    day = 1.25 * decor.daylight
    room.lamps.append(
        Lamp(
            (1.26, FAR - 0.02, 1.45),
            (0.40, 0.0, 0.0),
            (0.0, 0.0, 0.40),
            (0.0, -1.0, 0.0),
            (0.90 * day, 1.0 * day, 1.14 * day),
        )
    )
    for x, y in ((-0.6, 2.6), (2.9, -0.3)):  # dimmer lamps in the corridors
        room.lamps.append(
            Lamp(
                (x, y, CEILING - 0.05),
                (0.3, 0.0, 0.0),
                (0.0, 0.3, 0.0),
                (0.0, 0.0, -1.0),
                (0.80, 0.72, 0.58),
                outdoors=True,
            )
        )


def _furniture(room: Interior, decor: Decor) -> None:
    wood = Finish("veneer", decor.cabinet, seed=decor.seed + 2, gloss=0.25)
    steel = Finish("plain", "#55575a", gloss=0.4)
    dark = Finish("plain", "#1d1e20", gloss=0.5)
    _armchair(room, decor)
    if decor.bookcase:
        books = Finish("books", "#7a5230", seed=decor.seed + 3)
        room.box((-2.08, 1.52, 0.0), (-1.12, 1.79, 1.86), wood)
        for shelf in range(5):
            low = 0.08 + 0.355 * shelf
            room.box((-2.04, 1.505, low), (-1.16, 1.55, low + 0.32), books)
    # low cabinet with doors, a vase and a stack of paper
    room.box((1.66, 0.66, 0.06), (2.08, 1.48, 0.80), wood)
    room.box((1.69, 0.69, 0.0), (2.08, 1.45, 0.06), dark)
    for y in (0.68, 1.08):
        room.box((1.645, y, 0.10), (1.67, y + 0.38, 0.77), wood)
        room.box((1.63, y + (0.33 if y < 1 else 0.03), 0.40), (1.645, y + 0.36, 0.50), steel)
    room.round(CYLINDER, (1.86, 1.28, 0.90), (0.06, 0.06, 0.10), Finish("plain", "#3f6a73"))
    room.round(BALL, (1.86, 1.28, 0.88), (0.085, 0.085, 0.08), Finish("plain", "#3f6a73"))
    room.box((1.75, 0.78, 0.80), (1.96, 1.02, 0.83), Finish("plain", "#e9e6dd"), yaw=0.2)
    if decor.console:
        room.box((1.66, -1.62, 0.70), (2.09, -0.72, 0.735), wood)
        for x, y in ((1.69, -1.58), (1.69, -0.79), (2.04, -1.58), (2.04, -0.79)):
            room.box((x, y, 0.0), (x + 0.04, y + 0.04, 0.70), steel)
        room.box((1.74, -1.36, 0.735), (1.97, -1.04, 0.75), dark)
        room.box((1.975, -1.37, 0.75), (1.99, -1.03, 0.97), Finish("screen", "#2b5f88", glow=0.25))
        room.round(CYLINDER, (1.92, -0.86, 0.76), (0.055, 0.055, 0.02), steel)
        room.round(CYLINDER, (1.92, -0.86, 0.92), (0.010, 0.010, 0.15), steel)
        room.round(CYLINDER, (1.92, -0.86, 1.10), (0.085, 0.085, 0.06), Finish("plain", "#e4d9b8"))
    plant(room, 1.86, 1.62, decor.seed)
    # on the walls
    frame = Finish("plain", "#2a2622")
    for number, (y, z, width, height) in enumerate(
        ((-0.82, 1.52, 0.34, 0.25), (0.52, 1.62, 0.26, 0.34))
    ):
        room.box((LEFT, y - width, z - height), (LEFT + 0.022, y + width, z + height), frame)
        art = Finish("picture", "#88a0b0", seed=decor.seed + 7 + number)
        inner = 0.035
        room.box(
            (LEFT + 0.005, y - width + inner, z - height + inner),
            (LEFT + 0.026, y + width - inner, z + height - inner),
            art,
        )
    room.box((RIGHT - 0.02, 0.78, 1.22), (RIGHT, 1.56, 1.78), Finish("plain", "#9a9c9e"))
    room.box((RIGHT - 0.024, 0.80, 1.24), (RIGHT - 0.01, 1.54, 1.76), Finish("board", "#eef0ef"))
    room.round(BALL, (-0.86, FAR, 2.28), (0.14, 0.03, 0.14), Finish("plain", "#20242a"))
    room.round(BALL, (-0.86, FAR - 0.012, 2.28), (0.125, 0.026, 0.125), Finish("clock", "#f1efe8"))
    room.box((0.42, FAR - 0.015, 1.12), (0.50, FAR, 1.20), Finish("plain", "#efece4"))
    if decor.rug is not None:
        first, second = decor.rug
        room.box((-1.05, -0.95, 0.0), (0.95, 0.55, 0.003), Finish("rug", first, second, seed=4))


def _armchair(room: Interior, decor: Decor) -> None:
    cloth = Finish("fabric", decor.armchair, seed=decor.seed + 4)
    legs = Finish("plain", "#3a2a1e")
    y0, y1 = 0.02, 0.98
    room.box((-2.06, y0, 0.12), (-1.56, y1, 0.40), cloth)
    room.box((-2.08, y0, 0.12), (-1.88, y1, 0.88), cloth)
    for y in (y0, y1 - 0.16):
        room.box((-2.06, y, 0.12), (-1.54, y + 0.16, 0.54), cloth)
        room.round(BALL, (-1.80, y + 0.08, 0.55), (0.27, 0.085, 0.06), cloth)
    room.round(BALL, (-1.74, 0.5, 0.42), (0.22, 0.31, 0.09), cloth)
    room.round(BALL, (-1.97, 0.5, 0.86), (0.11, 0.46, 0.08), cloth)
    room.round(
        BALL,
        (-1.80, 0.52, 0.62),
        (0.07, 0.20, 0.17),
        Finish("fabric", decor.cushion, seed=9),
        tilt=-0.25,
    )
    for x in (-2.0, -1.6):
        for y in (y0 + 0.06, y1 - 0.10):
            room.box((x, y, 0.0), (x + 0.04, y + 0.04, 0.12), legs)


def plant(room: Interior, x: float, y: float, seed: int) -> None:
    """A plant in a pot."""
    room.round(CYLINDER, (x, y, 0.16), (0.13, 0.13, 0.16), Finish("plain", "#8d8a84"))
    room.round(CYLINDER, (x, y, 0.31), (0.115, 0.115, 0.015), Finish("plain", "#2c2119"))
    rng = np.random.default_rng(seed)
    for number in range(15):
        yaw = 2.4 * number + float(rng.uniform(-0.3, 0.3))
        rise = 0.45 + 0.05 * number + float(rng.uniform(-0.03, 0.03))
        out = float(rng.uniform(0.05, 0.13))
        place = (x + out * math.cos(yaw), y + out * math.sin(yaw) * 0.8, rise)
        shade = ("#2f5a2b", "#3d6b33", "#274d2c")[number % 3]
        room.round(
            BALL,
            place,
            (0.15, 0.045, 0.012),
            Finish("plain", shade, gloss=0.2),
            yaw=yaw,
            tilt=float(rng.uniform(-1.0, -0.35)),
        )
