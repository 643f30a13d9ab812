"""When somebody was there: the best sequence of there and away, compiled."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


@kernel
def presence(
    starts: ndarray, odds: ndarray, arrival: ndarray, stay: float, departure: float, end: int,
    lasts: ndarray,
) -> tuple[ndarray, ndarray]:  # fmt: skip
    """The most likely steps at which each path's person was there, exactly, by Viterbi's recursion.

    Args:
        starts: (n + 1,), where each path's rows begin, and the end.
        odds: (N,), log of what each row's evidence says for somebody against nobody.
        arrival: (n,), log probability of coming.
        stay: Log probability of staying from one step to the next.
        departure: Log probability of leaving.
        end: The recording's last step: who is there at it has not left.
        lasts: (n,), the last step of each path.

    Returns:
        (N,) whether he is there; (n,) log odds of the best sequence against nobody at any step.
    """
    there = np.zeros(len(odds), dtype=np.bool_)
    totals = np.zeros(len(starts) - 1)
    for path in range(len(starts) - 1):
        first, count = starts[path], starts[path + 1] - starts[path]
        came = np.zeros(count, dtype=np.bool_)
        left = np.zeros(count + 1, dtype=np.bool_)
        away, here = 0.0, -np.inf
        for k in range(count):
            stayed, arrived = here + stay, away + arrival[path]
            gone = here + departure
            if gone > away:
                left[k], away = True, gone
            came[k] = arrived > stayed
            here = max(stayed, arrived) + odds[first + k]
        last = here + (0.0 if lasts[path] >= end else departure)
        present = last > away
        totals[path] = max(last, away)
        for k in range(count - 1, -1, -1):
            there[first + k] = present
            if present:
                present = not came[k]
            else:
                present = left[k]
    return there, totals
