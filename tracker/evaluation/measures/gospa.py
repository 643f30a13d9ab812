"""GOSPA with α = 2, split into localisation, missed and false targets.

[RGS17] Rahmathullah, García-Fernández, Svensson, "Generalized optimal sub-pattern
assignment metric", FUSION 2017.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation.measures.matching import Comparison
from tracker.geometry.assignment import linear_sum_assignment


@dataclass(frozen=True, slots=True, eq=False)
class Gospa:
    """GOSPA of every step. The three parts are p-th powers: they sum to distance^p."""

    distance: Float[ndarray, " S"]
    """GOSPA at each step, in the unit of the distance."""
    localisation: Float[ndarray, " S"]
    """Σ d^p over the pairs."""
    missed: Float[ndarray, " S"]
    """c^p/2 for each missed target."""
    false: Float[ndarray, " S"]
    """c^p/2 for each false target."""
    missed_count: Int[ndarray, " S"]
    """The number of missed targets."""
    false_count: Int[ndarray, " S"]
    """The number of false targets."""


def gospa_parts(
    distances: Float[ndarray, "M N"], *, cutoff: float, order: float
) -> tuple[float, int, int]:
    """Return the localisation cost, the number of missed and the number of false targets.

    They minimise, over all partial assignments γ, with α = 2 [RGS17], proposition 1:

        GOSPA^p = min_γ ( Σ_{(i, j) ∈ γ} d(x_i, y_j)^p + c^p/2 (missed + false) ).

    A pair at the cut-off or beyond counts as one missed and one false target.

    Args:
        distances: The distance of every true target (rows) to every estimate (columns).
        cutoff: c > 0, in the unit of the distances.
        order: p >= 1.

    Returns:
        Σ d^p over the pairs, missed, false. Two empty sets give zeros.
    """
    people, estimates = distances.shape
    if not distances.size:
        return 0.0, people, estimates
    costs = np.minimum(distances, cutoff) ** order
    rows, columns = linear_sum_assignment(costs)
    paired = distances[rows, columns] < cutoff
    pairs = int(paired.sum())
    near = float(costs[rows, columns][paired].sum())
    return near, people - pairs, estimates - pairs


def gospa(comparison: Comparison, *, cutoff: float, order: float) -> Gospa:
    """Compute GOSPA at each step; see :func:`gospa_parts` for the arguments."""
    parts = [gospa_parts(d, cutoff=cutoff, order=order) for d in comparison.distances]
    near = np.array([part[0] for part in parts], dtype=float)
    missed = np.array([part[1] for part in parts], dtype=np.int64)
    false = np.array([part[2] for part in parts], dtype=np.int64)
    half = cutoff**order / 2.0
    return Gospa(
        distance=(near + half * (missed + false)) ** (1.0 / order),
        localisation=near,
        missed=half * missed,
        false=half * false,
        missed_count=missed,
        false_count=false,
    )
