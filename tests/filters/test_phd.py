"""The PHD update: its laws, the Kalman filter as its simplest case, and Stone Soup's beside it."""

from __future__ import annotations

from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import chi2, multivariate_normal
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

from tests import world
from tests.filters.mixtures import (
    assert_positive_definite,
    mixtures,
    random_covariances,
    random_mixture,
    reference_reduce,
    reference_update,
)
from tracker.filters import gaussian_mixture, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels import kalman as update_kernels
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.lens import project_points

seeds = st.integers(0, 2**32 - 1)
DIMENSIONS = (1, 2, 4, 6)


class Linear:
    """A random linear measurement of a mixture, with some measurements near and some far."""

    def __init__(self, mixture: GaussianMixture, seed: int, *, count: int | None = None) -> None:
        self.rng = np.random.default_rng(seed)
        rng, d = self.rng, mixture.dimension
        size = int(rng.integers(1, d + 1))
        self.matrix = rng.normal(size=(size, d))
        self.expected = mixture.means @ self.matrix.T
        self.jacobians = np.broadcast_to(self.matrix, (mixture.size, size, d))
        count = int(rng.integers(0, 6)) if count is None else count
        self.noise = random_covariances(rng, count if rng.random() < 0.5 else 1, size)
        chosen = rng.integers(0, max(mixture.size, 1), count)
        near = self.expected[chosen] if mixture.size else np.zeros((count, size))
        self.measurements = near + rng.normal(size=(count, size)) * 3.0

    def update(
        self,
        mixture: GaussianMixture,
        detection_probability: float | ndarray,
        clutter_intensity: float | ndarray,
        gate: float = np.inf,
    ) -> phd.PhdUpdate:
        """The update under test."""
        return phd.update(
            mixture,
            self.measurements,
            expected=Expected.of(self.expected, self.jacobians),
            noise=self.noise,
            detection_probability=detection_probability,
            clutter_intensity=clutter_intensity,
            gate=gate,
        )


@given(mixtures(), seeds)
def test_without_detection_the_intensity_stays_as_it_is(
    mixture: GaussianMixture, seed: int
) -> None:
    updated = Linear(mixture, seed).update(mixture, 0.0, 0.3)
    assert_array_equal(updated.posterior.weights, mixture.weights)
    assert_array_equal(updated.posterior.means, mixture.means)
    assert_array_equal(updated.posterior.covariances, mixture.covariances)
    assert_array_equal(updated.posterior.labels, mixture.labels)
    assert_array_equal(updated.measurements, np.full(mixture.size, -1))
    assert not updated.measurement_weights.any()


@given(mixtures(most=12), seeds, st.sampled_from((0.9, 0.999, 1.0)))
def test_update_agrees_with_the_recursion_pair_by_pair(
    mixture: GaussianMixture, seed: int, gate_probability: float
) -> None:
    linear = Linear(mixture, seed)
    p_d = linear.rng.uniform(0.0, 1.0, mixture.size) * (linear.rng.random(mixture.size) < 0.8)
    gate = float(chi2.ppf(gate_probability, df=len(linear.matrix)))
    kappa = linear.rng.choice([1e-12, 0.01, 5.0], len(linear.measurements))
    updated = linear.update(mixture, p_d, kappa, gate)
    reference = reference_update(
        mixture,
        linear.measurements,
        linear.expected,
        linear.jacobians,
        linear.noise,
        p_d,
        kappa,
        gate,
    )
    pairs = list(zip(updated.parents.tolist(), updated.measurements.tolist(), strict=True))
    assert len(set(pairs)) == len(pairs)
    assert set(pairs) == set(reference)
    assert pairs[: mixture.size] == [(j, -1) for j in range(mixture.size)]
    for k, pair in enumerate(pairs):
        weight, mean, covariance = reference[pair]
        assert_allclose(updated.posterior.weights[k], weight, rtol=1e-7, atol=1e-200)
        assert_allclose(updated.posterior.means[k], mean, rtol=1e-7, atol=1e-6)
        assert_allclose(updated.posterior.covariances[k], covariance, rtol=1e-5, atol=1e-6)
    assert_array_equal(updated.posterior.labels, mixture.labels[updated.parents])


