"""What another look at the recording says of who is who: backwards in time, for instance."""

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
from tracker.review.queue.item import Lanes
from tracker.review.queue.linking import Move, Piece

_REACH = 0.7
"""Metres on the ground within which the two runs mean one person."""

_SETTLED = 0.6
"""Seconds for which a track must be the other run's one, or it is passing by."""

_FOR, _AGAINST = 2.5, -2.5
"""What the other run's word adds to the log odds of a move."""


def _told(pairs: list[tuple[int, int]]) -> list[bool]:
    """Whether each pair is one person for the other run, where it knows both."""
    return [one == other for one, other in pairs if min(one, other) >= 0]


class Opinion:
    """The other run's id at each row of a run's tracks."""

    def __init__(self, tracks: Trajectories, other: Trajectories, step_time: float) -> None:
        """Pair the two runs step by step, the nearest first.

        Args:
            tracks: Of the run.
            other: Of the other one, at the same steps.
            step_time: Seconds.
        """
        self._tracks, self._lanes = tracks, Lanes(tracks)
        self.ids: Int[ndarray, " N"] = np.full(len(tracks), -1, dtype=np.int64)
        self._least = max(round(_SETTLED / step_time), 2)
        for step in np.unique(tracks.frames).tolist():
            own, theirs = tracks.at(step), other.at(step)
            apart = np.linalg.norm(
                tracks.positions[own][:, None, :2] - other.positions[theirs][None, :, :2], axis=2
            )
            if not apart.size:
                continue
            rows, columns = pairs_within(apart, _REACH)
            self.ids[own.start + rows] = other.ids[theirs][columns]

    def at(self, track: int, place: Place, *, before: bool) -> int:
        """Who it is for the other run, mostly, in the steps up to a place or from it on; -1 for
        nobody."""
        rows = self._lanes.rows[track]
        frames = self._tracks.frames[rows]
        if before:
            own = rows[frames <= place.step][-3 * self._least :]
        else:
            own = rows[frames >= place.step][: 3 * self._least]
        told = self.ids[own]
        told = told[told >= 0]
        if not len(told):
            return -1
        names, counts = np.unique(told, return_counts=True)
        return int(names[np.argmax(counts)])

    def weighed(self, move: Move) -> Move:
        """A move with the other run's word for it, or against it."""
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
            agrees, differs = _told(new), _told(now)
            if agrees and all(agrees):
                added += _FOR
            if differs and all(differs):
                added += _AGAINST
        return replace(move, odds=move.odds + added)

    def moves(self) -> Iterator[Move]:
        """What the other run links otherwise: with its word, which is weighed later, each is as
        likely as what the run has, for the one is right as often as the other."""
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
        for told in by_other.values():
            for (_, one), (_, after) in itertools.pairwise(told):
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
        """Parts of tracks that are one id of the other run throughout, and which."""
        for track, rows in self._lanes.rows.items():
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
                begin, end = self._lanes.of_row(own[0]), self._lanes.of_row(own[-1])
                yield int(self.ids[own[0]]), Piece(track, begin, end)
