"""Estimation of room, floor and size of people for a recording without them.

[FRU71] Fruin, "Pedestrian Planning and Design", Metropolitan Association of Urban Designers and
Environmental Planners, New York, 1971: the body ellipse.
[PHE96] Pheasant, "Bodyspace: Anthropometry, Ergonomics and the Design of Work", second edition,
Taylor & Francis, 1996.
"""

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
"""Half width, depth and height of a standing person, metres: the default target. The height is that
of a person in shoes, which add 0.025 m (men) and 0.045 m (women) [PHE96] to a mean stature of 1.65
m (:data:`tracker.single_view.box_sizes.STATURE`); the width is that of the body ellipse, 0.61 m
[FRU71]."""

LEAST_AGREEING = 20
"""Least number of agreeing pairs of boxes for an estimate of room and people. In thirty random
rooms with the boxes of other rooms, five steps have at most 7 by chance and twenty at most 23;
with the right boxes two steps have 20 in the median."""

LEAST_POSSIBLE = 3 * LEAST_AGREEING
"""Number of pairs of boxes that could agree below which it tells nothing that few of them do."""

# The sensitivities below are measured in the random rooms of seeds 1500 … 1519, of whose people
# some are 1.2 m tall and some are seen for 12 steps alone, and in four recordings.
_SHORTEST_STANDING = 1.45
"""Height above which people stand, metres: the crown of a seated man has a 95th percentile of
0.965 m above the seat and the seat one of 0.49 m [PHE96]. At 1.6, boxes of one room of people who
stand are taken for others."""

_TALLEST_STANDING = 2.3
"""Height of boxes below which people stand, metres. From 2 to 2.6 nothing changes."""

_TRUST = 0.3
"""Weight of the boxes' height against that of :data:`STANDING`, since detectors pad boxes. Halved
or doubled it changes sizes and the floor by 0.02 m at most, and no figure of tracks in eight random
rooms and two recordings by 0.001; without it mean IDF1 falls by 0.004, with 1 by 0.017."""

_MARGIN = 0.5
"""Extent of the room beyond the places of people, metres: a first guess, which the user sees and
corrects. With it 98 % of the true places are in the room, doubled 98 and without it 96; in eight
random rooms and two recordings recall is 0.027 less without it, and 0.001 more with twice."""

_OUTLIERS = 0.01
"""Share of the places on either side that may be outside the room. Halved it moves a wall
by 1.3 m at most, doubled by 1.1 m; without it one wall is 6.5 m farther away."""

_NEAR_ZERO = 0.2
"""Distance of seated people's feet from z = 0 within which they are on it, in heights of their
boxes. From 0.1 to 0.4 nothing changes; without it the floor of a room of seated people is 0.8 m
lower. It has no effect where people stand."""

_FARTHEST = 15.0
"""Largest distance between a camera and the overlap of views in a recording without boxes, metres:
a first guess like the margin. With it 98 % of the true places are in the room, halved 86 and
doubled nearly all, but then the walls are 7 m farther away in the mean."""


@dataclass(frozen=True, slots=True, eq=False)
class Suggestion:
    """An estimate of the room and of the size of people."""

    minimum: Float[ndarray, " 3"]
    """Least corner of the room, world metres."""
    maximum: Float[ndarray, " 3"]
    """Largest corner of the room, world metres."""
    half_extents: Float[ndarray, " 3"]
    """Half width, depth and height of a target, metres."""
    floor: float
    """Height z of the floor, world metres."""
    people: int
    """Number of pairs of boxes that the estimate is made from; 0 if from the cameras alone."""


def consensus_of_cameras(
    cameras: Many[Camera], rays: Many[Rays], most_pairs: int = 20_000
) -> Consensus:
    """Find the consensus of the boxes of calibrated cameras, metres.

    Args:
        cameras: The calibrated cameras.
        rays: Rays of each camera's boxes, in its own axes.
        most_pairs: Largest number of pairs of boxes for each two cameras.
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
    """Estimate a room that contains all people, and their size.

    The room extends from the floor to above the heads, and half a metre around the places of
    feet. Boxes end lower than feet: detectors pad them, and seen from above their lower
    edge is at the nearest toe. Their middle has no such bias, so the floor is half a person
    below it, and the height of a standing person is shrunk from that of the boxes towards
    that of :data:`STANDING`. Without boxes the room is where the views of two cameras overlap.

    Args:
        cameras: The calibrated cameras, in metres, z up.
        agreed: The consensus of their boxes; None without boxes.
        half_extents: Half width, depth and height of a target, metres, if known.

    Returns:
        The estimate; None where neither boxes meet nor views overlap.
    """
    if agreed is None or agreed.agreeing < LEAST_AGREEING:
        return _from_views(cameras, half_extents)
    size = _size(agreed) if half_extents is None else np.asarray(half_extents, dtype=float)
    middles = agreed.feet + agreed.rises / 2.0
    low, high = np.quantile(middles, [_OUTLIERS, 1.0 - _OUTLIERS], axis=0)
    floor = float(np.median(middles[:, 2])) - float(size[2])
    foot = float(np.median(agreed.feet[:, 2]))
    if stands(agreed.height):
        bottom, top = floor, floor + max(2.0, 2.5 * float(size[2]))
    elif abs(foot) < _NEAR_ZERO * agreed.height:  # they sit on the floor that the calibration has
        floor = bottom = 0.0
        top = high[2] + 2.0 * float(size[2])
    else:  # heads, people at tables: the distance of the floor below them is unknown
        floor = bottom = low[2] - 2.0 * float(size[2])
        top = high[2] + 2.0 * float(size[2])
    minimum = np.array([*(low[:2] - _MARGIN), bottom])
    maximum = np.array([*(high[:2] + _MARGIN), top])
    lower = np.floor(minimum * 10.0) / 10.0
    lower[2] = np.round(bottom, 1) + 0.0  # the floor itself: heights are measured from it
    return Suggestion(
        lower,
        np.ceil(maximum * 10.0) / 10.0,
        np.round(size, 3),
        floor,
        agreed.agreeing,
    )


def stands(height: float) -> bool:
    """Whether boxes of a height in metres are of standing people."""
    return _SHORTEST_STANDING <= height <= _TALLEST_STANDING


def _size(agreed: Consensus) -> Float[ndarray, " 3"]:
    """Estimate half width, depth and height of a target from the common height, metres."""
    height = agreed.height
    if stands(height):
        return np.asarray(STANDING * (1.0 - _TRUST + _TRUST * height / (2.0 * STANDING[2])))
    # a head, or a head with shoulders, is less slender than a whole person
    broad = 0.35 if height < 0.5 else 0.25
    return np.array([broad, broad, 0.5]) * height


def _from_views(
    cameras: Many[Camera], half_extents: Float[ndarray, " 3"] | None
) -> Suggestion | None:
    """Estimate the room from the overlap of two views, between the floor at z = 0 and 2 m."""
    size = STANDING if half_extents is None else half_extents
    centres = np.array([camera.centre for camera in cameras])
    low, high = centres.min(axis=0) - _FARTHEST, centres.max(axis=0) + _FARTHEST
    ground = np.stack(
        np.meshgrid(*(np.arange(a, b, 0.5) for a, b in zip(low[:2], high[:2], strict=True))),
        axis=-1,
    ).reshape(-1, 2)
    seen = np.zeros(len(ground), dtype=int)
    for camera in cameras:
        near = np.linalg.norm(ground - camera.centre[:2], axis=1) < _FARTHEST
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
