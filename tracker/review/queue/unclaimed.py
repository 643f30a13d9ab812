"""Boxes of several cameras that meet where no track is: somebody who may be missing."""

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

_MISS = 0.3
"""Metres by which the rays through the middles of two boxes of one person may miss each other."""

_SIZE = 1.6
"""By which a box may be higher or lower than a target there would be."""

_REACH, _FASTEST = 0.5, 2.0
"""Metres, and metres a second, that somebody may be from where he was seen last."""

_PAUSE = 0.5
"""Seconds without a meeting after which it is somebody else."""

_LASTS = 1.0
"""Seconds for which boxes must meet."""

_SHARE = 0.5
"""Of the steps of which they must."""


@dataclass(frozen=True, slots=True)
class Unclaimed:
    """Somebody whom boxes show and no track takes."""

    places: tuple[Place, ...]
    """One a step at which boxes meet."""
    cameras: tuple[int, ...]
    """Whose boxes."""
    share: float
    """Of its steps, those at which they do."""


@dataclass(frozen=True, slots=True, eq=False)
class _Free:
    """Boxes of one camera that are no track's."""

    steps: Int[ndarray, " B"]
    rays: Float[ndarray, "B 3"]
    heights: Float[ndarray, " B"]
    """Pixels."""


def unclaimed(run: Run) -> list[Unclaimed]:
    """Everybody whom at least two cameras' boxes show for a while and who is nobody's track.

    A box is a track's where its middle lies in the picture of that track's box. Free boxes of two
    cameras meet where the rays through their middles pass within 0.3 m of each other, in the room,
    where nobody is within the reach of a correction, and where both are as high as a target is.
    """
    free = [_free(run, number) for number in range(len(run.sequence.cameras))]
    found = [
        _meet(run, one, other, free[one], free[other])
        for one, other in itertools.combinations(range(len(free)), 2)
    ]
    points = np.concatenate([np.zeros((0, 6)), *found])
    points = points[np.argsort(points[:, 0], kind="stable")]
    return list(_chains(points, run.sequence.step_time))


def _free(run: Run, number: int) -> _Free:
    camera, views = run.sequence.cameras[number], run.views[: run.done]
    boxes = [step[number].boxes for step in views]
    counts = np.array([len(one) for one in boxes], dtype=np.int64)
    steps = np.repeat(np.arange(len(boxes)), counts)
    all_boxes = np.concatenate([np.zeros((0, 4)), *boxes])
    taken = _taken(run, camera, steps, all_boxes)
    own = all_boxes[~taken]
    return _Free(steps[~taken], camera.back_project(own[:, :2]), 2.0 * own[:, 3])


def _taken(
    run: Run, camera: Camera, steps: Int[ndarray, " B"], boxes: Float[ndarray, "B 4"]
) -> Bool[ndarray, " B"]:
    """Whether the middle of each box lies in a track's."""
    tracks = run.tracks
    drawn, _ = camera.project_boxes(tracks.positions, run.sequence.target_half_extents)
    theirs = Boxes.from_left_top(drawn)
    box, row = _at_one_step(steps, tracks.frames)
    with np.errstate(invalid="ignore"):  # who is behind the camera takes nothing
        inside = (np.abs(boxes[box, :2] - theirs.centres[row]) <= theirs.half_sizes[row]).all(
            axis=1
        )
    taken = np.zeros(len(steps), dtype=bool)
    taken[box[inside]] = True
    return taken


def _at_one_step(
    one: Int[ndarray, " A"], other: Int[ndarray, " B"]
) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """Rows of both that are of one step, every one with every one; the other's are in order."""
    first, last = np.searchsorted(other, [one, one + 1])
    counts = last - first
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(np.arange(len(one)), counts), np.repeat(first, counts) + within


def _meet(run: Run, one: int, other: int, mine: _Free, theirs: _Free) -> Float[ndarray, "M 6"]:
    """Step, world place and the two cameras of every meeting of free boxes."""
    cameras, sequence = run.sequence.cameras, run.sequence
    i, j = _at_one_step(mine.steps, theirs.steps)
    if not len(i):
        return np.zeros((0, 6))
    # the points of the two rays that are nearest to each other
    between = cameras[other].centre - cameras[one].centre
    r, s = mine.rays[i], theirs.rays[j]
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
    for camera, heights in ((cameras[one], mine.heights[i]), (cameras[other], theirs.heights[j])):
        expected = camera.project_boxes(middle, sequence.target_half_extents)[0][:, 3]
        with np.errstate(invalid="ignore"):
            as_high &= np.abs(np.log(heights / expected)) <= np.log(_SIZE)
    i, middle = i[as_high], middle[as_high]
    steps = mine.steps[i]
    alone = ~_somebody_near(run, steps, middle)
    pair = np.tile([one, other], (int(alone.sum()), 1))
    return np.column_stack([steps[alone], middle[alone], pair]).astype(float)


def _somebody_near(run: Run, steps: ndarray, places: Float[ndarray, "M 3"]) -> Bool[ndarray, " M"]:
    tracks = run.tracks
    near = np.zeros(len(steps), dtype=bool)
    for k, step in enumerate(steps.tolist()):
        ground = tracks.positions[tracks.at(int(step)), :2]
        near[k] = bool((np.hypot(*(ground - places[k, :2]).T) <= REACH).any())
    return near


def _chains(points: Float[ndarray, "M 6"], step_time: float) -> Iterator[Unclaimed]:
    """Meetings that follow each other, as long as they last."""
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
        if span * step_time < _LASTS or share < _SHARE:
            continue
        middles = [rows[rows[:, 0] == step, 1:4].mean(axis=0) for step in steps]
        places = tuple(
            Place(int(step), *map(float, at)) for step, at in zip(steps, middles, strict=True)
        )
        cameras = tuple(sorted({int(c) for c in rows[:, 4:].ravel()}))
        yield Unclaimed(places, cameras, share)
