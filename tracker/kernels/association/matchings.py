"""The cheapest matchings one after another, compiled.

Every kernel must agree with a counterpart by enumeration in the tests.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


@kernel
def augment(
    cost: ndarray,
    start: int,
    row_duals: ndarray,
    column_duals: ndarray,
    column_of: ndarray,
    row_of: ndarray,
    closed: ndarray,
) -> bool:
    """Assign a column to one more row, by the shortest augmenting path ([C16]), in place.

    The columns' duals and those of the rows that have a column must be feasible. In a
    matching of all rows to all columns they then prove it the cheapest.

    [C16] D. F. Crouse, "On implementing 2D rectangular assignment algorithms", IEEE
    TAES 52(4), 2016.

    Args:
        cost: (N, N), infinite where a pair is forbidden.
        start: The row without a column.
        row_duals: (N,) duals of the rows.
        column_duals: (N,) duals of the columns.
        column_of: (N,) the column of each row, -1 for none.
        row_of: (N,) the row of each column, -1 for none.
        closed: (N,) columns that may not be touched.

    Returns:
        Whether there is such a path; if not, nothing has changed.
    """
    size = cost.shape[0]
    shortest = np.full(size, np.inf)
    before = np.full(size, -1, dtype=np.int64)
    done = closed.copy()
    reached = np.zeros(size, dtype=np.bool_)
    reached[start] = True
    distance = 0.0
    row = start
    sink = -1
    while sink < 0:
        best = np.inf
        nearest = -1
        for j in range(size):
            if done[j]:
                continue
            length = distance + cost[row, j] - row_duals[row] - column_duals[j]
            if length < shortest[j]:
                shortest[j] = length
                before[j] = row
            if shortest[j] < best or (shortest[j] == best and row_of[j] < 0 and nearest >= 0):
                best = shortest[j]
                nearest = j
        if nearest < 0:
            return False
        distance = best
        done[nearest] = True
        if row_of[nearest] < 0:
            sink = nearest
        else:
            row = row_of[nearest]
            reached[row] = True
    row_duals[start] += distance
    for i in range(size):
        if reached[i] and i != start:
            row_duals[i] += distance - shortest[column_of[i]]
    for j in range(size):
        if done[j] and not closed[j]:
            column_duals[j] -= distance - shortest[j]
    j = sink
    while True:
        row = before[j]
        row_of[j] = row
        j, column_of[row] = column_of[row], j
        if row == start:
            return True


@kernel
def assign(
    cost: ndarray,
    row_duals: ndarray,
    column_duals: ndarray,
    column_of: ndarray,
    row_of: ndarray,
) -> bool:
    """Find the cheapest matching of all rows to all columns, from any column duals, in place.

    Returns:
        Whether there is a matching of finite cost.
    """
    size = cost.shape[0]
    column_of[:] = -1
    row_of[:] = -1
    nothing = np.zeros(size, dtype=np.bool_)
    # rows whose cheapest column is still free need no search
    for i in range(size):
        best = np.inf
        nearest = -1
        for j in range(size):
            reduced = cost[i, j] - column_duals[j]
            if reduced < best or (reduced == best and nearest >= 0 and row_of[nearest] >= 0):
                best = reduced
                nearest = j
        if nearest < 0:
            return False
        row_duals[i] = best
        if row_of[nearest] < 0:
            row_of[nearest] = i
            column_of[i] = nearest
    for i in range(size):
        if column_of[i] < 0 and not augment(
            cost, i, row_duals, column_duals, column_of, row_of, nothing
        ):
            return False
    return True


@kernel
def best_matchings(cost: ndarray, branching: int, count: int) -> ndarray:
    """Find the cheapest matchings of all rows to all columns that differ in the first rows ([M68]).

    The best of the remaining parts is split: for each of the rows that are not fixed, one
    part in which the rows before are fixed and this row may not have its column. Each
    part is solved from its parent's duals by one augmenting path ([MSC97]).

    [M68] K. G. Murty, "An algorithm for ranking all the assignments in order of
    increasing cost", Operations Research 16(3), 1968.
    [MSC97] Miller, Stone, Cox, "Optimizing Murty's ranked assignment method", IEEE
    TAES 33(3), 1997.

    Args:
        cost: (N, N), infinite where a pair is forbidden.
        branching: Number of first rows by which matchings are distinguished.
        count: Largest number of matchings.

    Returns:
        (K, N) the column of each row, cheapest first, K ≤ count.
    """
    size = cost.shape[0]
    most = 1 + count * max(1, branching)
    totals = np.full(most, np.inf)
    first_free = np.zeros(most, dtype=np.int64)
    columns = np.empty((most, size), dtype=np.int64)
    row_duals = np.zeros((most, size))
    column_duals = np.zeros((most, size))
    forbidden = np.zeros((most, size), dtype=np.bool_)
    found = np.empty((count, size), dtype=np.int64)
    work = cost.copy()
    row_of = np.empty(size, dtype=np.int64)
    if not assign(work, row_duals[0], column_duals[0], columns[0], row_of):
        return found[:0].copy()
    totals[0] = 0.0
    for i in range(size):
        totals[0] += cost[i, columns[0, i]]
    used = 1
    for k in range(count):
        node = -1
        for m in range(used):
            if totals[m] < np.inf and (node < 0 or totals[m] < totals[node]):
                node = m
        if node < 0:
            return found[:k].copy()
        found[k] = columns[node]
        totals[node] = np.inf
        if k == count - 1:
            break
        closed = np.zeros(size, dtype=np.bool_)
        for i in range(first_free[node]):
            closed[columns[node, i]] = True
        for row in range(first_free[node], branching):
            for j in range(size):
                forbidden[used, j] = row == first_free[node] and forbidden[node, j]
            forbidden[used, columns[node, row]] = True
            columns[used] = columns[node]
            row_duals[used] = row_duals[node]
            column_duals[used] = column_duals[node]
            for i in range(size):
                row_of[columns[node, i]] = i
            row_of[columns[node, row]] = -1
            columns[used, row] = -1
            for j in range(size):
                work[row, j] = np.inf if forbidden[used, j] else cost[row, j]
            if augment(
                work, row, row_duals[used], column_duals[used], columns[used], row_of, closed
            ):
                total = 0.0
                for i in range(size):
                    total += cost[i, columns[used, i]]
                totals[used] = total
                first_free[used] = row
                used += 1
            work[row] = cost[row]
            closed[columns[node, row]] = True
    return found
