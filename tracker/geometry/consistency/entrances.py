"""Where people come in and go out, worked out from where tracks begin and end."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

RADIUS = 1.0
"""Metres on the floor: who begins this near to each other came through the same door."""

AT_THE_EDGE = 0.75
"""Metres from the edge of where anybody was: a single beginning farther in is an accident."""

AGAIN_WITHIN = 1.5
"""Metres and seconds: whoever begins so near where a track ended shortly before was lost there
and found again, and did not come in."""

SOON = 0.5
"""Seconds: who begins this soon was there already, and a track so short is an accident."""

_LEAST_SIGMA = np.array([0.3, 0.3, 0.15])  # metres: a door, and people of several heights
_PRIOR = 3.0  # beginnings that the least deviations count as

MOST = 12
"""Entrances that are suggested; where people come from everywhere, more tell nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Door:
    """A place where tracks begin and end: a Gaussian, as a room's entrances are."""

    position: Float[ndarray, " 3"]
    """World metres."""
    sigma: Float[ndarray, " 3"]
    """Standard deviations, metres."""
    tracks: int
    """How many begin or end there."""


def suggest_entrances(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: Float[ndarray, "N 3"],
    *,
    steps: int,
    fps: float,
) -> list[Door]:
    """Places at which people seem to come in, those that most tracks tell of first.

    What counts is where tracks begin and end, but for the first and the last half second of the
    recording, when people were there already or still, for tracks shorter than half a second and
    for those that are lost and found again at the same place. Ends that lie near each other are
    one entrance; one that is alone counts at the edge of where anybody was.

    Args:
        frames: The step of each row of the tracks, 0-based.
        ids: Whose row it is.
        positions: World metres, z up.
        steps: How many the recording has.
        fps: Steps a second.
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
    again = _again(begun, positions[first], ended, positions[last], fps)
    lost = _again(-ended, positions[last], -begun, positions[first], fps)
    comes = first[(begun >= soon) & ~again]
    goes = last[(ended < steps - soon) & ~lost]
    places = positions[np.concatenate([comes, goes])]
    at_edge = _from_edge(positions[:, :2], places[:, :2]) <= AT_THE_EDGE
    doors: list[Door] = []
    while len(places):
        apart = np.linalg.norm(places[:, None, :2] - places[None, :, :2], axis=2)
        near = apart <= RADIUS
        near = near[int(near.sum(axis=1).argmax())]
        if near.sum() > 1 or at_edge[near].all():
            doors.append(_door(places[near]))
        places, at_edge = places[~near], at_edge[~near]
    return sorted(doors, key=lambda door: -door.tracks)[:MOST]


def not_yet_there(doors: list[Door], known: Iterable[Float[ndarray, " 3"]]) -> list[Door]:
    """Those that are at none of the places that are known, world metres."""
    places = [place[:2] for place in known]
    return [
        door
        for door in doors
        if all(np.linalg.norm(door.position[:2] - place) > RADIUS for place in places)
    ]


def _again(
    begun: Int[ndarray, " T"],
    where: Float[ndarray, "T 3"],
    ended: Int[ndarray, " T"],
    there: Float[ndarray, "T 3"],
    fps: float,
) -> Bool[ndarray, " T"]:
    """Whether each track begins where another one ended shortly before."""
    if not len(begun):
        return np.zeros(0, dtype=bool)
    seconds = (begun[:, None] - ended[None]) / fps
    apart = np.linalg.norm(where[:, None, :2] - there[None, :, :2], axis=2)
    near = (seconds > 0.0) & (seconds <= AGAIN_WITHIN) & (apart <= AGAIN_WITHIN)
    return np.asarray(near.any(axis=1))


def _from_edge(
    points: Float[ndarray, "N 2"], places: Float[ndarray, "M 2"]
) -> Float[ndarray, " M"]:
    """How far inside of the points' convex hull each place is, metres: 0 on its edge."""
    import cv2

    hull = cv2.convexHull(points.astype(np.float32))
    if len(hull) < 3:
        return np.zeros(len(places))
    return np.array(
        [max(0.0, cv2.pointPolygonTest(hull, (float(x), float(y)), True)) for x, y in places]
    )


def _door(places: Float[ndarray, "M 3"]) -> Door:
    middle = places.mean(axis=0)
    squares = ((places - middle) ** 2).sum(axis=0)
    sigma = np.sqrt((squares + _PRIOR * _LEAST_SIGMA**2) / (len(places) + _PRIOR))
    return Door(middle.round(2), sigma.round(2), len(places))
