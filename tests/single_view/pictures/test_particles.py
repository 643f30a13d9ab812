"""Particles: weights, multinomial resampling, Epanechnikov clusters, drawing anew."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker.kernels.pictures import images
from tracker.single_view.pseudo_particle import particles
from tracker.single_view.pseudo_particle.particles import Clusters, clusters

CENTRES = np.array([[60.0, 50.0, 10.0, 15.0], [110.0, 52.0, 12.0, 16.0], [62.0, 140.0, 8.0, 12.0]])

logarithms = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=30)


def around(centres: ndarray, counts: list[int], seed: int = 0, spread: float = 0.3) -> ndarray:
    """Boxes that scatter by a share of their half sizes."""
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [
            centre + rng.normal(0.0, spread, (count, 4)) * centre[[2, 3, 2, 3]] * [1, 1, 0.2, 0.2]
            for centre, count in zip(centres, counts, strict=True)
        ]
    )


def one_group(boxes: ndarray) -> ndarray:
    return np.zeros(len(boxes), dtype=np.int64)


def together(
    boxes: ndarray, counts: ndarray, merge_distance: float = 1.0, **more: float
) -> Clusters:
    """Clusters of all particles at once."""
    return clusters(
        boxes, counts, one_group(boxes), merge_distance=merge_distance, **{"bandwidth": 1.0, **more}
    )


def test_a_weight_is_that_of_the_target_it_fits_best() -> None:
    distances = np.array([[0.2, 0.9], [0.8, 0.4], [1.0, 1.0]])
    weights = np.exp(particles.log_likelihoods(distances, 20.0))
    np.testing.assert_allclose(weights, np.exp(-20.0 * distances).max(axis=1))


@given(logarithms, st.floats(-1e5, 1e5))
def test_weights_sum_to_1_and_only_ratios_count(values: list[float], shift: float) -> None:
    weights = particles.normalised(np.array(values))
    assert weights.sum() == pytest.approx(1.0)
    assert np.all(weights >= 0.0)
    np.testing.assert_allclose(particles.normalised(np.array(values) + shift), weights, atol=1e-8)


@given(logarithms)
def test_each_group_keeps_its_share_of_the_particles(values: list[float]) -> None:
    scores = np.array(values)
    groups = np.arange(len(scores)) % 3 * 2  # the groups between have no members
    weights = particles.normalised_by_group(scores, groups)
    for group in np.unique(groups):
        members = groups == group
        assert weights[members].sum() == pytest.approx(members.mean())
        np.testing.assert_allclose(
            weights[members] / weights[members].sum(), particles.normalised(scores[members])
        )
    same = particles.normalised_by_group(scores, np.zeros(len(scores), dtype=np.int64))
    np.testing.assert_allclose(same, particles.normalised(scores))


def test_no_particles_have_no_weights() -> None:
    nothing = np.zeros(0)
    none = np.zeros(0, dtype=np.int64)
    assert len(particles.normalised(nothing)) == 0
    assert len(particles.normalised_by_group(nothing, none)) == 0
    assert len(particles.resample(nothing, 100, np.random.default_rng(0))) == 0
    assert particles.effective_number(nothing) == 0.0


def test_the_effective_number_runs_from_one_to_all() -> None:
    assert particles.effective_number(np.full(40, 1 / 40)) == pytest.approx(40.0)
    assert particles.effective_number(np.eye(40)[3]) == pytest.approx(1.0)


def test_resampling_draws_each_particle_as_often_as_it_weighs() -> None:
    rng = np.random.default_rng(5)
    weights = particles.normalised(np.append(rng.normal(0.0, 1.0, 9), -np.inf))
    drawn = np.array([particles.resample(weights, 50, rng) for _ in range(4000)])
    assert np.all(drawn.sum(axis=1) == 50)
    assert drawn[:, -1].max() == 0
    # of a multinomial draw: mean n p, variance n p (1 - p)
    spread = np.sqrt(50 * weights * (1.0 - weights))
    assert np.all(np.abs(drawn.mean(axis=0) - 50 * weights) <= 4.0 * spread / np.sqrt(4000))
    np.testing.assert_allclose(drawn.var(axis=0), spread**2, rtol=0.15)


def test_the_modes_are_the_targets_the_largest_cluster_first() -> None:
    boxes = around(CENTRES, [90, 60, 30])
    found = together(boxes, np.ones(180, dtype=int))
    assert len(found.modes) == 3
    np.testing.assert_allclose(found.shares, [1 / 2, 1 / 3, 1 / 6], atol=0.03)
    assert np.abs((found.modes - CENTRES)[:, :2] / CENTRES[:, 2:]).max() < 0.12
    assert np.mean(found.owners == np.repeat([0, 1, 2], [90, 60, 30])) > 0.99


def test_a_climb_never_goes_down() -> None:
    # with one size for all the density that is climbed is the same everywhere
    boxes = around(CENTRES, [40, 30, 20], spread=0.6)
    boxes[:, 2:] = [10.0, 14.0]
    counts = np.random.default_rng(4).integers(1, 4, len(boxes)).astype(float)

    def density(points: ndarray) -> ndarray:
        offsets = (boxes[None, :, :2] - points[:, None, :2]) / [10.0, 14.0]
        return (counts * np.maximum(1.0 - (offsets**2).sum(axis=2), 0.0)).sum(axis=1)

    points, _ = images.epanechnikov_climb(boxes, counts, one_group(boxes), 1.0, 30, 0.0)
    assert np.all(density(points) >= density(boxes) - 1e-9)


@given(st.floats(0.1, 20.0), st.floats(-300.0, 300.0), st.floats(-300.0, 300.0))
def test_the_bandwidth_follows_the_radius(scale: float, x: float, y: float) -> None:
    boxes, counts = around(CENTRES, [30, 20, 10]), np.ones(60, dtype=int)
    here = together(boxes, counts)
    there = together(boxes * scale + [x, y, 0.0, 0.0], counts)
    np.testing.assert_array_equal(there.owners, here.owners)
    np.testing.assert_allclose(there.modes, here.modes * scale + [x, y, 0, 0], atol=1e-6)


def test_a_particle_drawn_twice_counts_as_two() -> None:
    boxes = around(CENTRES, [20, 15, 10], spread=0.6)
    counts = np.random.default_rng(2).integers(0, 4, len(boxes))
    once = together(boxes, counts)
    copies = together(np.repeat(boxes, counts, axis=0), np.ones(counts.sum(), dtype=int))
    np.testing.assert_allclose(once.modes, copies.modes)
    np.testing.assert_allclose(once.shares, copies.shares)
    np.testing.assert_array_equal(np.repeat(once.owners, counts), copies.owners)
    assert np.all(once.owners[counts == 0] == -1)
    assert once.shares.sum() == pytest.approx(1.0)


def test_each_group_has_modes_of_its_own() -> None:
    # half a box apart: together they are one, by themselves two
    pair = CENTRES[[0, 0]] + [[0.0, 0, 0, 0], [11.0, 0, 0, 0]]
    boxes, counts = around(pair, [80, 60], spread=0.25), np.ones(140, dtype=int)
    groups = np.repeat([4, 1], [80, 60])
    apart = clusters(boxes, counts, groups, bandwidth=1.0, merge_distance=1.0)
    assert len(apart.modes) == 2
    np.testing.assert_array_equal(apart.owners, np.repeat([0, 1], [80, 60]))
    np.testing.assert_allclose(apart.modes[:, 0], pair[:, 0], atol=0.8)
    for group, rows in ((0, boxes[:80]), (1, boxes[80:])):
        alone = together(rows, np.ones(len(rows), dtype=int))
        np.testing.assert_allclose(alone.modes, apart.modes[[group]])
    assert len(together(boxes, counts).modes) == 1


def test_modes_keep_their_distance() -> None:
    rng = np.random.default_rng(1)
    boxes = np.column_stack([rng.uniform(0, 90, (150, 2)), np.full((150, 2), 10.0)])
    found = together(boxes, np.ones(150, dtype=int), 1.5, bandwidth=0.6)
    between = np.linalg.norm(found.modes[:, None, :2] - found.modes[None, :, :2], axis=2)
    assert len(found.modes) > 5
    assert between[~np.eye(len(between), dtype=bool)].min() >= 15.0
    assert found.owners.min() == 0


def test_no_particles_have_no_modes() -> None:
    for boxes in (np.zeros((0, 4)), CENTRES):
        found = together(boxes, np.zeros(len(boxes), dtype=int))
        assert found.modes.shape == (0, 4)
        assert found.shares.shape == (0,)
        np.testing.assert_array_equal(found.owners, np.full(len(boxes), -1))


def test_particles_are_drawn_anew_around_each_target() -> None:
    rng = np.random.default_rng(8)
    sigmas = np.array([[5.0, 7.0], [2.0, 3.0], [0.0, 0.0]])
    drawn = particles.redistribute(CENTRES, sigmas, 9001, rng)
    assert len(drawn) == 9001
    for index in range(3):
        own = drawn[index::3]
        np.testing.assert_array_equal(own[:, 2:], np.tile(CENTRES[index, 2:], (len(own), 1)))
        np.testing.assert_allclose(own[:, :2].mean(axis=0), CENTRES[index, :2], atol=0.4)
        np.testing.assert_allclose(own[:, :2].std(axis=0), sigmas[index], rtol=0.06)
    assert len(particles.redistribute(np.zeros((0, 4)), np.zeros((0, 2)), 100, rng)) == 0
    assert len(particles.redistribute(CENTRES, sigmas, 0, rng)) == 0
