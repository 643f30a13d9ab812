"""Tracklet association: all tracklets are linked into tracks at once, at the least cost.

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

from tracker.smoothing.identity import integer_program
from tracker.smoothing.identity.constraints import LinkConstraints

_FREE = LinkConstraints()

_LITTLE = 1.0
"""Loss by colours, in log odds, below which the best chains without colours are accepted. It bounds
how much less they are worth than the best chains with colours."""


def join(
    worths: Float[ndarray, " n"],
    births: Float[ndarray, " n"],
    deaths: Float[ndarray, " n"],
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
    constraints: LinkConstraints = _FREE,
    people: Float[ndarray, "n G"] | None = None,
    cuts: list[integer_program.Cut] | None = None,
) -> tuple[Int[ndarray, " n"], Bool[ndarray, " n"]]:
    """Find the most likely set of chains of tracklets that satisfies the constraints, exactly.

    A tracklet is false, or it begins a chain or follows another tracklet, and ends the chain or
    is followed. The solution maximises

        Σ_used worth_i + Σ_first birth_i + Σ_last death_i + Σ_linked gain_ij

    This is the minimum-cost flow of [ZLN08]; since a tracklet has one person or none, it is an
    assignment: a row for each tracklet's successor (another tracklet, the end, or, where it is
    false, itself), a column for its predecessor. Tracklets that no chain of possible pairs
    connects are solved separately.

    Constraints, and the condition that each chain has the colours of one of the people with
    templates, make it an integer program:
    :func:`tracker.smoothing.identity.integer_program.solve`.

    Args:
        worths: Log odds of each tracklet's evidence against clutter.
        births: Log probability of a track beginning with each tracklet.
        deaths: Log probability of a track ending with each tracklet.
        earlier: Index of the first tracklet of each possible pair.
        later: Index of the second tracklet of each pair.
        gains: Log odds of each pair being of one person.
        constraints: Constraints on the links. A pair that must be linked and is not among the
            possible ones is added, with the gain of an end and a beginning.
        people: Log likelihood of each tracklet's colours under each of G people with templates,
            less the largest of these, at most 0.
        cuts: Constraints that solutions for the same tracklets violated so far, which are applied
            from the beginning. New ones are added to the list.

    Returns:
        The tracklet that follows each, -1 for none, and whether each is used in a chain.
    """
    count = len(worths)
    following, used = np.full(count, -1, dtype=np.int64), np.zeros(count, dtype=bool)
    people = np.zeros((count, 1)) if people is None else people
    cuts = [] if cuts is None else cuts
    if not count:
        return following, used
    if constraints:
        earlier, later, gains = _with_required_pairs(
            constraints, births, deaths, earlier, later, gains
        )
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
            used[i] = (used[i] or i in constraints.targets) and i not in constraints.clutter
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
        successors = _solved(table, _within(constraints, own, place), people[own], known)
        cuts += [(kind, own[some].tolist()) for kind, some in known[before:]]
        for row, column in enumerate(successors):
            used[own[row]] = column != row
            if column < size and column != row:
                following[own[row]] = own[column]
    return following, used


def _with_required_pairs(
    constraints: LinkConstraints,
    births: Float[ndarray, " n"],
    deaths: Float[ndarray, " n"],
    earlier: Int[ndarray, " P"],
    later: Int[ndarray, " P"],
    gains: Float[ndarray, " P"],
) -> tuple[Int[ndarray, " Q"], Int[ndarray, " Q"], Float[ndarray, " Q"]]:
    """Add the pairs that constraints require and remove those that they forbid.

    For a pair (i, j) that must be linked, the successor of i is j or lies on a path of pairs from
    i to j, and so does the predecessor of j.
    """
    keep = ~np.isin(later, list(constraints.firsts)) & ~np.isin(earlier, list(constraints.lasts))
    together = set(constraints.must_link)
    for k in np.flatnonzero(~keep).tolist():
        keep[k] = (int(earlier[k]), int(later[k])) in together
    from_each = _ways(earlier[keep], later[keep], constraints, len(births))
    to_each = from_each.T.tocsr()
    for i, j in constraints.must_link:
        between = _reached(from_each, i) & _reached(to_each, j)
        keep &= (earlier != i) | (later == j) | between[later]
        keep &= (later != j) | (earlier == i) | between[earlier]
    earlier, later, gains = earlier[keep], later[keep], gains[keep]
    there = set(zip(earlier.tolist(), later.tolist(), strict=True))
    more = np.array([pair for pair in constraints.must_link if pair not in there], dtype=np.int64)
    ends, begins = more.reshape(-1, 2).T
    return (
        np.concatenate([earlier, ends]),
        np.concatenate([later, begins]),
        np.concatenate([gains, deaths[ends] + births[begins]]),
    )


def _ways(
    earlier: Int[ndarray, " P"], later: Int[ndarray, " P"], constraints: LinkConstraints, count: int
) -> csr_array:
    """Make the directed graph of the possible pairs and of those that must be linked."""
    ends, begins = np.array(constraints.must_link, dtype=np.int64).reshape(-1, 2).T
    rows, columns = np.concatenate([earlier, ends]), np.concatenate([later, begins])
    return coo_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()


def _reached(ways: csr_array, tracklet: int) -> Bool[ndarray, " n"]:
    """Whether each tracklet can be reached from one, itself among them."""
    found = np.zeros(ways.shape[0], dtype=bool)
    found[breadth_first_order(ways, tracklet, return_predecessors=False)] = True
    return found


def _within(
    constraints: LinkConstraints, own: Int[ndarray, " k"], place: Int[ndarray, " n"]
) -> LinkConstraints:
    """Restrict the constraints to k tracklets, renumbered by their place among these.

    Args:
        constraints: Constraints on all n tracklets.
        own: Indices of the k tracklets.
        place: The place of each of the n tracklets among the k.
    """
    if not constraints:
        return constraints
    members = set(own.tolist())

    def pairs(of: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
        return tuple((int(place[i]), int(place[j])) for i, j in of if {i, j} <= members)

    def tracklets(of: frozenset[int]) -> frozenset[int]:
        return frozenset(int(place[i]) for i in of & members)

    return LinkConstraints(
        pairs(constraints.must_link),
        pairs(constraints.cannot_link),
        tracklets(constraints.targets),
        tracklets(constraints.clutter),
    )


def _forbid_ends(constraints: LinkConstraints, table: Float[ndarray, "m m"], size: int) -> None:
    """Forbid the end of a tracklet that must be linked to a later one, and the beginning of the
    latter."""
    for i, j in constraints.must_link:
        table[i, size + i] = -np.inf
        table[size + j, j] = -np.inf


def _solved(
    table: Float[ndarray, "m m"],
    constraints: LinkConstraints,
    people: Float[ndarray, "k G"],
    cuts: list[integer_program.Cut],
) -> list[int]:
    """Solve the assignment of k tracklets under the constraints.

    Args:
        table: Log odds of each row and column, -inf for inadmissible ones.
        constraints: Constraints on the k tracklets.
        people: Log likelihood of the colours of each tracklet under each of G people.
        cuts: Constraints that solutions violated so far; new ones are added.

    Returns:
        The column of each of the first k rows.
    """
    size = len(people)
    for tracklet in constraints.targets:
        table[tracklet, tracklet] = -np.inf
    for tracklet in constraints.clutter:
        unused = table[tracklet, tracklet]
        table[tracklet, :] = table[:, tracklet] = -np.inf
        table[tracklet, tracklet] = unused
    _forbid_ends(constraints, table, size)
    possible = np.isfinite(table)
    never = -1e3 - 4.0 * size * np.abs(table[possible]).max()
    _, columns = linear_sum_assignment(np.where(possible, table, never), True)
    successors: list[int] = columns[:size].tolist()
    if (
        not integer_program.violated(successors, constraints, size)
        and _loss_by_colours(successors, people) < _LITTLE
    ):
        return successors
    return integer_program.solve(table, possible, constraints, people, columns, cuts)


def _loss_by_colours(successors: list[int], people: Float[ndarray, "k G"]) -> float:
    """Compute the loss of chains by colours, an upper bound of what other chains can gain.

    Args:
        successors: The tracklet that follows each of k tracklets, or another number for none.
        people: Log likelihood of the colours of each tracklet under each of G people.
    """
    loss = 0.0
    following = np.array([column if column < len(people) else -1 for column in successors])
    used = following != np.arange(len(people))
    for chain in chains(np.where(used, following, -1), used):
        loss -= float(people[chain].sum(axis=0).max())
    return loss


def chains(following: Int[ndarray, " n"], used: Bool[ndarray, " n"]) -> list[list[int]]:
    """List the tracklets of each chain, in the order of time.

    Args:
        following: The tracklet that follows each of n tracklets, -1 for none.
        used: Whether each tracklet is in a chain.
    """
    followed = set(following[following >= 0].tolist())
    result = []
    for tracklet in np.flatnonzero(used).tolist():
        if tracklet in followed:
            continue
        chain = [tracklet]
        while following[chain[-1]] >= 0:
            chain.append(int(following[chain[-1]]))
        result.append(chain)
    return result
