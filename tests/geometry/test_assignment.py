"""Assignments against all of them, pairs within a reach, and names by majority."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker.geometry.assignment import linear_sum_assignment, names_by_majority, pairs_within


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 4), st.booleans())
def test_the_assignment_is_the_best_of_all(
    seed: int, rows: int, columns: int, maximize: bool
) -> None:
    cost = np.random.default_rng(seed).normal(size=(rows, columns))
    first, second = linear_sum_assignment(cost, maximize=maximize)
    assert len(first) == min(rows, columns)
    assert len(set(second.tolist())) == len(second)
    wide = cost if rows <= columns else cost.T
    every = [
        sum(wide[row, column] for row, column in enumerate(chosen))
        for chosen in itertools.permutations(range(wide.shape[1]), len(wide))
    ]
    best = max(every) if maximize else min(every)
    assert cost[first, second].sum() == pytest.approx(best)


@given(st.integers(0, 10_000), st.integers(0, 4), st.integers(0, 4), st.floats(0.1, 5.0))
def test_pairs_within_a_reach_are_those_of_the_least_sum_with_the_reach_for_whoever_is_alone(
    seed: int, rows: int, columns: int, reach: float
) -> None:
    apart = np.random.default_rng(seed).uniform(0.0, 6.0, (rows, columns))
    first, second = pairs_within(apart, reach)
    assert (apart[first, second] < reach).all()
    assert len(set(second.tolist())) == len(second)
    assert (np.diff(first) > 0).all()
    found = apart[first, second].sum() - reach * len(first)
    every = [0.0]
    for count in range(1, min(rows, columns) + 1):
        for a in itertools.combinations(range(rows), count):
            for b in itertools.permutations(range(columns), count):
                every.append(float(apart[a, b].sum()) - reach * count)
    assert found == pytest.approx(min(every))


def test_a_pair_at_the_reach_itself_is_none() -> None:
    assert [len(part) for part in pairs_within(np.array([[2.0]]), 2.0)] == [0, 0]
    assert [len(part) for part in pairs_within(np.array([[2.0]]), np.nextafter(2.0, 3.0))] == [1, 1]
    # nobody moves up to make room for one whom nobody is near
    first, second = pairs_within(np.array([[0.0, 1.0], [9.0, 0.9]]), 1.5)
    assert (first.tolist(), second.tolist()) == ([0, 1], [0, 1])
    first, second = pairs_within(np.array([[1.0, 9.0], [0.0, 1.4]]), 1.5)
    assert (first.tolist(), second.tolist()) == ([1], [0])


@pytest.mark.parametrize(
    ("counts", "largest", "names"),
    [
        ([], 5, []),
        ([{3: 2}], 5, [3]),
        ([{}], 5, [6]),
        ([{3: 2}, {3: 5}], 5, [6, 3]),  # who has more of it has the name
        ([{3: 2, 4: 1}, {3: 5}], 5, [4, 3]),  # the other the next of its own
        ([{3: 5, 4: 1}, {3: 2, 4: 1}], 5, [3, 4]),
        ([{2: 1}, {2: 1}], 2, [2, 3]),  # of equals the first
        ([{7: 1, 2: 1}], 9, [2]),  # of equal names the lower
        ([{}, {1: 1}, {}], 4, [5, 1, 6]),
    ],
)
def test_a_group_has_the_name_that_it_has_most_of(
    counts: list[dict[int, int]], largest: int, names: list[int]
) -> None:
    assert names_by_majority(counts, largest) == names