@given(seeds, st.integers(1, 4), st.floats(0.5, 30.0), st.booleans())
def test_the_gate_bounds_the_squared_mahalanobis_distance(
    seed: int, size: int, gate: float, shared: bool
) -> None:
    """A measurement just inside the gate forms a pair, and one just outside of it none."""
    rng = np.random.default_rng(seed)
    own, noise = random_covariances(rng, 1, size), random_covariances(rng, 1, size)
    direction = rng.normal(size=size)
    on_gate = np.linalg.cholesky(own[0] + noise[0]) @ direction / np.linalg.norm(direction)
    factors = np.sqrt(gate * np.array([1.0 - 1e-6, 1.0 + 1e-6]))
    expected = rng.normal(size=(1, size))
    pairs = update_kernels.gated_pairs(
        expected,
        Measurements(
            expected + factors[:, None] * on_gate, noise if shared else noise.repeat(2, 0)
        ),
        own,
        gate,
        np.empty((1, size, size)),
    )
    assert pairs.measured.tolist() == [0]
    assert_allclose(
        pairs.log_likelihoods,
        multivariate_normal.logpdf(factors[0] * on_gate, cov=own[0] + noise[0]),
        rtol=1e-6,
    )


@given(mixtures(), seeds, st.floats(0.0, 1.0), st.sampled_from((0.0, 1e-30, 0.1, 10.0)))
def test_one_measurement_makes_at_most_one_target(
    mixture: GaussianMixture, seed: int, p_d: float, clutter: float
) -> None:
    linear = Linear(mixture, seed)
    updated = linear.update(mixture, p_d, clutter)
    posterior = updated.posterior
    assert np.isfinite(posterior.weights).all()
    assert (posterior.weights >= 0.0).all()
    assert (updated.measurement_weights <= 1.0 + 1e-12).all()
    for z in range(len(linear.measurements)):
        share = posterior.weights[updated.measurements == z].sum()
        assert_allclose(updated.measurement_weights[z], share, atol=1e-15)
    if clutter == 0.0 and p_d > 0.0 and mixture.size:
        assert_allclose(updated.measurement_weights, 1.0)
    missed = (1.0 - p_d) * mixture.cardinality
    expected = missed + updated.measurement_weights.sum()
    assert_allclose(posterior.cardinality, expected, rtol=1e-12, atol=1e-15)


@given(mixtures(least=1), seeds)
def test_covariances_stay_symmetric_positive_and_shrink(
    mixture: GaussianMixture, seed: int
) -> None:
    posterior = Linear(mixture, seed, count=4).update(mixture, 0.9, 0.1)
    assert_positive_definite(posterior.posterior.covariances)
    before = np.trace(mixture.covariances[posterior.parents], axis1=1, axis2=2)
    after = np.trace(posterior.posterior.covariances, axis1=1, axis2=2)
    assert (after <= before * (1.0 + 1e-12)).all()


@given(mixtures(least=1), seeds, st.permutations(range(4)))
def test_the_order_of_measurements_does_not_matter(
    mixture: GaussianMixture, seed: int, order: list[int]
) -> None:
    linear = Linear(mixture, seed, count=4)
    before = linear.update(mixture, 0.9, 0.1)
    linear.measurements = linear.measurements[order]
    linear.noise = linear.noise[order] if len(linear.noise) > 1 else linear.noise
    after = linear.update(mixture, 0.9, 0.1)
    assert_allclose(after.measurement_weights, before.measurement_weights[order], rtol=1e-12)


@pytest.mark.parametrize("distance", [1e2, 1e6, 1e12, 1e160])
def test_a_measurement_far_from_everybody_gives_no_nonsense(distance: float) -> None:
    mixture = GaussianMixture(
        np.array([0.5, 0.5]),
        np.array([[0.0, 0.0], [1.0, 0.0]]),
        np.stack([np.eye(2)] * 2),
        np.array([1, 2]),
    )
    for clutter in (0.0, 1e-300, 1.0):
        updated = phd.update(
            mixture,
            np.array([[distance, 0.0]]),
            expected=Expected.of(mixture.means, np.stack([np.eye(2)] * 2)),
            noise=np.eye(2)[None],
            detection_probability=0.9,
            clutter_intensity=clutter,
        )
        assert np.isfinite(updated.posterior.weights).all()
        if clutter > 0.0:
            assert updated.measurement_weights[0] < 1e-200
        elif distance < 1e10:  # nothing but a target could have made it: the nearest takes it
            assert updated.measurement_weights[0] == pytest.approx(1.0)
            assert updated.posterior.weights[-1] > 0.999


def test_nobody_and_nothing() -> None:
    nobody, nothing = GaussianMixture.empty(4), np.zeros((0, 2))
    updated = Linear(nobody, 1, count=3).update(nobody, 0.9, 0.1)
    assert updated.posterior.size == 0
    assert_array_equal(updated.measurement_weights, np.zeros(3))
    mixture = random_mixture(np.random.default_rng(2), 5, 4)
    updated = phd.update(
        mixture,
        nothing,
        expected=Expected.of(np.zeros((5, 2)), np.zeros((5, 2, 4))),
        noise=np.zeros((0, 2, 2)),
        detection_probability=0.9,
        clutter_intensity=0.1,
    )
    assert_allclose(updated.posterior.weights, 0.1 * mixture.weights)
    assert updated.measurement_weights.shape == (0,)
    assert phd.extract(nobody, 0.5).shape == (0,)


