"""The lens against OpenCV; boxes by OpenCV, derivatives by differences, who hides whom by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from tests.world import BARREL, PERSON, ring, upright
from tracker.geometry.camera import Camera
from tracker.kernels import boxes as kernels
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


HALF_HEIGHT, HALF_WIDTH = PERSON[2], PERSON[0]
CAMERA = ring(1, distortion=BARREL)[0]


def rolled(camera: Camera, degrees: float) -> Camera:
    """The same camera turned about its own axis."""
    angle = np.radians(degrees)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return replace(camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation)


def seen(camera: Camera, states: ndarray, size: int) -> kernels.UprightBoxes:
    """Of people."""
    return kernels.expected_boxes(states, HALF_HEIGHT, HALF_WIDTH, size, camera.calibration)


@pytest.mark.parametrize("camera", ring(3, distortion=BARREL))
def test_a_box_spans_the_projected_axis(camera: Camera) -> None:
    places = np.random.default_rng(0).uniform([-1.5, -1.5, 0.8], [1.5, 1.5, 0.9], (8, 3))
    wanted = upright(camera, places)
    found = seen(camera, places, 4)
    corners = np.concatenate([wanted[:, :2] - wanted[:, 2:], wanted[:, :2] + wanted[:, 2:]], axis=1)
    assert_allclose(found.boxes, corners, atol=1e-6)
    assert_allclose(found.values[:, 0], wanted[:, 0], atol=1e-6)
    assert_allclose(found.values[:, 1], np.clip(corners[:, 1], 0.0, 799.0), atol=1e-6)
    assert_allclose(found.values[:, 2], np.clip(corners[:, 3], 0.0, 799.0), atol=1e-6)
    assert_allclose(found.values[:, 3], 2.0 * wanted[:, 2], atol=1e-6)
    assert_allclose(found.depths, np.linalg.norm(places - camera.centre, axis=1))
    assert_allclose(seen(camera, places, 2).values, camera.project(places)[0], atol=1e-9)


def test_a_picture_turned_by_a_quarter_turns_the_box() -> None:
    camera, place = ring(1)[0], np.array([[0.2, -0.1, 0.85]])
    straight = seen(camera, place, 4).boxes[0]
    for degrees in (90.0, -90.0):
        turned = seen(rolled(camera, degrees), place, 4)
        left, top, right, bottom = turned.boxes[0]
        assert right - left == pytest.approx(straight[3] - straight[1], rel=0.01)
        assert bottom - top == pytest.approx(straight[2] - straight[0], rel=0.01)
        assert turned.values[0, 3] == pytest.approx(right - left)
    around = seen(rolled(camera, 180.0), place, 4)
    middle = np.array(camera.image_size * 2) - 1.0
    assert_allclose(around.boxes[0], (middle - straight[[2, 3, 0, 1]]), atol=1e-6)


@pytest.mark.parametrize("degrees", [50.0, -50.0, 130.0])
def test_in_a_picture_turned_by_less_the_box_spans_the_axis_from_top_to_bottom(
    degrees: float,
) -> None:
    camera, place = rolled(ring(1)[0], degrees), np.array([0.2, -0.1, 0.85])
    ends, _ = camera.project(place + np.outer([-1.0, 1.0], [0.0, 0.0, HALF_HEIGHT]))
    _, top, _, bottom = seen(camera, place[None], 4).boxes[0]
    assert_allclose([top, bottom], np.sort(ends[:, 1]), atol=1e-6)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 89.0, -91.0, 180.0])
@pytest.mark.parametrize("size", [2, 3, 4])
def test_the_derivative_is_that_of_the_values(degrees: float, size: int) -> None:
    camera = rolled(CAMERA, degrees)
    states = np.random.default_rng(1).uniform([-0.8, -0.8, 0.8], [0.8, 0.8, 0.9], (3, 3))
    states = np.concatenate([states, np.full((3, 2), 7.0)], axis=1)
    found = seen(camera, states, size)
    assert not found.jacobians[:, :, 3:].any()
    for axis in range(3):
        step = np.zeros(5)
        step[axis] = 1e-5
        ahead, behind = seen(camera, states + step, size), seen(camera, states - step, size)
        slopes = (ahead.values - behind.values) / 2e-5
        assert_allclose(found.jacobians[:, :, axis], slopes, rtol=1e-4, atol=1e-3)


def test_beyond_the_edge_of_the_picture_a_box_ends_and_has_no_derivative() -> None:
    camera = ring(1)[0]
    near = np.add(camera.centre, [-0.9, 0.0, -1.2])
    found = seen(camera, near[None], 3)
    top, bottom = found.boxes[0, [1, 3]]
    assert top > 0.0
    assert bottom > 799.0
    assert_array_equal(found.values[0, 1:], [top, 799.0])
    assert found.jacobians[0, 1].any()
    assert not found.jacobians[0, 2].any()
    above = seen(camera, np.add(camera.centre, [-1.4, 0.0, 0.0])[None], 3)
    assert above.boxes[0, 1] < 0.0
    assert above.values[0, 1] == 0.0
    assert not above.jacobians[0, 1].any()


@pytest.mark.parametrize("offset", [[3.0, 0.0, 0.0], [0.0, 0.0, -0.85], [0.0, 0.0, 0.85]])
def test_of_whom_a_part_is_behind_the_lens_nothing_is_expected(offset: list[float]) -> None:
    camera = ring(1)[0]
    found = seen(camera, (camera.centre + offset)[None], 3)
    assert not found.valid[0]
    assert not found.boxes.any()
    assert not found.values.any()
    assert not found.jacobians.any()
    assert found.depths[0] == pytest.approx(np.linalg.norm(offset))


@pytest.mark.parametrize("middle", [(640.0, 400.0), (3.0, 400.0), (640.0, 805.0), (-9.0, -4.0)])
def test_the_chance_to_be_inside_is_that_of_a_normal_distribution(
    middle: tuple[float, float],
) -> None:
    rng = np.random.default_rng(3)
    jacobian, factor = rng.normal(0.0, 20.0, (3, 4)), rng.normal(0.0, 0.2, (4, 4))
    covariance = factor @ factor.T
    box = np.array([middle[0] - 20.0, middle[1] - 50.0, middle[0] + 20.0, middle[1] + 50.0])
    found = kernels.inside_probability(
        np.stack([box, box]), np.stack([jacobian] * 2), np.stack([covariance] * 2),
        np.array([True, False]), np.array([1280.0, 800.0]), True,
    )  # fmt: skip
    wanted = 1.0
    for row, (at, size) in enumerate(zip(middle, (1280.0, 800.0), strict=True)):
        sigma = np.sqrt(jacobian[row] @ covariance @ jacobian[row]) + 1.0
        wanted *= norm.cdf(size - 0.5, at, sigma) - norm.cdf(-0.5, at, sigma)
    assert_allclose(found, [wanted, 0.0], rtol=1e-9)


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (-0.5, 400.0, 1.0), (-0.501, 400.0, 0.0), (1279.499, 400.0, 1.0), (1279.5, 400.0, 0.0),
        (640.0, -0.5, 1.0), (640.0, -0.501, 0.0), (640.0, 799.499, 1.0), (640.0, 799.5, 0.0),
    ],
)  # fmt: skip
def test_without_softness_the_middle_is_inside_or_not(x: float, y: float, expected: float) -> None:
    found = kernels.inside_probability(
        np.array([[x - 8.0, y - 16.0, x + 8.0, y + 16.0]]), np.ones((1, 2, 3)), np.ones((1, 3, 3)),
        np.array([True]), np.array([1280.0, 800.0]), False,
    )  # fmt: skip
    assert found[0] == expected


RULE = kernels.Occlusion(near=0.3, strength=0.8, reporting_share=0.1)


def hidden(
    front: tuple[float, float, float, float] = (10.0, 0.0, 30.0, 40.0),
    *,
    depth: float = 3.0,
    apart: tuple[float, float, float] = (1.0, 0.0, 0.0),
    label: int = 7,
    weight: float = 0.9,
    rule: kernels.Occlusion = RULE,
) -> tuple[float, int]:
    """Detection probability, and by whom it is hidden, of a box (0, 0, 20, 40) at depth 4."""
    found = kernels.hide(
        np.array([0.9, 0.8]),
        np.array([[0.0, 0.0, 20.0, 40.0], front]),
        np.array([4.0, depth]),
        np.array([[0.0, 0.0, 1.0], [apart[0], apart[1], 1.0 + apart[2]]]),
        np.array([5, label]),
        np.array([1]),
        np.array([weight]),
        rule,
    )
    assert found.detection_probabilities[1] == 0.8
    assert found.hidden_by[1] == -1
    return float(found.detection_probabilities[0]), int(found.hidden_by[0])


HALF = 0.9 * (1.0 - 0.8 * 0.9 * 0.5)


@pytest.mark.parametrize(
    ("case", "expected", "by"),
    [
        ({}, HALF, 7),
        # touching in one axis only, or at a border only, hides nothing
        ({"front": (20.0, 0.0, 40.0, 40.0)}, 0.9, -1),
        ({"front": (10.0, 40.0, 30.0, 80.0)}, 0.9, -1),
        ({"front": (30.0, 0.0, 50.0, 40.0)}, 0.9, -1),
        ({"front": (10.0, 10.0, 30.0, 20.0)}, 0.9 * (1.0 - 0.8 * 0.9 * 0.125), 7),
        # as far, or one and the same
        ({"depth": 4.0}, 0.9, -1),
        ({"depth": 4.5}, 0.9, -1),
        ({"label": 5}, 0.9, -1),
        # a duplicate within 0.3 m, along each axis
        ({"apart": (0.3, 0.0, 0.0)}, 0.9, -1),
        ({"apart": (0.301, 0.0, 0.0)}, HALF, 7),
        ({"apart": (0.0, 0.2, 0.2)}, 0.9, -1),
        ({"apart": (0.0, 0.0, 0.31)}, HALF, 7),
        # a weight counts up to 1
        ({"weight": 2.5}, 0.9 * (1.0 - 0.8 * 0.5), 7),
        # exactly the share that is worth telling is not told
        ({"rule": kernels.Occlusion(0.3, 0.8, 0.45)}, HALF, -1),
        ({"rule": kernels.Occlusion(0.3, 0.8, 0.449)}, HALF, 7),
        ({"front": (0.0, 0.0, 20.0, 40.0), "rule": kernels.Occlusion(0.3, 2.0, 0.1)}, 0.0, 7),
    ],
)
def test_who_hides_whom(case: dict, expected: float, by: int) -> None:
    found, who = hidden(**case)
    assert found == pytest.approx(expected)
    assert who == by


def test_of_two_occluders_both_count_and_the_stronger_is_named() -> None:
    found = kernels.hide(
        np.array([1.0, 1.0, 1.0]),
        np.array([[0.0, 0.0, 20.0, 40.0], [0.0, 0.0, 20.0, 10.0], [0.0, 0.0, 20.0, 20.0]]),
        np.array([4.0, 2.0, 3.0]),
        np.diag([3.0, 5.0, 9.0]),
        np.array([1, 2, 3]),
        np.array([2, 1]),
        np.array([1.0, 1.0]),
        kernels.Occlusion(0.3, 0.5, 0.1),
    )
    assert_allclose(found.detection_probabilities, [0.75 * 0.875, 1.0, 0.75])
    assert_array_equal(found.hidden_by, [3, -1, 2])


@given(st.integers(0, 2**32 - 1), st.integers(0, 6))
def test_alone_is_what_touches_no_other_box_of_its_step(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = np.concatenate([rng.integers(0, 8, (count, 2)), rng.integers(1, 4, (count, 2))], 1)
    starts = np.array([0, count // 2, count // 2, count])
    found = kernels.alone(boxes.astype(float), starts)
    step = np.searchsorted(starts, np.arange(count), side="right")
    for i in range(count):
        others = [j for j in range(count) if j != i and step[j] == step[i]]
        apart = [(abs(boxes[i, :2] - boxes[j, :2]) >= boxes[i, 2:] + boxes[j, 2:]) for j in others]
        assert found[i] == all(axis.any() for axis in apart)
