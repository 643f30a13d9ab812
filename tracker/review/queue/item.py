"""A doubtful place of a run: what is doubted, what depends on it, and what else it could be."""

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
"""Of how far around its places nobody is: how near these keep to the course of who was nobody."""

_UNSAID = datetime(2000, 1, 1, tzinfo=UTC)
"""The time of what nobody said yet."""


@dataclass(frozen=True, slots=True)
class Alternative:
    """What may be true at a doubtful place."""

    words: str
    probability: float
    corrections: tuple[Correction, ...]
    """What somebody says who says that it is so."""


@dataclass(frozen=True, slots=True)
class ReviewItem:
    """One doubtful place."""

    kind: ItemKind
    title: str
    why: str
    """One sentence."""
    first: int
    """Steps, both included."""
    last: int
    tracks: tuple[int, ...]
    """The run's ids of whom it is about."""
    places: tuple[Place, ...]
    probability: float
    """That the run is wrong here."""
    stake: int
    """Steps of tracks that depend on it."""
    alternatives: tuple[Alternative, ...]
    """As it is, then what else it could be, the most probable first."""

    @property
    def id(self) -> str:
        """The same for the same place and people, whatever the run's numbers."""
        said = [self.kind, *(f"{p.step} {p.x:.1f} {p.y:.1f}" for p in self.places)]
        return hashlib.sha256("|".join(said).encode()).hexdigest()[:12]

    @property
    def weight(self) -> float:
        """Steps that are expected to be wrong: what the queue is ordered by."""
        return self.probability * self.stake


def proposed(kind: str, places: Iterable[Place], **values: Any) -> tuple[Correction, ...]:
    """A correction that somebody may make; none where it could not be one."""
    try:
        return (make(kind=kind, places=[tuple(p) for p in places], time=_UNSAID, **values),)
    except CorrectionError:
        return ()


def confirmed(corrections: Iterable[Correction], note: str = "") -> tuple[Correction, ...]:
    """What was only possible, said now."""
    now = datetime.now(UTC).replace(microsecond=0)
    return tuple(
        make(**{**one.model_dump(exclude={"id"}), "time": now, "note": note or one.note})
        for one in corrections
    )


class Lanes:
    """A run's tracks one by one."""

    def __init__(self, tracks: Trajectories) -> None:
        """Sort them."""
        self.tracks = tracks
        order = np.lexsort((tracks.frames, tracks.ids))
        self.ids, begins = np.unique(tracks.ids[order], return_index=True)
        self.rows: dict[int, Int[ndarray, " K"]] = dict(
            zip(self.ids.tolist(), np.split(order, begins[1:]), strict=True)
        ) if len(order) else {}  # fmt: skip

    def span(self, track: int) -> tuple[int, int]:
        """The first and the last step of a track."""
        rows = self.rows[track]
        return int(self.tracks.frames[rows[0]]), int(self.tracks.frames[rows[-1]])

    def count(self, track: int, first: int = 0, last: int | None = None) -> int:
        """How many steps of a track lie between two."""
        frames = self.tracks.frames[self.rows[track]]
        end = len(frames) if last is None else int(np.searchsorted(frames, last, side="right"))
        return max(end - int(np.searchsorted(frames, first)), 0)

    def place(self, track: int, step: int, *, after: bool = False) -> Place:
        """Where a track was at a step; where it is not there, at its last one before, or its first
        one after."""
        rows = self.rows[track]
        frames = self.tracks.frames[rows]
        at = int(np.searchsorted(frames, step, side="left" if after else "right")) - (not after)
        return self.of_row(int(rows[min(max(at, 0), len(rows) - 1)]))

    def course(self, rows: Int[ndarray, " K"], within: float) -> tuple[Place, ...]:
        """So few places of a track that the straight ways between them keep near it all along.

        It is the polygon of Ramer, Douglas and Peucker in time: the place farthest from the way
        from the first to the last, at its own step, is taken, and so on on both sides of it.

        Args:
            rows: Of the track, at least one, in the order of steps.
            within: Metres on the ground.
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
        """The place of a row."""
        x, y, z = self.tracks.positions[row].tolist()
        return Place(int(self.tracks.frames[row]), x, y, z)
