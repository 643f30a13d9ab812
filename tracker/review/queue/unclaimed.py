"""Unclaimed boxes: boxes of several cameras that agree on a place where there is no track.

No run depends on the bounds of this module: they decide what a person is asked.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.corrections import Place
from tracker.corrections.kinds import REACH
from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.runs.run import Run

# The sensitivities below are of the items of missing people, where tracks were cut or taken out: in
# three random crowds, in two random rooms that people leave and whose detectors miss a third, and
# in two recordings. There are 284 items, of which 208 are right.
_MISS = 0.3
"""Largest distance between the rays through the centres of two boxes of one person, metres. Halved,
there are 264 items of which 202 are right; doubled 314, of which 214 are."""

_SIZE = 1.6
"""Largest ratio of the height of a box to that of a target's box at the place; its inverse is the
smallest. With 1.3 there are 257 items of which 218 are right; with 2.5 303, of which 180 are."""

_REACH, _FASTEST = 0.5, 2.0
"""Largest distance between consecutive places of one person: a constant in metres, plus a speed in
metres per second times the time between them. With half the constant there are 300 items of which
241 are right, with twice 264 and 174, since the places of two people are joined; with half the
speed 280 and 210, with twice 291 and 214."""

_PAUSE = 0.5
"""Longest gap between consecutive places of one person, seconds. Halved, there are 58 items of
which 55 are right, as a step is 0.2 to 0.5 s; doubled 274, of which 184 are."""

_LASTS = 1.0
"""Least time between the first and the last step at which boxes agree on a person, seconds. Halved,
there are 329 items of which 247 are right; doubled 228, of which 156 are."""


@dataclass(frozen=True, slots=True)
class Unclaimed:
    """A person that boxes of several cameras show and that has no track."""

    places: tuple[Place, ...]
    """The place at each step at which boxes agree, world metres."""
    cameras: tuple[int, ...]
    """The indices of the cameras whose boxes agree."""
    share: float
    """The share of the steps between first and last at which boxes agree."""


@dataclass(frozen=True, slots=True, eq=False)
class _UnexplainedBoxes:
    """The B boxes of one camera that no track explains."""

    steps: Int[ndarray, " B"]
    """The step of each box."""
    rays: Float[ndarray, "B 3"]
    """Unit vectors from the camera through the centre of each box, world frame."""
    heights: Float[ndarray, " B"]
    """The height of each box, pixels."""


def find_unclaimed(run: Run) -> list[Unclaimed]:
    """Return all people that boxes of at least two cameras show for a while without a track.

    A box is explained by a track if its centre lies in the track's reprojected box. Unexplained
    boxes of two cameras agree if the rays through their centres pass within 0.3 m of each other at
    a place in the room, if no track is within the reach of a correction (:data:`REACH`) from this
    place, and if both boxes are about as high as a target's box there.
    """
    free = [_unexplained_boxes(run, number) for number in range(len(run.sequence.cameras))]
    found = [
        _agreeing_places(run, one, other, free[one], free[other])
        for one, other in itertools.combinations(range(len(free)), 2)
    ]
    points = np.concatenate([np.zeros((0, 6)), *found])
    points = points[np.argsort(points[:, 0], kind="stable")]
    return list(_chains(points, run.sequence.step_time))


def _unexplained_boxes(run: Run, number: int) -> _UnexplainedBoxes:
    """Return the boxes of the camera with an index that no track explains."""
    camera, boxes = run.sequence.cameras[number], run.views.column("boxes", number, last=run.done)
    steps, all_boxes = boxes.steps, boxes.values.reshape(-1, 4)
    explained = _explained(run, camera, steps, all_boxes)
    own = all_boxes[~explained]
    return _UnexplainedBoxes(steps[~explained], camera.back_project(own[:, :2]), 2.0 * own[:, 3])


def _explained(
    run: Run, camera: Camera, steps: Int[ndarray, " B"], boxes: Float[ndarray, "B 4"]
) -> Bool[ndarray, " B"]:
    """Whether the centre of each box lies in a track's reprojected box."""
    tracks = run.tracks
    drawn, _ = camera.project_boxes(tracks.positions, run.sequence.target_half_extents)
    expected = Boxes.from_left_top(drawn)
    box, row = _at_one_step(steps, tracks.frames)
    with np.errstate(invalid="ignore"):  # boxes behind the camera are NaN and contain no centre
        apart = np.abs(boxes[box, :2] - expected.centres[row])
        inside = (apart <= expected.half_sizes[row]).all(axis=1)
    explained = np.zeros(len(steps), dtype=bool)
    explained[box[inside]] = True
    return explained


