"""Stated covariances are those of the errors: NEES, NIS and gates of seeded draws are χ²."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from tests.filters.mixtures import random_covariances
from tracker.filters import gaussian_mixture, phd, pmb
from tracker.filters.gaussian_mixture import GaussianMixture, gate_distance
from tracker.filters.models import constant_velocity
from tracker.kernels.kalman import Expected

COUNT = 120
H = np.array([[1.0, 0, 0, 0, 0, 0], [0, 1.0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0]])


@pytest.mark.parametrize("dimension", [1, 2, 3, 6])
@pytest.mark.parametrize("probability", [0.5, 0.9, 0.999])
def test_the_gate_is_the_quantile_of_chi_square(probability: float, dimension: int) -> None:
    assert_allclose(gate_distance(probability, dimension), chi2.ppf(probability, dimension))


def squares(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Squared Mahalanobis lengths."""
    return np.einsum("na,nab,nb->n", errors, np.linalg.inv(covariances), errors)


def assert_chi_square(values: np.ndarray, dimension: int) -> None:
    """Their mean is that of χ² within what 1 of 10,000 seeds would exceed."""
    total, count = values.sum(), len(values) * dimension
    assert chi2.ppf(5e-5, count) < total < chi2.ppf(1.0 - 5e-5, count)


def draws() -> tuple[GaussianMixture, np.ndarray, np.ndarray, np.ndarray]:
    """People so far apart that each has its own box: prediction, truth, boxes, their noise."""
    rng = np.random.default_rng(11)
    transition, motion = constant_velocity(np.array([1.0, 1.5, 0.3]), 0.2, 2.0)
    centres = np.zeros((COUNT, 6))
    centres[:, 0] = 1e4 * np.arange(COUNT)
    before = random_covariances(rng, COUNT, 6)
    state = centres + np.array([rng.multivariate_normal(np.zeros(6), p) for p in before])
    truth = state @ transition.T + rng.multivariate_normal(np.zeros(6), motion, COUNT)
    mixture = GaussianMixture(np.ones(COUNT), centres, before, np.arange(COUNT))
    noises = random_covariances(rng, COUNT, 3)
    boxes = truth @ H.T + np.array([rng.multivariate_normal(np.zeros(3), r) for r in noises])
    return gaussian_mixture.predict(mixture, transition, motion, 1.0), truth, boxes, noises


PREDICTED, TRUTH, BOXES, NOISES = draws()
EXPECTED = Expected.of(PREDICTED.means @ H.T, H[None])


def test_predicted_and_updated_errors_are_as_large_as_stated() -> None:
    assert_chi_square(squares(TRUTH - PREDICTED.means, PREDICTED.covariances), 6)
    innovations = BOXES - PREDICTED.means @ H.T
    assert_chi_square(squares(innovations, H @ PREDICTED.covariances @ H.T + NOISES), 3)
    settings = {"expected": EXPECTED, "noise": NOISES, "gate": 1e3}
    found = phd.update(
        PREDICTED, BOXES, detection_probability=1.0, clutter_intensity=1e-9, **settings
    )
    updated = found.posterior.take(found.measurements >= 0)
    assert_allclose(updated.weights, 1.0, atol=1e-3)
    assert_chi_square(squares(TRUTH - updated.means, updated.covariances), 6)
    sure = pmb.update(
        PREDICTED,
        BOXES,
        detection_probability=np.ones(COUNT),
        unexplained_intensity=np.full(COUNT, 1e-9),
        **settings,
    )
    assert_chi_square(squares(TRUTH - sure.tracks.means, sure.tracks.covariances), 6)


@pytest.mark.parametrize("probability", [0.6, 0.95])
def test_as_many_boxes_lie_within_the_gate_as_it_says(probability: float) -> None:
    found = phd.update(
        PREDICTED,
        BOXES,
        expected=EXPECTED,
        noise=NOISES,
        detection_probability=0.9,
        clutter_intensity=1e-9,
        gate=gate_distance(probability, 3),
    )
    share = float((found.measurements >= 0).sum()) / COUNT
    sigma = np.sqrt(probability * (1.0 - probability) / COUNT)
    assert abs(share - probability) < 4.0 * sigma
