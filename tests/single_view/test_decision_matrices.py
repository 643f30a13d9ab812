"""Decision matrices by hand: who goes on, merges, splits, is new or interrupted."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy import ndarray

from tracker.single_view.association_matrix import track_transfer as matrices

decisions = arrays.arrays(np.bool_, st.tuples(st.integers(0, 6), st.integers(0, 6)))


def test_by_distance_each_goes_to_its_nearest_within_reach() -> None:
    before = np.array([[10.0, 10.0], [50.0, 10.0], [90.0, 10.0]])
    now = np.array([[52.0, 10.0], [12.0, 11.0], [112.0, 10.0]])
    apart = matrices.distances(before, now)
    assert apart[0, 1] == pytest.approx(np.hypot(2.0, 1.0))
    decision = matrices.decide_by_distance(apart, np.full(3, 20.0))
    np.testing.assert_array_equal(decision, [[0, 1, 0], [1, 0, 0], [0, 0, 0]])
    assert not matrices.is_one_to_one(decision)
    assert matrices.is_one_to_one(matrices.decide_by_distance(apart, np.full(3, 60.0)))


def test_by_distance_two_do_not_share_one() -> None:
    """The nearest of both is the same object: only the nearer one gets it."""
    apart = np.array([[3.0, 40.0], [5.0, 45.0]])
    np.testing.assert_array_equal(
        matrices.decide_by_distance(apart, np.full(2, 20.0)), [[1, 0], [0, 0]]
    )


def test_by_boxes_what_overlaps_counts_in_pixels() -> None:
    before = np.array([[10.0, 10.0, 5.0, 10.0], [30.0, 10.0, 5.0, 10.0]])
    now = np.array([[20.0, 10.0, 8.0, 10.0], [60.0, 10.0, 5.0, 10.0]])
    np.testing.assert_allclose(matrices.box_overlaps(before, now), [[60.0, 0.0], [60.0, 0.0]])


def test_by_pixels_what_two_objects_share_counts() -> None:
    before = np.full((6, 8), -1)
    before[1:4, 1:3], before[1:4, 5:7] = 0, 1
    now = np.full((6, 8), -1)
    now[2:5, 1:7], now[0, 0] = 0, 1
    shared = matrices.pixel_overlaps(before, now, 2, 2)
    np.testing.assert_array_equal(shared, [[4, 0], [4, 0]])
    nothing = matrices.pixel_overlaps(before, np.full((6, 8), -1), 2, 3)
    np.testing.assert_array_equal(nothing, np.zeros((2, 3)))


@given(st.integers(0, 1000))
def test_pixels_agree_with_counting(seed: int) -> None:
    rng = np.random.default_rng(seed)
    before, now = rng.integers(-1, 3, (7, 9)), rng.integers(-1, 4, (7, 9))
    shared = matrices.pixel_overlaps(before, now, 3, 4)
    for i in range(3):
        for j in range(4):
            assert shared[i, j] == ((before == i) & (now == j)).sum()


@pytest.mark.parametrize(
    ("decision", "families"),
    [
        ([[1, 0], [0, 1]], [([0], [0]), ([1], [1])]),
        ([[1], [1]], [([0, 1], [0])]),
        ([[1, 1]], [([0], [0, 1])]),
        ([[0, 1]], [([0], [1]), ([], [0])]),
        ([[1], [0]], [([0], [0]), ([1], [])]),
        ([[1, 1], [0, 1]], [([0, 1], [0, 1])]),
    ],
    ids=["continue", "merge", "split", "new", "interrupted", "merge and split at once"],
)
def test_rows_and_columns_of_a_family_name_the_case(
    decision: list[list[int]], families: list
) -> None:
    matrix = np.array(decision, dtype=bool)
    assert sorted(matrices.families(matrix)) == sorted(families)


@given(decisions)
def test_families_are_apart_and_leave_nobody_out(decision: ndarray) -> None:
    families = matrices.families(decision)
    rows = [row for family, _ in families for row in family]
    columns = [column for _, family in families for column in family]
    assert sorted(rows) == list(range(decision.shape[0]))
    assert sorted(columns) == list(range(decision.shape[1]))
    inside = np.zeros_like(decision)
    for family_rows, family_columns in families:
        inside[np.ix_(family_rows, family_columns)] = True
    assert not (decision & ~inside).any()


@given(decisions)
def test_by_distance_nobody_is_shared(decision: ndarray) -> None:
    apart = np.random.default_rng(decision.sum()).uniform(0.0, 50.0, decision.shape)
    found = matrices.decide_by_distance(apart, np.full(decision.shape[0], 30.0))
    assert found.shape == decision.shape
    if found.size:
        assert found.sum(axis=0).max() <= 1
        assert found.sum(axis=1).max() <= 1
        assert np.all(apart[found] <= 30.0)
