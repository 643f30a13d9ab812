"""When somebody was there: two states and what the cameras say at every step, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class Habits(NamedTuple):
    """How people come and go: log probabilities."""

    stay: float
    """From one step to the next."""
    enter: float
    """Of coming, and of leaving for good."""
    change: float
    """Of going away for a while, and of returning."""


class Presence(NamedTuple):
    """When the people of n paths were there."""

    probabilities: ndarray
    """(N,), at each row."""
    odds: ndarray
    """(n,), log odds of the best sequence with somebody at some step against nobody at any."""


@kernel
def presence(
    starts: ndarray, firsts: ndarray, votes: ndarray, habits: Habits, end: int
) -> Presence:
    """How surely a path's person was there at each step, exactly, by Viterbi's recursion both ways.

    A person comes once and leaves once, with the probability e^enter each, and may be away in
    between, with e^change for each going and returning; staying has e^stay, being away costs
    nothing. At each step the best sequence in which he is there is set against the best in
    which he is not.

    Args:
        starts: (n + 1,), where each path's rows begin, and the end.
        firsts: (n,), the first step of each path.
        votes: (N,), log of what each row's evidence says for somebody against nobody.
        habits: Of all.
        end: The recording's last step: who is there at it has not left, and who is there at its
            first one has not come.
    """
    stay, enter, change = habits
    chances = np.zeros(len(votes))
    odds = np.full(len(starts) - 1, -np.inf)
    for path in range(len(starts) - 1):
        first, count = starts[path], starts[path + 1] - starts[path]
        here, between, gone = np.empty(count), np.empty(count), np.empty(count)
        present, away, left = -np.inf, -np.inf, -np.inf
        coming = 0.0 if firsts[path] <= 0 else enter
        for k in range(count):
            away, left, present = (
                max(away, present + change),
                max(left, present + enter),
                max(coming, max(away + change, present + stay)) + votes[first + k],
            )
            here[k], between[k], gone[k] = present, away, left
            coming = enter
        leaving = 0.0 if firsts[path] + count - 1 >= end else enter
        odds[path] = max(present + leaving, left)
        # what can still come, from each state
        if_present, if_never, if_away = leaving, 0.0, -np.inf
        for k in range(count - 1, -1, -1):
            absent = max(if_never, max(between[k] + if_away, gone[k]))
            difference = absent - here[k] - if_present
            chances[first + k] = 1.0 / (1.0 + math.exp(min(max(difference, -500.0), 500.0)))
            on = votes[first + k] + if_present
            if_present, if_never, if_away = (
                max(stay + on, max(change + if_away, enter)),
                max(if_never, enter + on),
                max(if_away, change + on),
            )
    return Presence(chances, odds)
