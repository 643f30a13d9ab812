"""The association of measurements with targets, compiled: marginals, and matchings.

:mod:`tracker.filters.association` has the equations and their sources; every kernel must agree with
a counterpart by enumeration in the tests.

Of heaviest matchings that share no pair, one of n rows starts from the column duals of the one
before, which stay feasible when costs of pairs increase. Only the few nearest columns of each row
are considered until a search has come so far that another could be nearer: duals of columns only
decrease, so the cost of a row's other columns at the start bounds their cost later. A matching
takes O(n²) to find the nearest columns, and searches of about √n rows each for the quarter of the
rows that the nearest columns do not serve ([V96] calls the nearest ones the core).

[V96] A. Volgenant, "Linear and semi-assignment problems: a core oriented approach",
Computers & Operations Research 23(10), 1996.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class Convergence(NamedTuple):
    """The criterion by which the iteration of the messages ends."""

    tolerance: float
    """Largest |Δν_ji| ρ_j at convergence: change of a message to a target, times the intensity of
    clutter and new targets at its measurement."""
    iterations: int
    """Largest number of iterations."""


class Marginals(NamedTuple):
    """Marginal association probabilities of n targets and M measurements."""

    rows: ndarray
    """(n, 1 + M), probabilities of a miss and of each measurement for every target."""
    unexplained: ndarray
    """(M,), probability that no target made the measurement."""


@kernel
def belief_propagation(
    missed: ndarray, detected: ndarray, unexplained: ndarray, convergence: Convergence
) -> Marginals:
    """Compute association marginals by messages between targets and measurements.

    Args:
        missed: w_i0 (n,), weight of each target being missed.
        detected: w_ij (n, M), weight of each target having made each measurement, 0 outside the
            gate.
        unexplained: ρ_j (M,), intensity of clutter and new targets at each measurement, > 0.
        convergence: The criterion of convergence.
    """
    targets, count = detected.shape
    # only pairs inside a gate exchange messages: listed row by row, with measurement and weight
    rows = np.zeros((targets, 1 + count))
    starts = np.zeros(targets + 1, dtype=np.int64)
    for i in range(targets):
        starts[i + 1] = starts[i]
        for j in range(count):
            if detected[i, j] > 0.0:
                starts[i + 1] += 1
    measured = np.empty(starts[targets], dtype=np.int64)
    weights = np.empty(starts[targets])
    to_target = np.empty(starts[targets])
    to_measurement = np.empty(starts[targets])
    pair = 0
    for i in range(targets):
        for j in range(count):
            if detected[i, j] > 0.0:
                measured[pair] = j
                weights[pair] = detected[i, j]
                to_target[pair] = 1.0 / unexplained[j]
                pair += 1
    totals = unexplained.copy()
    for _ in range(convergence.iterations):
        totals[:] = unexplained
        for i in range(targets):
            total = missed[i]
            for pair in range(starts[i], starts[i + 1]):
                total += weights[pair] * to_target[pair]
            for pair in range(starts[i], starts[i + 1]):
                rest = total - weights[pair] * to_target[pair]
                # where one pair has nearly all of the sum, the rest is rounding error
                if rest < 0.5 * missed[i]:
                    rest = missed[i]
                to_measurement[pair] = weights[pair] / max(rest, 1e-300)
                totals[measured[pair]] += to_measurement[pair]
        change = 0.0
        for pair in range(len(measured)):
            j = measured[pair]
            rest = totals[j] - to_measurement[pair]
            if rest < 0.5 * unexplained[j]:
                rest = unexplained[j]
            new = 1.0 / max(rest, 1e-300)
            change = max(change, abs(new - to_target[pair]) * unexplained[j])
            to_target[pair] = new
        if change < convergence.tolerance:
            break
    for i in range(targets):
        total = missed[i]
        for pair in range(starts[i], starts[i + 1]):
            total += weights[pair] * to_target[pair]
        total = max(total, 1e-300)
        rows[i, 0] = missed[i] / total
        for pair in range(starts[i], starts[i + 1]):
            rows[i, 1 + measured[pair]] = weights[pair] * to_target[pair] / total
    return Marginals(rows, unexplained / totals)


class SubsetMarginals(NamedTuple):
    """Sums of the weights of choices of s steps among k items."""

    none: ndarray
    """(s,), over choices in which each step takes none."""
    chosen: ndarray
    """(s, k), over choices in which each step takes each item."""
    left: ndarray
    """(k,), over choices in which no step takes each item."""
    total: float
    """Sum over all choices."""


@kernel
def subset_marginals(
    skips: ndarray, pairs: ndarray, rests: ndarray, factors: ndarray
) -> SubsetMarginals:
    """Sum the weights of all one-to-one choices of items by a row of steps, over subsets of items.

    Each step takes one item that no other takes, or none. The weight of a choice is
    Π skips of steps that take none · Π pairs · Π rests of items that no step takes ·
    factors[number of items taken]. With F_s(S) the sum over the first s steps that take
    just the items S, and B_s(S) over the others given S,

        F_{s+1}(S) = F_s(S) skips_s + Σ_{i ∈ S} F_s(S \\ i) pairs_si
        B_s(S) = B_{s+1}(S) skips_s + Σ_{i ∉ S} B_{s+1}(S ∪ i) pairs_si
        Σ choices with s ← i = Σ_{S ∌ i} F_s(S) pairs_si B_{s+1}(S ∪ i)

    Args:
        skips: (s,) weight of each step taking none.
        pairs: (s, k) weight of each step and item; 0 where a step cannot take an item.
        rests: (k,) weight of each item that no step takes.
        factors: (k + 1,) factor by the number of items taken.
    """
    steps, items = pairs.shape
    subsets = 1 << items
    backward = np.zeros((steps + 1, subsets))
    for subset in range(subsets):
        weight = 1.0
        assigned = 0
        for i in range(items):
            if subset >> i & 1:
                assigned += 1
            else:
                weight *= rests[i]
        backward[steps, subset] = weight * factors[assigned]
    for s in range(steps - 1, -1, -1):
        for subset in range(subsets):
            backward[s, subset] = backward[s + 1, subset] * skips[s]
        for i in range(items):
            pair = pairs[s, i]
            if pair == 0.0:
                continue
            bit = 1 << i
            for high in range(0, subsets, 2 * bit):
                for subset in range(high, high + bit):
                    backward[s, subset] += backward[s + 1, subset + bit] * pair
    skipped = np.zeros(steps)
    chosen = np.zeros((steps, items))
    forward = np.zeros(subsets)
    following = np.zeros(subsets)
    forward[0] = 1.0
    for s in range(steps):
        total = 0.0
        for subset in range(subsets):
            following[subset] = forward[subset] * skips[s]
            total += following[subset] * backward[s + 1, subset]
        skipped[s] = total
        for i in range(items):
            pair = pairs[s, i]
            if pair == 0.0:
                continue
            bit = 1 << i
            total = 0.0
            for high in range(0, subsets, 2 * bit):
                for subset in range(high, high + bit):
                    step = forward[subset] * pair
                    following[subset + bit] += step
                    total += step * backward[s + 1, subset + bit]
            chosen[s, i] = total
        forward, following = following, forward
    left = np.zeros(items)
    for i in range(items):
        bit = 1 << i
        for high in range(0, subsets, 2 * bit):
            for subset in range(high, high + bit):
                left[i] += forward[subset] * backward[steps, subset]
    return SubsetMarginals(skipped, chosen, left, backward[0, 0])


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
