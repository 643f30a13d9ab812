"""Who may have made what: gates, the validation matrix, and clusters that share measurements."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray


def validation_matrix(
    squared_distances: Float[ndarray, "n M"], bound: float
) -> Bool[ndarray, "M n1"]:
    """The validation matrix Ω = [ω_jt]: row j a measurement, column t its possible source.

    Column 0 is the false alarm, which every measurement can be; ω_jt is true where

        (z_j − ẑ_t)ᵀ S_t⁻¹ (z_j − ẑ_t) ≤ bound

    that is, z_j lies in the gate of target t (Bar-Shalom, Fortmann, *Tracking and Data
    Association*, 1988, §9.3).

    Args:
        squared_distances: Squared Mahalanobis distances of targets and measurements.
        bound: Of a gate, a quantile of χ².
    """
    targets, count = squared_distances.shape
    matrix = np.ones((count, 1 + targets), dtype=bool)
    matrix[:, 1:] = squared_distances.T <= bound
    return matrix


def clusters(possible: Bool[ndarray, "n M"]) -> list[tuple[ndarray, ndarray]]:
    """Groups of targets that compete for measurements, each to be associated by itself.

    Args:
        possible: Whether target i may have made measurement j.

    Returns:
        Targets and measurements of each group, ascending. A target without any
        measurement is a group of its own; measurements of nobody are in none.
    """
    targets = len(possible)
    left = np.ones(targets, dtype=bool)
    groups = []
    for first in range(targets):
        if not left[first]:
            continue
        members = np.zeros(targets, dtype=bool)
        members[first] = True
        while True:
            shared = possible[members].any(axis=0)
            wider = members | possible[:, shared].any(axis=1)
            if (wider == members).all():
                break
            members = wider
        left &= ~members
        groups.append((np.flatnonzero(members), np.flatnonzero(shared)))
    return groups
