"""An item of the review queue: where a run may be wrong, and what may be true instead."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.corrections import Correction, CorrectionError, Place
from tracker.corrections.kinds import make
from tracker.fusion.trajectories import Trajectories

ItemKind = Literal[
    "exchange", "join", "cut", "crossing", "gap", "short", "begins", "ends", "missing", "fast"
]

WITHIN = 0.5
"""Largest distance between the removed track and the path through the places of a correction
"nobody", as a share of the correction's radius."""

_UNMADE = datetime(2000, 1, 1, tzinfo=UTC)
"""The time of a correction that is proposed and not made yet."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """An answer to a review item: what may be true where a run may be wrong."""

    words: str
    """The answer, in a few words."""
    probability: float
    """The probability that this answer is true, 0 … 1."""
    corrections: tuple[Correction, ...]
    """The corrections that a person makes by choosing this alternative."""


@dataclass(frozen=True, slots=True)
class ReviewItem:
    """One item of the queue: a place and time at which the run may be wrong."""

    kind: ItemKind
    """The kind of mistake that is possible."""
    title: str
    """The possible mistake, in a few words."""
    why: str
    """The reason, in one sentence without a full stop."""
    first: int
    """The first step that the item concerns."""
    last: int
    """The last step that the item concerns, included."""
    tracks: tuple[int, ...]
    """The ids of the run's tracks that the item concerns."""
    places: tuple[Place, ...]
    """The places of these tracks at which the run may be wrong."""
    probability: float
    """The probability that the run is wrong here."""
    stake: int
    """The number of steps of tracks that are wrong if the run is wrong here."""
    alternatives: tuple[Alternative, ...]
    """The answers: that of the run itself, then all others, the most probable first."""

    @property
    def id(self) -> str:
        """An id that depends on kind and places alone, not on the ids of tracks."""
        parts = [self.kind, *(f"{p.step} {p.x:.1f} {p.y:.1f}" for p in self.places)]
        return hashlib.sha256("|".join(parts).encode()).hexdigest()[:12]

    @property
    def weight(self) -> float:
        """The expected number of wrong steps, probability × stake, by which the queue is
        ordered."""
        return self.probability * self.stake


def propose(kind: str, places: Iterable[Place], **values: Any) -> tuple[Correction, ...]:
    """Return the correction with these values as a tuple of one; empty if they are invalid."""
    try:
        return (make(kind=kind, places=[tuple(p) for p in places], time=_UNMADE, **values),)
    except CorrectionError:
        return ()


def confirm(corrections: Iterable[Correction], note: str = "") -> tuple[Correction, ...]:
    """Return proposed corrections with the present time as the time they were made.

    Args:
        corrections: The proposed corrections.
        note: The user's note; if empty, each correction keeps the note it has.
    """
    now = datetime.now(UTC).replace(microsecond=0)
    return tuple(
        make(**{**one.model_dump(exclude={"id"}), "time": now, "note": note or one.note})
        for one in corrections
    )


class TrackRows:
    """The rows of a run's tracks, grouped by track."""

    def __init__(self, tracks: Trajectories) -> None:
        """Group the rows by id; those of each track are in the order of steps."""
        self.tracks = tracks
        order = np.lexsort((tracks.frames, tracks.ids))
        self.ids, begins = np.unique(tracks.ids[order], return_index=True)
        self.rows: dict[int, Int[ndarray, " K"]] = dict(
            zip(self.ids.tolist(), np.split(order, begins[1:]), strict=True)
        ) if len(order) else {}  # fmt: skip

    def span(self, track: int) -> tuple[int, int]:
        """Return the first and the last step of a track."""
        rows = self.rows[track]
        return int(self.tracks.frames[rows[0]]), int(self.tracks.frames[rows[-1]])

    def count(self, track: int, first: int = 0, last: int | None = None) -> int:
        """Count the steps of a track between two steps, both included."""
        frames = self.tracks.frames[self.rows[track]]
        end = len(frames) if last is None else int(np.searchsorted(frames, last, side="right"))
        return max(end - int(np.searchsorted(frames, first)), 0)

    def place(self, track: int, step: int, *, after: bool = False) -> Place:
        """Return the place of a track at a step.

        Args:
            track: The id of the track.
            step: The step.
            after: Which place is taken if the track has none at the step: the first one after it,
                or (by default) the last one before it.
        """
        rows = self.rows[track]
        frames = self.tracks.frames[rows]
        at = int(np.searchsorted(frames, step, side="left" if after else "right")) - (not after)
        return self.of_row(int(rows[min(max(at, 0), len(rows) - 1)]))

    def simplified_path(self, rows: Int[ndarray, " K"], within: float) -> tuple[Place, ...]:
        """Simplify a track to a few places, between which linear interpolation stays near it.

        This is the algorithm of Ramer (Computer Graphics and Image Processing 1, 1972) and of
        Douglas and Peucker (Cartographica 10, 1973), with the distance at the same step instead of
        that from the line: if the interpolation between the first and the last place is too far
        from the track, the place where it is farthest is kept, and both parts are simplified in
        the same way.

        Args:
            rows: The rows of the track, at least one, in the order of steps.
            within: Largest distance of the interpolation from the track, metres on the ground.
        """
        steps, ground = self.tracks.frames[rows], self.tracks.positions[rows, :2]
        chosen, parts = {0, len(rows) - 1}, [(0, len(rows) - 1)]
        while parts:
            first, last = parts.pop()
            inner = np.arange(first + 1, last)
            if not len(inner):
                continue
            ends = [first, last]
            way = [np.interp(steps[inner], steps[ends], ground[ends, axis]) for axis in (0, 1)]
            apart = np.hypot(*(ground[inner].T - way))
            farthest = first + 1 + int(np.argmax(apart))
            if apart.max() > within:
                chosen.add(farthest)
                parts += [(first, farthest), (farthest, last)]
        return tuple(self.of_row(int(rows[k])) for k in sorted(chosen))

    def of_row(self, row: int) -> Place:
        """Return the place of a row."""
        x, y, z = self.tracks.positions[row].tolist()
        return Place(int(self.tracks.frames[row]), x, y, z)
