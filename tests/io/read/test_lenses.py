"""Rational and fisheye lenses draw what OpenCV draws, and lead back."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray

from tests.io.read.rig import SIZE, cameras, raw_cameras
from tracker.export.calibration import Form, save_calibration
from tracker.geometry.camera import Camera, stacked
from tracker.io.conventions.reading import Reading, to_camera

RATIONAL = np.array([0.2, -0.05, 0.001, -0.0005, 0.01, 0.35, -0.02, 0.005])
FISHEYE = np.array([-0.02, 0.01, -0.004, 0.0008])


def _camera(kind: str) -> Camera:
    plain = cameras()[0]
    k = plain.intrinsics.copy()
    k[0, 0] = k[1, 1] = 420.0  # wide
    lens = FISHEYE if kind == "fisheye" else RATIONAL
    return Camera(
        "wide", SIZE, k, plain.rotation, plain.translation, lens, fisheye=kind == "fisheye"
    )


def _points() -> ndarray:
    rng = np.random.default_rng(3)
    return rng.uniform([-3.0, -3.0, 0.0], [3.0, 3.0, 2.0], (300, 3))


@pytest.mark.parametrize("kind", ["rational", "fisheye"])
def test_points_fall_where_opencv_draws_them(kind: str) -> None:
    camera, points = _camera(kind), _points()
    vector = cv2.Rodrigues(camera.rotation)[0]
    if kind == "fisheye":
        expected = cv2.fisheye.projectPoints(
            points[:, None], vector, camera.translation[:, None], camera.intrinsics, FISHEYE
        )[0]
    else:
        expected = cv2.projectPoints(
            points, vector, camera.translation, camera.intrinsics, RATIONAL
        )[0]
    pixels, valid = camera.project(points)
    assert valid.mean() > 0.9
    np.testing.assert_allclose(pixels[valid], expected.reshape(-1, 2)[valid], atol=1e-7)


@pytest.mark.parametrize("kind", ["rational", "fisheye"])
def test_the_derivative_is_that_of_the_projection(kind: str) -> None:
    camera, points = _camera(kind), _points()
    found = camera.project_with_jacobian(points)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        ahead, _ = camera.project(points + step)
        behind, _ = camera.project(points - step)
        slope = (ahead - behind) / 2e-6
        np.testing.assert_allclose(
            found.jacobians[found.valid, :, axis], slope[found.valid], rtol=1e-5, atol=1e-3
        )


@pytest.mark.parametrize("kind", ["rational", "fisheye"])
def test_rays_lead_back_to_the_points(kind: str) -> None:
    camera, points = _camera(kind), _points()
    pixels, valid = camera.project(points)
    seen = valid & camera.contains(pixels)
    assert seen.sum() > 50
    ways = points[seen] - camera.centre
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    np.testing.assert_allclose(camera.back_project(pixels[seen]), ways, atol=1e-7)


def test_lenses_of_several_kinds_are_stacked() -> None:
    plain, rational, fisheye = cameras()[0], _camera("rational"), _camera("fisheye")
    together = stacked([plain, rational, fisheye])
    assert together.distortions.shape == (3, 9)
    assert stacked([plain]).distortions.shape == (1, 5)
    np.testing.assert_array_equal(together.distortions[0, :5], plain.distortion)


@pytest.mark.parametrize("form", ["opencv", "pose2sim"])
def test_a_fisheye_is_written_and_read_again(tmp_path: Path, form: Form) -> None:
    camera = _camera("fisheye")
    path = tmp_path / ("cameras.yml" if form == "opencv" else "cameras.toml")
    save_calibration(path, [camera], form)
    (raw,) = raw_cameras(path)
    found = to_camera(raw, Reading(), SIZE)
    assert found.fisheye
    for name in ("intrinsics", "rotation", "translation", "distortion"):
        np.testing.assert_allclose(getattr(found, name), getattr(camera, name), atol=1e-9)
