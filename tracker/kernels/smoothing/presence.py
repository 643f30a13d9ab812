"""Existence of tracks over time: two states and the evidence of every step, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class ExistenceTransitions(NamedTuple):
    """The transition model of existence, as log probabilities."""

    stay: float
    """Log probability of existing at the next step."""
    enter: float
    """Log probability of a birth, and of a death."""
    change: float
    """Log probability of becoming absent for a while, and of returning."""


class Presence(NamedTuple):
    """The existence of n tracks over N rows."""

    probabilities: ndarray
    """(N,), 1 / (1 + e^−δ) at each row, with the log odds δ of the best sequence in which the track
    exists there against the best in which it does not."""
    odds: ndarray
    """(n,), log odds of the best sequence that exists at some step against never existing."""


@kernel
def presence(
    starts: ndarray, firsts: ndarray, votes: ndarray, transitions: ExistenceTransitions, end: int
) -> Presence:
    """Compare, for each path and step, the best sequences of presence with and without the step.

    A track is born once and dies once, with the probability e^enter each, and may be absent in
    between, with e^change for each change; staying present has e^stay, being absent has 1.
    Viterbi's recursion, forwards and backwards, gives the exact maximum over all sequences in
    which the track exists at a step, and over those in which it does not (max-marginals, no sums).

    Args:
        starts: (n + 1,), index of each path's first row, and N.
        firsts: (n,), first step of each path.
        votes: (N,), log likelihood ratio of each row's evidence: the track exists against it does
            not.
        transitions: The transition model of all paths.
        end: Last step of the recording: a track that exists at it has not died, and one that
            exists at step 0 was not born.
    """
    stay, enter, change = transitions
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
        # the best continuation from each state
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
