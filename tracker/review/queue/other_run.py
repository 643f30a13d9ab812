"""Evidence on identities from another run of the recording, for instance backwards in time."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.corrections import Place
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.assignment import pairs_within
from tracker.review.queue.item import TrackRows
from tracker.review.queue.linking import Move, Piece

_REACH = 0.7
"""Largest distance of tracks of the two runs that follow one person, metres on the ground."""

_LASTING = 0.6
"""Least time for which a track must be paired with one of the other run, seconds; shorter pairings
are of people who pass by."""

_FOR, _AGAINST = 2.5, -2.5
"""What the other run adds to the log odds of a move that it agrees, or disagrees, with."""


def _same(pairs: list[tuple[int, int]]) -> list[bool]:
    """Whether each pair is one track of the other run; pairs with an unknown id are left out."""
    return [one == other for one, other in pairs if min(one, other) >= 0]


class OtherRun:
    """The id in another run at each row of a run's tracks, and what follows for moves."""

    def __init__(self, tracks: Trajectories, other: Trajectories, step_time: float) -> None:
        """Pair the tracks of the two runs at each step, the nearest first.

        Args:
            tracks: The tracks of the run.
            other: The tracks of the other run, at the same steps.
            step_time: Duration of a step, seconds.
        """
        self._tracks, self._track_rows = tracks, TrackRows(tracks)
        self.ids: Int[ndarray, " N"] = np.full(len(tracks), -1, dtype=np.int64)
        self._least = max(round(_LASTING / step_time), 2)
        for step in np.unique(tracks.frames).tolist():
            own, others = tracks.at(step), other.at(step)
            apart = np.linalg.norm(
                tracks.positions[own][:, None, :2] - other.positions[others][None, :, :2], axis=2
            )
            if not apart.size:
                continue
            rows, columns = pairs_within(apart, _REACH)
            self.ids[own.start + rows] = other.ids[others][columns]

    def at(self, track: int, place: Place, *, before: bool) -> int:
        """Return the most frequent id of a track in the other run, in the steps up to a place or
        from it on; −1 for none."""
        rows = self._track_rows.rows[track]
        frames = self._tracks.frames[rows]
        if before:
            own = rows[frames <= place.step][-3 * self._least :]
        else:
            own = rows[frames >= place.step][: 3 * self._least]
        ids = self.ids[own]
        ids = ids[ids >= 0]
        if not len(ids):
            return -1
        names, counts = np.unique(ids, return_counts=True)
        return int(names[np.argmax(counts)])

    def weighed(self, move: Move) -> Move:
        """Return a move with the other run's evidence added to its odds."""
        earlier = [self.at(one.track, one.end, before=True) for one in move.earlier]
        later = [self.at(one.track, one.begin, before=False) for one in move.later]
        added = 0.0
        if len(earlier) == 1 and len(later) == 1:
            if min(earlier[0], later[0]) >= 0:
                added = _FOR if (earlier[0] == later[0]) == move.joins else _AGAINST
        else:
            now = [(earlier[0], later[0])]
            new = [(earlier[0], later[-1])] if len(later) == 2 else [(earlier[-1], later[0])]
            if len(earlier) == 2 and len(later) == 2:
                now, new = (
                    [*now, (earlier[1], later[1])],
                    [(earlier[0], later[1]), (earlier[1], later[0])],
                )
            agrees, differs = _same(new), _same(now)
            if agrees and all(agrees):
                added += _FOR
            if differs and all(differs):
                added += _AGAINST
        return replace(move, odds=move.odds + added)

    def moves(self) -> Iterator[Move]:
        """Yield moves to the links of the other run, where they differ.

        With the other run's evidence, which :meth:`weighed` adds, each has even odds: either run
        is right as often as the other.
        """
        stretches = sorted(self._stretches(), key=lambda one: one[1].begin.step)
        by_other: dict[int, list[tuple[int, Piece]]] = {}
        for name, piece in stretches:
            by_other.setdefault(name, []).append((piece.begin.step, piece))
        next_own: dict[Place, Piece] = {}
        before_own: dict[Place, Piece] = {}
        by_track: dict[int, list[Piece]] = {}
        for _, piece in stretches:
            by_track.setdefault(piece.track, []).append(piece)
        for pieces in by_track.values():
            for one, after in itertools.pairwise(pieces):
                next_own[one.end], before_own[after.begin] = after, one
        for of_one in by_other.values():
            for (_, one), (_, after) in itertools.pairwise(of_one):
                if one.track == after.track or one.end.step >= after.begin.step:
                    continue
                follows, precedes = next_own.get(one.end), before_own.get(after.begin)
                if follows is None and precedes is None:
                    yield Move((one,), (after,), "join", -_FOR)
                elif follows is not None and precedes is not None:
                    yield Move((one, precedes), (follows, after), "exchange", -_FOR)
                elif follows is not None:
                    yield Move((one,), (follows, after), "exchange", -_FOR)
                elif precedes is not None:
                    yield Move((precedes, one), (after,), "exchange", -_FOR)

    def _stretches(self) -> Iterable[tuple[int, Piece]]:
        """Yield the parts of tracks that have one id in the other run throughout, each with it."""
        for track, rows in self._track_rows.rows.items():
            known = rows[self.ids[rows] >= 0]
            if not len(known):
                continue
            names = self.ids[known]
            cuts = np.flatnonzero(np.diff(names)) + 1
            parts = [p for p in np.split(known, cuts) if len(p) >= self._least]
            merged: list[list[int]] = []
            for part in parts:
                if merged and self.ids[merged[-1][-1]] == self.ids[part[0]]:
                    merged[-1].extend(part.tolist())
                else:
                    merged.append(part.tolist())
            for own in merged:
                begin, end = self._track_rows.of_row(own[0]), self._track_rows.of_row(own[-1])
                yield int(self.ids[own[0]]), Piece(track, begin, end)