def test_extraction_lists_what_is_above_the_threshold_heaviest_first() -> None:
    mixture = random_mixture(np.random.default_rng(2), 5, 1)
    weights = np.array([0.5, 0.9, 0.51, 0.2, 1.7])
    mixture = GaussianMixture(weights, mixture.means, mixture.covariances, mixture.labels)
    assert_array_equal(phd.extract(mixture, 0.5), [4, 1, 2])


@pytest.mark.parametrize("d", DIMENSIONS)
def test_one_sure_target_is_the_kalman_filter(d: int) -> None:
    rng = np.random.default_rng(d)
    m = (d + 1) // 2
    transition = np.eye(d) + 0.1 * rng.normal(size=(d, d))
    noise, measurement_noise = random_covariances(rng, 1, d)[0], random_covariances(rng, 1, m)
    matrix = rng.normal(size=(m, d))
    oracle = KalmanFilter(dim_x=d, dim_z=m)
    oracle.F, oracle.Q, oracle.H, oracle.R = transition, noise, matrix, measurement_noise[0]
    oracle.x, oracle.P = rng.normal(size=d), random_covariances(rng, 1, d)[0]
    mixture = GaussianMixture(np.ones(1), oracle.x[None].copy(), oracle.P[None], np.array([4]))
    for _ in range(30):
        z = rng.normal(size=m) * 3.0
        oracle.predict()
        oracle.update(z)
        mixture = gaussian_mixture.predict(mixture, transition, noise, 1.0)
        updated = phd.update(
            mixture,
            z[None],
            expected=Expected.of(mixture.means @ matrix.T, matrix[None]),
            noise=measurement_noise,
            detection_probability=1.0,
            clutter_intensity=0.0,
        )
        mixture, _ = gaussian_mixture.reduce(
            updated.posterior, pruning_threshold=1e-9, merging_threshold=4.0, max_components=5
        )
        assert_array_equal(mixture.labels, [4])
        assert_allclose(mixture.weights, [1.0])
        assert_allclose(mixture.means[0], oracle.x, rtol=1e-9, atol=1e-9)
        assert_allclose(mixture.covariances[0], oracle.P, rtol=1e-9, atol=1e-9)


def test_one_sure_target_before_a_camera_is_the_extended_kalman_filter() -> None:
    rng = np.random.default_rng(8)
    camera = world.ring(1, distortion=world.BARREL)[0]
    noise, measurement_noise = 0.02**2 * np.eye(3), np.diag([1.5**2, 1.2**2])
    path = world.walk([(-1.0, -0.8, 1.0), (1.0, 0.9, 1.2)], [0.0, 6.0], 5.0)
    oracle = ExtendedKalmanFilter(dim_x=3, dim_z=2)
    oracle.x, oracle.P = path[0] + [0.2, -0.1, 0.05], 0.3**2 * np.eye(3)
    oracle.F, oracle.Q, oracle.R = np.eye(3), noise, measurement_noise
    mixture = GaussianMixture(np.ones(1), oracle.x[None].copy(), oracle.P[None], np.array([1]))
    for place in path:
        z = camera.project(place[None])[0][0] + rng.normal(size=2)
        oracle.predict()
        oracle.update(
            z,
            HJacobian=lambda x: project_points(x[None], camera.calibration, True).jacobians[0],
            Hx=lambda x: camera.project(x[None])[0][0],
        )
        mixture = gaussian_mixture.predict(mixture, np.eye(3), noise, 1.0)
        drawn = project_points(mixture.means, camera.calibration, True)
        updated = phd.update(
            mixture,
            z[None],
            expected=Expected.of(drawn.pixels, drawn.jacobians),
            noise=measurement_noise[None],
            detection_probability=1.0,
            clutter_intensity=0.0,
        )
        mixture = updated.posterior.take(np.array([1]))
        assert_allclose(updated.posterior.weights, [0.0, 1.0])
        assert_allclose(mixture.means[0], oracle.x, atol=1e-9)
        assert_allclose(mixture.covariances[0], oracle.P, atol=1e-12)


def test_a_noise_that_is_no_covariance_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        update_kernels.kalman_pairs(
            np.zeros((1, 2)),
            np.zeros((1, 2, 2)),
            Expected.of(np.zeros((1, 2)), np.eye(2)[None]),
            Measurements(np.zeros((1, 2)), np.zeros((1, 2, 2))),
            np.inf,
        )


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
