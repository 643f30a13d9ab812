"""The laws of the mixture: what prediction, pruning, merging and capping keep."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.mixtures import (
    assert_positive_definite,
    first_moment,
    mixtures,
    random_covariances,
    random_mixture,
    reference_merge,
    reference_reduce,
    second_moment,
)
from tracker.filters import gaussian_mixture as gm
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels import mixtures as mixture_kernels

thresholds = st.sampled_from((0.0, 0.5, 4.0, 50.0, 1e6))


@given(mixtures(), thresholds)
def test_merging_keeps_cardinality_mean_and_second_moment(
    mixture: GaussianMixture, threshold: float
) -> None:
    merged, _ = gm.merge(mixture, threshold)
    assert_allclose(merged.cardinality, mixture.cardinality, rtol=1e-12)
    scale = np.abs(mixture.means).max(initial=1.0)
    weight = max(mixture.cardinality, 1.0)
    assert_allclose(first_moment(merged), first_moment(mixture), atol=1e-12 * scale * weight)
    assert_allclose(
        second_moment(merged), second_moment(mixture), rtol=1e-9, atol=1e-10 * scale**2 * weight
    )


@given(mixtures(), thresholds)
def test_merging_agrees_with_the_published_table(
    mixture: GaussianMixture, threshold: float
) -> None:
    merged, leaders = gm.merge(mixture, threshold)
    reference, reference_leaders, _ = reference_merge(mixture, threshold)
    assert_array_equal(leaders, reference_leaders)
    assert_array_equal(merged.labels, reference.labels)
    assert_allclose(merged.weights, reference.weights, rtol=1e-12)
    assert_allclose(merged.means, reference.means, rtol=1e-9, atol=1e-9)
    assert_allclose(merged.covariances, reference.covariances, rtol=1e-9, atol=1e-9)


@given(mixtures(), thresholds)
def test_leaders_are_the_heaviest_of_their_groups(
    mixture: GaussianMixture, threshold: float
) -> None:
    order = np.argsort(-mixture.weights, kind="stable")
    nobody = np.full(mixture.size, -1)
    group, leaders = mixture_kernels.merge_groups(
        mixture.means, mixture.covariances, order, nobody, threshold
    )
    _, reference_leaders, members = reference_merge(mixture, threshold)
    assert_array_equal(leaders, reference_leaders)
    for number, (leader, reference_members) in enumerate(zip(leaders, members, strict=True)):
        assert_array_equal(np.flatnonzero(group == number), reference_members)
        assert group[leader] == number
        assert mixture.weights[leader] == mixture.weights[group == number].max()
    assert (np.diff(mixture.weights[leaders]) <= 0.0).all()


@given(st.integers(0, 2**32 - 1), st.sampled_from((1, 2, 4, 6)), st.sampled_from((0.5, 4.0, 50.0)))
def test_all_within_the_threshold_merge_however_far_they_reach_along_an_axis(
    seed: int, dimension: int, threshold: float
) -> None:
    """Where (m_i − m_l)ᵀ P_i⁻¹ (m_i − m_l) = U lies farthest along each axis, a millionth nearer
    and farther: that is √(U / P_aa) P e_a from the leader."""
    rng = np.random.default_rng(seed)
    covariances = random_covariances(rng, 4 * dimension + 1, dimension)
    means = rng.uniform(-100.0, 100.0, dimension) + np.zeros((len(covariances), 1))
    farthest = np.sqrt(threshold / covariances.diagonal(axis1=1, axis2=2))[:, None] * covariances
    for i in range(1, len(means)):
        side, beyond, axis = (-1.0) ** i, 1.0 if i % 4 < 2 else -1.0, (i - 1) // 4
        means[i] += side * (1.0 + 1e-6 * beyond) * farthest[i, :, axis]
    order, nobody = np.arange(len(means)), np.full(len(means), -1)
    group, _ = mixture_kernels.merge_groups(means, covariances, order, nobody, threshold)
    assert_array_equal(group == 0, (order == 0) | (order % 4 >= 2))


@given(mixtures(), st.sampled_from((0.0, 1e-4, 0.1)), thresholds)
def test_reducing_never_raises_the_cardinality(
    mixture: GaussianMixture, pruning: float, merging: float
) -> None:
    count = reference_reduce(mixture, pruning, merging, 100).size
    for most in {1, max(count - 1, 1), count + 1}:
        reduced, leaders = gm.reduce(
            mixture, pruning_threshold=pruning, merging_threshold=merging, max_components=most
        )
        assert reduced.cardinality <= mixture.cardinality * (1.0 + 1e-12)
        assert reduced.size == min(most, count)
        assert (reduced.weights >= pruning * (1.0 - 1e-12)).all()
        assert (np.diff(reduced.weights) <= 0.0).all()
        assert len(np.unique(leaders)) == reduced.size
        assert_array_equal(reduced.labels, mixture.labels[leaders])
        if reduced.size:  # however few are left, they stand for all that were not pruned
            heavy = mixture.weights[mixture.weights >= pruning]
            assert reduced.cardinality == pytest.approx(heavy.sum())
        reference = reference_reduce(mixture, pruning, merging, most)
        assert_allclose(reduced.weights, reference.weights, rtol=1e-12)
        assert_allclose(reduced.means, reference.means, rtol=1e-9, atol=1e-9)


@given(mixtures(), st.floats(0.0, 1.0), st.integers(0, 2**32 - 1), thresholds)
def test_covariances_stay_symmetric_and_positive(
    mixture: GaussianMixture, survival: float, seed: int, threshold: float
) -> None:
    rng = np.random.default_rng(seed)
    d = mixture.dimension
    transition = np.eye(d) + 0.3 * rng.normal(size=(d, d))
    noise = random_covariances(rng, 1, d)[0]
    predicted = gm.predict(mixture, transition, noise, survival)
    assert_positive_definite(predicted.covariances)
    assert_positive_definite(gm.merge(predicted, threshold)[0].covariances)


@given(mixtures(), st.integers(0, 2**32 - 1))
def test_prediction_moves_the_moments_as_the_motion_model_says(
    mixture: GaussianMixture, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    d = mixture.dimension
    transition = rng.normal(size=(d, d))
    noise = random_covariances(rng, 1, d)[0]
    survival = rng.uniform(size=mixture.size)
    predicted = gm.predict(mixture, transition, noise, survival)
    assert_allclose(predicted.weights, survival * mixture.weights)
    assert_array_equal(predicted.labels, mixture.labels)
    for j in range(mixture.size):
        assert_allclose(predicted.means[j], transition @ mixture.means[j], atol=1e-10)
        expected = transition @ mixture.covariances[j] @ transition.T + noise
        assert_allclose(predicted.covariances[j], expected, rtol=1e-9, atol=1e-9)


def test_standing_still_changes_nothing() -> None:
    mixture = random_mixture(np.random.default_rng(3), 6, 3)
    still = gm.predict(mixture, np.eye(3), np.zeros((3, 3)), 1.0)
    assert_array_equal(still.weights, mixture.weights)
    assert_array_equal(still.means, mixture.means)
    assert_array_equal(still.covariances, mixture.covariances)


def test_components_of_no_weight_do_no_harm() -> None:
    mixture = random_mixture(np.random.default_rng(5), 4, 2, extent=100.0)
    weightless = GaussianMixture(
        np.array([0.0, 0.7, 0.0, 5e-324]), mixture.means, mixture.covariances, mixture.labels
    )
    merged, leaders = gm.merge(weightless, 1e-9)
    assert merged.size == 4
    assert_array_equal(merged.means, mixture.means[leaders])
    assert_array_equal(merged.covariances, mixture.covariances[leaders])


def test_everything_merges_into_its_mean() -> None:
    mixture = GaussianMixture(
        weights=np.array([3.0, 1.0]),
        means=np.array([[0.0], [4.0]]),
        covariances=np.full((2, 1, 1), 2.0),
        labels=np.array([7, 9]),
    )
    merged, leaders = gm.merge(mixture, 8.0)  # 4² / 2 = 8 is just near enough
    assert_array_equal(merged.weights, [4.0])
    assert_array_equal(merged.means, [[1.0]])
    assert_array_equal(merged.covariances, [[[5.0]]])  # 2 + 3/4 · 1/4 · 4²
    assert_array_equal(merged.labels, [7])
    assert_array_equal(leaders, [0])
    apart, _ = gm.merge(mixture, 7.999)
    assert apart.size == 2


def test_nobody_stays_nobody() -> None:
    nobody = GaussianMixture.empty(4)
    assert (nobody.size, nobody.dimension, nobody.cardinality) == (0, 4, 0.0)
    assert gm.predict(nobody, np.eye(4), np.eye(4), 0.9).size == 0
    merged, leaders = gm.merge(nobody, 4.0)
    assert (merged.size, len(leaders)) == (0, 0)
    reduced, leaders = gm.reduce(
        nobody, pruning_threshold=1e-5, merging_threshold=4.0, max_components=3
    )
    assert (reduced.size, reduced.dimension, len(leaders)) == (0, 4, 0)
    assert leaders.dtype == np.int64
    somebody = random_mixture(np.random.default_rng(1), 3, 4)
    assert gm.concatenate([nobody, somebody, nobody]).size == 3


def test_pruning_keeps_the_weight_of_the_threshold_itself() -> None:
    mixture = random_mixture(np.random.default_rng(1), 3, 1)
    weights = np.array([0.1, 0.2, 0.3])
    mixture = GaussianMixture(weights, mixture.means, mixture.covariances, mixture.labels)
    assert_array_equal(gm.prune(mixture, 0.2), [1, 2])
    everything_pruned, _ = gm.reduce(
        mixture, pruning_threshold=1.0, merging_threshold=4.0, max_components=3
    )
    assert everything_pruned.size == 0


def test_a_negative_threshold_is_refused() -> None:
    mixture = random_mixture(np.random.default_rng(1), 3, 2)
    with pytest.raises(ValueError, match=r"threshold must be >= 0 .*got -0\.5"):
        gm.merge(mixture, -0.5)


def test_a_singular_covariance_is_refused() -> None:
    mixture = GaussianMixture(
        np.ones(2), np.zeros((2, 2)), np.stack([np.eye(2), np.ones((2, 2))]), np.arange(2)
    )
    with pytest.raises(np.linalg.LinAlgError):
        gm.merge(mixture, 4.0)


@pytest.mark.parametrize(
    ("weights", "means", "covariances", "labels"),
    [
        ((3,), (2, 4), (2, 4, 4), (2,)),
        ((2,), (2, 4), (2, 4, 3), (2,)),
        ((2,), (2, 4), (1, 4, 4), (2,)),
        ((2,), (2, 4), (2, 4, 4), (1,)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(
    weights: tuple[int, ...],
    means: tuple[int, ...],
    covariances: tuple[int, ...],
    labels: tuple[int, ...],
) -> None:
    with pytest.raises(ValueError, match="must have shapes"):
        GaussianMixture(
            np.zeros(weights), np.zeros(means), np.zeros(covariances), np.zeros(labels, int)
        )


@pytest.mark.parametrize("size", [0, 1, 2, 48, 49, 700])
def test_the_heaviest_come_first_and_equal_ones_in_order(size: int) -> None:
    rng = np.random.default_rng(size)
    spread = rng.choice([0.0, -0.0, 1e-300, 1e-9, 0.5, 0.5, 1.0, 3.0, np.inf], size)
    for weights in (spread, rng.exponential(1.0, size), np.full(size, 0.25)):
        order = mixture_kernels.heaviest_first(weights)
        assert_array_equal(order, np.argsort(-weights, kind="stable"))


def test_weights_that_differ_in_their_last_bits_only_are_sorted_too() -> None:
    rng = np.random.default_rng(0)
    close = 1.0 + 1e-13 * rng.random(2000)
    for weights in (close, np.append(close, 0.0)):  # with the zero the upper bits all agree
        order = mixture_kernels.heaviest_first(weights)
        assert_array_equal(order, np.argsort(-weights, kind="stable"))


def test_the_heaviest_of_each_group_and_of_equal_ones_the_last() -> None:
    weights = np.array([0.2, 0.7, 0.7, 0.1, 0.0, 0.9])
    group = np.array([0, 2, 2, 0, 3, -1])
    assert_array_equal(mixture_kernels.heaviest_of_groups(weights, group, 5), [0, -1, 2, 4, -1])
