"""The measurement model, compiled, against the same in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.engine.synthetic import CAMERAS
from tracker.fusion.target_model import MeasurementKind, TargetModel
from tracker.kernels import boxes as box_kernels
from tracker.kernels import measurement

HALF_EXTENTS = np.array([0.3, 0.3, 0.84])
KINDS: tuple[MeasurementKind, ...] = ("centre", "box", "box_and_width")


@pytest.mark.parametrize("kind", KINDS)
def test_a_box_and_its_noise_are_transformed_alike(kind: MeasurementKind) -> None:
    rng = np.random.default_rng(0)
    transform, products = TargetModel(HALF_EXTENTS, kind).transforms
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
    camera, model = CAMERAS[0], TargetModel(HALF_EXTENTS, kind, "unscented")
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
