"""Which pieces of tracks are one person's: all at once, at the least cost.

[ZLN08] Zhang, Li, Nevatia, "Global data association for multi-object tracking using network
flows", CVPR 2008.
[DFJ54] Dantzig, Fulkerson, Johnson, "Solution of a large-scale traveling-salesman problem",
Operations Research 2(4), 1954.
"""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.optimize import Bounds, LinearConstraint, linear_sum_assignment, milp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tracker.smoothing.identity.ties import Ties

_FREE = Ties()


def join(
    worths: Float[ndarray, " n"],
    births: Float[ndarray, " n"],
    deaths: Float[ndarray, " n"],
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    ties: Ties = _FREE,
) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
    """The most likely set of chains of pieces, exactly; of those that obey the ties, if any.

    A piece is nobody's, or begins a chain or follows another piece, and ends the chain or is
    followed; what is sought is

        max Σ_used (worth_i) + Σ_first birth_i + Σ_last death_i + Σ_joined gain_ij

    This is the minimum-cost flow of [ZLN08]; since a piece carries one person or none, it is an
    assignment: a row for how each piece goes on (to which, to its end, or, where it is
    nobody's, to itself), a column for how each comes about. Pieces that no chain of possible
    pairs connects are solved apart.

    Ties are linear inequalities of the same program. Who is tied together is in one chain: of
    what i's chain has without j, S, something goes on out of S, Σ_{u∈S, v∉S} x_uv ≥ 1. Who is
    apart is not: of the joins on the way from i to j one is not made, Σ x_uv ≤ L − 1. They are
    added where a solution breaks them, until none does, as the subtours of a travelling
    salesman are [DFJ54].

    Args:
        worths: Log odds of each piece's evidence against clutter.
        births: Log probability of each piece's beginning being a person's.
        deaths: Of its end being one's.
        earlier: The first piece of each possible pair.
        later: The second.
        gains: Log odds of being one person's.
        ties: What must hold; of pieces that no pair connects, a pair is made with no odds of
            its own.

    Returns:
        The piece that each is followed by, -1 for none, and whether it is somebody's.
    """
    count = len(worths)
    following, used = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=bool)
    if not count:
        return following, used
    if ties:
        earlier, later, gains = _with_ties(ties, births, deaths, earlier, later, gains)
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
            used[i] = (used[i] or i in ties.somebody) and i not in ties.nobody
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
        goes_on = _solved(table, _within(ties, own, place), size)
        for row, column in enumerate(goes_on):
            used[own[row]] = column != row
            if column < size and column != row:
                following[own[row]] = own[column]
    return following, used


def _with_ties(
    ties: Ties,
    births: Float[ndarray, " n"],
    deaths: Float[ndarray, " n"],
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
) -> tuple[Int[ndarray, " Q"], Int[ndarray, " Q"], Float[ndarray, " Q"]]:
    """The pairs, with those that ties need and without those that they forbid.

    What goes on from i, tied to j, is j or lies between them; and so is what comes before j.
    """
    keep = ~np.isin(later, list(ties.firsts)) & ~np.isin(earlier, list(ties.lasts))
    together = set(ties.together)
    for k in np.flatnonzero(~keep).tolist():
        keep[k] = (int(earlier[k]), int(later[k])) in together
    for i, j in ties.together:
        between = ties.between[i, j]
        keep &= (earlier != i) | (later == j) | np.isin(later, between)
        keep &= (later != j) | (earlier == i) | np.isin(earlier, between)
    earlier, later, gains = earlier[keep], later[keep], gains[keep]
    there = set(zip(earlier.tolist(), later.tolist(), strict=True))
    more = np.array([pair for pair in ties.together if pair not in there], dtype=np.int64)
    ends, begins = more.reshape(-1, 2).T
    return (
        np.concatenate([earlier, ends]),
        np.concatenate([later, begins]),
        np.concatenate([gains, deaths[ends] + births[begins]]),
    )


