"""Gating: the validation matrix, and clusters of targets that share measurements."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray


def validation_matrix(
    squared_distances: Float[ndarray, "n M"], bound: float
) -> Bool[ndarray, "M n1"]:
    """Compute the validation matrix Ω = [ω_jt]: row j is a measurement, column t a possible source.

    Column 0 is clutter, a possible source of every measurement; ω_jt with t ≥ 1 is true where

        (z_j − ẑ_t)ᵀ S_t⁻¹ (z_j − ẑ_t) ≤ bound

    that is, z_j lies in the gate of target t (Bar-Shalom, Fortmann, *Tracking and Data
    Association*, 1988, §9.3).

    Args:
        squared_distances: Squared Mahalanobis distance of each measurement from each target.
        bound: Squared Mahalanobis distance of the gate, a quantile of χ².
    """
    targets, count = squared_distances.shape
    matrix = np.ones((count, 1 + targets), dtype=bool)
    matrix[:, 1:] = squared_distances.T <= bound
    return matrix


def clusters(possible: Bool[ndarray, "n M"]) -> list[tuple[ndarray, ndarray]]:
    """Find groups of targets that share measurements; each can be associated independently.

    Args:
        possible: Whether target i may have made measurement j.

    Returns:
        Indices of the targets and of the measurements of each group, ascending. A target
        without any measurement is a group of its own; a measurement outside every gate is in
        no group.
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
