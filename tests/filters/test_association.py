"""Associations against all joint events written down, and against Stone Soup's JPDA."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linear_sum_assignment
from stonesoup.dataassociator.probability import JPDA, JPDAwithEHM2
from stonesoup.hypothesiser.probability import PDAHypothesiser
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantVelocity,
)
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import GaussianState
from stonesoup.types.track import Track
from stonesoup.updater.kalman import KalmanUpdater

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


DETECTION, GATE, CLUTTER = 0.9, 0.999, 1e-3
"""P_D; the probability of a gate; expected false measurements a unit of area."""

NOW = datetime(2000, 1, 1)


@dataclass(frozen=True, eq=False)
class Cluster:
    """Targets close together, with their measurements and a false one."""

    tracks: list[Any]
    detections: list[Any]
    missed: ndarray
    detected: ndarray
    unexplained: ndarray

    def stone_soup(self, associator: Any) -> ndarray:
        """Its marginals: (n, 1 + M), the miss first."""
        result = associator.associate(set(self.tracks), set(self.detections), NOW)
        table = np.zeros((len(self.tracks), 1 + len(self.detections)))
        for i, track in enumerate(self.tracks):
            for hypothesis in result[track]:
                j = 1 + self.detections.index(hypothesis.measurement) if hypothesis else 0
                table[i, j] += float(hypothesis.probability)
        return table


def cluster(targets: int, seed: int, *, spread: float = 1.5) -> Cluster:
    """n targets within ``spread`` standard deviations of noise, n + 1 measurements of them."""
    rng = np.random.default_rng(seed)
    places = rng.normal(0.0, spread, (targets, 2))
    measurements = np.vstack([places, np.zeros((1, 2))]) + rng.normal(0.0, 1.0, (targets + 1, 2))
    sensor = LinearGaussian(4, (0, 2), np.eye(2))
    covariance = np.diag([1.0, 0.5, 1.5, 0.5])
    tracks = [
        Track([GaussianState([x, 0.1, y, -0.1], covariance, timestamp=NOW)]) for x, y in places
    ]
    detections = [
        Detection(z[:, None], timestamp=NOW, measurement_model=sensor) for z in measurements
    ]
    innovation = np.array([2.0, 2.5])  # no time passes: the state's covariance and the noise
    offsets = measurements[None] - places[:, None]
    squared = (offsets**2 / innovation).sum(axis=2)
    density = np.exp(-0.5 * squared) / (2.0 * np.pi * np.sqrt(innovation.prod()))
    inside = squared <= -2.0 * np.log(1.0 - GATE)  # χ² of two degrees of freedom
    return Cluster(
        tracks,
        detections,
        missed=np.full(targets, 1.0 - DETECTION * GATE),
        detected=DETECTION * density * inside,
        unexplained=np.full(targets + 1, CLUTTER),
    )


def associators() -> dict[str, Any]:
    """Stone Soup's, by name, with the same numbers."""
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.1), ConstantVelocity(0.1)])
    hypothesiser = PDAHypothesiser(
        KalmanPredictor(motion),
        KalmanUpdater(None),
        clutter_spatial_density=CLUTTER,
        prob_detect=DETECTION,
        prob_gate=GATE,
    )
    hypothesiser = _Remembering(hypothesiser)
    return {"JPDA": JPDA(hypothesiser), "EHM2": JPDAwithEHM2(hypothesiser)}


class _Remembering:
    """Gives the hypotheses of a track again, so that a benchmark times the association alone."""

    def __init__(self, hypothesiser: Any) -> None:
        self._hypothesiser = hypothesiser
        self._known: dict[str, Any] = {}  # by the tracks' own names: an address is given again

    def hypothesise(self, track: Any, detections: Any, timestamp: datetime) -> Any:
        """Those of the first time that the track was asked for."""
        if track.id not in self._known:
            self._known[track.id] = self._hypothesiser.hypothesise(track, detections, timestamp)
        return self._known[track.id]


@pytest.mark.parametrize(
    ("name", "targets", "seed"),
    [("JPDA", 2, 0), ("JPDA", 3, 1), ("EHM2", 3, 2), ("EHM2", 5, 3), ("EHM2", 6, 4)],
)
def test_exact_marginals_are_those_of_stone_soup(name: str, targets: int, seed: int) -> None:
    problem = cluster(targets, seed)
    expected = problem.stone_soup(associators()[name])
    found = exact_marginals(problem.missed, problem.detected, problem.unexplained)
    assert_allclose(np.column_stack([found.missed, found.detected]), expected, atol=1e-9)
    assert ((expected[:, 1:] > 0.01).sum(axis=1) > 1).any(), "they compete"


def test_a_few_hundred_best_events_are_close_to_all_of_them() -> None:
    problem = cluster(5, 3)
    weights = problem.missed, problem.detected, problem.unexplained
    events = murty(*weights, 300)
    found = marginals_of(events, log_weights(events, *weights))
    assert_allclose(found.detected, exact_marginals(*weights).detected, atol=0.02)
