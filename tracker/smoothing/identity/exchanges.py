"""Where two paths fit their motion better with what follows exchanged."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.smoothing.identity.pieces import log_integral
from tracker.smoothing.smoother import Fitted

_BEYOND = 1e-9
"""Of the covariance before: what keeps information at 0 where a row's boxes say nothing."""


def exchange_breaks(
    fitted: Fitted, *, reach: float, least: float, apart: int
) -> Bool[ndarray, " N"]:
    """The rows before which two paths are cut, so that each may go on as the other.

    A filter that took the wrong turn where two passed has no row that was near a draw: only
    both lives as a whole tell.

    Args:
        fitted: Of the paths.
        reach: Metres on the ground within which two are compared.
        least: Log odds from which both are cut: whether they are exchanged is for the joining.
        apart: Steps within which the same two are cut once, where they gain most.
    """
    paths = fitted.paths
    breaks = np.zeros(len(paths.states), dtype=bool)
    one, other = _pairs(fitted, reach)
    if not len(one):
        return breaks
    gains = gains_of(fitted, one, other)
    for chosen in _best(paths.owners[one], paths.owners[other], paths.steps[one], gains, apart):
        if gains[chosen] > least:
            breaks[[one[chosen], other[chosen]]] = True
    return breaks


def gains_of(
    fitted: Fitted, one: Int[ndarray, " P"], other: Int[ndarray, " P"]
) -> Float[ndarray, " P"]:
    """The log odds of pairs of rows of one step, each path going on as the other from there on.

    With a_i, A_i what the rows of path i before step k say of it, and Λ_i, η_i the information of
    its rows from k on, the paths i and j exchanged at k gain

        g = ℓ(a_i, A_i; η_j, Λ_j) + ℓ(a_j, A_j; η_i, Λ_i) − ℓ(a_i, A_i; η_i, Λ_i)
            − ℓ(a_j, A_j; η_j, Λ_j),    ℓ = log ∫ N(x; a, A) e^{ηᵀx − ½ xᵀΛx} dx
    """
    paths = fitted.paths
    rows, place = np.unique(np.concatenate([one, other]), return_inverse=True)
    i, j = place[: len(one)], place[len(one) :]
    a, spread = fitted.ahead[rows], fitted.ahead_covariances[rows]
    inverse, before = np.linalg.inv(paths.covariances[rows]), np.linalg.inv(spread)
    information = inverse - (1.0 - _BEYOND) * before
    vectors = np.einsum("nij,nj->ni", inverse, paths.states[rows])
    vectors -= (1.0 - _BEYOND) * np.einsum("nij,nj->ni", before, a)
    own = log_integral(a, spread, information, vectors)
    gains = log_integral(a[i], spread[i], information[j], vectors[j])
    gains += log_integral(a[j], spread[j], information[i], vectors[i])
    return np.asarray(gains - own[i] - own[j])


def turn(fitted: Fitted, one: int, other: int, after: int, until: int) -> list[int]:
    """The rows before which two paths are cut so that the one goes on as the other: at the step
    at which that fits both lives best.

    Args:
        fitted: Of the paths.
        one: The path.
        other: The path that it goes on as.
        after: The step at which it is still the one.
        until: The step at which it is the other.
    """
    paths = fitted.paths
    first = max(after + 1, int(paths.firsts[one]) + 1, int(paths.firsts[other]))
    last = min(until, int(paths.lasts[one]), int(paths.lasts[other]))
    if last < first:
        return []  # the one is gone when the other comes
    steps = np.arange(first, last + 1)
    own = int(paths.starts[one]) + steps - int(paths.firsts[one])
    theirs = int(paths.starts[other]) + steps - int(paths.firsts[other])
    best = int(np.argmax(gains_of(fitted, own, theirs)))
    return [int(own[best]), int(theirs[best])]


def _pairs(fitted: Fitted, reach: float) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The rows of two paths at one step that are near each other, neither of them its first."""
    paths = fitted.paths
    inner = np.ones(len(paths.states), dtype=bool)
    inner[paths.starts[:-1][np.diff(paths.starts) > 0]] = False
    rows = np.flatnonzero(inner)
    rows = rows[np.argsort(paths.steps[rows], kind="stable")]
    steps = paths.steps[rows]
    last = np.searchsorted(steps, steps, side="right")
    count = last - np.arange(len(rows)) - 1
    one = np.repeat(np.arange(len(rows)), count)
    offset = np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
    one, other = rows[one], rows[one + 1 + offset] if len(one) else one
    way = fitted.ahead[one, :2] - fitted.ahead[other, :2]
    near = (way**2).sum(axis=1) <= reach**2
    return one[near], other[near]


def _best(
    one: Int[ndarray, " P"],
    other: Int[ndarray, " P"],
    steps: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    apart: int,
) -> list[int]:
    """Of each two the pair of most gain, and of those further off than ``apart`` steps again."""
    order = np.lexsort((steps, np.maximum(one, other), np.minimum(one, other)))
    low, high = np.minimum(one, other)[order], np.maximum(one, other)[order]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(low) != 0) | (np.diff(high) != 0) | (np.diff(steps[order]) > max(apart, 1))
    meeting = np.cumsum(fresh) - 1
    by_gain = np.lexsort((-gains[order], meeting))
    first = np.ones(len(order), dtype=bool)
    first[1:] = np.diff(meeting[by_gain]) != 0
    return [int(k) for k in order[by_gain[first]]]
