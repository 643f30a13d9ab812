"""Something of one track over the steps: height, speed, what the cameras make of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query
from jaxtyping import Float, Int
from numpy import ndarray
from pydantic import Field

from app.errors import ApiError
from app.messages import Model, filled
from app.state.scores import Scored
from app.web.dependencies import ERRORS, Bench, Part, opened
from app.web.evaluation import axis_end
from app.web.timeline import Window
from tracker.runs.pipeline import Run


class TrackCourse(Model):
    """One curve, or one for each camera."""

    name: str
    word: str
    unit: str
    """Empty for a share."""
    help: str
    low: float
    """Value at the lower edge of its plot."""
    high: float
    """At its upper edge: a round number."""
    values: list[list[float | None]]
    """Each curve by buckets; null where the track is not there or the value is not known."""
    cameras: list[str] = Field(default_factory=list)
    """Whose the curves are; empty for one that is no camera's."""


class Courses(Model):
    """Of one track of the shown run, in the buckets that were asked for."""

    run: str
    track: int
    first: int
    stride: int
    """Steps a bucket: a value stands for the mean over them."""
    courses: list[TrackCourse]


class CourseKind(Model):
    """What can be plotted."""

    name: str
    word: str
    help: str
    needs_truth: bool


class CourseKinds(Model):
    """All of it, in the order of the list."""

    kinds: list[CourseKind]


SPEED_SECONDS = 0.4
"""A speed is taken over so long: from one step to the next it would be noise."""


@dataclass(frozen=True, slots=True, eq=False)
class _Life:
    """A track's rows in a run, by step."""

    run: Run
    scored: Scored | None
    """The same run against the truth, where that is known."""
    track: int
    rows: Int[ndarray, " K"]
    frames: Int[ndarray, " K"]


@dataclass(frozen=True, slots=True)
class Kind:
    """What can be plotted of a track."""

    word: str
    unit: str
    help: str
    values: Callable[[_Life], Float[ndarray, "V K"]]
    """At each of its steps, a row a curve; not a number where it is unknown."""
    top: float | None = None
    """Upper edge of the plot; None for a round number above nearly all values."""
    by_camera: bool = False
    needs_truth: bool = False


def _height(life: _Life) -> Float[ndarray, "1 K"]:
    heights: ndarray = life.run.tracks.positions[life.rows, 2] - life.run.sequence.room.minimum[2]
    return heights[None]


def _speed(life: _Life) -> Float[ndarray, "1 K"]:
    """Length of the horizontal displacement between the steps half a window before and after, by
    the time between them."""
    sequence = life.run.sequence
    reach = max(1, round(SPEED_SECONDS * sequence.fps / 2.0))
    last = len(life.frames) - 1
    before = np.clip(np.searchsorted(life.frames, life.frames - reach), 0, last)
    after = np.clip(np.searchsorted(life.frames, life.frames + reach, side="right") - 1, 0, last)
    places = life.run.tracks.positions[life.rows, :2]
    seconds = (life.frames[after] - life.frames[before]) / sequence.fps
    way = np.linalg.norm(places[after] - places[before], axis=1)
    speeds: ndarray = np.divide(way, seconds, out=np.full(len(way), np.nan), where=seconds > 0.0)
    return speeds[None]


def _existence(life: _Life) -> Float[ndarray, "1 K"]:
    existences: ndarray = life.run.tracks.existences[life.rows]
    return existences[None]


def _uncertainty(life: _Life) -> Float[ndarray, "1 K"]:
    sigmas: ndarray = np.linalg.norm(life.run.tracks.sigmas[life.rows, :2], axis=1)
    return sigmas[None]


def _detection(life: _Life) -> Float[ndarray, "C K"]:
    return life.run.detection_probabilities(life.rows).T


def _distance(life: _Life) -> Float[ndarray, "1 K"]:
    tracks = life.run.tracks
    found: ndarray = np.full(len(life.rows), np.nan)
    for k, (row, frame) in enumerate(zip(life.rows.tolist(), life.frames.tolist(), strict=True)):
        here = tracks.at(frame)
        gaps = np.linalg.norm(tracks.positions[here, :2] - tracks.positions[row, :2], axis=1)
        gaps[row - here.start] = np.inf
        nearest = gaps.min()
        found[k] = nearest if np.isfinite(nearest) else np.nan
    return found[None]


