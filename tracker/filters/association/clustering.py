"""Clusters of targets that share measurements."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool
from numpy import ndarray


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
