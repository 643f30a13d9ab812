"""How far a track is one person's for sure, seen from a step: what hangs on a decision there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.review.queue.item import Lanes

_MOST = 0.95
"""Probability of a mistake beyond which none is taken for sure."""


class Trust:
    """Steps of a track that are the same person's as at a step of it.

    With p_m the probability of a mistake at moment m, the expected number of rows r before step s
    that hang together with it is Σ_r Π_{m between r and s} (1 − p_m); likewise after it. Who was
    somebody else a moment before has little to lose.
    """

    def __init__(self, lanes: Lanes, mistakes: Iterable[tuple[int, int, int, float]]) -> None:
        """Take notice of where tracks may be wrong.

        Args:
            lanes: Of a run.
            mistakes: Track, last step before, first step after it, and probability.
        """
        self._lanes = lanes
        self._logs: dict[int, Float[ndarray, " K"]] = {}
        for track, before, after, probability in mistakes:
            rows = lanes.rows[track]
            logs = self._logs.setdefault(track, np.zeros(len(rows)))
            frames = lanes.tracks.frames[rows]
            at = int(np.searchsorted(frames, (before + after + 1) // 2))
            if 0 < at < len(rows):
                logs[at] += np.log1p(-min(probability, _MOST))

    def before(self, track: int, step: int) -> float:
        """Steps up to one, itself included."""
        frames = self._lanes.tracks.frames[self._lanes.rows[track]]
        count = int(np.searchsorted(frames, step, side="right"))
        logs = self._logs.get(track)
        if logs is None or not count:
            return float(count)
        between = np.cumsum(logs[1:count][::-1])  # from the step backwards
        return 1.0 + float(np.exp(between).sum())

    def after(self, track: int, step: int) -> float:
        """Steps from one on."""
        frames = self._lanes.tracks.frames[self._lanes.rows[track]]
        first = int(np.searchsorted(frames, step))
        logs = self._logs.get(track)
        if logs is None or first >= len(frames):
            return float(len(frames) - first)
        return 1.0 + float(np.exp(np.cumsum(logs[first + 1 :])).sum())
