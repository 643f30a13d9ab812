"""The hot loops of the association, compiled: assignments one after the other, sums over subsets.

Every kernel has a counterpart by enumeration in the tests that it must agree with.
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
    """Give one more row its column, by the shortest augmenting path ([C16]), in place.

    The columns' duals and those of the rows that have a column must be feasible. In a
    matching of all rows to all columns they then prove it the cheapest.

    [C16] D. F. Crouse, "On implementing 2D rectangular assignment algorithms", IEEE
    TAES 52(4), 2016.

    Args:
        cost: (N, N), infinite where a pair is forbidden.
        start: The row without a column.
        row_duals: (N,).
        column_duals: (N,).
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
    """The cheapest matching of all rows to all columns, from any column duals, in place.

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
    """The cheapest matchings of all rows to all columns that differ in the first rows ([M68]).

    The best of what is left is split: for each of the rows that are not fixed, one
    part in which the rows before are fixed and this row may not have its column. Each
    part is solved from its parent's duals by one augmenting path ([MSC97]).

    [M68] K. G. Murty, "An algorithm for ranking all the assignments in order of
    increasing cost", Operations Research 16(3), 1968.
    [MSC97] Miller, Stone, Cox, "Optimizing Murty's ranked assignment method", IEEE
    TAES 33(3), 1997.

    Args:
        cost: (N, N), infinite where a pair is forbidden.
        branching: Only the first so many rows tell one matching from another.
        count: At most so many.

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


@kernel
def subset_marginals(
    skips: ndarray, pairs: ndarray, rests: ndarray, factors: ndarray
) -> tuple[ndarray, ndarray, ndarray, float]:
    """Sums over all one-to-one choices of items by a row of steps, by subsets of the items.

    Each step takes one item that no other takes, or none. The weight of a choice is
    Π skips of steps that take none · Π pairs · Π rests of items that nobody takes ·
    factors[number of items taken]. With F_s(S) the sum over the first s steps that take
    just the items S, and B_s(S) over the others given S,

        F_{s+1}(S) = F_s(S) skips_s + Σ_{i ∈ S} F_s(S \\ i) pairs_si
        B_s(S) = B_{s+1}(S) skips_s + Σ_{i ∉ S} B_{s+1}(S ∪ i) pairs_si
        Σ choices with s ← i = Σ_{S ∌ i} F_s(S) pairs_si B_{s+1}(S ∪ i)

    Args:
        skips: (s,).
        pairs: (s, k); 0 where a step cannot take an item.
        rests: (k,).
        factors: (k + 1,).

    Returns:
        The sums in which each step takes none (s,), takes each item (s, k), in which
        nobody takes each item (k,), and of all choices.
    """
    steps, items = pairs.shape
    subsets = 1 << items
    backward = np.zeros((steps + 1, subsets))
    for subset in range(subsets):
        weight = 1.0
        taken = 0
        for i in range(items):
            if subset >> i & 1:
                taken += 1
            else:
                weight *= rests[i]
        backward[steps, subset] = weight * factors[taken]
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
    return skipped, chosen, left, backward[0, 0]