def _within(ties: Ties, own: Int[ndarray, " k"], place: Int[ndarray, " n"]) -> Ties:
    """The ties of some pieces, by their place among them."""
    if not ties:
        return ties
    members = set(own.tolist())

    def pairs(of: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        return tuple((int(place[i]), int(place[j])) for i, j in of if {i, j} <= members)

    def pieces(of: frozenset[int]) -> frozenset[int]:
        return frozenset(int(place[i]) for i in of & members)

    return Ties(pairs(ties.together), pairs(ties.apart), pieces(ties.somebody), pieces(ties.nobody))


def _goes_on(ties: Ties, table: Float[ndarray, "m m"], size: int) -> None:
    """Who is tied to somebody later does not end, and who is to somebody earlier does not begin."""
    for i, j in ties.together:
        table[i, size + i] = -np.inf
        table[size + j, j] = -np.inf


def _solved(table: Float[ndarray, "m m"], ties: Ties, size: int) -> list[int]:
    """The column of each of the first ``size`` rows in the best assignment that obeys the ties."""
    for piece in ties.somebody:
        table[piece, piece] = -np.inf
    for piece in ties.nobody:
        nobody = table[piece, piece]
        table[piece, :] = table[:, piece] = -np.inf
        table[piece, piece] = nobody
    _goes_on(ties, table, size)
    possible = np.isfinite(table)
    never = -1e3 - 4.0 * size * np.abs(table[possible]).max()
    _, columns = linear_sum_assignment(np.where(possible, table, never), True)
    goes_on: list[int] = columns[:size].tolist()
    if not _broken(goes_on, ties, size):
        return goes_on
    # how a piece goes on, and where it does not follow another its beginning
    possible[size:, size:] = False
    edges = np.argwhere(possible)
    at_row, at_column = edges[:, 0], edges[:, 1]
    count = len(edges)
    out, into = np.flatnonzero(at_row < size), np.flatnonzero(at_column < size)
    once = coo_array(
        (
            np.ones(len(out) + len(into)),
            (np.concatenate([at_row[out], size + at_column[into]]), np.concatenate([out, into])),
        ),
        shape=(2 * size, count),
    ).tocsr()
    inequalities: list[tuple[ndarray, float, float]] = []
    inner = (at_row < size) & (at_column < size) & (at_row != at_column)
    while broken := _broken(goes_on, ties, size):
        for kind, some in broken:
            if kind == "together":
                leaves = np.isin(at_row, some) & ~np.isin(at_column, some) & inner
                inequalities.append((leaves.astype(float), 1.0, np.inf))
            else:
                way = [i * (2 * size) + j for i, j in itertools.pairwise(some)]
                on_it = np.isin(at_row * (2 * size) + at_column, way) & inner
                inequalities.append((on_it.astype(float), -np.inf, len(way) - 1.0))
        rows = np.stack([row for row, _, _ in inequalities])
        found = milp(
            -table[at_row, at_column],
            integrality=np.ones(count, dtype=np.int64),
            bounds=Bounds(0.0, 1.0),
            constraints=[
                LinearConstraint(once, 1.0, 1.0),
                LinearConstraint(
                    rows,
                    np.array([low for _, low, _ in inequalities]),
                    np.array([high for _, _, high in inequalities]),
                ),
            ],
            options={"mip_rel_gap": 0.0},
        )
        if found.x is None:
            raise RuntimeError(f"ties that can all hold were found impossible: {found.message}")
        chosen = found.x > 0.5
        for row, column in edges[chosen & (at_row < size)].tolist():
            goes_on[row] = column
    return goes_on


def _broken(goes_on: list[int], ties: Ties, size: int) -> list[tuple[str, list[int]]]:
    """The ties that a solution breaks: of those together the chain that lacks the other from the
    first on, of those apart the way between them."""

    def chain(piece: int) -> list[int]:
        found = [piece]
        while goes_on[found[-1]] < size and goes_on[found[-1]] != found[-1]:
            found.append(goes_on[found[-1]])
        return found

    broken = []
    for i, j in ties.together:
        if j not in (own := chain(i)):
            broken.append(("together", own))
    for i, j in ties.apart:
        for one, other in ((i, j), (j, i)):
            own = chain(one)
            if other in own[1:]:
                broken.append(("apart", own[: own.index(other) + 1]))
    return broken


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
