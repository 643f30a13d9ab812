"""Heaviest matchings that share no pair, one after another, compiled.

A matching of n rows starts from the column duals of the one before, which stay feasible
when costs of pairs increase. Only the few nearest columns of each row are considered until a
search has come so far that another could be nearer: duals of columns only decrease, so the
cost of a row's other columns at the start bounds their cost later. A matching takes
O(n²) to find the nearest columns, and searches of about √n rows each for the quarter of
the rows that the nearest columns do not serve ([V96] calls the nearest ones the core).

[V96] A. Volgenant, "Linear and semi-assignment problems: a core oriented approach",
Computers & Operations Research 23(10), 1996.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel

CORE = 6
"""Number of nearest columns of each row in the core."""


class _Matching(NamedTuple):
    """An incomplete matching, with the duals that prove it the heaviest."""

    row_duals: ndarray
    """(N,), feasible with the duals of the columns."""
    column_duals: ndarray
    """(N,), duals of the columns."""
    column_of: ndarray
    """(N,) the column of each row, -1 for none."""
    row_of: ndarray
    """(N,) the row of each column, -1 for none."""


class _Workspace(NamedTuple):
    """Working memory of a search."""

    shortest: ndarray
    """(N,) lengths of the shortest paths, all infinite before and after a search."""
    before: ndarray
    """(N,) row from which each column is reached."""
    finished: ndarray
    """(N,) whether the path to a column is final, all false before and after a search."""
    touched: ndarray
    """(N,) the columns that were reached."""
    keys: ndarray
    """(N (N + 2),) keys of the heap, and its nodes in the next array."""
    nodes: ndarray


@kernel
def disjoint_matchings(weights: ndarray, count: int) -> ndarray:
    """Find matchings one after another, each the heaviest without the pairs of those before.

    Args:
        weights: (N, N) weights, 0 where there is no pair.
        count: Largest number of matchings.

    Returns:
        (K, N) the column of each row, -1 where its pair has no weight; only the last may be
        without pairs.
    """
    size = weights.shape[0]
    kept = min(CORE, size)
    found = np.empty((count, size), dtype=np.int64)
    cost = -weights
    column_duals = np.zeros(size)
    column_of = np.empty(size, dtype=np.int64)
    row_of = np.empty(size, dtype=np.int64)
    core = np.empty((size, kept), dtype=np.int64)
    reduced = np.empty((size, kept))
    row_duals = np.empty(size)
    matching = _Matching(row_duals, column_duals, column_of, row_of)
    workspace = _Workspace(
        np.full(size, np.inf),
        np.empty(size, dtype=np.int64),
        np.zeros(size, dtype=np.bool_),
        np.empty(size, dtype=np.int64),
        np.empty(size * (size + 2)),
        np.empty(size * (size + 2), dtype=np.int64),
    )
    for k in range(count):
        column_of[:] = -1
        row_of[:] = -1
        for i in range(size):
            _nearest(cost[i], column_duals, core[i], reduced[i])
            row_duals[i] = reduced[i, 0]
            # rows whose nearest column is still free need no search
            for m in range(kept):
                if reduced[i, m] > reduced[i, 0]:
                    break
                if row_of[core[i, m]] < 0:
                    row_of[core[i, m]] = i
                    column_of[i] = core[i, m]
                    break
        for i in range(size):
            if column_of[i] < 0:
                _augment(cost, i, matching, core, reduced[:, kept - 1], workspace)
        pairs = 0
        for i in range(size):
            found[k, i] = -1
            if cost[i, column_of[i]] < 0.0:
                found[k, i] = column_of[i]
                cost[i, column_of[i]] = 0.0
                pairs += 1
        if pairs == 0:
            return found[: k + 1].copy()
    return found


@kernel
def _nearest(cost: ndarray, duals: ndarray, columns: ndarray, reduced: ndarray) -> None:
    """Select the columns of the least reduced cost of one row, nearest first, in place."""
    kept = len(columns)
    filled = 0
    for j in range(len(cost)):
        value = cost[j] - duals[j]
        if filled == kept and not value < reduced[kept - 1]:
            continue
        place = filled if filled < kept else kept - 1
        filled = min(filled + 1, kept)
        while place > 0 and value < reduced[place - 1]:
            reduced[place] = reduced[place - 1]
            columns[place] = columns[place - 1]
            place -= 1
        reduced[place] = value
        columns[place] = j


@kernel
def _augment(
    cost: ndarray,
    start: int,
    matching: _Matching,
    core: ndarray,
    bounds: ndarray,
    workspace: _Workspace,
) -> None:
    """Assign a column to one more row by the shortest augmenting path, in place.

    This is Dijkstra's search over rows, from a heap of columns (0 … N - 1) and of rows whose other
    columns are not considered yet (N … 2N - 1), by the least that these can cost.

    Args:
        cost: (N, N) costs, finite.
        start: The row without a column.
        matching: Matching of the other rows.
        core: (N, C) the nearest columns of each row.
        bounds: (N,) the least reduced cost of each row's other columns.
        workspace: Working memory.
    """
    row_duals, column_duals = matching.row_duals, matching.column_duals
    column_of, row_of = matching.column_of, matching.row_of
    shortest, before, finished = workspace.shortest, workspace.before, workspace.finished
    touched, keys, nodes = workspace.touched, workspace.keys, workspace.nodes
    size = len(cost)
    partial = core.shape[1] < size
    heap, reached = 0, 0
    row, distance = start, 0.0
    sink, best = -1, np.inf
    whole = False  # whether all columns of the row are considered, or its core
    while True:
        offset = distance - row_duals[row]
        for m in range(size if whole else core.shape[1]):
            j = m if whole else core[row, m]
            length = offset + cost[row, j] - column_duals[j]
            if not length < best or not length < shortest[j] or finished[j]:
                continue
            if shortest[j] == np.inf:
                touched[reached] = j
                reached += 1
            shortest[j] = length
            before[j] = row
            if row_of[j] < 0:
                sink, best = j, length
            else:
                heap = _push(keys, nodes, heap, length, j)
        if partial and not whole and offset + bounds[row] < best:
            heap = _push(keys, nodes, heap, offset + bounds[row], size + row)
        row = -1
        while row < 0 and heap and keys[0] < best:
            distance, node = keys[0], nodes[0]
            heap = _pop(keys, nodes, heap)
            whole = node >= size
            if whole:
                row = node - size
                distance = 0.0 if row == start else shortest[column_of[row]]
            elif not finished[node]:
                finished[node] = True
                row = row_of[node]
        if row < 0:
            break
    row_duals[start] += best
    for m in range(reached):
        j = touched[m]
        if finished[j]:
            row_duals[row_of[j]] += best - shortest[j]
            column_duals[j] -= best - shortest[j]
        finished[j] = False
        shortest[j] = np.inf
    j = sink
    while True:
        row = before[j]
        row_of[j] = row
        j, column_of[row] = column_of[row], j
        if row == start:
            return


@kernel
def _push(keys: ndarray, nodes: ndarray, count: int, key: float, node: int) -> int:
    """Insert a node into a binary heap, least key first, in place; the new number of nodes."""
    place = count
    while place > 0:
        parent = (place - 1) >> 1
        if keys[parent] <= key:
            break
        keys[place], nodes[place] = keys[parent], nodes[parent]
        place = parent
    keys[place], nodes[place] = key, node
    return count + 1


@kernel
def _pop(keys: ndarray, nodes: ndarray, count: int) -> int:
    """Remove the first node of the heap, in place; the new number of nodes."""
    count -= 1
    key, node = keys[count], nodes[count]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= count:
            break
        if child + 1 < count and keys[child + 1] < keys[child]:
            child += 1
        if key <= keys[child]:
            break
        keys[place], nodes[place] = keys[child], nodes[child]
        place = child
    keys[place], nodes[place] = key, node
    return count
