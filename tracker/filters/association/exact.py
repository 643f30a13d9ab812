"""Exact marginal association probabilities, by dynamic programming over subsets.

The sum over all joint events of n targets and M measurements has more terms than can
be enumerated, but after any number of measurements only the *set* of targets that are
assigned matters, not which measurement each has: M · 2ⁿ sums suffice (or n · 2ᴹ, whichever
is less). Efficient hypothesis management uses the same observation: S. Maskell, M. Briers,
R. Wright, "Fast mutual exclusion", Signal and Data Processing of Small Targets, SPIE
5428, 2004.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.filters.association.belief_propagation import Marginals
from tracker.kernels.association.subsets import subset_marginals

MOST_ITEMS = 18
"""Largest value of min(n, M): the memory grows as n · 2ⁿ, 44 MB for n = M = 18 and 193 MB for
20."""


def exact_marginals(
    missed: Float[ndarray, " n"],
    detected: Float[ndarray, "n M"],
    unexplained: Float[ndarray, " M"],
    *,
    false_counts: Float[ndarray, " M1"] | None = None,
) -> Marginals:
    """Compute marginals of the one-to-one association over all joint events, up to rounding.

    Args:
        missed: w_i0, the weight of target i being missed.
        detected: w_ij, the weight of target i having made measurement j; 0 outside the gate.
        unexplained: ρ_j, clutter and newborn intensity at measurement j.
        false_counts: g(0) … g(M), the factor by the number of measurements without a target;
            None stands for 1.

    Returns:
        Marginals whose rows and columns sum to 1.

    Raises:
        ValueError: If both numbers are above :data:`MOST_ITEMS`, or no joint event has a
            positive weight.
    """
    targets, count = detected.shape
    if min(targets, count) > MOST_ITEMS:
        raise ValueError(
            f"exact marginals of {targets} targets and {count} measurements: one of the numbers "
            f"must be at most {MOST_ITEMS}; split them into clusters, or use belief propagation"
        )
    factors = np.ones(count + 1) if false_counts is None else np.asarray(false_counts, float)
    # by the number of targets that have a measurement: the other measurements are false
    factors = factors[::-1][: min(targets, count) + 1]
    factors = np.ascontiguousarray(factors / factors.max())
    weights = np.array(detected, dtype=float)
    missed, unexplained = np.array(missed, dtype=float), np.array(unexplained, dtype=float)
    # each measurement and each target has one factor in every event: scaled to at most 1,
    # measurements first, since their weights are densities of any unit
    columns = np.maximum(unexplained, weights.max(axis=0, initial=0.0))
    columns[columns == 0.0] = 1.0
    weights /= columns
    unexplained /= columns
    rows = np.maximum(missed, weights.max(axis=1, initial=0.0))
    rows[rows == 0.0] = 1.0
    weights /= rows[:, None]
    missed /= rows
    if targets <= count:
        # measurement by measurement, each of which is assigned a target or none
        sums = subset_marginals(unexplained, np.ascontiguousarray(weights.T), missed, factors)
        detected, none, left = sums.chosen.T, sums.left, sums.none
    else:
        sums = subset_marginals(missed, weights, unexplained, factors)
        detected, none, left = sums.chosen, sums.none, sums.left
    if not sums.total > 0.0:
        raise ValueError("no joint event has a positive weight; give every target a w_i0 above 0")
    return Marginals(detected / sums.total, none / sums.total, left / sums.total)
