"""The multi-Bernoulli update against exact Bayes, and covariances against errors (NEES, NIS)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose
from scipy.stats import chi2

from tests.filters.mixtures import random_covariances
from tests.filters.test_association import exact
from tracker.filters import gaussian_mixture, phd, pmb
from tracker.filters.gaussian_mixture import GaussianMixture, gate_distance
from tracker.filters.models import constant_velocity
from tracker.kernels.kalman import Expected

H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]])
R = 0.3 * np.eye(2)


def tracks(existences: list[float], seed: int = 0) -> GaussianMixture:
    """Random people near the origin: position and velocity in the plane."""
    rng = np.random.default_rng(seed)
    count = len(existences)
    spread = rng.normal(size=(count, 4, 4))
    return GaussianMixture(
        np.array(existences),
        rng.normal(0.0, 0.5, (count, 4)),
        spread @ spread.transpose(0, 2, 1) / 4.0 + 0.1 * np.eye(4),
        np.arange(count) + 5,
    )


def update(
    before: GaussianMixture,
    boxes: ndarray,
    p_d: float | ndarray = 0.9,
    rho: float = 0.05,
    resemblance: ndarray | None = None,
) -> pmb.PmbUpdate:
    """One linear camera."""
    return pmb.update(
        before,
        boxes,
        expected=Expected.of(before.means @ H.T, np.tile(H, (before.size, 1, 1))),
        noise=R[None],
        detection_probability=np.broadcast_to(np.asarray(p_d, dtype=float), (before.size,)).copy(),
        unexplained_intensity=np.full(len(boxes), rho),
        gate=np.inf,
        resemblance=resemblance,
    )


def likelihood(before: GaussianMixture, boxes: ndarray) -> ndarray:
    """q_i(z_j) by the formula of the normal density."""
    values = np.empty((before.size, len(boxes)))
    for i in range(before.size):
        s = H @ before.covariances[i] @ H.T + R
        offsets = boxes - before.means[i] @ H.T
        distance = np.einsum("na,ab,nb->n", offsets, np.linalg.inv(s), offsets)
        values[i] = np.exp(-distance / 2.0) / (2.0 * np.pi * np.sqrt(np.linalg.det(s)))
    return values


def kalman(mean: ndarray, covariance: ndarray, z: ndarray) -> tuple[ndarray, ndarray]:
    """The textbook update."""
    gain = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + R)
    return mean + gain @ (z - H @ mean), (np.eye(4) - gain @ H) @ covariance


@given(st.integers(0, 10_000), st.integers(0, 3), st.floats(0.01, 1.0), st.floats(0.05, 0.99))
def test_one_person_is_the_bernoulli_filter(seed: int, count: int, r: float, p_d: float) -> None:
    before = tracks([r], seed)
    boxes = np.random.default_rng(seed + 1).normal(0.0, 1.0, (count, 2))
    after = update(before, boxes, p_d).tracks
    # exact Bayes over: not there, there and missed, there and one of the boxes
    weights = np.array([r * (1 - p_d), *(r * p_d * likelihood(before, boxes)[0] / 0.05)])
    assert after.weights[0] == pytest.approx(weights.sum() / (1 - r + weights.sum()), rel=1e-4)
    parts = [(before.means[0], before.covariances[0])]
    parts += [kalman(before.means[0], before.covariances[0], z) for z in boxes]
    share = weights / weights.sum()
    mean = sum(w * m for w, (m, _) in zip(share, parts, strict=True))
    second = sum(
        w * (c + np.outer(m - mean, m - mean)) for w, (m, c) in zip(share, parts, strict=True)
    )
    assert_allclose(after.means[0], mean, atol=1e-4)
    assert_allclose(after.covariances[0], second, atol=1e-4)


@given(st.integers(0, 10_000))
def test_two_people_and_one_box_are_exact(seed: int) -> None:
    before = tracks([0.9, 0.6], seed)
    boxes = np.random.default_rng(seed).normal(0.0, 0.5, (1, 2))
    p_d = np.array([0.8, 0.95])
    found = update(before, boxes, p_d)
    r = before.weights
    missed = 1 - r * p_d
    rows, columns = exact(missed, (r * p_d)[:, None] * likelihood(before, boxes), np.full(1, 0.05))
    assert_allclose(found.marginals.detected, rows[:, 1:], atol=1e-5)
    assert_allclose(found.marginals.unexplained, columns, atol=1e-5)
    expected = rows[:, 1] + rows[:, 0] * r * (1 - p_d) / missed
    assert_allclose(found.tracks.weights, expected, atol=1e-5)


@given(st.integers(0, 10_000))
def test_looks_multiply_the_likelihood_of_those_who_are_known_by_them(seed: int) -> None:
    before, rng = tracks([0.9, 0.6], seed), np.random.default_rng(seed)
    box, alike = rng.normal(0.0, 0.5, (1, 2)), rng.uniform(0.1, 3.0, (1, 1))
    r, p_d = before.weights, 0.9
    detected = (r * p_d)[:, None] * likelihood(before, box)
    detected[0] *= alike[0]
    rows, columns = exact(1 - r * p_d, detected, np.full(1, 0.05))
    found = update(before, box, p_d, resemblance=alike)
    assert_allclose(found.marginals.detected, rows[:, 1:], atol=1e-5)
    assert_allclose(found.marginals.unexplained, columns, atol=1e-5)


@given(st.lists(st.floats(0.001, 1.0), min_size=1, max_size=4), st.floats(0.0, 0.999))
def test_a_miss_lowers_existence_by_bayes_rule(existences: list[float], p_d: float) -> None:
    before = tracks(existences)
    after = update(before, np.zeros((0, 2)), p_d).tracks
    r = before.weights
    assert_allclose(after.weights, r * (1 - p_d) / (1 - r * p_d), rtol=1e-9)
    assert_allclose(after.means, before.means)
    # far boxes say no more than none
    far = update(before, np.full((2, 2), 80.0), p_d).tracks
    assert_allclose(far.weights, after.weights, atol=1e-6)


@given(st.lists(st.floats(0.05, 0.95), min_size=2, max_size=5), st.integers(0, 100))
def test_misses_ask_for_no_order_of_the_cameras(chances: list[float], seed: int) -> None:
    def after(order: list[float]) -> float:
        state = tracks([0.97])
        for p_d in order:
            state = update(state, np.zeros((0, 2)), p_d).tracks
        return float(state.weights[0])

    shuffled = np.random.default_rng(seed).permutation(chances).tolist()
    assert after(shuffled) == pytest.approx(after(chances), rel=1e-9)


def test_a_hit_and_a_miss_ask_for_no_order_either() -> None:
    before = tracks([0.9])
    box = before.means[:, :2]
    hit_first = update(update(before, box, 0.95).tracks, np.zeros((0, 2)), 0.5).tracks
    miss_first = update(update(before, np.zeros((0, 2)), 0.5).tracks, box, 0.95).tracks
    assert hit_first.weights[0] == pytest.approx(miss_first.weights[0], abs=2e-4)


@given(st.integers(0, 10_000), st.integers(0, 5), st.integers(0, 5))
def test_existence_stays_a_probability_and_covariances_stay_positive(
    seed: int, people: int, count: int
) -> None:
    rng = np.random.default_rng(seed)
    before = tracks(rng.uniform(0.01, 1.0, people).tolist(), seed)
    found = update(before, rng.normal(0.0, 1.0, (count, 2)), rng.uniform(0.0, 1.0, people))
    assert ((found.tracks.weights >= 0.0) & (found.tracks.weights <= 1.0)).all()
    assert found.tracks.labels.tolist() == before.labels.tolist()
    assert people == 0 or np.linalg.eigvalsh(found.tracks.covariances).min() > 0.0
    assert found.marginals.detected.shape == (people, count)


def test_outside_every_picture_nothing_changes() -> None:
    before = tracks([0.7, 0.2])
    after = update(before, np.zeros((3, 2)), 0.0).tracks
    assert_allclose(after.weights, before.weights)
    assert_allclose(after.means, before.means)
    assert_allclose(after.covariances, before.covariances)


def test_what_a_component_adds_to_the_noise_counts_as_noise() -> None:
    before, box = tracks([0.9]), np.array([[0.4, -0.2]])
    more, straight = 0.2 * np.eye(2), before.means @ H.T
    common = {
        "detection_probability": np.array([0.9]),
        "unexplained_intensity": np.array([0.05]),
        "gate": np.inf,
    }
    spread = pmb.update(
        before, box, expected=Expected.of(straight, H[None], more[None]), noise=R[None], **common
    )
    noisy = pmb.update(
        before, box, expected=Expected.of(straight, H[None]), noise=(R + more)[None], **common
    )
    assert_allclose(spread.tracks.means, noisy.tracks.means)
    assert_allclose(spread.tracks.covariances, noisy.tracks.covariances)
    assert_allclose(spread.tracks.weights, noisy.tracks.weights)


def test_a_box_of_two_kinds_is_bayes_over_both() -> None:
    rng = np.random.default_rng(5)
    before, box = tracks([0.7], 3), rng.normal(0.0, 0.5, (1, 2))
    share, drift, more = 0.3, np.diag([0.2, 0.0, 0.0, 0.0]), 0.4 * np.eye(2)
    shifted = before.means @ H.T + [0.3, -0.2]
    both = Expected.of(before.means @ H.T, H[None])._replace(
        posture_values=shifted,
        posture_jacobians=2.0 * H[None],
        posture_spreads=more[None],
        posture_drift=drift,
        posture_share=share,
    )
    found = pmb.update(
        before,
        box,
        expected=both,
        noise=R[None],
        detection_probability=np.array([0.9]),
        unexplained_intensity=np.array([0.05]),
        gate=np.inf,
    ).tracks
    parts, weights = [(before.means[0], before.covariances[0])], [0.7 * 0.1]
    for expected, slope, noise, spread, part in (
        (before.means[0] @ H.T, H, R, before.covariances[0], 1.0 - share),
        (shifted[0], 2.0 * H, R + more, before.covariances[0] + drift, share),
    ):
        s = slope @ spread @ slope.T + noise
        offset = box[0] - expected
        density = np.exp(-offset @ np.linalg.inv(s) @ offset / 2.0)
        weights.append(0.7 * 0.9 * part * density / np.sqrt(np.linalg.det(2.0 * np.pi * s)) / 0.05)
        gain = spread @ slope.T @ np.linalg.inv(s)
        parts.append((before.means[0] + gain @ offset, spread - gain @ s @ gain.T))
    total = sum(weights)
    assert found.weights[0] == pytest.approx(total / (0.3 + total), rel=1e-6)
    mean = sum(w * m for w, (m, _) in zip(weights, parts, strict=True)) / total
    second = sum(
        w * (c + np.outer(m - mean, m - mean)) for w, (m, c) in zip(weights, parts, strict=True)
    )
    assert_allclose(found.means[0], mean, atol=1e-9)
    assert_allclose(found.covariances[0], second / total, atol=1e-9)


COUNT = 120
H_OF_PLACE = np.array([[1.0, 0, 0, 0, 0, 0], [0, 1.0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0]])


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
    boxes = truth @ H_OF_PLACE.T + np.array(
        [rng.multivariate_normal(np.zeros(3), r) for r in noises]
    )
    return gaussian_mixture.predict(mixture, transition, motion, 1.0), truth, boxes, noises


PREDICTED, TRUTH, BOXES, NOISES = draws()
EXPECTED = Expected.of(PREDICTED.means @ H_OF_PLACE.T, H_OF_PLACE[None])


def test_predicted_and_updated_errors_are_as_large_as_stated() -> None:
    assert_chi_square(squares(TRUTH - PREDICTED.means, PREDICTED.covariances), 6)
    innovations = BOXES - PREDICTED.means @ H_OF_PLACE.T
    assert_chi_square(
        squares(innovations, H_OF_PLACE @ PREDICTED.covariances @ H_OF_PLACE.T + NOISES), 3
    )
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
