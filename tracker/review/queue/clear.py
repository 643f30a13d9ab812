"""Where a track stands clear of all others: places that mean one person and no other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.corrections import Place
from tracker.corrections.kinds import REACH
from tracker.review.queue.item import Lanes
from tracker.review.queue.linking import Move, Piece

_WIDTHS = 4.0
"""Target widths from the nearest of others: a place said a little beside is still nearest."""

_FARTHEST = 2.0 * REACH
"""Metres beyond which nobody is clearer."""

_ASIDE, _FEWEST = 0.4, 2
"""Seconds, and steps, from a doubtful moment at which a track is on its way from one to another."""

_LONGEST = 5.0
"""Seconds before and after a doubtful moment within which a clear place is looked for."""


class Clear:
    """Moves doubtful moments apart, to where it can be said who is who.

    While people are close, a place among them means now the one and now the other, and for a run
    with other values perhaps a third. Who they are before they meet and after they part can be
    said by anybody who sees it, and holds for every run.
    """

    def __init__(self, lanes: Lanes, step_time: float, width: float) -> None:
        """See how far each row is from the nearest of others.

        Args:
            lanes: Of a run.
            step_time: Seconds.
            width: Of a target, metres.
        """
        self._lanes, tracks = lanes, lanes.tracks
        self._clear = min(_WIDTHS * width, _FARTHEST)
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
        """The last clear place of a track up to a step, or the clearest one."""
        rows = self._lanes.rows[track]
        frames = self._lanes.tracks.frames[rows]
        own = rows[(frames <= step) & (frames >= step - self._longest)]
        if not len(own):
            return self._lanes.place(track, step)
        aside = own[self._lanes.tracks.frames[own] <= step - self._aside]
        own = aside if len(aside) else own
        apart = self._apart[own]
        clear = np.flatnonzero(apart >= self._clear)
        best = clear[-1] if len(clear) else len(own) - 1 - np.argmax(apart[::-1])
        return self._lanes.of_row(int(own[best]))

    def after(self, track: int, step: int) -> Place:
        """The first clear place of a track from a step on, or the clearest one."""
        rows = self._lanes.rows[track]
        frames = self._lanes.tracks.frames[rows]
        own = rows[(frames >= step) & (frames <= step + self._longest)]
        if not len(own):
            return self._lanes.place(track, step, after=True)
        aside = own[self._lanes.tracks.frames[own] >= step + self._aside]
        own = aside if len(aside) else own
        apart = self._apart[own]
        clear = np.flatnonzero(apart >= self._clear)
        return self._lanes.of_row(int(own[clear[0] if len(clear) else np.argmax(apart)]))

    def move(self, move: Move) -> Move:
        """The same move between clear places."""
        return Move(
            tuple(
                Piece(one.track, one.begin, self.before(one.track, one.last), one.last)
                for one in move.earlier
            ),
            tuple(
                Piece(one.track, self.after(one.track, one.first), one.end, one.first)
                for one in move.later
            ),
            move.kind,
            move.odds,
            move.why,
        )
