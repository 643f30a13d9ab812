"""Which way is up in the world of a calibration: what people, cameras and the floor say of it.

A detector's boxes lie along the picture's sides, whatever way people stand in it: cameras may be
rolled, and hang upside down. Which side of a box is the head's follows from the poses once the
world's way up is known; where it is not, the few ways that are usual are tried, and the boxes of
several cameras meet only with the right one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from collections.abc import Sequence as Many
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.consensus import Consensus
from tracker.geometry.consistency.observed import Pose
from tracker.geometry.consistency.standing import turn_of
from tracker.io.conventions.reading import UPS, upright
from tracker.io.read.pieces import Up

# Halved and doubled, the constants below leave all interpretations of the random rooms of seeds
# 1300 … 1303 as they are, correct and with one mistake each (camera-to-world poses, y up, frames
# counted from 1, exchanged calibrations).
LEVEL = 6.0
"""Degrees: a world that leans less is taken to be level. Boxes tell no better: cameras that look
down see the top of a head before its middle."""

MOST_ROLL = 4.0
"""Degrees, root mean square: by more cameras are rolled on purpose, or stand on slanting ground."""

LEAST_TURN = 25.0
"""Degrees: cameras that are turned less against each other do not tell which way is up."""


def horizon(
    poses: Sequence[Pose], turns: Sequence[int] | None = None
) -> Float[ndarray, " 3"] | None:
    """The world's direction up, as cameras tell that stand upright: their right is level.

    Args:
        poses: Of the cameras.
        turns: Where up is in each picture, as
            :func:`tracker.geometry.consistency.standing.sides` counts; at the top of all where it
            is not given.

    Returns:
        A unit vector; None where the cameras are rolled otherwise, or look the same way.
    """
    if len(poses) < 3:  # two always agree
        return None
    turns = turns or [0] * len(poses)
    level = np.array([p.rotation[turn % 2] for p, turn in zip(poses, turns, strict=True)])
    _, lengths, axes = np.linalg.svd(level, full_matrices=False)
    lengths = lengths / np.sqrt(len(poses))
    if lengths[2] > np.sin(np.radians(MOST_ROLL)) or lengths[1] < np.sin(np.radians(LEAST_TURN)):
        return None
    ups = [
        p.rotation[1 - turn % 2] * (-1.0 if turn in (0, 3) else 1.0)
        for p, turn in zip(poses, turns, strict=True)
    ]
    return np.asarray(axes[2] * (1.0 if axes[2] @ np.mean(ups, axis=0) >= 0.0 else -1.0))


def upwards(rise: Float[ndarray, " 3"]) -> Up:
    """The axis of the world that is nearest to the way from foot to head."""
    axis = int(np.argmax(np.abs(rise)))
    return UPS[axis + 3 * int(rise[axis] < 0.0)]


def leaning(upward: Float[ndarray, " 3"], least: float = LEVEL) -> tuple[float, float]:
    """A direction up as :attr:`Reading.lean`; 0, 0 below so many degrees: as good as level."""
    if upward[2] > np.cos(np.radians(least)):
        return 0.0, 0.0
    return float(upward[0]), float(upward[1])


def lean_of(
    agreed: Consensus,
    pictured: Float[ndarray, " 3"],
    poses: Sequence[Pose],
    turns: Sequence[int],
    up: Up,
) -> tuple[float, float]:
    """How people stand in a world that is not level, as :attr:`Reading.lean`; 0, 0 where it is.

    Args:
        agreed: What the boxes agree on.
        pictured: From foot to head as boxes alone have it.
        poses: Of the cameras.
        turns: Where heads are in each picture.
        up: The world's axis that is nearest to the way people stand.
    """
    to_world = upright(up)
    rise = to_world @ pictured / np.linalg.norm(pictured)
    if rise[2] > np.cos(np.radians(LEVEL)):
        return 0.0, 0.0
    witness = confirmed(agreed, pictured, poses, turns)
    return (0.0, 0.0) if witness is None else leaning(to_world @ witness)


def confirmed(
    agreed: Consensus,
    pictured: Float[ndarray, " 3"],
    poses: Sequence[Pose],
    turns: Sequence[int],
) -> Float[ndarray, " 3"] | None:
    """The way up on which a second witness agrees with the boxes; None where there is none.

    Boxes alone lean in cameras that are rolled. So a second witness must say the same, and is
    what is taken, being the more exact one: the plane in which people were, or the cameras' level.
    """
    rise = pictured / np.linalg.norm(pictured)
    across = _across(agreed.feet + agreed.rises / 2.0, rise, agreed.height)
    for witness in (across, horizon(poses, turns)):
        if witness is not None and witness @ rise > np.cos(np.radians(2.0 * LEVEL)):
            return witness
    return None


def _across(
    middles: Float[ndarray, "N 3"], rise: Float[ndarray, " 3"], height: float
) -> Float[ndarray, " 3"] | None:
    """The normal of the plane in which the middles of people lie; None where they lie in none."""
    if len(middles) < 3:
        return None
    for _ in range(5):
        centred = middles - np.median(middles, axis=0)
        _, lengths, axes = np.linalg.svd(centred, full_matrices=False)
        off = np.abs(centred @ axes[2])
        middles = middles[off <= 3.0 * np.median(off)]
    spread = lengths / np.sqrt(len(centred))
    if spread[1] < 0.3 * height or spread[1] < 4.0 * spread[2]:
        return None
    return np.asarray(axes[2] * np.sign(axes[2] @ rise))


_NEAR = np.cos(np.radians(40.0))  # boxes lean as much as cameras are rolled, or look down
_BELOW = 0.75  # heights of a person, and
_BELOW_METRES = 1.0  # so much below people's middle no camera stands
_LOOKS_DOWN = 0.3


def turns_tried(poses: Many[Pose]) -> Iterator[tuple[int, ...]]:
    """Where heads may be in the pictures of all cameras: at the top, or as a way up would have it.

    The ways up are the world's axes and what is level to the cameras. Of two opposite ways one
    is tried: with both the same boxes meet.
    """
    ups = [*np.eye(3), horizon(poses), horizon(poses, [1] * len(poses))]
    found = {(0,) * len(poses)}
    yield from found
    for up in ups:
        if up is None:
            continue
        turns = tuple(turn_of(pose.rotation @ up) for pose in poses)
        reverse = tuple((turn + 2) % 4 for turn in turns)
        if turns not in found and reverse not in found:
            found.add(turns)
            yield turns if turns.count(0) >= turns.count(2) else reverse


def standing(agreed: Consensus) -> Float[ndarray, " 3"] | None:
    """The way in which people stand, by which head and foot are found exactly in every box.

    Returns:
        The world's axis that is nearest to how the boxes rise; None where none is near enough to
        be meant.
    """
    if agreed.height <= 0.0:
        return None
    rise = agreed.rise / agreed.height
    axis = np.zeros(3)
    nearest = int(np.argmax(np.abs(rise)))
    axis[nearest] = np.sign(rise[nearest])
    return axis if axis @ rise > _NEAR else None


def upside_down(
    agreed: Consensus, poses: Many[Pose], metres: float, claimed: Float[ndarray, " 3"] | None
) -> bool:
    """Whether the heads that boxes show are feet, since the cameras hang upside down.

    The picture's way up is believed where cameras do not contradict it, and they do where they
    would stand below the people's feet. A way that the file claims is believed where cameras are
    above people and look down by it. Of cameras that are rolled by a quarter nobody knows more.

    Args:
        agreed: What the boxes agree on.
        poses: Of the cameras.
        metres: How long the world's unit may be.
        claimed: The way up that the file claims; None where it claims none.
    """
    if not agreed.agreeing:
        return False
    rise = agreed.rise / agreed.height
    centres = np.array([pose.centre for pose in poses])
    middles = agreed.feet + agreed.rises / 2.0
    above = float(np.median((centres[agreed.cameras] - middles[:, None]) @ rise))
    down = -float(np.mean([pose.rotation[2] @ rise for pose in poses]))
    ups = [pose.rotation @ rise for pose in poses]
    pictured = float(np.mean([-up[1] / max(float(np.linalg.norm(up[:2])), 1e-9) for up in ups]))
    if claimed is not None and abs(claimed @ rise) > _NEAR:
        side = float(np.sign(claimed @ rise))
        if side * (above / agreed.height + down) > _LOOKS_DOWN:
            return side < 0.0
    if above < -_BELOW * agreed.height and above * metres < -_BELOW_METRES:
        return True
    if abs(pictured) < 0.5:
        return above / agreed.height + down < 0.0
    return pictured < 0.0


def reversed_(agreed: Consensus) -> Consensus:
    """The same with heads for feet."""
    return replace(agreed, rise=-agreed.rise, feet=agreed.feet + agreed.rises, rises=-agreed.rises)
