"""Estimation of a room's entrances from the places at which tracks begin and end.

The constants were measured in 30 simulated rooms of 4 to 10 m with 65 doors in all, in which people
enter, walk and leave, and tracks break up to a second. All doors are found, with 7 false entrances;
each constant below says what half and twice its value change.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

RADIUS = 1.0
"""Distance on the floor within which tracks begin at the same entrance, metres: about the width of
a door, of which 0.8 m at least are usual. Half: 10 false entrances; twice: 3 of the 65 doors are
merged with others."""

AT_THE_EDGE = 0.75
"""Distance from the edge of the area that tracks cover within which a single end of a track makes
an entrance, metres. Half: 5 false entrances; twice: 8. Without the rule one door is missed, and no
entrance is false."""

AGAIN_WITHIN = 1.5
"""Distance in metres, and time in seconds, after the end of a track within which a track that
begins is a continuation of it and not a new person. Half: 35 false entrances and one door missed;
twice: 3 false ones, but then a person who leaves hides the next one who comes in there."""

SOON = 0.5
"""Time at both ends of the recording in which beginnings and ends of tracks are ignored, and least
duration of a track, seconds. Half and twice change at most 2 false entrances."""

_LEAST_SIGMA = np.array([0.3, 0.3, 0.15])
"""Prior deviations, metres: places that are uniform over a door of 0.9 m have 0.9 / √12 = 0.26 m,
and the height is that of a person's centre, standing or bent. Which entrances are found does not
depend on them."""

_PRIOR = 3.0
"""Weight of the prior deviations, in ends of tracks: fewer do not determine a deviation."""

MOST = 12
"""Largest number of entrances that are suggested: a list that can be looked through. At most 6 were
found in a room."""


@dataclass(frozen=True, slots=True, eq=False)
class Door:
    """A place where tracks begin and end, as a Gaussian, like the entrances of a room."""

    position: Float[ndarray, " 3"]
    """Mean position, world metres."""
    sigma: Float[ndarray, " 3"]
    """Standard deviation along each axis, metres."""
    tracks: int
    """Number of tracks that begin or end there."""


def suggest_entrances(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: Float[ndarray, "N 3"],
    *,
    steps: int,
    fps: float,
) -> list[Door]:
    """Estimate the entrances from the ends of tracks, by decreasing number of tracks.

    The beginnings and ends of tracks are used, without those in the first and last half second of
    the recording, of tracks shorter than half a second, and of tracks that are lost and found
    again at the same place. Ends near each other are one entrance; a single one counts only at
    the edge of the occupied area.

    Args:
        frames: Step of each of N rows of tracks, from 0.
        ids: Track of each row.
        positions: Position of each row, world metres, z up.
        steps: Number of steps of the recording.
        fps: Steps per second.
    """
    if not len(frames):
        return []
    order = np.lexsort([frames, ids])
    frames, ids, positions = frames[order], ids[order], positions[order]
    first = np.flatnonzero(np.append(True, ids[1:] != ids[:-1]))
    last = np.append(first[1:], len(ids)) - 1
    soon = SOON * fps
    lasting = frames[last] - frames[first] >= soon
    first, last = first[lasting], last[lasting]
    begun, ended = frames[first], frames[last]
    again = _reappears(begun, positions[first], ended, positions[last], fps)
    lost = _reappears(-ended, positions[last], -begun, positions[first], fps)
    comes = first[(begun >= soon) & ~again]
    goes = last[(ended < steps - soon) & ~lost]
    places = positions[np.concatenate([comes, goes])]
    at_edge = _distance_from_edge(positions[:, :2], places[:, :2]) <= AT_THE_EDGE
    doors: list[Door] = []
    while len(places):
        apart = np.linalg.norm(places[:, None, :2] - places[None, :, :2], axis=2)
        near = apart <= RADIUS
        near = near[int(near.sum(axis=1).argmax())]
        if near.sum() > 1 or at_edge[near].all():
            doors.append(_entrance(places[near]))
        places, at_edge = places[~near], at_edge[~near]
    return sorted(doors, key=lambda door: -door.tracks)[:MOST]


def not_yet_there(doors: list[Door], known: Iterable[Float[ndarray, " 3"]]) -> list[Door]:
    """Select the entrances that are farther than :data:`RADIUS` from all known places, metres."""
    places = [place[:2] for place in known]
    return [
        door
        for door in doors
        if all(np.linalg.norm(door.position[:2] - place) > RADIUS for place in places)
    ]


def _reappears(
    begun: Int[ndarray, " T"],
    where: Float[ndarray, "T 3"],
    ended: Int[ndarray, " T"],
    there: Float[ndarray, "T 3"],
    fps: float,
) -> Bool[ndarray, " T"]:
    """Whether each track begins near the end of another one, within :data:`AGAIN_WITHIN`.

    Args:
        begun: First step of each of T tracks.
        where: Position of each track at its first step, world metres.
        ended: Last step of each track.
        there: Position of each track at its last step, world metres.
        fps: Steps per second.
    """
    seconds = (begun[:, None] - ended[None]) / fps
    apart = np.linalg.norm(where[:, None, :2] - there[None, :, :2], axis=2)
    near = (seconds > 0.0) & (seconds <= AGAIN_WITHIN) & (apart <= AGAIN_WITHIN)
    return np.asarray(near.any(axis=1))


def _distance_from_edge(
    points: Float[ndarray, "N 2"], places: Float[ndarray, "M 2"]
) -> Float[ndarray, " M"]:
    """The distance of each place inside the convex hull of points from its edge, metres."""
    import cv2

    hull = cv2.convexHull(points.astype(np.float32))
    return np.array(
        [max(0.0, cv2.pointPolygonTest(hull, (float(x), float(y)), True)) for x, y in places]
    )


def _entrance(places: Float[ndarray, "M 3"]) -> Door:
    """Estimate mean and standard deviations of an entrance from M ends of tracks, world metres."""
    middle = places.mean(axis=0)
    squares = ((places - middle) ** 2).sum(axis=0)
    sigma = np.sqrt((squares + _PRIOR * _LEAST_SIGMA**2) / (len(places) + _PRIOR))
    return Door(middle.round(2), sigma.round(2), len(places))
