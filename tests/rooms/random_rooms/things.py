"""What else moves in a random room: a screen with a film on, a plant, people in a mirror."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.rooms.cast.people import Body
from tests.rooms.lighting import Placed, Skeleton, place_bodies
from tests.rooms.random_rooms.choices import Choices, generator
from tests.rooms.random_rooms.shell import Furnished
from tests.rooms.scene import Figure, Thing, surface
from tests.rooms.walls.background import AMBIENT
from tests.rooms.walls.textures import TILE, linear

_HEIGHT = 0.30
"""Half height of a screen's picture, metres."""


@dataclass(frozen=True, slots=True, eq=False)
class Screen:
    """A picture that changes: soft blobs of colour that wander, and a cut now and then."""

    body: Body
    light: Float[ndarray, "F V 3"]

    def placed(self, steps: slice, lamps: Float[ndarray, "L 9"]) -> Placed:
        """It hangs still, and gives its own light."""
        light = self.light[steps]
        world = np.broadcast_to(self.body.vertices, light.shape)
        return Placed(np.ascontiguousarray(world), light.astype(np.float32))

    def drawn(self, steps: slice) -> Bool[ndarray, " F"]:
        """Always."""
        return np.ones(len(self.light[steps]), dtype=bool)


@dataclass(frozen=True, slots=True, eq=False)
class Plant:
    """Leaves that sway, the more the higher they are."""

    body: Body
    sway: Float[ndarray, "F V 3"]
    """Metres from where each vertex hangs in still air."""

    def placed(self, steps: slice, lamps: Float[ndarray, "L 9"]) -> Placed:
        """The leaves, lit as they hang in still air."""
        still = Skeleton(np.zeros((1, 3)), np.eye(3)[None, None], np.zeros((1, 1, 3)))
        placed = place_bodies(surface(self.body), still, lamps, AMBIENT)
        sway = self.sway[steps]
        light = np.ascontiguousarray(np.broadcast_to(placed.light, sway.shape))
        return Placed(placed.world + sway, light)

    def drawn(self, steps: slice) -> Bool[ndarray, " F"]:
        """Always."""
        return np.ones(len(self.sway[steps]), dtype=bool)


@dataclass(frozen=True, slots=True, eq=False)
class Reflection:
    """A person behind a mirror's glass, where its image is."""

    body: Body
    """With its triangles turned round, as a mirror turns them."""
    figure: Figure
    axis: int
    plane: float
    """Metres along the axis."""

    def placed(self, steps: slice, lamps: Float[ndarray, "L 9"]) -> Placed:
        """Mirrored, in the light of who stands before the glass."""
        placed = self.figure.placed(steps, lamps)
        world = placed.world.copy()
        world[:, :, self.axis] = 2.0 * self.plane - world[:, :, self.axis]
        return Placed(world, placed.light * np.float32(0.9))

    def drawn(self, steps: slice) -> Bool[ndarray, " F"]:
        """Whenever the person is there, before the glass."""
        side = self.figure.centres[steps, self.axis] - self.plane
        return np.asarray(self.figure.drawn[steps] & (side * np.sign(-self.plane) > 0.05))


def things(choices: Choices, room: Furnished, figures: tuple[Figure, ...]) -> tuple[Thing, ...]:
    """All of them."""
    rng = generator(choices.seed, 5)
    found: list[Thing] = []
    if room.screen is not None:
        found.append(_screen(choices, room, rng))
    if room.plant is not None:
        found.append(_plant(choices, room.plant, rng))
    if room.mirror is not None:
        side, plane = room.mirror
        axis = 1 if side in ("north", "south") else 0
        found += [Reflection(_turned(f.body), f, axis, plane) for f in figures]
    return tuple(found)


def _turned(body: Body) -> Body:
    return Body(
        body.vertices, body.normals, body.texture_points, body.bones, body.shares, body.openness,
        np.ascontiguousarray(body.triangles[:, ::-1]), body.texture,
    )  # fmt: skip


def _mesh(vertices: ndarray, normals: ndarray, triangles: ndarray, colour: str) -> Body:
    count = len(vertices)
    return Body(
        vertices,
        normals,
        np.full((count, 2), TILE / 2.0),
        np.zeros((count, 2), dtype=np.int32),
        np.zeros(count),
        np.full(count, 0.85),
        triangles.astype(np.int32),
        np.broadcast_to(linear(colour), (TILE, TILE, 3)).copy(),
    )


