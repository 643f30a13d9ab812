"""Assignment of rows to columns at the least cost, and of names to groups by majority.

SciPy's optimisers are imported when they are first needed, for their import is slow and a server
starts without them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray


def linear_sum_assignment(
    cost: Float[ndarray, "rows columns"], maximize: bool = False
) -> tuple[Int[ndarray, " pairs"], Int[ndarray, " pairs"]]:
    """Pair rows with columns one to one so that the summed cost is least.

    As :func:`scipy.optimize.linear_sum_assignment`, which it calls [Crouse16].

    Args:
        cost: Cost of pairing each row with each column; +inf for a forbidden pair.
        maximize: Whether the sum is maximised instead.

    Returns:
        Rows, ascending, and the column of each: as many pairs as the shorter side has.

    Raises:
        ValueError: If a cost is NaN, or no assignment has a finite cost.

    [Crouse16] Crouse, "On implementing 2D rectangular assignment algorithms", IEEE Transactions
    on Aerospace and Electronic Systems 52(4), 2016.
    """
    from scipy import optimize

    rows, columns = optimize.linear_sum_assignment(cost, maximize=maximize)
    return rows, columns


def pairs_within(
    apart: Float[ndarray, "rows columns"], reach: float
) -> tuple[Int[ndarray, " pairs"], Int[ndarray, " pairs"]]:
    """Pair rows and columns less than a reach apart, one to one, at the least summed distance.

    A distance beyond the reach costs as much as the reach: else one far column could change the
    pairs of all others.

    Args:
        apart: Distance of each row from each column.
        reach: Distance from which two are not paired, in the same unit.

    Returns:
        Rows, ascending, and the column of each.
    """
    rows, columns = linear_sum_assignment(np.minimum(apart, reach))
    near = apart[rows, columns] < reach
    return rows[near], columns[near]


def names_by_majority(counts: Sequence[Mapping[int, int]], largest: int) -> list[int]:
    """Choose a name for each group: its most frequent one, unless another group has more of it.

    Args:
        counts: Number of occurrences of each name in each group.
        largest: The largest name so far; groups without a name of their own get the next ones.
    """
    votes = [
        (-count, name, group) for group, own in enumerate(counts) for name, count in own.items()
    ]
    names: dict[int, int] = {}
    used: set[int] = set()
    for _, name, group in sorted(votes):
        if group not in names and name not in used:
            names[group] = name
            used.add(name)
    for group in range(len(counts)):
        if group not in names:
            largest += 1
            names[group] = largest
    return [names[group] for group in range(len(counts))]
