"""Who gets what: the assignment of least cost, and names by majority.

SciPy's optimisers are slow to import; a server that only shows its page need not wait for them:
they are read when they are first needed.
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
        cost: Of pairing each row with each column; may hold +inf where a pair is forbidden.
        maximize: Have the sum largest instead.

    Returns:
        Rows, ascending, and the column of each: as many pairs as the shorter side has.

    Raises:
        ValueError: If a number is NaN, or no assignment has a finite cost.

    [Crouse16] Crouse, "On implementing 2D rectangular assignment algorithms", IEEE Transactions
    on Aerospace and Electronic Systems 52(4), 2016.
    """
    from scipy import optimize

    rows, columns = optimize.linear_sum_assignment(cost, maximize=maximize)
    return rows, columns


def pairs_within(
    apart: Float[ndarray, "rows columns"], reach: float
) -> tuple[Int[ndarray, " pairs"], Int[ndarray, " pairs"]]:
    """Pair who is less than a reach apart, one to one, so that the summed distance is least.

    Who is left without a partner counts as far as the reach: else all others would move up to make
    room for one whom nobody is near.

    Args:
        apart: Distance of each row from each column.
        reach: In the same unit.

    Returns:
        Rows, ascending, and the column of each.
    """
    rows, columns = linear_sum_assignment(np.minimum(apart, reach))
    near = apart[rows, columns] < reach
    return rows[near], columns[near]


def names_by_majority(counts: Sequence[Mapping[int, int]], largest: int) -> list[int]:
    """A name for each group: the one that it has most of, where no other group has more of it.

    Args:
        counts: Of each group how often it has each name.
        largest: Groups that get none of theirs get new names from the next one on.
    """
    votes = [
        (-count, name, group) for group, own in enumerate(counts) for name, count in own.items()
    ]
    names: dict[int, int] = {}
    taken: set[int] = set()
    for _, name, group in sorted(votes):
        if group not in names and name not in taken:
            names[group] = name
            taken.add(name)
    for group in range(len(counts)):
        if group not in names:
            largest += 1
            names[group] = largest
    return [names[group] for group in range(len(counts))]
