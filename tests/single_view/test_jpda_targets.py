"""Constant velocity and the update over all associations, against mixtures written out."""

# mypy: disable-error-code="import-untyped"

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose

from tracker.single_view.jpda import targets as kalman
from tracker.single_view.jpda.targets import Targets, innovations

POSITION = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def some(seed: int, count: int) -> Targets:
    """Targets anywhere, with any covariance."""
    rng = np.random.default_rng(seed)
    boxes = np.column_stack([rng.uniform(0, 300, (count, 2)), rng.uniform(2, 20, (count, 2))])
    begun = Targets.at_rest(boxes, np.full((count, 4), 2.0), 5.0, np.arange(1, count + 1))
    factors = rng.normal(0.0, 3.0, (count, 4, 4))
    covariances = factors @ factors.transpose(0, 2, 1) + np.eye(4)
    means = begun.means + rng.normal(0.0, 5.0, (count, 4))
    return replace(begun, means=means, covariances=covariances)


def test_who_begins_stands_still_and_is_unsure_of_it() -> None:
    box = np.array([[40.0, 50.0, 4.0, 9.0]])
    begun = Targets.at_rest(box, np.array([[1.0, 2.0, 3.0, 4.0]]), 5.0, np.array([7]))
    assert_allclose(begun.means, [[40.0, 0.0, 50.0, 0.0]])
    assert_allclose(np.diag(begun.covariances[0]), [1.0, 30.0**2, 4.0, 30.0**2])
    assert_allclose(begun.boxes, box)
    assert begun.hits.tolist() == [1]


@given(st.integers(0, 10_000), st.integers(0, 4))
def test_a_step_ahead_is_filterpys(seed: int, count: int) -> None:
    targets, time, sigma = some(seed, count), 0.04, 8.0
    ahead = targets.predict(time, sigma)
    axis = np.array([[time**3 / 3, time**2 / 2], [time**2 / 2, time]])
    for i in range(count):
        other = KalmanFilter(dim_x=4, dim_z=2)
        other.F = np.kron(np.eye(2), [[1.0, time], [0.0, 1.0]])
        other.x, other.P = targets.means[i], targets.covariances[i]
        other.Q = np.kron(np.eye(2), axis) * sigma**2 * targets.half_sizes[i].prod()
        other.predict()
        assert_allclose(ahead.means[i], other.x)
        assert_allclose(ahead.covariances[i], other.P)


def mixture(targets: Targets, i: int, places: ndarray, sigmas: ndarray, shares: ndarray) -> tuple:
    """Mean and covariance of the miss and of a Kalman update by each measurement."""
    means, covariances = [targets.means[i]], [targets.covariances[i]]
    for place, sigma in zip(places, sigmas, strict=True):
        other = KalmanFilter(dim_x=4, dim_z=2)
        other.x, other.P = targets.means[i], targets.covariances[i]
        other.H, other.R = POSITION, np.diag(sigma**2)
        other.update(place)
        means.append(other.x)
        covariances.append(other.P)
    weights = np.append(1.0 - shares.sum(), shares)
    mean = weights @ np.array(means)
    spread = sum(
        w * (P + np.outer(m - mean, m - mean))
        for w, m, P in zip(weights, means, covariances, strict=True)
    )
    return mean, spread


@given(st.integers(0, 10_000), st.integers(0, 3), st.integers(0, 4))
def test_the_update_keeps_two_moments_of_all_associations(
    seed: int, count: int, measured: int
) -> None:
    rng = np.random.default_rng(seed)
    targets = some(seed, count)
    places, sigmas = rng.uniform(0, 300, (measured, 2)), rng.uniform(0.5, 5.0, (measured, 2))
    shares = rng.dirichlet(np.ones(measured + 1), count)[:, 1:]
    updated = kalman.update(targets, innovations(targets, places, sigmas), shares)
    for i in range(count):
        mean, covariance = mixture(targets, i, places, sigmas, shares[i])
        assert_allclose(updated.means[i], mean, rtol=1e-7, atol=1e-6)
        assert_allclose(updated.covariances[i], covariance, rtol=1e-6, atol=1e-5)


def test_without_any_measurement_the_prediction_stands() -> None:
    targets = some(3, 2)
    found = innovations(targets, np.array([[10.0, 20.0]]), np.ones((1, 2)))
    same = kalman.update(targets, found, np.zeros((2, 1)))
    assert_allclose(same.means, targets.means)
    assert_allclose(same.covariances, targets.covariances)


def test_innovations_are_densities_and_distances() -> None:
    target = Targets.at_rest(
        np.array([[5.0, 5.0, 4.0, 4.0]]), np.full((1, 4), 3.0), 1.0, np.ones(1)
    )
    found = innovations(target, np.array([[10.0, 5.0], [5.0, 5.0]]), np.full((2, 2), 4.0))
    assert_allclose(found.covariances[0, 0], 25.0 * np.eye(2))
    assert_allclose(found.squared, [[1.0, 0.0]])
    assert_allclose(found.densities[0], np.exp([-0.5, 0.0]) / (2.0 * np.pi * 25.0))


def test_as_an_intensity_each_is_one_person() -> None:
    targets = some(5, 3)
    intensity = targets.as_boxes(np.full((3, 4), 2.0))
    assert intensity.cardinality == pytest.approx(3.0)
    assert_allclose(intensity.means, targets.boxes)
    assert_allclose(intensity.covariances[:, 0, 1], targets.covariances[:, 0, 2])
    assert_allclose(intensity.covariances[:, 3, 3], 4.0)