def _screen(choices: Choices, room: Furnished, rng: np.random.Generator) -> Screen:
    assert room.screen is not None
    side, middle, out, height, half = room.screen
    columns, rows = 17, 11
    u, v = np.meshgrid(np.linspace(-1.0, 1.0, columns), np.linspace(-1.0, 1.0, rows))
    vertices = np.array(
        [
            (*room.world(side, middle + half * a, out), height + _HEIGHT * b)
            for a, b in zip(u.ravel(), v.ravel(), strict=True)
        ]
    )
    near, far = room.world(side, middle, 1.0), room.world(side, middle, 0.0)
    normal = np.array([near[0] - far[0], near[1] - far[1], 0.0])
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangles = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    first = vertices[triangles[0]]
    if np.cross(first[1] - first[0], first[2] - first[0]) @ normal < 0.0:
        triangles = triangles[:, ::-1]
    times = np.arange(choices.steps) / choices.fps
    light = np.zeros((choices.steps, rows * columns, 3))
    scene = np.cumsum(rng.random(choices.steps) < 0.35 / choices.fps)
    for shot in np.unique(scene):
        on = scene == shot
        light[on] += rng.uniform(0.02, 0.3, 3)
        for _ in range(5):
            colour, size = rng.uniform(0.0, 1.1, 3), rng.uniform(0.2, 0.7)
            pace, start = rng.uniform(0.3, 2.2, 2), rng.uniform(0.0, 6.3, 2)
            x, y = np.sin(pace[0] * times[on] + start[0]), np.sin(pace[1] * times[on] + start[1])
            squared = (u.ravel() - x[:, None]) ** 2 + (0.6 * (v.ravel() - y[:, None])) ** 2
            light[on] += np.exp(-squared / size**2)[:, :, None] * colour
    normals = np.broadcast_to(normal, vertices.shape).copy()
    return Screen(_mesh(vertices, normals, triangles, "#ffffff"), 0.55 * light)


def _plant(choices: Choices, place: tuple[float, float], rng: np.random.Generator) -> Plant:
    vertices: list[ndarray] = []
    normals: list[ndarray] = []
    triangles: list[ndarray] = []
    phases: list[ndarray] = []
    for number in range(46):
        yaw = 2.4 * number + float(rng.uniform(-0.3, 0.3))
        rise = 0.42 + 0.018 * number + float(rng.uniform(-0.04, 0.04))
        away = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        across = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
        droop = float(rng.uniform(-0.5, 0.5))
        base = np.array([*place, rise]) + 0.05 * away
        along = away + np.array([0.0, 0.0, droop])
        long, wide = float(rng.uniform(0.2, 0.34)), float(rng.uniform(0.03, 0.055))
        shares = ((0.0, 0.0), (0.35, 1.0), (0.35, -1.0), (0.75, 0.7), (0.75, -0.7), (1.0, 0.0))
        leaf = np.array([base + long * s * along + wide * w * across for s, w in shares])
        up = np.cross(along, across)
        up /= np.linalg.norm(up)
        for sign in (1.0, -1.0):  # both faces of a leaf
            faces = np.array([[0, 2, 1], [1, 2, 4], [1, 4, 3], [3, 4, 5]])
            start = 6 * len(vertices)  # of the leaves so far
            first = leaf[faces[0]]
            outward = np.cross(first[1] - first[0], first[2] - first[0]) @ (sign * up) > 0.0
            triangles.append((faces if outward else faces[:, ::-1]) + start)
            vertices.append(leaf)
            normals.append(np.tile(sign * up, (len(leaf), 1)))
            phases.append(np.full(len(leaf), float(rng.uniform(0.0, 6.3)) if sign > 0 else np.nan))
            if sign < 0:
                phases[-1][:] = phases[-2][0]
    places = np.concatenate(vertices)
    times = np.arange(choices.steps)[:, None] / choices.fps
    phase = np.concatenate(phases)
    gust = 0.6 + 0.4 * np.sin(0.9 * times + rng.uniform(0.0, 6.3))
    amount = 0.075 * np.maximum(places[:, 2] - 0.35, 0.0) * gust
    sway = np.stack(
        [
            amount * np.sin(4.2 * times + phase),
            amount * np.sin(3.1 * times + 1.7 * phase),
            0.3 * amount * np.sin(5.3 * times + phase),
        ],
        axis=2,
    )
    body = _mesh(places, np.concatenate(normals), np.concatenate(triangles), "#3d6b33")
    return Plant(body, sway)
