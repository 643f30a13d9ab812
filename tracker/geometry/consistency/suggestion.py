"""Room, floor and size of people, worked out where a recording does not state them."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.consensus import Consensus, consensus
from tracker.geometry.consistency.observed import Rays, pair_up, pose_of

STANDING = np.array([0.3, 0.3, 0.85])
"""Half extents of a standing person, metres: what is tracked where nothing is known."""

LEAST_AGREEING = 20
"""Fewer pairs of boxes that meet say nothing of room and people."""

_SHORTEST_STANDING, _TALLEST_STANDING = 1.45, 2.3  # metres, of boxes: a detector's may be padded
_USUAL_HEIGHT, _TRUST = 1.70, 0.3  # of people who stand; what a box's height says against it
_USUAL_SLENDERNESS = 0.36  # width of a standing person's box, as the model has it, by its height
_MARGIN = 0.5  # metres around where feet were seen
_OUTLIERS = 0.01  # share on either side
_FARTHEST = 30.0  # metres: where views overlap farther away nobody can be told apart


@dataclass(frozen=True, slots=True, eq=False)
class Suggestion:
    """What the boxes, or the cameras alone, tell of the room and of who is in it."""

    minimum: Float[ndarray, " 3"]
    """Of the room, metres."""
    maximum: Float[ndarray, " 3"]
    half_extents: Float[ndarray, " 3"]
    """Of what is tracked, metres."""
    floor: float
    """z of what people stand on, metres."""
    people: int
    """Pairs of boxes that it was made from; 0 where it follows from the cameras alone."""


def agreement(cameras: Many[Camera], rays: Many[Rays], most_pairs: int = 20_000) -> Consensus:
    """What the boxes of calibrated cameras agree on, metres.

    Args:
        cameras: Where they stand.
        rays: Of each camera's boxes, in its own axes.
        most_pairs: Of boxes of two cameras.
    """
    count = len(cameras)
    pairs = {
        (a, b): found
        for a in range(count)
        for b in range(a + 1, count)
        if (found := pair_up(rays[a], rays[b], most_pairs)).most
    }
    return consensus(rays, [pose_of(camera) for camera in cameras], pairs)


def suggest(
    cameras: Many[Camera],
    agreed: Consensus | None,
    half_extents: Float[ndarray, " 3"] | None = None,
) -> Suggestion | None:
    """A room in which everybody is, and how large they are.

    The room reaches from the floor to above the heads, and by half a metre around where feet
    were seen. Boxes end lower than feet: detectors pad them, and seen from above their lower
    edge is at the toe that is nearest. Their middle has no such fault, so the floor is sought
    half a person below it, and a person who stands is taken to be nearer to 1.70 m than the
    boxes are. Without boxes the room is where the views of two cameras overlap.

    Args:
        cameras: In metres, z up.
        agreed: What their boxes agree on; None without boxes.
        half_extents: Of what is tracked, where it is known.

    Returns:
        None where neither boxes nor views meet.
    """
    if agreed is None or agreed.agreeing < LEAST_AGREEING:
        return _from_views(cameras, half_extents)
    size = _size(agreed) if half_extents is None else np.asarray(half_extents, dtype=float)
    middles = agreed.feet + agreed.rises / 2.0
    low, high = np.quantile(middles, [_OUTLIERS, 1.0 - _OUTLIERS], axis=0)
    floor = float(np.median(middles[:, 2])) - float(size[2])
    if stands(agreed.height):
        bottom, top = floor, floor + max(2.0, 2.5 * float(size[2]))
    else:  # heads, people at tables: how far below them the floor is nobody knows
        floor = bottom = low[2] - 2.0 * float(size[2])
        top = high[2] + 2.0 * float(size[2])
    minimum = np.array([*(low[:2] - _MARGIN), bottom])
    maximum = np.array([*(high[:2] + _MARGIN), top])
    return Suggestion(
        np.floor(minimum * 10.0) / 10.0,
        np.ceil(maximum * 10.0) / 10.0,
        np.round(size, 3),
        floor,
        agreed.agreeing,
    )


def stands(height: float) -> bool:
    """Whether boxes so tall, metres, are of people who stand."""
    return _SHORTEST_STANDING <= height <= _TALLEST_STANDING


def _size(agreed: Consensus) -> Float[ndarray, " 3"]:
    height = agreed.height
    if stands(height):
        height = _USUAL_HEIGHT + _TRUST * (height - _USUAL_HEIGHT)
        return np.array([_USUAL_SLENDERNESS / 2.0, _USUAL_SLENDERNESS / 2.0, 0.5]) * height
    # a head, or a head with shoulders, is less slender than a whole person
    broad = 0.35 if height < 0.5 else 0.25
    return np.array([broad, broad, 0.5]) * height


def _from_views(
    cameras: Many[Camera], half_extents: Float[ndarray, " 3"] | None
) -> Suggestion | None:
    """Where two cameras see the same place, between the floor at z = 0 and 2 m."""
    size = STANDING if half_extents is None else half_extents
    centres = np.array([camera.centre for camera in cameras])
    low, high = centres.min(axis=0) - _FARTHEST, centres.max(axis=0) + _FARTHEST
    ground = np.stack(
        np.meshgrid(*(np.arange(a, b, 0.5) for a, b in zip(low[:2], high[:2], strict=True))),
        axis=-1,
    ).reshape(-1, 2)
    seen = np.zeros(len(ground), dtype=int)
    for camera in cameras:
        near = np.linalg.norm(ground - camera.centre[:2], axis=1) < _FARTHEST / 2.0
        own = np.ones(len(ground), dtype=bool)
        for height in (0.3, 1.5):
            own &= camera.sees(np.column_stack([ground, np.full(len(ground), height)]))
        seen += own & near
    both = ground[seen >= min(2, len(cameras))]
    if not len(both):
        return None
    floor = np.array([*both.min(axis=0), 0.0])
    return Suggestion(
        floor, np.array([*both.max(axis=0), 2.0]), np.array(size, dtype=float), 0.0, 0
    )
