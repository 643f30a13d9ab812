"""The joining of pieces as an integer program: what a person said, and who has whose colours.

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

from tracker.smoothing.identity.constraints import Ties

_REACH = 40.0
"""What the ways cost at most that are looked at first: few corrections cost more."""

_ROUNDING = 1e-9

Cut = tuple[str, list[int]]
"""What a solution broke, and the pieces that say so, as :func:`broken`."""


class _Edges(NamedTuple):
    """E ways of a piece to go on or to come about, once for each of the people it may be."""

    rows: Int[ndarray, " E"]
    """As of the table: of a piece, how it goes on; beyond them, how one begins."""
    columns: Int[ndarray, " E"]
    people: Int[ndarray, " E"]
    """Whose looks it has."""


def solved(
    table: Float[ndarray, "2k 2k"],
    possible: Bool[ndarray, "2k 2k"],
    ties: Ties,
    people: Float[ndarray, "k G"],
    best: Int[ndarray, " 2k"],
    cuts: list[Cut],
) -> list[int]:
    """The column of each of the k pieces' rows in the best chains that obey the ties, where each
    chain looks like one of G people throughout.

    With x_e^g for a way e that is taken as person g the program is that of the assignment, and

        Σ_g Σ_{e out of i} x_e^g = Σ_g Σ_{e into i} x_e^g = 1
        Σ_{e out of i} x_e^g = Σ_{e into i} x_e^g

    where a piece as g's is worth u_g more.

    Ties are linear inequalities. Who is tied together is in one chain: of what i's chain has
    without j, S, something goes on out of S, Σ_{u∈S, v∉S} x_uv ≥ 1. Who is apart is not: of the
    joins on the way from i to j one is not made, Σ x_uv ≤ L − 1. They are added where a solution
    breaks them, until none does, as the subtours of a travelling salesman are [DFJ54].

    Only ways that cost little are looked at first. What is found with these is the best of all if
    it is worth no less than the assignment by more than the least that any other way costs.

    Args:
        table: Of the assignment: log odds of each way.
        possible: Which ways there are.
        ties: What must hold.
        people: u, as :func:`tracker.smoothing.identity.joining.join`.
        best: The assignment without what is added here: each row's column.
        cuts: What solutions broke so far; more are added.
    """
    size = len(people)
    possible = possible.copy()
    slack = _slack(table, best)
    possible[size:, size:] = False
    if not ties:
        _leave_out_what_is_worse_than_two(table, possible, size)
    worth = float(table[np.arange(2 * size), best].sum())
    reach = _REACH
    while True:
        found = _within_reach(table, possible & (slack <= reach), ties, people, best, cuts)
        if found is not None:
            goes_on, value = found
            if worth - value <= reach:
                return goes_on
            reach = worth - value + _ROUNDING  # whatever is better is made of these
        elif np.isinf(reach):
            raise RuntimeError("ties that can all hold were found impossible")
        else:
            reach = np.inf


def _slack(table: Float[ndarray, "m m"], best: Int[ndarray, " m"]) -> Float[ndarray, "m m"]:
    """What each way costs at least: no assignment that has it is worth more than the best without
    so much.

    It is u_r + v_c − w_rc with the prices u and v of rows and columns of the dual program,

        v_c = max(0, max_r v_{c(r)} + w_rc − w_{r c(r)}),   u_r = w_{r c(r)} − v_{c(r)}

    where c(r) is the best assignment: longest ways, which have no cycle that gains.
    """
    chosen = table[np.arange(len(table)), best]
    if not np.isfinite(chosen).all():  # it is none: whatever it is worth tells nothing
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
    ties: Ties,
    people: Float[ndarray, "k G"],
    best: Int[ndarray, " 2k"],
    cuts: list[Cut],
) -> tuple[list[int], float] | None:
    """The best chains of some ways, as :func:`solved`, and what they are worth; None if there are
    none.

    Args:
        table: As the next four.
        possible: Which ways are looked at.
        ties: What must hold.
        people: u.
        best: The assignment.
        cuts: What solutions broke so far.
    """
    size, kinds = people.shape
    edges = _edges(possible, kinds)
    rows, columns = edges.rows, edges.columns
    values = table[rows, columns]
    somebody = (rows < size) & (rows != columns)
    values[somebody] += people[rows[somebody], edges.people[somebody]]
    inner = (rows < size) & (columns < size) & (rows != columns)
    constraints = [LinearConstraint(_once(edges, size), 1.0, 1.0)]
    if kinds > 1:
        constraints.append(LinearConstraint(_one_person(edges, size, kinds), 0.0, 0.0))

    def cut(kind: str, some: list[int]) -> LinearConstraint:
        if kind == "together":
            leaves = np.isin(rows, some) & ~np.isin(columns, some) & inner
            return LinearConstraint(leaves.astype(float)[None], 1.0, np.inf)
        way = [i * (2 * size) + j for i, j in itertools.pairwise(some)]
        on_it = np.isin(rows * (2 * size) + columns, way) & inner
        return LinearConstraint(on_it.astype(float)[None], -np.inf, len(way) - 1.0)

    cuts += [] if cuts else broken(best[:size].tolist(), ties, size)
    constraints += [cut(*one) for one in cuts]
    while True:
        found = milp(
            -values,
            integrality=np.ones(len(rows), dtype=np.int64),
            bounds=Bounds(0.0, 1.0),
            constraints=constraints,
            options={"mip_rel_gap": 0.0},
        )
        if found.x is None:
            return None
        taken = found.x > 0.5
        chosen = taken & (rows < size)
        goes_on = [-1] * size
        for row, column in zip(rows[chosen].tolist(), columns[chosen].tolist(), strict=True):
            goes_on[row] = column
        unmet = broken(goes_on, ties, size)
        if not unmet:
            return goes_on, float(values[taken].sum())
        cuts += unmet
        constraints += [cut(*one) for one in unmet]


def _leave_out_what_is_worse_than_two(
    table: Float[ndarray, "2k 2k"], possible: Bool[ndarray, "2k 2k"], size: int
) -> None:
    """Leave out joins that lose against one who leaves and another who comes: in no best set of
    chains is such a join, whoever the two are."""
    inner = np.arange(size)
    ends, begins = table[inner, size + inner], table[size + inner, inner]
    worse = table[:size, :size] < ends[:, None] + begins[None, :]
    worse[inner, inner] = False
    possible[:size, :size] &= ~worse


def _edges(possible: Bool[ndarray, "m m"], kinds: int) -> _Edges:
    """Each way as each person; who is nobody is so once."""
    rows, columns = np.nonzero(possible)
    people = np.repeat(np.arange(kinds), len(rows))
    rows, columns = np.tile(rows, kinds), np.tile(columns, kinds)
    kept = (rows != columns) | (people == 0)
    return _Edges(rows[kept], columns[kept], people[kept])


def _once(edges: _Edges, size: int) -> csr_array:
    """Each piece goes on once and comes about once."""
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
    """A piece goes on as the one who it was: of all but the first, for whom it follows from
    the rest."""
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


def broken(goes_on: list[int], ties: Ties, size: int) -> list[Cut]:
    """The ties that a solution breaks: of those together the chain that lacks the other from the
    first on, of those apart the way between them."""

    def chain(piece: int) -> list[int]:
        found = [piece]
        while goes_on[found[-1]] < size and goes_on[found[-1]] != found[-1]:
            found.append(goes_on[found[-1]])
        return found

    broken: list[Cut] = []
    for i, j in ties.together:
        if j not in (own := chain(i)):
            broken.append(("together", own))
    for i, j in ties.apart:
        for one, other in ((i, j), (j, i)):
            own = chain(one)
            if other in own[1:]:
                broken.append(("apart", own[: own.index(other) + 1]))
    return broken
