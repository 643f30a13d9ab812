"""Places at which a track is clear of all others, so that a correction there is unambiguous."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Place
from tracker.corrections.kinds import REACH
from tracker.review.queue.item import TrackRows
from tracker.review.queue.moves import Move, Tracklet

# The sensitivities below are of the queues of six random crowds of twelve people, of four random
# rooms that people leave, whose detectors miss a third, and of three recordings, with and without
# smoothing: 381 items, 105 of whose first fifteen are true.
_CLEAR = 2.0 * REACH
"""Least distance of a clear place from the nearest other track, metres: a correction that is made a
little beside the place is then still nearest to its track. Halved, 103 of the first fifteen are
true; from twice on, 107."""

_ASIDE, _FEWEST = 0.4, 2
"""Time, in seconds, and least number of steps around the moment of a move at which the track may
lie between two persons. At these rates the number counts: without it, 107 are true, and with twice
as many, or with 0.8 s, 110 and 108."""

_LONGEST = 5.0
"""Time before and after the moment of a move within which a clear place is searched, seconds.
Halved, 102 are true; doubled 118, and unlimited 126, but of 26 items fewer, since moves of other
moments lead to the same place; twelve truthful answers win as much IDF1 in six rooms."""


class ClearPlaces:
    """The places of a run's tracks that a correction can refer to without ambiguity.

    While two people are close, a place between them may be of either, and in a run with other
    parameters of a third person. Before they meet and after they part their identities are evident
    in the pictures, and a correction there has the same meaning for every run. Places at which no
    camera has a box are not clear.
    """

    def __init__(self, track_rows: TrackRows, step_time: float) -> None:
        """Compute the distance of each row to the nearest other track.

        Args:
            track_rows: The tracks of the run.
            step_time: Duration of a step, seconds.
        """
        self._track_rows, tracks = track_rows, track_rows.tracks
        self._longest = max(round(_LONGEST / step_time), 1)
        self._aside = max(round(_ASIDE / step_time), _FEWEST)
        self._apart: Float[ndarray, " N"] = np.full(len(tracks), np.inf)
        for step in np.unique(tracks.frames).tolist():
            own = tracks.at(step)
            ground = tracks.positions[own, :2]
            apart = np.hypot(*(ground[:, None] - ground[None]).transpose(2, 0, 1))
            np.fill_diagonal(apart, np.inf)
            self._apart[own] = apart.min(axis=1)
        self._apart[~tracks.seen.any(axis=1)] = 0.0

    def before(self, track: int, step: int) -> Place:
        """Return the last clear place of a track up to a step, or else the farthest from others."""
        rows = self._track_rows.rows[track]
        frames = self._track_rows.tracks.frames[rows]
        own = rows[(frames <= step) & (frames >= step - self._longest)]
        if not len(own):
            return self._track_rows.place(track, step)
        aside = own[self._track_rows.tracks.frames[own] <= step - self._aside]
        own = aside if len(aside) else own
        apart = self._apart[own]
        clear = np.flatnonzero(apart >= _CLEAR)
        best = clear[-1] if len(clear) else len(own) - 1 - np.argmax(apart[::-1])
        return self._track_rows.of_row(int(own[best]))

    def after(self, track: int, step: int) -> Place:
        """Return the first clear place of a track from a step on, or else the farthest from
        others."""
        rows = self._track_rows.rows[track]
        frames = self._track_rows.tracks.frames[rows]
        own = rows[(frames >= step) & (frames <= step + self._longest)]
        if not len(own):
            return self._track_rows.place(track, step, after=True)
        aside = own[self._track_rows.tracks.frames[own] >= step + self._aside]
        own = aside if len(aside) else own
        apart = self._apart[own]
        clear = np.flatnonzero(apart >= _CLEAR)
        return self._track_rows.of_row(int(own[clear[0] if len(clear) else np.argmax(apart)]))

    def move(self, move: Move) -> Move:
        """Return a move whose begins and ends are replaced by clear places."""
        return Move(
            tuple(
                Tracklet(one.track, one.begin, self.before(one.track, one.last), one.last)
                for one in move.earlier
            ),
            tuple(
                Tracklet(one.track, self.after(one.track, one.first), one.end, one.first)
                for one in move.later
            ),
            move.kind,
            move.log_odds,
            move.why,
        )
