"""A scene over time, before any picture: bodies, bones, doors, truth, shadows' balls."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tests.rooms.cast.doors import leaf, leaf_angle, leaf_hinge
from tests.rooms.cast.gait import (
    CHEST,
    FOOT,
    FOREARM,
    HEAD,
    JOINTS,
    PELVIS,
    SHIN,
    STATURE,
    THIGH,
    UPPER_ARM,
    Poses,
    pose,
)
from tests.rooms.cast.paths import Path, walk
from tests.rooms.cast.people import Body, build
from tests.rooms.lighting import Placed, Skeleton, Surface, place_bodies
from tests.rooms.rooms import TARGET_HALF_EXTENTS, VOLUME_MAXIMUM, VOLUME_MINIMUM, RoomSpec
from tests.rooms.walls.background import AMBIENT
from tests.rooms.walls.interior import FAR, RIGHT


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """One person of a scene over all its steps."""

    body: Body
    path: Path
    poses: Poses
    rest: Float[ndarray, "B 3"]
    """Joints of the upright body."""
    centres: Float[ndarray, "F 3"]
    """The middle of the target box around head and torso, metres."""
    inside: Bool[ndarray, " F"]
    """Whether that middle is in the tracking volume: the steps of the truth."""
    drawn: Bool[ndarray, " F"]
    """Whether any of the person can be in a picture."""

    def placed(self, steps: slice, lamps: Float[ndarray, "L 9"]) -> Placed:
        """The body as it stands and is lit at some steps."""
        bones = Skeleton(
            self.rest,
            np.ascontiguousarray(self.poses.rotations[steps]),
            np.ascontiguousarray(self.poses.joints[steps]),
        )
        return place_bodies(surface(self.body), bones, lamps, AMBIENT)


class Thing(Protocol):
    """Something other than a person that moves or changes, over all steps of a scene."""

    @property
    def body(self) -> Body:
        """Its mesh and what that is covered with."""
        ...

    def placed(self, steps: slice, lamps: Float[ndarray, "L 9"]) -> Placed:
        """The mesh as it stands and is lit at some steps."""
        ...

    def drawn(self, steps: slice) -> Bool[ndarray, " F"]:
        """At which of some steps it can be in a picture."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Leaf:
    """A door's leaf over all steps of a scene."""

    body: Body
    hinge: Float[ndarray, " 3"]
    angle: Float[ndarray, " F"]
    """Radians about the vertical through the hinge, from the world's x axis."""

    def placed(self, steps: slice, lamps: Float[ndarray, "L 9"]) -> Placed:
        """The leaf, turned about its hinge."""
        angle = self.angle[steps]
        c, s, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
        turned = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=1)
        bones = Skeleton(
            np.zeros((1, 3)),
            np.ascontiguousarray(turned.reshape(-1, 1, 3, 3)),
            np.tile(self.hinge, (len(angle), 1, 1)),
        )
        return place_bodies(surface(self.body), bones, lamps, AMBIENT)

    def drawn(self, steps: slice) -> Bool[ndarray, " F"]:
        """Always."""
        return np.ones(len(self.angle[steps]), dtype=bool)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Everything that moves."""

    frames: int
    figures: tuple[Figure, ...]
    things: tuple[Thing, ...]


def surface(body: Body) -> Surface:
    """A body as the kernels take it."""
    return Surface(body.vertices, body.normals, body.bones, body.shares, body.openness)


def script(spec: RoomSpec) -> Scene:
    """Play a room's script over all its steps, without rendering anything."""
    figures = []
    for number, person in enumerate(spec.people):
        scale = person.look.stature / STATURE
        path = walk(person.waypoints, person.facings, spec.frames, leg=0.83 * scale)
        poses = pose(path, person.look.stature, seed=100 * (number + 1))
        middle = (poses.joints[:, PELVIS, :2] + poses.joints[:, HEAD, :2]) / 2.0
        centres = np.column_stack([middle, poses.top - TARGET_HALF_EXTENTS[2]])
        held = (centres >= VOLUME_MINIMUM) & (centres <= VOLUME_MAXIMUM)
        inside = np.asarray(held.all(axis=1))
        first, last = person.waypoints[0][0], person.waypoints[-1][0]
        steps = np.arange(spec.frames)
        drawn = np.asarray((steps >= first) & ((steps <= last) | inside))
        # in the corridor a closed door hides the person from every camera
        rest = JOINTS * scale * np.array([person.look.build, person.look.build, 1.0])
        figures.append(Figure(build(person.look), path, poses, rest, centres, inside, drawn))
    leaves = []
    for hinge, closed, opened, openings in (
        (*leaf_hinge("back", spec.back_door, FAR), spec.back_openings),
        (*leaf_hinge("front", spec.front_door, RIGHT), spec.front_openings),
    ):
        angle = leaf_angle(spec.frames, closed, opened, openings)
        leaves.append(Leaf(leaf(), hinge, angle))
    return Scene(spec.frames, tuple(figures), tuple(leaves))


def shadow_balls(figure: Figure, steps: slice) -> Float[ndarray, "F 15 4"]:
    """A person as fifteen balls (centre, radius), radius 0 where it is not drawn."""
    joints = figure.poses.joints[steps]
    down = np.array([0.0, 0.0, 1.0])
    parts: list[tuple[ndarray, float]] = [
        (joints[:, PELVIS], 0.15),
        (joints[:, CHEST] + 0.20 * down, 0.16),
        (joints[:, HEAD] + 0.12 * down, 0.10),
    ]
    for side in range(2):
        upper, fore = joints[:, UPPER_ARM[side]], joints[:, FOREARM[side]]
        turned = figure.poses.rotations[steps, FOREARM[side]]
        thigh, knee = joints[:, THIGH[side]], joints[:, SHIN[side]]
        ankle = joints[:, FOOT[side]]
        ahead = figure.poses.rotations[steps, FOOT[side], :, 0]
        parts += [
            ((upper + fore) / 2.0, 0.06),
            (fore - 0.16 * turned[:, :, 2], 0.05),
            ((thigh + knee) / 2.0, 0.085),
            (knee, 0.065),
            ((knee + ankle) / 2.0, 0.06),
            (ankle + 0.05 * ahead - 0.03 * down, 0.07),
        ]
    balls = np.empty((len(joints), len(parts), 4))
    for number, (centre, radius) in enumerate(parts):
        balls[:, number, :3] = centre
        balls[:, number, 3] = np.where(figure.drawn[steps], radius, 0.0)
    return balls