def _error(life: _Life) -> Float[ndarray, "1 K"]:
    values: ndarray = np.full(life.run.sequence.frames, np.nan)
    if life.scored is not None and life.scored.evaluation is not None:
        pairs = life.scored.evaluation.pairs
        own = pairs.tracks == life.track
        values[pairs.steps[own]] = pairs.distances[own]
    errors: ndarray = values[life.frames]
    return errors[None]


KINDS: dict[str, Kind] = {
    "height": Kind("Height", "m", "Of its middle above the floor of the room", _height),
    "speed": Kind("Speed", "m/s", f"Over the floor, taken over {SPEED_SECONDS} s", _speed),
    "existence": Kind("Existence", "", "How probable it is that somebody is", _existence, 1.0),
    "uncertainty": Kind(
        "Uncertainty", "m", "Standard deviation of its place on the floor", _uncertainty
    ),
    "detection": Kind(
        "Detectability", "", "How likely each camera is to detect it, bright is likely",
        _detection, 1.0, by_camera=True,
    ),
    "error": Kind(
        "Position error", "m", "From the person of the truth whom it follows", _error,
        needs_truth=True,
    ),
    "distance": Kind("Next person", "m", "How far the nearest other one is", _distance),
}  # fmt: skip
"""What can be plotted, by the name in the address."""


def kinds_told() -> CourseKinds:
    """What can be plotted, for the page's list."""
    return CourseKinds(kinds=[filled(CourseKind, kind, name=name) for name, kind in KINDS.items()])


def courses_of(
    run: Run, scored: Scored | None, track: int, names: list[str], window: Window
) -> Courses:
    """Some courses of one track, by buckets; empty where the run has no such track.

    Args:
        run: That is shown.
        scored: What is scored last; used where it is of this run.
        track: Its id.
        names: Of :data:`KINDS`; others are left out.
        window: The part that somebody looks at.
    """
    run = run.snapshot()
    done = run.tracks.at(run.done).start
    rows = np.flatnonzero(run.tracks.ids[:done] == track)
    same = scored is not None and scored.key == run.key and scored.tracks is run.tracks
    life = _Life(run, scored if same else None, track, rows, run.tracks.frames[rows])
    names = [name for name in dict.fromkeys(names) if name in KINDS]
    return Courses(
        run=run.key,
        track=track,
        first=window.first,
        stride=window.stride,
        courses=[_course(name, KINDS[name], life, window) for name in names] if len(rows) else [],
    )


def _course(name: str, kind: Kind, life: _Life, window: Window) -> TrackCourse:
    values = kind.values(life)
    low = min(0.0, math.floor(float(np.nanmin(values, initial=0.0)) * 10.0) / 10.0)
    cameras = [camera.name for camera in life.run.sequence.cameras] if kind.by_camera else []
    return filled(
        TrackCourse,
        kind,
        name=name,
        low=low,
        high=kind.top if kind.top is not None else axis_end(values.ravel()),
        values=[_buckets(row, life.frames, window) for row in values],
        cameras=cameras,
    )


def _buckets(
    values: Float[ndarray, " K"], frames: Int[ndarray, " K"], window: Window
) -> list[float | None]:
    """The mean of each bucket; None in one without a value."""
    inside = (frames >= window.first) & (frames < window.end) & np.isfinite(values)
    count = -(-(window.end - window.first) // window.stride)
    which = (frames[inside] - window.first) // window.stride
    sizes = np.bincount(which, minlength=count)
    sums = np.bincount(which, weights=values[inside], minlength=count)
    return [
        round(float(total / size), 4) if size else None
        for total, size in zip(sums, sizes, strict=True)
    ]


router = APIRouter(prefix="/api/courses", responses=ERRORS)


@router.get("/kinds")
def kinds() -> CourseKinds:
    """What can be plotted of a track."""
    return kinds_told()


@router.get("/{track}")
def of_track(
    track: int,
    bench: Bench,
    part: Part,
    kind: Annotated[list[str] | None, Query(description="Which; all where none is named.")] = None,
) -> Courses:
    """Something of one track of the shown run over time, at the width that it is drawn at."""
    snapshot, sequence = opened(bench)
    if snapshot.run is None:
        raise ApiError(409, "nothing_computed", "There are no tracks yet.")
    names = list(KINDS) if kind is None else kind
    window = part.window(sequence.frames)
    return courses_of(snapshot.run, snapshot.scores.shown, track, names, window)
