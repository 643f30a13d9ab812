"""Corrections applied to finished tracks by splitting, joining and removing them.

They are used for methods that do not take corrections, and as a preview while a run is computed.
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
        self.frames, self.positions = frames, positions
        self.whereabouts = TrackIndex(frames, positions, ids)
        self.leeway = leeway
        order = np.lexsort((frames, ids))
        _names, begins = np.unique(ids[order], return_index=True)
        self.rows: list[ndarray] = np.split(order, begins[1:]) if len(order) else []
        self.following: list[int] = [-1] * len(self.rows)
        self.of_row = np.empty(len(ids), dtype=np.int64)
        for number, rows in enumerate(self.rows):
            self.of_row[rows] = number

    def find(self, place: Place) -> int | None:
        """The row that a place refers to, None for none."""
        return self.whereabouts.nearest(place, leeway=self.leeway)

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

    def nearest(self, one: int, other: int, after: int, until: int) -> int | None:
        """The step at which two segments are nearest to each other.

        Args:
            one: Index of the first segment.
            other: Index of the second.
            after: Step after which the search begins.
            until: Last step of the search.

        Returns:
            The step; None where the segments have none in common.
        """
        own, others = (
            rows[(self.frames[rows] > after) & (self.frames[rows] <= until)]
            for rows in (self.rows[one], self.rows[other])
        )
        steps, at, there = np.intersect1d(
            self.frames[own], self.frames[others], return_indices=True
        )
        if not len(steps):
            return None
        ground = self.positions[:, :2]
        apart = np.hypot(*(ground[own[at]] - ground[others[there]]).T)
        return int(steps[np.argmin(apart)])

    def longest_way(self, earlier: int, later: int) -> int:
        """The row with the longest way from the row before, between two rows of a segment.

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

    def cut_from(self, number: int, step: int) -> int:
        """The segment that begins at a step, split there from its first part."""
        rows = self.rows[number]
        row = int(rows[np.searchsorted(self.frames[rows], step)])
        self.cut(row)
        return int(self.of_row[row])

    def before(self, number: int) -> int:
        """The segment that a segment follows, -1 for none."""
        return self.following.index(number) if number in self.following else -1

    def part(self, number: int) -> None:
        """Separate a segment from the one that it follows."""
        earlier = self.before(number)
        if earlier >= 0:
            self.following[earlier] = -1

    def tie(self, earlier: int, later: int) -> None:
        """Let a segment follow another, instead of the one that followed that."""
        self.part(later)
        self.following[earlier] = later

    def chain(self, number: int) -> list[int]:
        """The segments of the track that a segment is in, in the order of time."""
        while (earlier := self.before(number)) >= 0:
            number = earlier
        found = [number]
        while (number := self.following[number]) >= 0:
            found.append(number)
        return found


def relabelled(
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
        if one.kind in ("same", "exchanged"):
            _tie(segments, one)
        elif one.kind == "different":
            _part(segments, one)
        elif one.kind in ("came", "left"):
            _end(segments, one)
        elif one.kind == "nobody":
            inside = segments.whereabouts.inside(one)
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


def _tie(segments: _Segments, one: Correction) -> None:
    found = [(segments.find(a), segments.find(b)) for a, b in one.pairs]
    if any(a is None or b is None for a, b in found):
        return
    pairs: list[tuple[int, int]] = [(a, b) for a, b in found if a is not None and b is not None]
    if len({segments.of_row[b] for _, b in pairs}) < len(pairs):
        return  # both places refer to one segment
    joins = []
    for a, b in pairs:
        earlier, later = int(segments.of_row[a]), int(segments.of_row[b])
        if later in segments.chain(earlier):
            continue  # they are one track already
        if not segments.frames[a] < segments.frames[b]:
            return
        # where both exist at the same time, they are exchanged where they are nearest
        turn = segments.nearest(
            earlier, later, int(segments.frames[[a for a, _ in pairs]].max()),
            int(segments.frames[[b for _, b in pairs]].min()),
        )  # fmt: skip
        joins.append((a, b, turn))
    for a, b, turn in joins:
        if turn is not None:
            for row in (a, b):
                number = int(segments.of_row[row])
                own = segments.frames[segments.rows[number]]
                if own[0] < turn <= own[-1]:
                    segments.cut_from(number, turn)
    for a, b, _ in joins:
        earlier, later = int(segments.of_row[a]), int(segments.of_row[b])
        if later not in segments.chain(earlier):
            segments.tie(earlier, later)


def _part(segments: _Segments, one: Correction) -> None:
    earlier, later = (segments.find(place) for place in one.places)
    if earlier is None or later is None:
        return
    if segments.of_row[later] not in segments.chain(int(segments.of_row[earlier])):
        return
    if segments.of_row[earlier] == segments.of_row[later]:
        segments.cut(segments.longest_way(earlier, later))
    segments.part(int(segments.of_row[later]))


def _end(segments: _Segments, one: Correction) -> None:
    row = segments.find(one.places[0])
    if row is None:
        return
    if one.kind == "came":
        segments.cut(row)
        segments.part(int(segments.of_row[row]))
        return
    rows = segments.rows[segments.of_row[row]]
    later = rows[segments.frames[rows] > segments.frames[row]]
    if len(later):
        segments.cut(int(later[0]))
    segments.following[segments.of_row[row]] = -1
