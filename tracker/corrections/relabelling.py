"""Corrections in finished tracks, where no stage settles who is who: cut, joined, left out.

Also what shows at once, while a run that obeys them is computed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence as Many

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.corrections.kinds import Correction, Place
from tracker.corrections.seeking import Whereabouts, mostly_inside
from tracker.geometry.assignment import names_by_majority


class _Segments:
    """Tracks cut into segments, each followed by at most one."""

    def __init__(self, frames: ndarray, ids: ndarray, positions: ndarray, leeway: int) -> None:
        self.frames, self.positions = frames, positions
        self.whereabouts = Whereabouts(frames, positions, ids)
        self.leeway = leeway
        order = np.lexsort((frames, ids))
        _names, begins = np.unique(ids[order], return_index=True)
        self.rows: list[ndarray] = np.split(order, begins[1:]) if len(order) else []
        self.following: list[int] = [-1] * len(self.rows)
        self.of_row = np.empty(len(ids), dtype=np.int64)
        for number, rows in enumerate(self.rows):
            self.of_row[rows] = number

    def find(self, place: Place) -> int | None:
        """The row that is meant."""
        return self.whereabouts.nearest(place, leeway=self.leeway)

    def cut(self, row: int) -> None:
        """Let the segment of a row begin at it; what was before goes on in it."""
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
        """The step after one and up to another at which two segments are nearest to each other;
        None where they are not both there."""
        mine, theirs = (
            rows[(self.frames[rows] > after) & (self.frames[rows] <= until)]
            for rows in (self.rows[one], self.rows[other])
        )
        steps, at, there = np.intersect1d(
            self.frames[mine], self.frames[theirs], return_indices=True
        )
        if not len(steps):
            return None
        ground = self.positions[:, :2]
        apart = np.hypot(*(ground[mine[at]] - ground[theirs[there]]).T)
        return int(steps[np.argmin(apart)])

    def longest_way(self, earlier: int, later: int) -> int:
        """The row up to a later one of a segment before which it goes farthest in one step."""
        rows = self.rows[self.of_row[later]]
        frames = self.frames[rows]
        own = rows[(frames >= self.frames[earlier]) & (frames <= self.frames[later])]
        if len(own) < 2:
            return later
        way = np.hypot(*np.diff(self.positions[own, :2], axis=0).T)
        return int(own[1 + np.argmax(way)])

    def cut_from(self, number: int, step: int) -> int:
        """The segment that begins at a step, cut off where it does not."""
        rows = self.rows[number]
        row = int(rows[np.searchsorted(self.frames[rows], step)])
        self.cut(row)
        return int(self.of_row[row])

    def before(self, number: int) -> int:
        """What a segment follows, -1 for nothing."""
        return self.following.index(number) if number in self.following else -1

    def part(self, number: int) -> None:
        """Let a segment follow nothing."""
        earlier = self.before(number)
        if earlier >= 0:
            self.following[earlier] = -1

    def tie(self, earlier: int, later: int) -> None:
        """Let a segment follow another, and what followed that follow nothing."""
        self.part(later)
        self.following[earlier] = later

    def chain(self, number: int) -> list[int]:
        """The segments of one person, in the order of time."""
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
    """Who is who with the corrections, one after another; what finds nobody is left alone.

    Args:
        frames: The step of each row of N.
        ids: Whose each is.
        positions: (N, 3) world metres.
        corrections: In their order.
        leeway: Steps within which somebody counts as meant who is not there at the very step.

    Returns:
        The id of each row: a person keeps the one of most of his rows, others get new numbers. And
        the rows that stay, ascending.
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
        return  # both are the same one there
    ties = []
    for a, b in pairs:
        earlier, later = int(segments.of_row[a]), int(segments.of_row[b])
        if later in segments.chain(earlier):
            continue  # so it is
        if not segments.frames[a] < segments.frames[b]:
            return
        # where both are there at once for a while, they turn into each other where they meet
        turn = segments.nearest(
            earlier, later, int(segments.frames[[a for a, _ in pairs]].max()),
            int(segments.frames[[b for _, b in pairs]].min()),
        )  # fmt: skip
        ties.append((a, b, turn))
    for a, b, turn in ties:
        if turn is not None:
            for row in (a, b):
                number = int(segments.of_row[row])
                own = segments.frames[segments.rows[number]]
                if own[0] < turn <= own[-1]:
                    segments.cut_from(number, turn)
    for a, b, _ in ties:
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
