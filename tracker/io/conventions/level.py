"""Which way is up in the world of a calibration: what people, cameras and the floor say of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.consensus import Consensus
from tracker.geometry.consistency.observed import Pose
from tracker.io.conventions.reading import UPS, upright
from tracker.io.read.pieces import Up

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
