"""Tracklet association as an integer program, with constraints and with people's colours.

[DFJ54] Dantzig, Fulkerson, Johnson, "Solution of a large-scale traveling-salesman problem",
Operations Research 2(4), 1954.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_array, csr_array

from tracker.smoothing.identity.constraints import LinkConstraints

_REACH = 40.0
"""Bound on the reduced cost of the edges that are considered first, log odds; few corrections cost
more."""

_ROUNDING = 1e-9

Cut = tuple[str, list[int]]
"""The kind of a violated constraint, and the tracklets concerned, as :func:`violated` returns
it."""


class _Edges(NamedTuple):
    """E edges, one for each entry of the table and each of the people that it may be."""

    rows: Int[ndarray, " E"]
    """Row of the table: a tracklet that is left, or beyond these the beginning of one."""
    columns: Int[ndarray, " E"]
    """Column of the table: a tracklet that is entered, or beyond these the end of one."""
    people: Int[ndarray, " E"]
    """Index of the person with a template whose colours the edge has."""


def solve(
    table: Float[ndarray, "2k 2k"],
    possible: Bool[ndarray, "2k 2k"],
    constraints: LinkConstraints,
    people: Float[ndarray, "k G"],
    best: Int[ndarray, " 2k"],
    cuts: list[Cut],
) -> list[int]:
    """Solve the association of k tracklets under the constraints, each chain being one of G people.

    With x_e^g = 1 for an edge e that is selected as person g the program is the assignment, and

        Σ_g Σ_{e out of i} x_e^g = Σ_g Σ_{e into i} x_e^g = 1
        Σ_{e out of i} x_e^g = Σ_{e into i} x_e^g

    where a tracklet as person g is worth u_g more.

    The constraints are linear inequalities. Two tracklets i and j that must be linked are in one
    chain: where the chain of i is a set S without j, an edge leaves S, Σ_{u∈S, v∉S} x_uv ≥ 1. Of
    the L links on a path from i to j that cannot be linked one is not made, Σ x_uv ≤ L − 1. They
    are added where a solution violates them, until none does, like the subtour eliminations of
    the travelling salesman problem [DFJ54].

    Only edges of small reduced cost are considered first. Their solution is the optimum if it is
    worth less than the assignment by no more than the least reduced cost of the other edges.

    Args:
        table: Log odds of each edge of the assignment.
        possible: Which edges are admissible.
        constraints: Constraints on the k tracklets.
        people: u, the log likelihood of the colours of each tracklet under each person, as in
            :func:`tracker.smoothing.identity.association.join`.
        best: The column of each row in the best assignment without constraints and people.
        cuts: Constraints that solutions violated so far; new ones are added.

    Returns:
        The column of each of the first k rows.
    """
    size = len(people)
    possible = possible.copy()
    slack = _slack(table, best)
    possible[size:, size:] = False
    if not constraints:
        _leave_out_what_is_worse_than_two(table, possible, size)
    worth = float(table[np.arange(2 * size), best].sum())
    reach = _REACH
    while True:
        found = _within_reach(table, possible & (slack <= reach), constraints, people, best, cuts)
        if found is not None:
            successors, value = found
            if worth - value <= reach:
                return successors
            reach = worth - value + _ROUNDING  # every better solution consists of these edges
        elif np.isinf(reach):
            raise RuntimeError("consistent constraints have no solution")
        else:
            reach = np.inf


def _slack(table: Float[ndarray, "m m"], best: Int[ndarray, " m"]) -> Float[ndarray, "m m"]:
    """Compute the reduced cost of each edge, by which an assignment with it is worth less at least.

    It is u_r + v_c − w_rc with the prices u and v of rows and columns of the dual program,

        v_c = max(0, max_r v_{c(r)} + w_rc − w_{r c(r)}),   u_r = w_{r c(r)} − v_{c(r)}

    where c(r) is the best assignment: longest paths, in a graph without positive cycles.
    """
    chosen = table[np.arange(len(table)), best]
    if not np.isfinite(chosen).all():  # the assignment is inadmissible and gives no bound
        return np.zeros_like(table)
    gains = table - chosen[:, None]
    prices = np.zeros(len(table))
    for _ in range(len(table)):
        raised = np.maximum(prices, (prices[best][:, None] + gains).max(axis=0))
        if (raised - prices).max() < _ROUNDING:
            break
        prices = raised
    return np.asarray(prices[None] - prices[best][:, None] - gains)


def _within_reach(
    table: Float[ndarray, "2k 2k"],
    possible: Bool[ndarray, "2k 2k"],
    constraints: LinkConstraints,
    people: Float[ndarray, "k G"],
    best: Int[ndarray, " 2k"],
    cuts: list[Cut],
) -> tuple[list[int], float] | None:
    """Solve the program over some edges, as :func:`solved`.

    Args:
        table: Log odds of each edge.
        possible: Which edges are considered.
        constraints: Constraints on the k tracklets.
        people: u, the log likelihood of the colours of each tracklet under each person.
        best: The column of each row in the best assignment without constraints and people.
        cuts: Constraints that solutions violated so far; new ones are added.

    Returns:
        The column of each of the first k rows, and the value of the solution; None if there is
        none.
    """
    size, kinds = people.shape
    edges = _edges(possible, kinds)
    rows, columns = edges.rows, edges.columns
    values = table[rows, columns]
    assigned = (rows < size) & (rows != columns)
    values[assigned] += people[rows[assigned], edges.people[assigned]]
    inner = (rows < size) & (columns < size) & (rows != columns)
    linear = [LinearConstraint(_once(edges, size), 1.0, 1.0)]
    if kinds > 1:
        linear.append(LinearConstraint(_one_person(edges, size, kinds), 0.0, 0.0))

    def cut(kind: str, some: list[int]) -> LinearConstraint:
        if kind == "together":
            leaves = np.isin(rows, some) & ~np.isin(columns, some) & inner
            return LinearConstraint(leaves.astype(float)[None], 1.0, np.inf)
        way = [i * (2 * size) + j for i, j in itertools.pairwise(some)]
        on_it = np.isin(rows * (2 * size) + columns, way) & inner
        return LinearConstraint(on_it.astype(float)[None], -np.inf, len(way) - 1.0)

    cuts += [] if cuts else violated(best[:size].tolist(), constraints, size)
    linear += [cut(*one) for one in cuts]
    while True:
        found = milp(
            -values,
            integrality=np.ones(len(rows), dtype=np.int64),
            bounds=Bounds(0.0, 1.0),
            constraints=linear,
            options={"mip_rel_gap": 0.0},
        )
        if found.x is None:
            return None
        selected = found.x > 0.5
        chosen = selected & (rows < size)
        successors = [-1] * size
        for row, column in zip(rows[chosen].tolist(), columns[chosen].tolist(), strict=True):
            successors[row] = column
        unmet = violated(successors, constraints, size)
        if not unmet:
            return successors, float(values[selected].sum())
        cuts += unmet
        linear += [cut(*one) for one in unmet]


def _leave_out_what_is_worse_than_two(
    table: Float[ndarray, "2k 2k"], possible: Bool[ndarray, "2k 2k"], size: int
) -> None:
    """Remove links that are worth less than an end and a beginning, which no optimum contains."""
    inner = np.arange(size)
    ends, begins = table[inner, size + inner], table[size + inner, inner]
    worse = table[:size, :size] < ends[:, None] + begins[None, :]
    worse[inner, inner] = False
    possible[:size, :size] &= ~worse


def _edges(possible: Bool[ndarray, "m m"], kinds: int) -> _Edges:
    """List each admissible edge once for each person; that of a false tracklet is listed once."""
    rows, columns = np.nonzero(possible)
    people = np.repeat(np.arange(kinds), len(rows))
    rows, columns = np.tile(rows, kinds), np.tile(columns, kinds)
    kept = (rows != columns) | (people == 0)
    return _Edges(rows[kept], columns[kept], people[kept])


def _once(edges: _Edges, size: int) -> csr_array:
    """Make the equations by which each tracklet is left once and entered once."""
    out, into = np.flatnonzero(edges.rows < size), np.flatnonzero(edges.columns < size)
    return coo_array(
        (
            np.ones(len(out) + len(into)),
            (
                np.concatenate([edges.rows[out], size + edges.columns[into]]),
                np.concatenate([out, into]),
            ),
        ),
        shape=(2 * size, len(edges.rows)),
    ).tocsr()


def _one_person(edges: _Edges, size: int, kinds: int) -> csr_array:
    """Make the equations by which a tracklet is left as the same person as it is entered.

    They are made for all but the first person, for whom the equation follows from the others.
    """
    named = (edges.people > 0) & (edges.rows != edges.columns)
    out = np.flatnonzero(named & (edges.rows < size))
    into = np.flatnonzero(named & (edges.columns < size))
    return coo_array(
        (
            np.concatenate([np.ones(len(out)), -np.ones(len(into))]),
            (
                np.concatenate(
                    [
                        (edges.people[out] - 1) * size + edges.rows[out],
                        (edges.people[into] - 1) * size + edges.columns[into],
                    ]
                ),
                np.concatenate([out, into]),
            ),
        ),
        shape=((kinds - 1) * size, len(edges.rows)),
    ).tocsr()


def violated(successors: list[int], constraints: LinkConstraints, size: int) -> list[Cut]:
    """Find the constraints that a solution violates.

    Returns:
        For a pair that must be linked, ``together`` and the chain of the first tracklet, which does
        not contain the second; for a pair that cannot be linked, ``apart`` and the path between
        them.
    """

    def chain(tracklet: int) -> list[int]:
        found = [tracklet]
        while successors[found[-1]] < size and successors[found[-1]] != found[-1]:
            found.append(successors[found[-1]])
        return found

    found_cuts: list[Cut] = []
    for i, j in constraints.must_link:
        if j not in (own := chain(i)):
            found_cuts.append(("together", own))
    for i, j in constraints.cannot_link:
        for one, other in ((i, j), (j, i)):
            own = chain(one)
            if other in own[1:]:
                found_cuts.append(("apart", own[: own.index(other) + 1]))
    return found_cuts
