"""Belief propagation message by message, and matchings one after the other, against NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linear_sum_assignment

from tracker.kernels.association import (
    Convergence,
    assign,
    augment,
    belief_propagation,
    disjoint_matchings,
)

seeds = st.integers(0, 2**32 - 1)


def messages(
    missed: ndarray, detected: ndarray, unexplained: ndarray, convergence: Convergence
) -> tuple[ndarray, ndarray, int]:
    """Rows (n, 1 + M), columns (M,), and how many rounds it took."""
    there, totals, rounds = detected > 0.0, unexplained, 0
    to_target = there / unexplained
    for _ in range(convergence.iterations):
        rest = missed[:, None] + (detected * to_target).sum(axis=1)[:, None] - detected * to_target
        to_measurement = detected / rest
        totals = unexplained + to_measurement.sum(axis=0)
        before, to_target = to_target, there / (totals - to_measurement)
        rounds += 1
        if (np.abs(to_target - before) * unexplained).max(initial=0.0) < convergence.tolerance:
            break
    rows = np.column_stack([missed, detected * to_target])
    return rows / rows.sum(axis=1)[:, None], unexplained / totals, rounds


@given(
    seeds, st.integers(0, 5), st.integers(0, 5),
    st.sampled_from((0.3, 0.03, 1e-6)), st.sampled_from((0, 1, 2, 200)),
)  # fmt: skip
def test_messages_pass_until_they_settle(
    seed: int, targets: int, count: int, tolerance: float, most: int
) -> None:
    rng = np.random.default_rng(seed)
    missed, unexplained = rng.uniform(0.02, 1.0, targets), rng.lognormal(-1.0, 2.0, count)
    detected = rng.lognormal(0.0, 2.0, (targets, count)) * (rng.random((targets, count)) < 0.7)
    convergence = Convergence(tolerance, most)
    rows, columns, rounds = messages(missed, detected, unexplained, convergence)
    found = belief_propagation(missed, detected, unexplained, convergence)
    assert_allclose(found.rows, rows, rtol=1e-9)
    assert_allclose(found.unexplained, columns, rtol=1e-9)
    assert rounds <= most


@given(seeds, st.integers(1, 12), st.integers(1, 6), st.sampled_from((0.2, 0.6, 1.0)))
def test_each_matching_is_the_heaviest_of_what_those_before_left(
    seed: int, size: int, most: int, share: float
) -> None:
    rng = np.random.default_rng(seed)
    weights = rng.integers(1, 9, (size, size)) * (rng.random((size, size)) < share)
    found = disjoint_matchings(weights.astype(float), most)
    left = weights.astype(float)
    assert 1 <= len(found) <= most
    for k, columns in enumerate(found):
        rows = np.flatnonzero(columns >= 0)
        assert (left[rows, columns[rows]] > 0.0).all()
        assert len(set(columns[rows].tolist())) == len(rows)
        best = linear_sum_assignment(left, maximize=True)
        assert left[rows, columns[rows]].sum() == left[best].sum()
        left[rows, columns[rows]] = 0.0
        assert len(rows) > 0 or k == len(found) - 1
    assert len(found) == most or not left.any()


@given(seeds, st.integers(1, 7), st.sampled_from((0.0, 0.4, 0.8)))
def test_an_assignment_is_the_cheapest_and_its_duals_prove_it(
    seed: int, size: int, forbidden: float
) -> None:
    rng = np.random.default_rng(seed)
    cost = rng.integers(0, 6, (size, size)).astype(float)
    cost[rng.random((size, size)) < forbidden] = np.inf
    rows, columns = np.zeros(size), rng.integers(-2, 3, size).astype(float)
    column_of, row_of = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
    try:
        best = cost[linear_sum_assignment(cost)].sum()
    except ValueError:  # there is none of finite cost
        assert not assign(cost, rows, columns, column_of, row_of)
        return
    assert assign(cost, rows, columns, column_of, row_of)
    assert_array_equal(row_of[column_of], np.arange(size))
    assert cost[np.arange(size), column_of].sum() == best
    assert (cost - rows[:, None] - columns >= -1e-9).all()
    assert rows.sum() + columns.sum() == best
    # a closed column stays with its row
    closed = np.zeros(size, dtype=np.bool_)
    closed[column_of[1:]] = rng.random(size - 1) < 0.5
    kept = [(row_of[j], j) for j in np.flatnonzero(closed)]
    free, column_of[0] = column_of[0], -1
    row_of[free] = -1
    cost[0, free] = np.inf
    before = column_of.copy(), row_of.copy()
    if augment(cost, 0, rows, columns, column_of, row_of, closed):
        assert all(column_of[i] == j for i, j in kept)
        assert_array_equal(row_of[column_of], np.arange(size))
        cost[:, closed] = np.inf
        for i, j in kept:
            cost[i] = np.where(np.arange(size) == j, 0.0, np.inf)
        best = cost[linear_sum_assignment(cost)].sum()
        assert cost[np.arange(size), column_of].sum() == best
    else:
        assert_array_equal(column_of, before[0])
        assert_array_equal(row_of, before[1])
