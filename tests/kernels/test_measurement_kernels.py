"""The measurement model, compiled, against the same in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.world import PERSON, ring
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.kernels import boxes as box_kernels
from tracker.kernels import measurement

CAMERA = ring(1)[0]
KINDS: tuple[MeasurementKind, ...] = ("centre", "box", "box_and_width")


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_and_its_noise_are_transformed_alike(kind: MeasurementKind) -> None:
    rng = np.random.default_rng(0)
    transform, products = TargetModel(PERSON, kind).transforms
    boxes, variances = rng.uniform(5.0, 200.0, (7, 4)), rng.uniform(1.0, 30.0, (7, 4))
    values, noises = measurement.measured_boxes(boxes, variances, transform, products)
    assert_allclose(values, boxes @ transform.T, rtol=1e-12)
    assert_allclose(
        noises, np.einsum("pa,ma,qa->mpq", transform, variances, transform), rtol=1e-12, atol=1e-12
    )


@pytest.mark.parametrize("kind", KINDS)
def test_the_unscented_regression_is_that_of_numpy(kind: MeasurementKind) -> None:
    """Values, slopes and what is left of six points, each by its defining equation."""
    rng = np.random.default_rng(1)
    camera, model = CAMERA, TargetModel(PERSON, kind, "unscented")
    states = np.concatenate(
        [rng.uniform(-1.0, 1.0, (5, 2)), np.full((5, 1), 0.84), rng.normal(size=(5, 3))], axis=1
    )
    roots = rng.normal(0.0, 0.1, (5, 6, 6))
    covariances = roots @ roots.transpose(0, 2, 1) + 0.01 * np.eye(6)
    found = model.expected(camera, states, covariances)
    for j, (state, covariance) in enumerate(zip(states, covariances, strict=True)):
        spread = covariance[:3, :3]
        lower = np.linalg.cholesky(spread)
        offsets = np.sqrt(3.0) * np.concatenate([lower.T, -lower.T])
        drawn = box_kernels.expected_boxes(
            state[:3] + offsets, model.half_height, model.half_width, model.size, camera.calibration
        )
        values = drawn.values
        assert drawn.valid.all()
        off = values - values.mean(axis=0)
        slopes = (off.T @ offsets / 6.0) @ np.linalg.inv(spread)
        assert_allclose(found.values[j], values.mean(axis=0), rtol=1e-12)
        assert_allclose(found.jacobians[j, :, :3], slopes, rtol=1e-7, atol=1e-7)
        assert not found.jacobians[j, :, 3:].any()
        left = off.T @ off / 6.0 - slopes @ spread @ slopes.T
        assert_allclose(found.spreads[j], left, rtol=1e-6, atol=1e-6)
        assert np.abs(found.spreads[j]).max() > 1e-3, "the projection bends"


def target(size: int, unscented: bool) -> measurement.Target:
    """A person who may lie, and whose box may then be off in all its numbers together."""
    noise = np.arange(size * size, dtype=float).reshape(size, size)
    return measurement.Target(
        0.85, 0.3, size, unscented, 0.35, 0.6, noise + noise.T, np.eye(6), 0.2
    )


@pytest.mark.parametrize("size", [2, 3, 4])
def test_in_another_posture_the_box_is_another_and_off_by_its_height(size: int) -> None:
    # near, far away (half a box is less than a pixel), and with the feet behind the lens
    ahead = CAMERA.rotation[2]
    beside = CAMERA.centre + 0.05 * ahead + [0.0, 0.0, 0.6]
    places = np.array([[0.3, 0.2, 0.85], CAMERA.centre + 900.0 * ahead, beside])
    states = np.concatenate([places, np.zeros((3, 3))], axis=1)
    who = target(size, False)
    found = measurement.expected_measurements(
        states, np.zeros((3, 6, 6)), who, CAMERA.calibration
    ).expected
    upright = box_kernels.expected_boxes(states, 0.85, 0.3, size, CAMERA.calibration)
    lying = box_kernels.expected_boxes(states, 0.35, 0.6, size, CAMERA.calibration)
    assert lying.valid.tolist() == [True, True, False]
    assert_allclose(found.values, upright.values)
    assert_allclose(found.jacobians, upright.jacobians)
    assert_allclose(found.posture_values[:2], lying.values[:2])
    assert np.isposinf(found.posture_values[2]).all()
    assert_allclose(found.posture_jacobians, lying.jacobians)
    heights = (upright.boxes[:, 3] - upright.boxes[:, 1]) / 2.0
    assert heights[0] > 50.0 > 1.0 > heights[1]
    scales = np.maximum(heights, 1.0) ** 2
    assert_allclose(found.posture_spreads, scales[:, None, None] * who.posture_noise)
    assert (found.posture_share, found.spreads.shape) == (0.2, (0, size, size))


def test_where_part_of_the_uncertainty_is_behind_the_lens_the_slope_counts() -> None:
    near = CAMERA.centre + 1.2 * CAMERA.rotation[2] * [1.0, 1.0, 0.0]
    states = np.concatenate([np.array([near, [0.0, 0.0, 0.85]]), np.zeros((2, 3))], axis=1)
    covariances = np.tile(0.6 * np.eye(6), (2, 1, 1))
    found = measurement.expected_measurements(
        states, covariances, target(3, True), CAMERA.calibration
    ).expected
    straight = box_kernels.expected_boxes(states, 0.85, 0.3, 3, CAMERA.calibration)
    assert straight.valid.all()
    assert_allclose(found.values[0], straight.values[0])
    assert_allclose(found.jacobians[0], straight.jacobians[0])
    assert not found.spreads[0].any()
    assert found.spreads[1].any()
