"""When somebody was there: two states and what the cameras say at every step, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


@kernel
def _log_add(a: float, b: float) -> float:
    """log(eᵃ + eᵇ)."""
    low, high = min(a, b), max(a, b)
    return high if low == -np.inf else high + math.log1p(math.exp(low - high))


@kernel
def presence(
    starts: ndarray, lasts: ndarray, votes: ndarray, stay: float, change: float, end: int
) -> tuple[ndarray, ndarray]:
    """The probability at each step that a path's person was there, forward and backward.

    A person is away or there; coming and leaving have the probability e^change each, staying
    has e^stay, being away costs nothing.

    Args:
        starts: (n + 1,), where each path's rows begin, and the end.
        lasts: (n,), the last step of each path.
        votes: (N,), log of what each row's evidence says for somebody against nobody.
        stay: Log probability.
        change: Log probability.
        end: The recording's last step: who is there at it has not left.

    Returns:
        (N,) probability of being there; (n,) log odds of somebody at some step against nobody.
    """
    chances = np.zeros(len(votes))
    odds = np.full(len(starts) - 1, -np.inf)
    for path in range(len(starts) - 1):
        first, count = starts[path], starts[path + 1] - starts[path]
        # log weight of all ways up to each step: never there, there, and there before
        here, after = np.empty(count), np.empty(count)
        present, gone = -np.inf, -np.inf
        for k in range(count):
            left = _log_add(gone, present + change)
            came = _log_add(_log_add(0.0, gone) + change, present + stay)
            present, gone = came + votes[first + k], left
            here[k], after[k] = present, gone
        leaving = 0.0 if lasts[path] >= end else change
        total = _log_add(here[count - 1] + leaving, after[count - 1]) if count else -np.inf
        odds[path] = total
        whole = _log_add(total, 0.0)
        behind_present, behind_away = leaving, 0.0
        for k in range(count - 1, -1, -1):
            chances[first + k] = math.exp(min(here[k] + behind_present - whole, 0.0))
            vote = votes[first + k]
            behind_present, behind_away = (
                _log_add(stay + vote + behind_present, change + behind_away),
                _log_add(change + vote + behind_present, behind_away),
            )
    return chances, odds
