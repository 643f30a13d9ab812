"""The GM-PHD recursion step for step beside Stone Soup's, on crossing targets in clutter.

Two lines run side by side over the same measurements, each on its own mixture: ours,
and one whose prediction and update are Stone Soup's (Kalman predictor, Gaussian-mixture
hypothesiser, PHD updater). What differs by design, and what the test does about it:

- p_S of births. Stone Soup's updater multiplies every component by p_S, newborn ones
  included; ours enter after prediction. Its births are handed over divided by p_S.
- Births that nobody detects. Stone Soup drops a missed component tagged ``birth``; here,
  as in [VM06], it stays with weight (1 - p_D) w. Its births bear an ordinary tag.
- The gate is a distance there and a squared distance here; ``<`` there, ``<=`` here.
- Reduction. Stone Soup spreads the pruned and the truncated weight over the survivors,
  measures distances from the mean of what a leader has absorbed so far, lightest first,
  rather than from the leader, and caps a merged weight at 1. All of that breaks the laws
  that ours keeps, so both lines are reduced by the published table (a plain NumPy form for
  the second line); the mixtures are compared before and after.
"""

# mypy: disable-error-code="import-untyped"

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.hypothesiser.gaussianmixture import GaussianMixtureHypothesiser
from stonesoup.measures import Mahalanobis
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.models.transition.linear import (
    CombinedLinearGaussianTransitionModel,
    ConstantVelocity,
)
from stonesoup.predictor.kalman import KalmanPredictor
from stonesoup.types.detection import Detection
from stonesoup.types.state import TaggedWeightedGaussianState
from stonesoup.updater.kalman import KalmanUpdater
from stonesoup.updater.pointprocess import PHDUpdater

from tests.filters.mixtures import reference_reduce
from tracker.filters import gaussian_mixture, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels.kalman import Expected

STEPS = 16
SURVIVAL, DETECTION, CLUTTER_RATE, EXTENT = 0.98, 0.9, 4.0, 100.0
CLUTTER = CLUTTER_RATE / EXTENT**2
GATE = 4.5  # standard deviations
PRUNING, MERGING, MOST = 1e-5, 4.0, 40
POSITION = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
NOISE = np.diag([1.0, 1.5])
START = datetime(2000, 1, 1)

MOTION = CombinedLinearGaussianTransitionModel([ConstantVelocity(0.05), ConstantVelocity(0.05)])
SENSOR = LinearGaussian(4, (0, 2), NOISE)

BIRTHS = GaussianMixture(
    weights=np.full(3, 0.05),
    means=np.array([[20.0, 0, 20, 0], [80.0, 0, 20, 0], [50.0, 0, 85, 0]]),
    covariances=np.tile(np.diag([25.0, 4.0, 25.0, 4.0]), (3, 1, 1)),
    labels=np.array([1, 2, 3]),
)


def scenario(seed: int) -> list[ndarray]:
    """Measurements of three targets: two cross at step 12, the third comes at 4, goes at 13."""
    rng = np.random.default_rng(seed)
    scans = []
    for step in range(STEPS):
        places = [
            np.array([20.0 + 2.5 * step, 20.0 + 1.2 * step]),
            np.array([80.0 - 2.5 * step, 20.0 + 1.2 * step]),
        ]
        if 4 <= step < 13:
            places.append(np.array([50.0, 85.0 - 1.4 * (step - 4)]))
        seen = [p + rng.normal(size=2) * [1.0, 1.2] for p in places if rng.random() < DETECTION]
        false = rng.uniform(0.0, EXTENT, (rng.poisson(CLUTTER_RATE), 2))
        scans.append(np.concatenate([np.array(seen).reshape(-1, 2), false]))
    return scans


def to_stone_soup(mixture: GaussianMixture, when: datetime) -> list[TaggedWeightedGaussianState]:
    """Components as Stone Soup's states, tagged by label."""
    return [
        TaggedWeightedGaussianState(
            mean[:, None], covariance, timestamp=when, weight=float(weight), tag=int(label)
        )
        for weight, mean, covariance, label in zip(
            mixture.weights, mixture.means, mixture.covariances, mixture.labels, strict=True
        )
    ]


