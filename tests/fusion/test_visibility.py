"""Where a camera can detect whom: the picture's edge, and people behind people."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from tests.fusion.rooms import CAMERAS, HALF_EXTENTS
from tests.world import look_at
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.target_model import TargetModel
from tracker.fusion.visibility import inside_probability, visibility
from tracker.geometry.camera import Camera
from tracker.kernels.boxes import Hidden
from tracker.kernels.measurement import ExpectedBoxes

MODEL = TargetModel(HALF_EXTENTS, "box")
FRONT = look_at("front", (0.0, -5.0, 1.2), (0.0, 0.0, 0.9), focal=600.0, image_size=(800, 600))


def people(places: ndarray, sigma: float = 0.05) -> GaussianMixture:
    """Sure people of different labels."""
    count = len(places)
    covariances = np.tile(np.eye(3) * sigma**2, (count, 1, 1))
    return GaussianMixture(np.full(count, 0.99), np.asarray(places), covariances, np.arange(count))


def hide(
    mixture: GaussianMixture, strength: float = 0.8, near: float = 0.3, camera: Camera = FRONT
) -> Hidden:
    """Everybody may hide everybody, from p_D = 0.9."""
    return visibility(
        np.full(mixture.size, 0.9),
        MODEL.expected(camera, mixture.means),
        mixture,
        occluders=np.arange(mixture.size),
        weights=mixture.weights,
        strength=strength,
        near=near,
    )


def by_formula(mixture: GaussianMixture, expected: ExpectedBoxes, strength: float) -> ndarray:
    """p_j Π (1 − ρ w a), written out."""
    chances = np.full(mixture.size, 0.9)
    for j, box in enumerate(expected.boxes):
        for k, other in enumerate(expected.boxes):
            nearer = expected.depths[k] < expected.depths[j]
            if k == j or not nearer:
                continue
            if np.linalg.norm(mixture.means[j] - mixture.means[k]) <= 0.3:
                continue
            overlap = np.minimum(box[2:], other[2:]) - np.maximum(box[:2], other[:2])
            share = overlap.clip(0.0).prod() / (box[2:] - box[:2]).prod()
            chances[j] *= max(1.0 - strength * min(mixture.weights[k], 1.0) * share, 0.0)
    return chances


@given(st.integers(0, 10_000), st.floats(0.05, 1.0))
def test_occlusion_is_the_formula(seed: int, strength: float) -> None:
    rng = np.random.default_rng(seed)
    mixture = people(rng.uniform([-2, -2, 0.8], [2, 2, 0.9], (6, 3)))
    expected = MODEL.expected(FRONT, mixture.means)
    found = hide(mixture, strength)
    assert_allclose(found.detection_probabilities, by_formula(mixture, expected, strength))


def test_who_stands_behind_is_hidden_and_by_whom() -> None:
    found = hide(people(np.array([[0.0, -1.0, 0.85], [0.05, 1.0, 0.85], [1.5, 1.0, 0.85]])))
    assert found.detection_probabilities[0] == 0.9
    assert found.detection_probabilities[1] < 0.3
    assert found.detection_probabilities[2] == 0.9
    assert_array_equal(found.hidden_by, [-1, 0, -1])


def test_whoever_hides_counts_by_his_weight_and_never_more_than_once() -> None:
    places = np.array([[0.0, -1.0, 0.85], [0.05, 1.0, 0.85]])
    covered = []
    for weight in (0.5, 1.0, 1.3):
        both = people(places)
        both = GaussianMixture(np.array([weight, 0.9]), both.means, both.covariances, both.labels)
        covered.append(1.0 - hide(both, strength=0.4).detection_probabilities[1] / 0.9)
    assert covered[1] == pytest.approx(2.0 * covered[0])
    assert covered[2] == pytest.approx(covered[1])


def test_nobody_hides_behind_himself_or_his_double() -> None:
    two = people(np.array([[0.0, -0.1, 0.85], [0.0, 0.1, 0.85]]))
    assert_array_equal(hide(two).detection_probabilities, [0.9, 0.9])
    far = people(np.array([[0.0, -1.0, 0.85], [0.0, 1.0, 0.85]]))
    same = GaussianMixture(far.weights, far.means, far.covariances, np.array([4, 4]))
    assert_array_equal(hide(same).detection_probabilities, [0.9, 0.9])
    assert hide(far).detection_probabilities[1] < 0.3


def test_without_strength_or_occluders_nothing_is_lowered() -> None:
    far = people(np.array([[0.0, -1.0, 0.85], [0.0, 1.0, 0.85]]))
    found = hide(far, strength=0.0)
    assert_array_equal(found.detection_probabilities, [0.9, 0.9])
    assert_array_equal(found.hidden_by, [-1, -1])
    nobody = hide(people(np.zeros((0, 3))))
    assert nobody.detection_probabilities.shape == nobody.hidden_by.shape == (0,)


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)
def test_the_edge_is_the_normal_distribution_over_it(camera: Camera) -> None:
    rng = np.random.default_rng(5)
    mixture = people(rng.uniform([-4, -4, 0.7], [4, 4, 1.1], (200, 3)), sigma=0.2)
    expected = MODEL.expected(camera, mixture.means)
    soft = inside_probability(camera, expected, mixture.covariances)
    middle = (expected.boxes[:, :2] + expected.boxes[:, 2:]) / 2.0
    slopes = expected.jacobians[:, :2]
    spread = np.einsum("jma,jab,jmb->jm", slopes, mixture.covariances, slopes) ** 0.5 + 1.0
    size = np.array(camera.image_size)
    reference = norm.cdf((size - 0.5 - middle) / spread) - norm.cdf((-0.5 - middle) / spread)
    assert_allclose(soft[expected.valid], reference.prod(axis=1)[expected.valid], atol=1e-12)
    assert not soft[~expected.valid].any()
    hard = inside_probability(camera, expected, mixture.covariances, soft=False)
    assert set(hard.tolist()) <= {0.0, 1.0}
    assert_array_equal(hard.astype(bool), camera.contains(middle) & expected.valid)


def test_behind_the_camera_nobody_is_seen() -> None:
    behind = people(np.array([[0.0, -7.0, 0.85], [0.0, -5.0, 0.85]]))
    expected = MODEL.expected(FRONT, behind.means)
    assert not expected.valid.any()
    assert not inside_probability(FRONT, expected, behind.covariances).any()


def test_the_less_is_known_the_softer_the_edge() -> None:
    # a place whose picture is a little outside
    outside = people(np.array([[4.5, 0.0, 0.85]]))
    expected = MODEL.expected(FRONT, outside.means)
    assert not FRONT.sees(outside.means)[0]
    chances = [
        inside_probability(FRONT, expected, np.eye(3)[None] * sigma**2)[0]
        for sigma in (0.01, 0.1, 0.3)
    ]
    assert chances[0] < chances[1] < chances[2] < 0.5
