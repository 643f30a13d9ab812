"""Which pieces of tracks are one person's: all at once, at the least cost.

[ZLN08] Zhang, Li, Nevatia, "Global data association for multi-object tracking using network
flows", CVPR 2008.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from tracker.smoothing.identity import program
from tracker.smoothing.identity.constraints import Ties

_FREE = Ties()

_LITTLE = 1.0
"""What colours may speak against the likeliest chains before others are sought: so far from the
best of all are these at most."""


def join(
    worths: Float[ndarray, " n"],
    births: Float[ndarray, " n"],
    deaths: Float[ndarray, " n"],
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    ties: Ties = _FREE,
    people: Float[ndarray, "n G"] | None = None,
    cuts: list[program.Cut] | None = None,
) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
    """The most likely set of chains of pieces, exactly; of those that obey the ties, if any.

    A piece is nobody's, or begins a chain or follows another piece, and ends the chain or is
    followed; what is sought is

        max Σ_used (worth_i) + Σ_first birth_i + Σ_last death_i + Σ_joined gain_ij

    This is the minimum-cost flow of [ZLN08]; since a piece carries one person or none, it is an
    assignment: a row for how each piece goes on (to which, to its end, or, where it is
    nobody's, to itself), a column for how each comes about. Pieces that no chain of possible
    pairs connects are solved apart.

    What a person said, and that each chain looks like one of the people with templates
    throughout, makes an integer program of it: :func:`tracker.smoothing.identity.program.solved`.

    Args:
        worths: Log odds of each piece's evidence against clutter.
        births: Log probability of each piece's beginning being a person's.
        deaths: Of its end being one's.
        earlier: The first piece of each possible pair.
        later: The second.
        gains: Log odds of being one person's.
        ties: What must hold; of pieces that no pair connects, a pair is made with no odds of
            its own.
        people: Of each piece, how much less likely its colours are each of G people's than its
            likeliest one's: log, at most 0.
        cuts: What solutions for the same pieces and ties broke so far: it is looked after from
            the beginning. More are added.

    Returns:
        The piece that each is followed by, -1 for none, and whether it is somebody's.
    """
    count = len(worths)
    following, used = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=bool)
    people = np.zeros((count, 1)) if people is None else people
    cuts = [] if cuts is None else cuts
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
        known = [(kind, place[some].tolist()) for kind, some in cuts if (group[some] == g).all()]
        before = len(known)
        goes_on = _solved(table, _within(ties, own, place), people[own], known)
        cuts += [(kind, own[some].tolist()) for kind, some in known[before:]]
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

    What goes on from i, tied to j, is j or on a way of pairs from i to j; and so is what comes
    before j.
    """
    keep = ~np.isin(later, list(ties.firsts)) & ~np.isin(earlier, list(ties.lasts))
    together = set(ties.together)
    for k in np.flatnonzero(~keep).tolist():
        keep[k] = (int(earlier[k]), int(later[k])) in together
    from_each = _ways(earlier[keep], later[keep], ties, len(births))
    to_each = from_each.T.tocsr()
    for i, j in ties.together:
        between = _reached(from_each, i) & _reached(to_each, j)
        keep &= (earlier != i) | (later == j) | between[later]
        keep &= (later != j) | (earlier == i) | between[earlier]
    earlier, later, gains = earlier[keep], later[keep], gains[keep]
    there = set(zip(earlier.tolist(), later.tolist(), strict=True))
    more = np.array([pair for pair in ties.together if pair not in there], dtype=np.int64)
    ends, begins = more.reshape(-1, 2).T
    return (
        np.concatenate([earlier, ends]),
        np.concatenate([later, begins]),
        np.concatenate([gains, deaths[ends] + births[begins]]),
    )


def _ways(
    earlier: Int[ndarray, " P"], later: Int[ndarray, " P"], ties: Ties, count: int
) -> csr_array:
    """The pairs as a graph, with those of ties."""
    ends, begins = np.array(ties.together, dtype=np.int64).reshape(-1, 2).T
    rows, columns = np.concatenate([earlier, ends]), np.concatenate([later, begins])
    return coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()


def _reached(ways: csr_array, piece: int) -> Bool[ndarray, " n"]:
    """Whom ways lead to from a piece, itself among them."""
    found = np.zeros(ways.shape[0], dtype=bool)
    found[breadth_first_order(ways, piece, return_predecessors=False)] = True
    return found


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


def _solved(
    table: Float[ndarray, "m m"],
    ties: Ties,
    people: Float[ndarray, "k G"],
    cuts: list[program.Cut],
) -> list[int]:
    """The column of each of the first k rows in the best assignment that obeys the ties."""
    size = len(people)
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
    if not program.broken(goes_on, ties, size) and _to_gain(goes_on, people) < _LITTLE:
        return goes_on
    return program.solved(table, possible, ties, people, columns, cuts)


def _to_gain(goes_on: list[int], people: Float[ndarray, "k G"]) -> float:
    """By how much the colours speak against these chains: other chains can gain no more."""
    told = 0.0
    following = np.array([column if column < len(people) else -1 for column in goes_on])
    used = following != np.arange(len(people))
    for chain in chains(np.where(used, following, -1), used):
        told -= float(people[chain].sum(axis=0).max())
    return told


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