def _at_one_step(
    one: Int[ndarray, " A"], other: Int[ndarray, " B"]
) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """Return all pairs of rows that have the same step.

    Args:
        one: The steps of the first rows, in any order.
        other: The steps of the second rows, ascending.
    """
    first, last = np.searchsorted(other, [one, one + 1])
    counts = last - first
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(np.arange(len(one)), counts), np.repeat(first, counts) + within


def _agreeing_places(
    run: Run, one: int, other: int, first: _UnexplainedBoxes, second: _UnexplainedBoxes
) -> Float[ndarray, "M 6"]:
    """Return the places on which boxes of two cameras agree, of all pairs of boxes.

    Args:
        run: The run.
        one: The index of the first camera.
        other: The index of the second camera.
        first: The unexplained boxes of the first camera.
        second: The unexplained boxes of the second camera.

    Returns:
        Step, x, y and z in world metres, and the indices of the two cameras, in a row for each
        pair of boxes that agrees.
    """
    cameras, sequence = run.sequence.cameras, run.sequence
    i, j = _at_one_step(first.steps, second.steps)
    if not len(i):
        return np.zeros((0, 6))
    # a and b: the points of the two rays that are nearest to each other
    between = cameras[other].centre - cameras[one].centre
    r, s = first.rays[i], second.rays[j]
    across = np.einsum("nk,nk->n", r, s)
    even = np.maximum(1.0 - across**2, 1e-9)
    along = (r @ between - across * (s @ between)) / even
    back = (across * (r @ between) - s @ between) / even
    a = cameras[one].centre + along[:, None] * r
    b = cameras[other].centre + back[:, None] * s
    middle = 0.5 * (a + b)
    good = (along > 0.0) & (back > 0.0) & (np.linalg.norm(a - b, axis=1) <= _MISS)
    good &= sequence.room.contains(middle)
    i, j, middle = i[good], j[good], middle[good]
    as_high = np.ones(len(middle), dtype=bool)
    for camera, heights in ((cameras[one], first.heights[i]), (cameras[other], second.heights[j])):
        expected = camera.project_boxes(middle, sequence.target_half_extents)[0][:, 3]
        with np.errstate(invalid="ignore"):
            as_high &= np.abs(np.log(heights / expected)) <= np.log(_SIZE)
    i, middle = i[as_high], middle[as_high]
    steps = first.steps[i]
    alone = ~_track_near(run, steps, middle)
    pair = np.tile([one, other], (int(alone.sum()), 1))
    return np.column_stack([steps[alone], middle[alone], pair]).astype(float)


def _track_near(run: Run, steps: ndarray, places: Float[ndarray, "M 3"]) -> Bool[ndarray, " M"]:
    """Whether a track is within the reach of a correction from each place."""
    tracks = run.tracks
    near = np.zeros(len(steps), dtype=bool)
    for k, step in enumerate(steps.tolist()):
        ground = tracks.positions[tracks.at(int(step)), :2]
        near[k] = bool((np.hypot(*(ground - places[k, :2]).T) <= REACH).any())
    return near


def _chains(points: Float[ndarray, "M 6"], step_time: float) -> Iterator[Unclaimed]:
    """Chain places that follow each other, and yield each chain that is long enough as a person.

    Args:
        points: The rows of :func:`_agreeing_places` of all pairs of cameras, in the order of steps.
        step_time: Duration of a step, seconds.
    """
    going: list[list[ndarray]] = []
    ended: list[list[ndarray]] = []
    for point in points:
        best, cost = None, np.inf
        for chain in going:
            seconds = (point[0] - chain[-1][0]) * step_time
            apart = float(np.linalg.norm(point[1:4] - chain[-1][1:4]))
            if seconds <= _PAUSE and apart <= min(_REACH + _FASTEST * seconds, cost):
                best, cost = chain, apart
        if best is None:
            going.append([point])
        else:
            best.append(point)
        late = [one for one in going if (point[0] - one[-1][0]) * step_time > _PAUSE]
        ended += late
        going = [one for one in going if (point[0] - one[-1][0]) * step_time <= _PAUSE]
    for chain in (*ended, *going):
        rows = np.array(chain)
        steps = np.unique(rows[:, 0])
        span = steps[-1] - steps[0] + 1
        share = float(len(steps) / span)
        if span * step_time < _LASTS:
            continue
        middles = [rows[rows[:, 0] == step, 1:4].mean(axis=0) for step in steps]
        places = tuple(
            Place(int(step), *map(float, at)) for step, at in zip(steps, middles, strict=True)
        )
        cameras = tuple(sorted({int(c) for c in rows[:, 4:].ravel()}))
        yield Unclaimed(places, cameras, share)
