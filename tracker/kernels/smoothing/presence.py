"""When somebody was there: two states and what the cameras say at every step, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


@kernel
def presence(
    starts: ndarray, lasts: ndarray, votes: ndarray, stay: float, change: float, end: int
) -> tuple[ndarray, ndarray]:
    """How surely a path's person was there at each step, exactly, by Viterbi's recursion both ways.

    A person is away or there; coming and leaving have the probability e^change each, staying
    has e^stay, being away costs nothing. At each step the best sequence in which he is there
    is set against the best in which he is not.

    Args:
        starts: (n + 1,), where each path's rows begin, and the end.
        lasts: (n,), the last step of each path.
        votes: (N,), log of what each row's evidence says for somebody against nobody.
        stay: Log probability.
        change: Log probability.
        end: The recording's last step: who is there at it has not left.

    Returns:
        (N,) probability of being there; (n,) log odds of the best sequence with somebody at
        some step against nobody at any.
    """
    chances = np.zeros(len(votes))
    odds = np.full(len(starts) - 1, -np.inf)
    for path in range(len(starts) - 1):
        first, count = starts[path], starts[path + 1] - starts[path]
        here, away = np.empty(count), np.empty(count)
        # the best up to each step: there, and away; and never there so far
        present, absent, been = -np.inf, 0.0, -np.inf
        for k in range(count):
            left = max(absent, present + change)
            been = max(been, present + change)
            present = max(absent + change, present + stay) + votes[first + k]
            absent = left
            here[k], away[k] = present, absent
        leaving = 0.0 if lasts[path] >= end else change
        odds[path] = max(present + leaving, been)
        behind_present, behind_away = leaving, 0.0
        for k in range(count - 1, -1, -1):
            difference = away[k] + behind_away - here[k] - behind_present
            chances[first + k] = 1.0 / (1.0 + math.exp(min(max(difference, -500.0), 500.0)))
            vote = votes[first + k]
            behind_present, behind_away = (
                max(stay + vote + behind_present, change + behind_away),
                max(change + vote + behind_present, behind_away),
            )
    return chances, odds
