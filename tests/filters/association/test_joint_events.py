"""Joint events, best and exact, against writing all of them down."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linear_sum_assignment

from tests.filters.association.test_association import exact, problem
from tracker.filters import association
from tracker.filters.association import (
    JointEvents,
    clusters,
    exact_marginals,
    log_weights,
    marginals_of,
    murty,
    simplified_murty,
)

sizes = st.integers(0, 4)


def all_events(targets: int, measurements: int) -> JointEvents:
    """Every joint event there is."""
    rows = [
        row
        for row in itertools.product(range(-1, targets), repeat=measurements)
        if len({t for t in row if t >= 0}) == sum(t >= 0 for t in row)
    ]
    return JointEvents(np.array(rows, dtype=np.int64).reshape(len(rows), measurements), targets)


def weight_of(sources: ndarray, missed: ndarray, detected: ndarray, unexplained: ndarray) -> float:
    """w(θ) of one event, factor by factor."""
    weight = 1.0
    for j, t in enumerate(sources):
        weight *= unexplained[j] if t < 0 else detected[t, j]
    for t in range(len(missed)):
        weight *= 1.0 if t in sources else missed[t]
    return weight


def diffuse(measurements: int) -> ndarray:
    """g(Φ) = Φ!"""
    return np.array([float(math.factorial(k)) for k in range(measurements + 1)])


@given(st.integers(0, 10_000), sizes, sizes, st.booleans())
def test_exact_marginals_are_those_of_all_events(
    seed: int, targets: int, count: int, with_factors: bool
) -> None:
    weights = problem(seed, targets, count)
    found = exact_marginals(*weights, false_counts=diffuse(count) if with_factors else None)
    events = all_events(targets, count)
    expected = marginals_of(
        events,
        log_weights(events, *weights, false_counts=diffuse(count) if with_factors else None),
    )
    for part in ("missed", "detected", "unexplained"):
        assert_allclose(getattr(found, part), getattr(expected, part), atol=1e-12)
    if not with_factors:
        rows, columns = exact(*weights)
        assert_allclose(found.detected, rows[:, 1:], atol=1e-12)
        assert_allclose(found.unexplained, columns, atol=1e-12)


def test_ten_targets_and_eleven_measurements_sum_to_one_and_agree_transposed() -> None:
    missed, detected, unexplained = problem(4, 10, 11, gated=0.0)
    found = exact_marginals(missed, detected, unexplained)
    assert_allclose(found.missed + found.detected.sum(axis=1), 1.0, atol=1e-12)
    assert_allclose(found.unexplained + found.detected.sum(axis=0), 1.0, atol=1e-12)
    turned = exact_marginals(unexplained, detected.T, missed)
    assert_allclose(turned.detected.T, found.detected, atol=1e-12)
    assert_allclose(turned.missed, found.unexplained, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-200, 1e-60, 1e200])
def test_the_common_scale_of_the_weights_does_not_matter(scale: float) -> None:
    missed, detected, unexplained = problem(11, 5, 6)
    plain = exact_marginals(missed, detected, unexplained)
    # a measurement's weights may bear any unit
    scaled = exact_marginals(missed, detected * scale, unexplained * scale)
    assert_allclose(scaled.detected, plain.detected, rtol=1e-9, atol=1e-15)


def test_what_cannot_be_summed_is_told() -> None:
    with pytest.raises(ValueError, match=r"19 targets and 19 measurements: one .* at most 18"):
        exact_marginals(np.ones(19), np.ones((19, 19)), np.ones(19))
    assert exact_marginals(np.ones(30), np.ones((30, 2)), np.ones(2)).detected.shape == (30, 2)
    with pytest.raises(ValueError, match="no joint event has a positive weight"):
        exact_marginals(np.zeros(2), np.ones((2, 1)), np.ones(1))


@given(st.integers(0, 10_000), sizes, sizes, st.integers(1, 250))
@settings(max_examples=25)
def test_murty_finds_the_best_events_in_order(
    seed: int, targets: int, count: int, wanted: int
) -> None:
    weights = problem(seed, targets, count)
    every = all_events(targets, count)
    expected = np.array([weight_of(row, *weights) for row in every.sources])
    expected = np.sort(expected[expected > 0.0])[::-1][:wanted]
    found = murty(*weights, wanted)
    assert_allclose([weight_of(row, *weights) for row in found.sources], expected, rtol=1e-9)
    assert len(np.unique(found.sources, axis=0)) == found.size
    assert_allclose(log_weights(found, *weights), np.log(expected), atol=1e-9)


def test_all_events_of_murty_give_the_exact_marginals() -> None:
    weights = problem(8, 4, 5)
    events = murty(*weights, 10_000)
    found = marginals_of(events, log_weights(events, *weights))
    assert_allclose(found.detected, exact_marginals(*weights).detected, atol=1e-9)


@given(st.integers(0, 10_000), sizes, sizes)
def test_simplified_events_are_joint_events_that_share_no_pair(
    seed: int, targets: int, count: int
) -> None:
    weights = problem(seed, targets, count)
    events = simplified_murty(*weights)
    assert 1 <= events.size <= max(1, targets + count)
    pairs = [(j, t) for row in events.sources for j, t in enumerate(row) if t >= 0]
    assert len(set(pairs)) == len(pairs)
    assert len(np.unique(events.sources, axis=0)) == events.size
    for row in events.sources:
        assert weight_of(row, *weights) > 0.0
    # n + M are enough for every pair, and for the event without any
    assert len(pairs) == np.count_nonzero(weights[1])
    assert (events.sources[-1] < 0).all()


@given(st.integers(0, 10_000), st.integers(1, 5))
def test_one_target_or_one_measurement_has_so_few_events_that_all_are_found(
    seed: int, other: int
) -> None:
    for weights in (problem(seed, 1, other), problem(seed, other, 1)):
        events = simplified_murty(*weights)
        found = marginals_of(events, log_weights(events, *weights))
        assert_allclose(found.detected, exact_marginals(*weights).detected, atol=1e-9)


def test_the_second_simplified_event_is_the_best_without_the_pairs_of_the_first() -> None:
    missed, unexplained = np.full(2, 0.1), np.full(2, 0.1)
    detected = np.array([[8.0, 3.0], [4.0, 6.0]])
    events = simplified_murty(missed, detected, unexplained)
    assert_array_equal(events.sources, [[0, 1], [1, 0], [-1, -1]])
    marginal = marginals_of(events, log_weights(events, missed, detected, unexplained))
    total = 48.0 + 12.0 + 1e-4
    assert_allclose(marginal.detected, np.array([[48.0, 12.0], [12.0, 48.0]]) / total)
    # of the events left out, one target's measurement and the other missed, nothing is left
    assert_allclose(marginal.missed, 1e-4 / total)


@pytest.mark.parametrize(("size", "gated"), [(7, 0.0), (30, 0.0), (30, 0.7), (30, 0.97)])
def test_each_simplified_event_is_the_heaviest_matching_of_what_is_left(
    size: int, gated: float
) -> None:
    missed, detected, unexplained = problem(size, size, size + 2, gated=gated)
    weights = np.log1p(detected / missed[:, None] / unexplained)
    for sources in simplified_murty(missed, detected, unexplained).sources:
        there = np.flatnonzero(sources >= 0)
        rows, columns = linear_sum_assignment(weights, maximize=True)
        assert_allclose(
            weights[sources[there], there].sum(), weights[rows, columns].sum(), rtol=1e-9
        )
        weights[sources[there], there] = 0.0
    assert not weights.any()


def test_indicators_of_an_event() -> None:
    events = JointEvents(np.array([[1, -1, 0], [-1, -1, -1]]), 3)
    assert_array_equal(events.target_indicators, [[1, 1, 0], [0, 0, 0]])
    assert_array_equal(events.false_counts, [1, 3])


def test_bayes_rule_of_the_patent() -> None:
    """Φ!/V^Φ · Π Λ^τ · Π P_D^δ (1 − P_D)^(1 − δ), for an event written out."""
    volume, p_d = 9.5, 0.9
    likelihood = np.array([[0.02, 0.01, 0.004], [0.001, 0.03, 0.0]])
    events = JointEvents(np.array([[-1, 1, -1]]), 2)
    found = log_weights(
        events,
        np.full(2, 1.0 - p_d),
        p_d * likelihood,
        np.full(3, 1.0 / volume),
        false_counts=diffuse(3),
    )
    assert found[0] == pytest.approx(math.log(2.0 / volume**2 * 0.03 * p_d * (1.0 - p_d)))


def test_clusters_share_no_measurements() -> None:
    possible = np.zeros((5, 6), dtype=bool)
    possible[0, [1, 4]] = possible[3, [4, 5]] = possible[1, 0] = possible[4, [0]] = True
    groups = [(t.tolist(), m.tolist()) for t, m in clusters(possible)]
    assert groups == [([0, 3], [1, 4, 5]), ([1, 4], [0]), ([2], [])]


@given(st.integers(0, 10_000), st.integers(1, 6), st.integers(1, 6))
def test_associating_by_clusters_is_associating_all_at_once(
    seed: int, targets: int, count: int
) -> None:
    missed, detected, unexplained = problem(seed, targets, count, gated=0.7)
    whole = exact_marginals(missed, detected, unexplained)
    together = np.zeros_like(detected)
    for members, shared in clusters(detected > 0.0):
        part = exact_marginals(missed[members], detected[np.ix_(members, shared)],
                               unexplained[shared])  # fmt: skip
        together[np.ix_(members, shared)] = part.detected
        assert_allclose(part.missed, whole.missed[members], atol=1e-12)
    assert_allclose(together, whole.detected, atol=1e-12)


def test_belief_propagation_is_still_where_it_was() -> None:
    weights = problem(3, 1, 4)
    assert_allclose(
        association.marginals(*weights).detected, exact_marginals(*weights).detected, atol=1e-5
    )
