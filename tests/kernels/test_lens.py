"""The lens kernels against OpenCV's three models, differences, and their own way back."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tracker.kernels import lens
from tracker.kernels.lens import Calibration

PLAIN = np.array([-0.28, 0.09, 0.004, -0.003, -0.01])
RATIONAL = np.array([0.31, -0.12, 0.003, 0.002, 0.05, 0.42, -0.07, 0.02, 0.0])
FISHEYE = np.array([0.06, -0.02, 0.0, 0.0, 0.01, -0.004, 0.0, 0.0, 1.0])
LENSES = {"plain": PLAIN, "rational": RATIONAL, "fisheye": FISHEYE}
TURN, _ = cv2.Rodrigues(np.array([0.2, -0.3, 0.1]))
SHIFT = np.array([0.1, -0.2, 0.4])
INTRINSICS = np.array([[510.0, 3.0, 330.0], [0.0, 480.0, 245.0], [0.0, 0.0, 1.0]])

seeds = st.integers(0, 2**32 - 1)
every_lens = pytest.mark.parametrize("lens_name", LENSES)


def camera_with(distortion: ndarray, intrinsics: ndarray = INTRINSICS) -> Calibration:
    """One that looks down its z axis, a little turned and shifted."""
    return Calibration(np.array([640.0, 480.0]), TURN, SHIFT, intrinsics, distortion, 0.05, 1.6)


def points_ahead(seed: int, count: int = 6) -> ndarray:
    """World points up to 0.8 aside of a camera's axis, in units of the depth."""
    rng = np.random.default_rng(seed)
    depths = rng.uniform(0.5, 6.0, count)
    aside = rng.uniform(-0.8, 0.8, (count, 2))
    seen = np.column_stack([aside * depths[:, None], depths])
    return np.asarray((seen - SHIFT) @ TURN)


@every_lens
@given(seeds)
def test_points_are_drawn_as_by_opencv(lens_name: str, seed: int) -> None:
    distortion, points = LENSES[lens_name], points_ahead(seed)
    turn, _ = cv2.Rodrigues(TURN)
    if lens_name == "fisheye":
        intrinsics = INTRINSICS * np.where(np.eye(3, k=1), [0.0, 0.0, 1.0], 1.0)
        intrinsics[0, 1] = 0.0  # OpenCV's skew is another number
        wanted, _ = cv2.fisheye.projectPoints(
            points[:, None], turn, SHIFT, intrinsics, distortion[[0, 1, 4, 5]]
        )
    else:
        intrinsics = INTRINSICS * (INTRINSICS != 3.0)  # OpenCV knows no skew
        wanted, _ = cv2.projectPoints(points[:, None], turn, SHIFT, intrinsics, distortion[:8])
    found = lens.project_points(points, camera_with(distortion, intrinsics), False)
    assert found.valid.all()
    assert found.jacobians.shape == (0, 2, 3)
    assert_allclose(found.pixels, wanted[:, 0], rtol=1e-9, atol=1e-7)
    # whatever the last step from the lens to pixels is, it is linear
    skewed = INTRINSICS + np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    normal = np.linalg.solve(intrinsics, np.column_stack([wanted[:, 0], np.ones(len(points))]).T)
    found = lens.project_points(points, camera_with(distortion, skewed), False)
    assert_allclose(found.pixels, (skewed @ normal)[:2].T, rtol=1e-9, atol=1e-7)


@every_lens
@given(seeds)
def test_the_slope_is_the_difference_and_the_way_back_ends_where_it_began(
    lens_name: str, seed: int
) -> None:
    skewed = INTRINSICS + np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    camera, points = camera_with(LENSES[lens_name], skewed), points_ahead(seed)
    found = lens.project_points(points, camera, True)
    for axis in range(3):
        step = 1e-5 * np.eye(3)[axis]
        ahead, behind = (
            lens.project_points(points + sign * step, camera, False).pixels for sign in (1, -1)
        )
        assert_allclose(found.jacobians[:, :, axis], (ahead - behind) / 2e-5, rtol=1e-5, atol=1e-3)
    rays = lens.directions(found.pixels, camera, 12)
    offsets = points + TURN.T @ SHIFT
    assert_allclose(rays, offsets / np.linalg.norm(offsets, axis=1)[:, None], atol=1e-9)


@pytest.mark.parametrize("lens_name", ["plain", "rational"])
@given(seeds)
def test_each_step_back_is_one_of_newton(lens_name: str, seed: int) -> None:
    distortion = LENSES[lens_name] * np.array([1, 1, 9, 9, 1, 1, 1, 1, 1])[: len(LENSES[lens_name])]
    straight = np.random.default_rng(seed).uniform(-0.6, 0.6, 2)

    def drawn(at: ndarray) -> ndarray:
        calibration = Calibration(
            np.ones(2), np.eye(3), np.zeros(3), np.eye(3), distortion, 0.0, 9.0
        )
        return lens.project_points(np.array([[*at, 1.0]]), calibration, False).pixels[0]

    goal = drawn(straight)
    place = goal
    for steps in (1, 2):
        slopes = np.column_stack(
            [(drawn(place + step) - drawn(place - step)) / 2e-6 for step in 1e-6 * np.eye(2)]
        )
        place = place - np.linalg.solve(slopes, drawn(place) - goal)
        assert_allclose(lens.undistort(goal[None], distortion, steps)[0], place, atol=1e-7)