def from_stone_soup(states: Any) -> GaussianMixture:
    """Stone Soup's states as a mixture."""
    parts = list(states)
    return GaussianMixture(
        np.array([float(part.weight) for part in parts]),
        np.array([np.asarray(part.mean, dtype=float).ravel() for part in parts]).reshape(-1, 4),
        np.array([np.asarray(part.covar, dtype=float) for part in parts]).reshape(-1, 4, 4),
        np.array([int(part.tag) for part in parts], dtype=np.int64),
    )


def our_update(posterior: GaussianMixture, scan: ndarray) -> GaussianMixture:
    """Predict and update with the engine, not reduced."""
    one_step = timedelta(seconds=1)
    survivors = gaussian_mixture.predict(
        posterior,
        np.asarray(MOTION.matrix(time_interval=one_step), dtype=float),
        np.asarray(MOTION.covar(time_interval=one_step), dtype=float),
        SURVIVAL,
    )
    predicted = gaussian_mixture.concatenate([survivors, BIRTHS])
    updated = phd.update(
        predicted,
        scan,
        expected=Expected.of(
            predicted.means @ POSITION.T, np.broadcast_to(POSITION, (predicted.size, 2, 4))
        ),
        noise=NOISE[None],
        detection_probability=DETECTION,
        clutter_intensity=CLUTTER,
        gate=GATE**2,
    )
    return updated.posterior


def stone_soup_update(posterior: GaussianMixture, scan: ndarray, step: int) -> GaussianMixture:
    """Predict and update with Stone Soup, not reduced."""
    now, before = START + timedelta(seconds=step), START + timedelta(seconds=step - 1)
    kalman = KalmanUpdater(SENSOR)
    hypothesiser = GaussianMixtureHypothesiser(
        DistanceHypothesiser(KalmanPredictor(MOTION), kalman, Mahalanobis(), missed_distance=GATE),
        order_by_detection=True,
    )
    updater = PHDUpdater(
        updater=kalman,
        clutter_spatial_density=CLUTTER,
        prob_detection=DETECTION,
        prob_survival=SURVIVAL,
    )
    newborn = to_stone_soup(BIRTHS, now)  # already now: prediction over no time leaves them
    for birth in newborn:
        birth.weight /= SURVIVAL
    components = to_stone_soup(posterior, before) + newborn
    detections = [Detection(z[:, None], timestamp=now, measurement_model=SENSOR) for z in scan]
    hypotheses = hypothesiser.hypothesise(components, detections, now)
    return from_stone_soup(updater.update(hypotheses))


def in_order(mixture: GaussianMixture) -> GaussianMixture:
    """Sorted by mean, so that the order of the components does not count."""
    return mixture.take(np.lexsort((np.round(mixture.weights, 9), *np.round(mixture.means.T, 6))))


def assert_same(ours: GaussianMixture, theirs: GaussianMixture) -> None:
    """The same components, in whatever order."""
    assert ours.size == theirs.size
    ours, theirs = in_order(ours), in_order(theirs)
    assert_allclose(ours.weights, theirs.weights, rtol=1e-9, atol=1e-12)
    assert_allclose(ours.means, theirs.means, rtol=1e-9, atol=1e-9)
    assert_allclose(ours.covariances, theirs.covariances, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", [1])
def test_the_recursion_agrees_step_for_step(seed: int) -> None:
    ours = theirs = GaussianMixture.empty(4)
    counts = []
    for step, scan in enumerate(scenario(seed)):
        our_posterior = our_update(ours, scan)
        their_posterior = stone_soup_update(theirs, scan, step)
        assert_same(our_posterior, their_posterior)
        ours, _ = gaussian_mixture.reduce(
            our_posterior,
            pruning_threshold=PRUNING,
            merging_threshold=MERGING,
            max_components=MOST,
        )
        theirs = reference_reduce(their_posterior, PRUNING, MERGING, MOST)
        assert_same(ours, theirs)
        counts.append(ours.cardinality)
    assert np.mean(counts[8:12]) == pytest.approx(3.0, abs=0.4)  # the scenario is no empty one
