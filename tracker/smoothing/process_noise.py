"""How restless each person is at each time: who stands moves less than the motion model says.

[SS82] Shumway, Stoffer, "An approach to time series smoothing and forecasting using the EM
algorithm", Journal of Time Series Analysis 3(4), 1982.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.kernels.smoothing.passes import SmoothedRows, drives, sums_around

_HABIT = 8.0
"""Seconds for which somebody stays as restless as he is."""

_PRIOR = 0.5
"""Seconds of a path that the motion as stated, s = 1, is worth."""

_WILD = 2.0
"""By which factor a step may be wilder than its surroundings and still counts in full: who turns
once, or was taken for another, is not restless."""


def restlessness(
    starts: Int[ndarray, " n1"],
    found: SmoothedRows,
    noise: Float[ndarray, "d d"],
    before: Float[ndarray, " N"],
    step_time: float,
) -> Float[ndarray, " N"]:
    """s of every row, the factor of the motion's noise Q on the way to it: a step of EM [SS82].

    What drove a person to row k is w_k ~ N(0, s Q). Given all boxes its mean and covariance are

        ŵ = s Q P⁻⁻¹ (m − m⁻),   W = s Q − s Q (P⁻⁻¹ − P⁻⁻¹ P P⁻⁻¹) s Q

    and s is the mean of tr Q⁻¹ (ŵ ŵᵀ + W) / d over the rows of the path, which count the less the
    longer before or after, each row's at most twice what it was before, and drawn towards 1. Only
    what happens on the ground counts.

    Args:
        starts: Where each path's rows begin, and the end.
        found: The rows, smoothed with ``before``.
        noise: Q.
        before: s so far.
        step_time: Seconds.
    """
    dimension = found.means.shape[1]
    ground = np.flatnonzero(np.arange(dimension) % 3 < 2)
    on_ground = noise[np.ix_(ground, ground)]
    size = float(len(ground))
    squares = before * size + before**2 * drives(found, on_ground, ground)
    squares = np.minimum(squares, _WILD * size * before)
    counts = np.full(len(squares), size)
    begins = starts[:-1]
    squares[begins], counts[begins] = 0.0, 0.0  # nothing leads to a first row
    kept = float(np.exp(-step_time / _HABIT))
    prior = _PRIOR * size / step_time
    total, count = sums_around(starts, squares, kept), sums_around(starts, counts, kept)
    return np.asarray((prior + total) / (prior + count))
