"""Evidence on identities from another run of the recording, for instance one backwards in time."""

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
from tracker.review.queue.moves import Move, Tracklet

_REACH = 0.7
"""Largest distance at which two tracks of the two runs may follow one person, metres on the
ground. Halved or doubled, 79 or 81 mistakes are found."""

_LASTING = 0.6
"""Least time for which a track must be paired with a track of the other run, seconds; shorter
pairings occur where another person passes by. Halved or doubled, 78 or 79 mistakes are found."""

_FOR, _AGAINST = 2.5, -2.5
"""Addend to the log odds of a move with which the other run agrees, or disagrees. Halved, 80
mistakes are found, but of 400 items; doubled 74, of 247."""


def _same(pairs: list[tuple[int, int]]) -> list[bool]:
    """Whether each pair of ids is one track of the other run; pairs with an id −1 are left out."""
    return [one == other for one, other in pairs if min(one, other) >= 0]


class OtherRun:
    """The id of the track in another run at each row of a run's tracks, as evidence on moves."""

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
        """Return the most frequent id in the other run over a few steps of a track, up to a place
        or from it on; −1 if the other run has no track there."""
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

    def with_evidence(self, move: Move) -> Move:
        """Return a move with the other run's evidence added to its log odds."""
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
        return replace(move, log_odds=move.log_odds + added)

    def moves(self) -> Iterator[Move]:
        """Yield moves that replace links by the links of the other run, where they differ.

        Their log odds are −2.5, so that they are 0 once :meth:`with_evidence` has added 2.5:
        either run is right as often as the other.
        """
        stretches = sorted(self._stretches(), key=lambda one: one[1].begin.step)
        by_other: dict[int, list[tuple[int, Tracklet]]] = {}
        for name, tracklet in stretches:
            by_other.setdefault(name, []).append((tracklet.begin.step, tracklet))
        next_own: dict[Place, Tracklet] = {}
        before_own: dict[Place, Tracklet] = {}
        by_track: dict[int, list[Tracklet]] = {}
        for _, tracklet in stretches:
            by_track.setdefault(tracklet.track, []).append(tracklet)
        for tracklets in by_track.values():
            for one, after in itertools.pairwise(tracklets):
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

    def _stretches(self) -> Iterable[tuple[int, Tracklet]]:
        """Yield the parts of tracks that have one id in the other run throughout, after that id."""
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
                yield int(self.ids[own[0]]), Tracklet(track, begin, end)
