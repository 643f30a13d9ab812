"""Which pieces of tracks are one person's: all at once, at the least cost.

[ZLN08] Zhang, Li, Nevatia, "Global data association for multi-object tracking using network
flows", CVPR 2008.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def join(
    worths: Float[ndarray, " n"],
    births: Float[ndarray, " n"],
    deaths: Float[ndarray, " n"],
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
    """The most likely set of chains of pieces, exactly.

    A piece is nobody's, or begins a chain or follows another piece, and ends the chain or is
    followed; what is sought is

        max Σ_used (worth_i) + Σ_first birth_i + Σ_last death_i + Σ_joined gain_ij

    This is the minimum-cost flow of [ZLN08]; since a piece carries one person or none, it is an
    assignment: a row for how each piece goes on (to which, to its end, or, where it is
    nobody's, to itself), a column for how each comes about. Pieces that no chain of possible
    pairs connects are solved apart.

    Args:
        worths: Log odds of each piece's evidence against clutter.
        births: Log probability of each piece's beginning being a person's.
        deaths: Of its end being one's.
        earlier: The first piece of each possible pair.
        later: The second.
        gains: Log odds of being one person's.

    Returns:
        The piece that each is followed by, -1 for none, and whether it is somebody's.
    """
    count = len(worths)
    following, used = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=bool)
    if not count:
        return following, used
    graph = coo_array((np.ones(len(earlier)), (earlier, later)), shape=(count, count))
    groups, group = connected_components(graph, directed=False)
    members = np.argsort(group, kind="stable")
    bounds = np.searchsorted(group[members], np.arange(groups + 1))
    pairs_by_group = np.argsort(group[earlier], kind="stable")
    pair_bounds = np.searchsorted(group[earlier][pairs_by_group], np.arange(groups + 1))
    place = np.empty(count, dtype=np.int64)
    for g in range(groups):
        own = members[bounds[g] : bounds[g + 1]]
        size = len(own)
        if size == 1:
            i = int(own[0])
            used[i] = worths[i] + births[i] + deaths[i] > 0.0
            continue
        place[own] = np.arange(size)
        pairs = pairs_by_group[pair_bounds[g] : pair_bounds[g + 1]]
        table = np.full((2 * size, 2 * size), -np.inf)
        table[place[earlier[pairs]], place[later[pairs]]] = worths[earlier[pairs]] + gains[pairs]
        inner = np.arange(size)
        table[inner, inner] = 0.0
        table[inner, size + inner] = worths[own] + deaths[own]
        table[size + inner, inner] = births[own]
        table[size:, size:] = 0.0
        finite = table[np.isfinite(table)]
        never = -1e3 - 4.0 * size * np.abs(finite).max()
        rows, columns = linear_sum_assignment(np.where(np.isfinite(table), table, never), True)
        for row, column in zip(rows[:size].tolist(), columns[:size].tolist(), strict=True):
            used[own[row]] = column != row
            if column < size and column != row:
                following[own[row]] = own[column]
    return following, used


def chains(following: Int[ndarray, " n"], used: Bool[ndarray, " n"]) -> list[list[int]]:
    """The pieces of each person, in the order of time."""
    followed = set(following[following >= 0].tolist())
    result = []
    for piece in np.flatnonzero(used).tolist():
        if piece in followed:
            continue
        chain = [piece]
        while following[chain[-1]] >= 0:
            chain.append(int(following[chain[-1]]))
        result.append(chain)
    return result
