"""Belief propagation against exact enumeration of all one-to-one associations."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose

from tracker.filters import association


def exact(missed: ndarray, detected: ndarray, unexplained: ndarray) -> tuple[ndarray, ndarray]:
    """Marginals by summing every joint event: (n, 1 + M) with the miss first, and (M,)."""
    targets, count = detected.shape
    rows, columns, total = np.zeros((targets, 1 + count)), np.zeros(count), 0.0
    for event in itertools.product(range(-1, count), repeat=targets):
        taken = [j for j in event if j >= 0]
        if len(set(taken)) < len(taken):
            continue
        free = [j for j in range(count) if j not in taken]
        weight = float(np.prod(unexplained[free]))
        for i, j in enumerate(event):
            weight *= missed[i] if j < 0 else detected[i, j]
        total += weight
        columns[free] += weight
        for i, j in enumerate(event):
            rows[i, 1 + j] += weight
    return rows / total, columns / total


def problem(seed: int, targets: int, count: int, *, gated: float = 0.3) -> tuple[ndarray, ...]:
    """Random weights, some pairs outside the gate."""
    rng = np.random.default_rng(seed)
    detected = rng.lognormal(0.0, 2.0, (targets, count)) * (rng.random((targets, count)) > gated)
    return rng.uniform(0.02, 1.0, targets), detected, rng.lognormal(-1.0, 1.0, count)


def compare(missed: ndarray, detected: ndarray, unexplained: ndarray, tolerance: float) -> None:
    """Belief propagation within a tolerance of the enumeration."""
    found = association.marginals(missed, detected, unexplained)
    rows, columns = exact(missed, detected, unexplained)
    assert_allclose(found.missed, rows[:, 0], atol=tolerance)
    assert_allclose(found.detected, rows[:, 1:], atol=tolerance)
    assert_allclose(found.unexplained, columns, atol=tolerance)


@given(st.integers(0, 10_000), st.integers(1, 5), st.sampled_from((1.0, 1e-20, 1e10, 1e18, 1e200)))
def test_one_target_or_one_measurement_is_exact(seed: int, other: int, scale: float) -> None:
    """However much likelier a measurement is a target's than clutter."""
    for targets, count in ((1, other), (other, 1)):
        missed, detected, unexplained = problem(seed, targets, count)
        compare(missed, scale * detected, unexplained, tolerance=1e-5)


@given(st.integers(0, 10_000))
def test_a_chain_is_a_tree_and_exact(seed: int) -> None:
    missed, detected, unexplained = problem(seed, 3, 3, gated=0.0)
    chain = np.array([[1, 1, 0], [0, 1, 1], [0, 0, 1]], dtype=float)
    compare(missed, detected * chain, unexplained, tolerance=1e-5)


@given(st.integers(0, 10_000), st.integers(2, 4), st.integers(2, 4))
def test_loops_are_close(seed: int, targets: int, count: int) -> None:
    compare(*problem(seed, targets, count), tolerance=0.2)


def test_loops_are_close_on_average() -> None:
    errors = []
    for seed in range(150):
        missed, detected, unexplained = problem(seed, 4, 4)
        rows, _ = exact(missed, detected, unexplained)
        found = association.marginals(missed, detected, unexplained)
        errors.append(np.abs(found.detected - rows[:, 1:]).mean())
    assert np.mean(errors) < 0.01


@given(st.integers(0, 10_000), st.integers(0, 6), st.integers(0, 6))
def test_every_row_and_column_is_a_distribution(seed: int, targets: int, count: int) -> None:
    found = association.marginals(*problem(seed, targets, count))
    assert_allclose(found.missed + found.detected.sum(axis=1), np.ones(targets), atol=1e-9)
    assert_allclose(found.unexplained + found.detected.sum(axis=0), np.ones(count), atol=1e-3)
    assert ((found.detected >= 0.0) & (found.detected <= 1.0)).all()


@given(st.integers(0, 10_000))
def test_the_order_of_targets_and_measurements_does_not_matter(seed: int) -> None:
    missed, detected, unexplained = problem(seed, 4, 5)
    rng = np.random.default_rng(seed)
    rows, columns = rng.permutation(4), rng.permutation(5)
    plain = association.marginals(missed, detected, unexplained)
    mixed = association.marginals(
        missed[rows], detected[np.ix_(rows, columns)], unexplained[columns]
    )
    assert_allclose(mixed.detected, plain.detected[np.ix_(rows, columns)], atol=1e-4)
    assert_allclose(mixed.unexplained, plain.unexplained[columns], atol=1e-4)


def test_two_sure_targets_share_two_boxes_evenly() -> None:
    found = association.marginals(np.full(2, 1e-6), np.ones((2, 2)), np.full(2, 1e-6))
    assert_allclose(found.detected, np.full((2, 2), 0.5), atol=1e-4)
    assert_allclose(found.unexplained, 0.0, atol=5e-3)


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_extreme_weights_give_numbers(scale: float) -> None:
    found = association.marginals(
        np.array([0.5, 1e-9]), np.full((2, 3), scale), np.array([1e-9, 1.0, 1e-12])
    )
    for part in (found.missed, found.detected, found.unexplained):
        assert np.isfinite(part).all()
