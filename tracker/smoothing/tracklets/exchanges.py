"""Identity swaps: steps at which two paths fit the motion better with their tails exchanged."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.smoothing.smoother import Fitted
from tracker.smoothing.tracklets.motion import PRIOR_LEFT, log_integral


def exchange_breaks(
    fitted: Fitted, *, reach: float, least: float, apart: int
) -> Bool[ndarray, " N"]:
    """Find the rows before which two paths are split, so that each may continue as the other.

    Where a filter swapped two tracks as they passed, its association was not ambiguous at any
    row: only both paths as a whole show it.

    Args:
        fitted: The paths, fitted to their boxes.
        reach: Distance on the ground within which two paths are compared, metres.
        least: Log odds of the swap above which both are split; the linking decides about it.
        apart: Number of steps within which the same two paths are split once, where the odds are
            largest.
    """
    paths = fitted.paths
    breaks = np.zeros(len(paths.states), dtype=bool)
    one, other = _pairs(fitted, reach)
    if not len(one):
        return breaks
    gains = exchange_log_odds(fitted, one, other)
    for chosen in _best_of_encounters(
        paths.owners[one], paths.owners[other], paths.steps[one], gains, apart
    ):
        if gains[chosen] > least:
            breaks[[one[chosen], other[chosen]]] = True
    return breaks


def exchange_log_odds(
    fitted: Fitted, one: Int[ndarray, " P"], other: Int[ndarray, " P"]
) -> Float[ndarray, " P"]:
    """Compute the log odds of a swap at pairs of rows of one step.

    With N(a_i, A_i) the prediction of path i to step k from the rows before, and Λ_i, η_i the
    information of its rows from k on, the swap of the paths i and j at k gains

        g = ℓ(a_i, A_i; η_j, Λ_j) + ℓ(a_j, A_j; η_i, Λ_i) − ℓ(a_i, A_i; η_i, Λ_i)
            − ℓ(a_j, A_j; η_j, Λ_j),    ℓ = log ∫ N(x; a, A) e^{ηᵀx − ½ xᵀΛx} dx

    Args:
        fitted: The paths, fitted to their boxes.
        one: Index of the row of path i, of each of P pairs.
        other: Index of the row of path j, at the same step.
    """
    paths = fitted.paths
    rows, place = np.unique(np.concatenate([one, other]), return_inverse=True)
    i, j = place[: len(one)], place[len(one) :]
    a, spread = fitted.ahead[rows], fitted.ahead_covariances[rows]
    inverse, before = np.linalg.inv(paths.covariances[rows]), np.linalg.inv(spread)
    information = inverse - (1.0 - PRIOR_LEFT) * before
    vectors = np.einsum("nij,nj->ni", inverse, paths.states[rows])
    vectors -= (1.0 - PRIOR_LEFT) * np.einsum("nij,nj->ni", before, a)
    own = log_integral(a, spread, information, vectors)
    gains = log_integral(a[i], spread[i], information[j], vectors[j])
    gains += log_integral(a[j], spread[j], information[i], vectors[i])
    return np.asarray(gains - own[i] - own[j])


def find_exchange(fitted: Fitted, one: int, other: int, after: int, until: int) -> list[int]:
    """Find the rows before which two paths are split so that the one continues as the other.

    They are those of the step at which the swap has the largest log odds.

    Args:
        fitted: The paths, fitted to their boxes.
        one: Index of the first path.
        other: Index of the path that it continues as.
        after: A step at which the person is still on the first path.
        until: A step at which the person is on the other.

    Returns:
        A row of each path; none where the first path ends before the other begins.
    """
    paths = fitted.paths
    first = max(after + 1, int(paths.firsts[one]) + 1, int(paths.firsts[other]))
    last = min(until, int(paths.lasts[one]), int(paths.lasts[other]))
    if last < first:
        return []  # the paths do not overlap in time
    steps = np.arange(first, last + 1)
    own = int(paths.starts[one]) + steps - int(paths.firsts[one])
    others = int(paths.starts[other]) + steps - int(paths.firsts[other])
    best = int(np.argmax(exchange_log_odds(fitted, own, others)))
    return [int(own[best]), int(others[best])]


def _pairs(fitted: Fitted, reach: float) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The pairs of rows of two paths at one step that are near each other, without first rows."""
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


def _best_of_encounters(
    one: Int[ndarray, " P"],
    other: Int[ndarray, " P"],
    steps: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    apart: int,
) -> list[int]:
    """The pair of rows of the largest gain for each encounter of two paths.

    Args:
        one: Path of the first row of each pair.
        other: Path of the second row.
        steps: Step of each pair.
        gains: Log odds of a swap at each pair.
        apart: Number of steps without a pair after which two paths meet anew.
    """
    order = np.lexsort((steps, np.maximum(one, other), np.minimum(one, other)))
    low, high = np.minimum(one, other)[order], np.maximum(one, other)[order]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (np.diff(low) != 0) | (np.diff(high) != 0) | (np.diff(steps[order]) > max(apart, 1))
    meeting = np.cumsum(fresh) - 1
    by_gain = np.lexsort((-gains[order], meeting))
    first = np.ones(len(order), dtype=bool)
    first[1:] = np.diff(meeting[by_gain]) != 0
    return [int(k) for k in order[by_gain[first]]]