@every_lens
@pytest.mark.parametrize("radius", [0.0, 9e-5, 1.1e-4, 0.01, 0.4, 1.2])
def test_the_bend_and_its_slope_are_smooth_from_the_middle_on(
    lens_name: str, radius: float
) -> None:
    distortion, r2 = LENSES[lens_name], radius**2
    k = distortion
    if lens_name == "fisheye":
        angle = math.atan(radius)
        powers = [k[0] * angle**2, k[1] * angle**4, k[4] * angle**6, k[5] * angle**8]
        factor = angle * (1.0 + sum(powers)) / radius if radius else 1.0
    else:
        above = 1.0 + k[0] * r2 + k[1] * r2**2 + k[4] * r2**3
        below = [1.0, *k[5:8]] if lens_name == "rational" else [1.0]
        factor = above / sum(c * r2**n for n, c in enumerate(below))
    radial, slope = lens.bend(r2, distortion)
    assert radial == pytest.approx(factor, rel=1e-10)
    step = max(r2, 1e-4) * 1e-2
    ends = r2 + step, max(r2 - step, 0.0)
    higher, lower = (lens.bend(end, distortion)[0] for end in ends)
    assert slope == pytest.approx(2.0 * (higher - lower) / (ends[0] - ends[1]), rel=2e-3, abs=1e-5)


@pytest.mark.parametrize("angle", [1e-9, 1e-3, 0.5, 1.2, 1.5])
def test_a_fisheye_is_undone(angle: float) -> None:
    k = FISHEYE[[0, 1, 4, 5]]
    drawn = angle * (1.0 + sum(c * angle ** (2 * n) for n, c in enumerate(k, 1)))
    stretch = lens.unbend_fisheye(drawn, FISHEYE, 30)
    assert stretch * drawn == pytest.approx(math.tan(angle), rel=1e-9)
    found = lens.undistort(np.array([[0.6 * drawn, -0.8 * drawn]]), FISHEYE, 30)
    assert_allclose(found, [[0.6 * math.tan(angle), -0.8 * math.tan(angle)]], rtol=1e-9)


def test_what_a_fisheye_cannot_have_drawn_ends_at_a_right_angle_or_where_it_began() -> None:
    straight = np.array([0.0] * 8 + [1.0])
    assert lens.unbend_fisheye(3.0, straight, 30) == pytest.approx(math.tan(1.57) / 3.0)
    folded = straight.copy()
    folded[0] = -0.5  # the radius falls again beyond an angle of 0.8
    assert lens.unbend_fisheye(1.4, folded, 30) == pytest.approx(math.tan(1.4) / 1.4)
    assert lens.unbend_fisheye(1.6, folded, 30) == pytest.approx(math.tan(1.5) / 1.6)
    # one step of Newton's method
    step = (0.7 + 0.06 * 0.343 - 0.02 * 0.7**5 + 0.01 * 0.7**7 - 0.004 * 0.7**9 - 0.7) / (
        1.0 + 0.18 * 0.49 - 0.1 * 0.7**4 + 0.07 * 0.7**6 - 0.036 * 0.7**8
    )
    assert lens.unbend_fisheye(0.7, FISHEYE, 1) == pytest.approx(math.tan(0.7 - step) / 0.7)


@pytest.mark.parametrize(
    ("point", "counts"),
    [
        ((0.0, 0.0, 0.25), False),
        ((0.0, 0.0, 0.2500001), True),
        ((0.5, 0.0, 1.0), False),
        ((0.0, -0.4999999, 1.0), True),
        ((0.3, 0.4, 1.0), False),
        ((0.6, 0.0, 2.0), True),
        ((0.0, 0.0, -1.0), False),
    ],
)
def test_what_is_too_near_or_too_far_aside_does_not_count(
    point: tuple[float, ...], counts: bool
) -> None:
    camera = Calibration(
        np.array([640.0, 480.0]), np.eye(3), np.zeros(3), INTRINSICS, PLAIN, 0.25, 0.5
    )
    found = lens.project_points(np.array([point]), camera, True)
    assert found.valid[0] == counts
    assert np.isfinite(found.pixels).all() == counts
    assert found.jacobians.any() == counts


def test_each_of_stacked_cameras_is_the_one_that_was_put_in() -> None:
    many = [np.arange(2 * size, dtype=float).reshape(2, *shape) for size, shape in (
        (2, (2,)), (9, (3, 3)), (3, (3,)), (9, (3, 3)), (5, (5,)),
    )]  # fmt: skip
    stack = lens.Calibrations(*many, 0.1, np.array([1.0, 2.0]))
    second = lens.one_camera(stack, 1)
    for whole, part in zip(many, second[:5], strict=True):
        assert_array_equal(part, whole[1])
    assert second[5:] == (0.1, 2.0)
