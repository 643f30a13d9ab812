"""Kernels that do not look at every pair find what looking at every pair finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.benchmarks.plane import scenario as scene
from tests.filters.mixtures import random_covariances, random_mixture
from tracker.filters import gaussian_mixture, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels import kalman, mixtures
from tracker.kernels.kalman import Expected, Measurements


def crowd(seed: int, size: int, dimension: int) -> GaussianMixture:
    """Components in clumps, of very different extent, some exactly on a line or a point."""
    rng = np.random.default_rng(seed)
    extent = float(rng.choice([0.0, 3.0, 100.0, 1e5]))
    clumps = rng.uniform(-extent, extent, (max(1, size // 6), dimension))
    means = clumps[rng.integers(0, len(clumps), size)] + rng.normal(0.0, 1.0, (size, dimension))
    if rng.random() < 0.3:
        means[:, rng.integers(dimension)] = 1.5
    scales = np.exp(rng.normal(0.0, float(rng.choice([0.1, 2.0])), size))
    covariances = random_covariances(rng, size, dimension) * scales[:, None, None]
    return GaussianMixture(rng.random(size), means, covariances, np.arange(size))


def groups_of_all(
    mixture: GaussianMixture, threshold: float, owners: ndarray
) -> tuple[ndarray, list[int]]:
    """Table II of [VM06], every pair looked at."""
    group, leaders = np.full(mixture.size, -1), []
    precisions = np.linalg.inv(mixture.covariances)
    for leader in np.argsort(-mixture.weights, kind="stable").tolist():
        if group[leader] >= 0:
            continue
        offset = mixture.means - mixture.means[leader]
        near = np.einsum("na,nab,nb->n", offset, precisions, offset) <= threshold
        near &= (group < 0) & ((owners < 0) | (owners == owners[leader]))
        group[near] = len(leaders)
        group[leader] = len(leaders)
        leaders.append(leader)
    return group, leaders


@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 120),
    st.sampled_from((1, 2, 4, 6)),
    st.sampled_from((0.0, 0.3, 4.0, 50.0, 1e6)),
)
def test_merging_groups_as_if_all_pairs_were_looked_at(
    seed: int, size: int, dimension: int, threshold: float
) -> None:
    mixture = crowd(seed, size, dimension)
    owners = np.random.default_rng(seed).integers(-1, 3, size)
    order = np.argsort(-mixture.weights, kind="stable")
    for whose in (np.full(size, -1), owners):
        group, leaders = mixtures.merge_groups(
            mixture.means, mixture.covariances, order, whose, threshold
        )
        expected, first = groups_of_all(mixture, threshold, whose)
        assert_array_equal(group, expected)
        assert leaders.tolist() == first


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.sampled_from((2, 4)))
def test_reducing_is_pruning_merging_and_capping(seed: int, size: int, dimension: int) -> None:
    mixture = crowd(seed, size, dimension)
    owners = np.random.default_rng(seed).integers(-1, 3, size)
    reduced, leaders = gaussian_mixture.reduce(
        mixture, pruning_threshold=0.3, merging_threshold=4.0, max_components=5, owners=owners
    )
    kept = np.flatnonzero(mixture.weights >= 0.3)
    merged, first = gaussian_mixture.merge(mixture.take(kept), 4.0, owners[kept])
    chosen = np.argsort(-merged.weights, kind="stable")[:5]
    part = merged.take(chosen)
    assert_array_equal(leaders, kept[first[chosen]])
    assert_array_equal(reduced.labels, part.labels)
    assert_allclose(reduced.cardinality, merged.cardinality, rtol=1e-12)
    if part.size:
        ratios = reduced.weights / part.weights
        assert_allclose(ratios, ratios[0], rtol=1e-12)
    assert_allclose(reduced.means, part.means, rtol=1e-12, atol=1e-12)
    assert_allclose(reduced.covariances, part.covariances, rtol=1e-12, atol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_a_position_has_the_component_whose_nearest_it_is(seed: int) -> None:
    """The kernel finds what all distances of a step give, on a small grid with many equal ones."""
    rng = np.random.default_rng(seed)
    counts, numbers = rng.integers(0, 5, 4), rng.integers(0, 6, 4)
    rows, starts = (np.concatenate([[0], np.cumsum(one)]) for one in (counts, numbers))
    positions = rng.integers(0, 3, (rows[-1], 3)) * 0.5
    means = np.concatenate([rng.integers(0, 3, (starts[-1], 3)) * 0.5, np.ones((starts[-1], 1))], 1)
    weights = rng.choice([0.0, 0.05, 0.5], starts[-1])
    found = mixtures.nearest_components(positions, rows, weights, means, starts, 0.05, 0.6)
    for step in range(4):
        own, sure = positions[rows[step] : rows[step + 1]], slice(starts[step], starts[step + 1])
        gaps = ((own[:, None] - means[None, sure, :3]) ** 2).sum(axis=2)
        gaps[:, weights[sure] <= 0.05] = np.inf
        for i, index in enumerate(found[rows[step] : rows[step + 1]]):
            best = int(gaps[i].argmin()) if gaps.shape[1] else -1
            mutual = best >= 0 and gaps[i, best] <= 0.36 and gaps[:, best].argmin() == i
            assert index == (best if mutual else -1)


def test_one_jacobian_for_all_is_as_good_as_one_each() -> None:
    mixture = crowd(5, 30, 4)
    settings = {
        "noise": scene.NOISE[None],
        # some are out of sight, so that the others are picked out
        "detection_probability": np.where(np.arange(30) % 3 == 0, 0.0, 0.9),
        "clutter_intensity": 1e-3,
    }
    measurements = mixture.means[:8, [0, 2]] + 0.5
    each = np.tile(scene.POSITION, (30, 1, 1))
    places = mixture.means[:, [0, 2]]
    one, many = (
        phd.update(mixture, measurements, expected=Expected.of(places, jacobians), **settings)
        for jacobians in (scene.POSITION[None], each)
    )
    assert one.posterior.size > mixture.size
    assert_array_equal(one.posterior.weights, many.posterior.weights)
    assert_array_equal(one.posterior.means, many.posterior.means)
    assert_array_equal(one.posterior.covariances, many.posterior.covariances)


def test_a_few_very_wide_components_are_found_among_many_small_ones() -> None:
    mixture = crowd(3, 60, 2)
    wide = GaussianMixture(
        np.full(3, 2.0), np.zeros((3, 2)), np.tile(np.diag([1e12, 1e12]), (3, 1, 1)), np.arange(3)
    )
    both = gaussian_mixture.concatenate([mixture, wide])
    order = np.argsort(-both.weights, kind="stable")
    nobody = np.full(both.size, -1)
    found = mixtures.merge_groups(both.means, both.covariances, order, nobody, 4.0)
    expected = groups_of_all(both, 4.0, nobody)
    assert_array_equal(found[0], expected[0])


@given(
    st.integers(0, 2**32 - 1),
    st.integers(0, 24),
    st.integers(0, 24),
    st.booleans(),
    st.booleans(),
    st.sampled_from((0.5, 9.2, 1000.0, np.inf)),
)
def test_every_pair_inside_the_gate_is_found_and_no_other(
    seed: int, size: int, count: int, shared: bool, spread: bool, gate: float
) -> None:
    rng = np.random.default_rng(seed)
    mixture = crowd(seed, size, 4)
    jacobians = rng.normal(size=(size, 2, 4))
    expected = mixture.means[:, :2] + rng.normal(size=(size, 2))
    near = expected[rng.integers(0, size, count)] if size else np.zeros((count, 2))
    measurements = near + rng.normal(0.0, 3.0, (count, 2))
    noises = random_covariances(rng, 1 if shared else count, 2)
    spreads = random_covariances(rng, size if spread else 0, 2)
    component, measured, likelihood, means, covariances = kalman.kalman_pairs(
        mixture.means,
        mixture.covariances,
        Expected.of(expected, jacobians, spreads),
        Measurements(measurements, noises),
        gate,
    )
    wanted = []
    for z in range(count):
        for j in range(size):
            h, p = jacobians[j], mixture.covariances[j]
            noise = noises[0 if shared else z] + (spreads[j] if spread else 0.0)
            s = h @ p @ h.T + noise
            innovation = measurements[z] - expected[j]
            distance = innovation @ np.linalg.solve(s, innovation)
            if abs(distance - gate) < 1e-6 * gate:
                return  # on the border either is right
            if distance <= gate:
                wanted.append((z, j))
                gain = p @ h.T @ np.linalg.inv(s)
                at = len(wanted) - 1
                density = -0.5 * (distance + np.linalg.slogdet(2.0 * np.pi * s)[1])
                assert_allclose(likelihood[at], density, rtol=1e-6, atol=1e-6)
                scale = max(1.0, float(np.abs(mixture.means[j]).max()))
                assert_allclose(means[at], mixture.means[j] + gain @ innovation, atol=1e-6 * scale)
                assert_allclose(
                    covariances[at], p - gain @ s @ gain.T, atol=1e-6 * float(np.abs(p).max())
                )
    assert list(zip(measured.tolist(), component.tolist(), strict=True)) == wanted


@given(st.integers(0, 2**32 - 1), st.integers(0, 20), st.booleans())
def test_prediction_is_the_formula(seed: int, size: int, shared: bool) -> None:
    rng = np.random.default_rng(seed)
    mixture = random_mixture(rng, size, 3)
    transition = rng.normal(size=(3, 3))
    noise = random_covariances(rng, 1 if shared else size, 3)
    found = gaussian_mixture.predict(mixture, transition, noise[0] if shared else noise, 0.9)
    assert_allclose(found.means, mixture.means @ transition.T, atol=1e-9)
    wanted = transition @ mixture.covariances @ transition.T + noise
    assert_allclose(found.covariances, wanted, rtol=1e-9, atol=1e-9)
    assert_array_equal(found.covariances, found.covariances.transpose(0, 2, 1))
    assert_allclose(found.weights, 0.9 * mixture.weights)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5), st.sampled_from((0.3, 0.5)))
def test_components_share_their_weight_among_measurements_the_surest_first(
    seed: int, count: int, threshold: float
) -> None:
    rng = np.random.default_rng(seed)
    predicted = random_mixture(rng, 4, 2)
    predicted.weights[:] = rng.choice([0.1, 0.25, 1.0, 1.75], 4)
    pairs = np.argwhere(rng.random((count, 4)) < 0.7).reshape(-1, 2)
    weights = rng.choice([0.125, 0.25, 0.5, 0.75], len(pairs))
    odds = rng.integers(0, 4, len(pairs)).astype(float)
    whole = random_mixture(rng, 4 + len(pairs), 2)
    whole.weights[:] = np.append(rng.choice([0.1, threshold, 0.7], 4), weights)
    sums = np.bincount(pairs[:, 0], weights, count) if len(pairs) else np.zeros(count)
    update = phd.PhdUpdate(
        whole, np.append(np.arange(4), pairs[:, 1]), np.append(np.full(4, -1), pairs[:, 0]),
        odds, sums,
    )  # fmt: skip
    found = phd.extract_measured(predicted, update, threshold)
    left = np.maximum(predicted.weights, 1.0) + phd.SPARE
    wanted = []
    surest = [odds[pairs[:, 0] == z].max(initial=-np.inf) for z in range(count)]
    for z in np.argsort(-np.array(surest), kind="stable"):
        own = np.flatnonzero(pairs[:, 0] == z)
        spent = np.minimum(weights[own], left[pairs[own, 1]])
        if sums[z] > threshold and spent.sum() > threshold:
            left[pairs[own, 1]] -= spent
            heaviest = own[len(own) - 1 - spent[::-1].argmax()]
            mean = spent @ whole.means[4 + own] / spent.sum()
            wanted.append((spent.sum(), *mean, whole.labels[4 + heaviest]))
    for j in np.flatnonzero(whole.weights[:4] > threshold):
        wanted.append((whole.weights[j], *whole.means[j], whole.labels[j]))
    table = np.column_stack([found.weights, found.means, found.labels])
    assert_allclose(table, np.reshape(wanted, (-1, 4)), rtol=1e-9, atol=1e-9)


def pairs_of(
    weights: list[float], parents: list[int], measured: list[int], odds: list[float], count: int
) -> phd.PhdUpdate:
    """An update of two components by hand: weights of its pairs."""
    size = 2
    sums = np.bincount(measured, weights, count) if weights else np.zeros(count)
    whole = len(weights) + size
    return phd.PhdUpdate(
        GaussianMixture(
            np.array([0.1, 0.6, *weights]),
            np.arange(whole, dtype=float)[:, None],
            np.ones((whole, 1, 1)),
            np.arange(whole),
        ),
        np.array([0, 1, *parents]),
        np.array([-1, -1, *measured]),
        np.array(odds),
        sums,
    )


def test_a_false_alarm_beside_a_target_gets_no_weight() -> None:
    predicted = random_mixture(np.random.default_rng(0), 2, 1)
    predicted = GaussianMixture(
        np.array([1.0, 0.3]), predicted.means, predicted.covariances, predicted.labels
    )
    # component 0 explains both measurements almost wholly, the second a little better
    both = pairs_of([0.9, 0.95], [0, 0], [0, 1], [3.0, 4.0], 2)
    found = phd.extract_measured(predicted, both)
    assert found.weights.tolist() == pytest.approx([0.95, 0.6])
    assert found.labels.tolist() == [3, 1], "the heavy component that nobody updated is there too"
    # of a component that stands for two, both are
    heavy = GaussianMixture(
        np.array([2.0, 0.3]), predicted.means, predicted.covariances, predicted.labels
    )
    found = phd.extract_measured(heavy, both)
    assert found.weights.tolist() == pytest.approx([0.95, 0.9, 0.6])
    # one that is spread over two components is found, with the mean of both
    spread = pairs_of([0.4, 0.3], [0, 1], [0, 0], [3.0, 4.0], 2)
    found = phd.extract_measured(predicted, spread)
    assert found.weights.tolist() == pytest.approx([0.7, 0.6])
    assert found.means[0, 0] == pytest.approx((0.4 * 2 + 0.3 * 3) / 0.7)
    assert found.labels.tolist() == [2, 1]


def test_nothing_measured_reports_what_is_heavy() -> None:
    predicted = random_mixture(np.random.default_rng(0), 2, 1)
    found = phd.extract_measured(predicted, pairs_of([], [], [], [], 3))
    assert found.weights.tolist() == [0.6]
    assert phd.extract_measured(predicted, pairs_of([], [], [], [], 0), 0.7).size == 0
