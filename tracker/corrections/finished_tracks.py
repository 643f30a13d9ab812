"""Application of corrections to finished tracks, which are split, linked and removed.

It serves methods that do not apply corrections themselves, and the preview while a run is computed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.corrections.kinds import Correction, Place
from tracker.corrections.lookup import TrackIndex, mostly_inside
from tracker.geometry.assignment import names_by_majority


class _Segments:
    """Tracks split into segments, each followed by at most one other."""

    def __init__(self, frames: ndarray, ids: ndarray, positions: ndarray, leeway: int) -> None:
        """Make one segment of each track, with the arguments of :func:`relabel`."""
        self.frames, self.positions = frames, positions
        self.index = TrackIndex(frames, positions, ids)
        self.leeway = leeway
        order = np.lexsort((frames, ids))
        _names, begins = np.unique(ids[order], return_index=True)
        self.rows: list[ndarray] = np.split(order, begins[1:]) if len(order) else []
        self.following: list[int] = [-1] * len(self.rows)
        self.of_row = np.empty(len(ids), dtype=np.int64)
        for number, rows in enumerate(self.rows):
            self.of_row[rows] = number

    def row_at(self, place: Place) -> int | None:
        """Return the row that a place refers to, None for none."""
        return self.index.nearest(place, leeway=self.leeway)

    def cut(self, row: int) -> None:
        """Split the segment of a row before it; the second part follows the first."""
        number = int(self.of_row[row])
        rows = self.rows[number]
        place = int(np.searchsorted(self.frames[rows], self.frames[row]))
        if place == 0:
            return
        new = len(self.rows)
        self.rows.append(rows[place:])
        self.rows[number] = rows[:place]
        self.following.append(self.following[number])
        self.following[number] = new
        self.of_row[rows[place:]] = new

    def turn(self, one: int, other: int, after: int, until: int) -> int:
        """Find the step from which the second of two segments follows the first.

        Args:
            one: Index of the first segment.
            other: Index of the second.
            after: Step after which the search begins.
            until: Last step of the search.

        Returns:
            The step at which they are nearest to each other on the ground; where they have none
            in common, the first of the second segment.
        """
        own, others = (
            rows[(self.frames[rows] > after) & (self.frames[rows] <= until)]
            for rows in (self.rows[one], self.rows[other])
        )
        steps, at, there = np.intersect1d(
            self.frames[own], self.frames[others], return_indices=True
        )
        if not len(steps):
            return int(self.frames[others].min(initial=until))
        ground = self.positions[:, :2]
        apart = np.hypot(*(ground[own[at]] - ground[others[there]]).T)
        return int(steps[np.argmin(apart)])

    def longest_way(self, earlier: int, later: int) -> int:
        """Find the row with the longest way from the row before, between two rows of a segment.

        Args:
            earlier: The first row.
            later: The last row, in the segment that is searched.
        """
        rows = self.rows[self.of_row[later]]
        frames = self.frames[rows]
        own = rows[(frames >= self.frames[earlier]) & (frames <= self.frames[later])]
        if len(own) < 2:
            return later
        way = np.hypot(*np.diff(self.positions[own, :2], axis=0).T)
        return int(own[1 + np.argmax(way)])

    def before(self, number: int) -> int:
        """Return the segment that a segment follows, -1 for none."""
        return self.following.index(number) if number in self.following else -1

    def separate(self, number: int) -> None:
        """Separate a segment from the one that it follows."""
        earlier = self.before(number)
        if earlier >= 0:
            self.following[earlier] = -1

    def link(self, earlier: int, later: int) -> None:
        """Let the segment ``later`` follow ``earlier``, instead of the one that did before."""
        self.separate(later)
        self.following[earlier] = later

    def chain(self, number: int) -> list[int]:
        """Return a segment and those that follow it, in the order of time."""
        found = [number]
        while (number := self.following[number]) >= 0:
            found.append(number)
        return found


def relabel(
    frames: Int[ndarray, " N"],
    ids: Int[ndarray, " N"],
    positions: ndarray,
    corrections: Many[Correction],
    *,
    leeway: int,
) -> tuple[Int[ndarray, " N"], Int[ndarray, " K"]]:
    """Apply corrections to tracks, one after another, without those that refer to no track.

    Args:
        frames: Step of each of N rows.
        ids: Track of each row.
        positions: Position of each row (N, 3), world metres.
        corrections: The corrections in the order in which they were made.
        leeway: Number of steps by which a track may miss the step of a place.

    Returns:
        The id of each row, that of most rows of its track or else a new one; and the indices of
        the rows that remain, ascending.
    """
    segments = _Segments(frames, ids, positions, leeway)
    gone: set[int] = set()
    for one in corrections:
        constraints = one.constraints
        if constraints.must_link:
            _link(segments, one)
        elif constraints.cannot_link:
            _separate(segments, one)
        elif constraints.firsts or constraints.lasts:
            _cut_ends(segments, one)
        elif constraints.clutter:
            inside = segments.index.inside(one)
            for number in mostly_inside(segments.of_row, frames, inside, one):
                rows = segments.rows[number]
                within = rows[inside[rows]]
                gone.update(rows[(frames[rows] >= frames[within[0]])
                                 & (frames[rows] <= frames[within[-1]])].tolist())  # fmt: skip
    result = np.empty(len(ids), dtype=np.int64)
    firsts = [n for n in range(len(segments.rows)) if segments.before(n) < 0]
    chains = [np.concatenate([segments.rows[n] for n in segments.chain(f)]) for f in firsts]
    counts = [Counter(ids[rows].tolist()) for rows in chains]
    for rows, name in zip(chains, names_by_majority(counts, int(ids.max(initial=0))), strict=True):
        result[rows] = name
    kept = np.array(sorted(set(range(len(ids))) - gone), dtype=np.int64)
    return result, kept


def _link(segments: _Segments, one: Correction) -> None:
    """Link the tracks at the places of one person, for a correction *same* or *exchanged*.

    Tracks that exist at the same time are split at the step at which they are nearest; nothing is
    linked where the places refer to rows that do not go forward in time.
    """
    found = [(segments.row_at(a), segments.row_at(b)) for a, b in one.constraints.must_link]
    if any(a is None or b is None for a, b in found):
        return
    pairs: list[tuple[int, int]] = [(a, b) for a, b in found if a is not None and b is not None]
    if len({segments.of_row[b] for _, b in pairs}) < len(pairs):
        return  # both places refer to one segment
    after = int(segments.frames[[a for a, _ in pairs]].max())
    until = int(segments.frames[[b for _, b in pairs]].min())
    joins = []
    for a, b in pairs:
        earlier, later = int(segments.of_row[a]), int(segments.of_row[b])
        if later in segments.chain(earlier):
            continue  # they are one track already
        if after >= until:
            return
        joins.append((a, b, segments.turn(earlier, later, after, until)))
    for a, b, turn in joins:
        for row in (a, b):
            rows = segments.rows[segments.of_row[row]]
            rest = rows[segments.frames[rows] >= turn]
            if len(rest):
                segments.cut(int(rest[0]))
    for a, b, _ in joins:
        earlier, later = int(segments.of_row[a]), int(segments.of_row[b])
        if later not in segments.chain(earlier):
            segments.link(earlier, later)


def _separate(segments: _Segments, one: Correction) -> None:
    """Separate the track of two people, for a correction *different*.

    A single segment is split where it moves farthest from one row to the next.
    """
    earlier, later = (segments.row_at(place) for place in one.places)
    if earlier is None or later is None:
        return
    if segments.of_row[later] not in segments.chain(int(segments.of_row[earlier])):
        return
    if segments.of_row[earlier] == segments.of_row[later]:
        segments.cut(segments.longest_way(earlier, later))
    segments.separate(int(segments.of_row[later]))


def _cut_ends(segments: _Segments, one: Correction) -> None:
    """Separate a track from what is before it, for *came*, or from what is after it, for *left*."""
    row = segments.row_at(one.places[0])
    if row is None:
        return
    if one.constraints.firsts:
        segments.cut(row)
        segments.separate(int(segments.of_row[row]))
        return
    rows = segments.rows[segments.of_row[row]]
    later = rows[segments.frames[rows] > segments.frames[row]]
    if len(later):
        segments.cut(int(later[0]))
    segments.following[segments.of_row[row]] = -1
