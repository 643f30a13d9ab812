"""The camera: projection against OpenCV, its derivative, its inverse, and where it ends."""

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

from tests import world
from tests.world import HEAD, PERSON
from tests.world import SMALL_CAMERAS as CAMERAS
from tests.world import SMALL_ROOM as ROOM
from tests.world import surveillance as look_at
from tracker.geometry.calibration import (
    LARGEST_ENTRY,
    LARGEST_SIDE,
    LEAST_FOCAL,
    ROTATION_TOLERANCE,
    check_focal_lengths,
    checked_intrinsics,
    checked_rotation,
    checked_size,
    is_rotation,
)
from tracker.geometry.camera import NEAREST_DEPTH, Camera, stacked
from tracker.kernels import lens

PINHOLE = look_at("pinhole", (-3.0, -3.0, 2.5), distortion=np.zeros(5))
CUSHION = look_at("cushion", (-3.0, 3.0, 2.5), distortion=np.array([0.1, -0.02, 0.001, 0.002, 0]))
SIXTH = look_at("sixth", (3.0, 3.0, 2.5), distortion=np.array([-0.3, 0.12, 0.003, 0, -0.03]))
PLAIN = [*CAMERAS, PINHOLE, CUSHION, SIXTH]
LENSES = pytest.mark.parametrize("camera", PLAIN, ids=lambda c: c.name)


def room_points(count: int, seed: int = 0) -> ndarray:
    """Points all over the tracking volume."""
    return np.random.default_rng(seed).uniform(ROOM.minimum, ROOM.maximum, (count, 3))


def through_opencv(camera: Camera, points: ndarray) -> ndarray:
    """The same projection by OpenCV."""
    rotation, _ = cv2.Rodrigues(camera.rotation)
    pixels, _ = cv2.projectPoints(
        points, rotation, camera.translation, camera.intrinsics, camera.distortion
    )
    return np.asarray(pixels).reshape(-1, 2)


@LENSES
def test_projection_agrees_with_opencv(camera: Camera) -> None:
    points = room_points(500)
    pixels, valid = camera.project(points)
    assert valid.sum() > 400
    assert_allclose(pixels[valid], through_opencv(camera, points)[valid], atol=1e-8)


@LENSES
def test_a_pixel_back_projected_and_projected_is_itself(camera: Camera) -> None:
    width, height = camera.image_size
    across, down = np.linspace(-0.5, width - 0.5, 41), np.linspace(-0.5, height - 0.5, 31)
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = camera.back_project(pixels)
    assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    for distance in (0.5, 4.0, 30.0):
        again, valid = camera.project(camera.centre + distance * rays)
        assert valid.all()
        assert_allclose(again, pixels, atol=1e-3)


def random_rotation(rng: np.random.Generator) -> ndarray:
    """Any direction."""
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.linalg.det(q)))


@given(st.integers(0, 2**32 - 1), st.sampled_from((1.0, -1.0, 1e-6, -3e4)))
def test_a_projection_matrix_is_split_into_what_made_it(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    focal = rng.uniform(200.0, 3000.0)
    intrinsics = np.array(
        [[focal, rng.normal(), rng.uniform(0, 2000)], [0, 1.1 * focal, 500], [0, 0, 1]]
    )
    rotation, translation = random_rotation(rng), rng.normal(size=3) * 5.0
    matrix = intrinsics @ np.column_stack([rotation, translation])
    camera = Camera.from_projection("p", (1920, 1080), scale * matrix)
    assert_allclose(camera.intrinsics, intrinsics, rtol=1e-6, atol=1e-6)
    assert_allclose(camera.rotation, rotation, atol=1e-8)
    assert_allclose(camera.translation, translation, atol=1e-7)
    assert camera.is_pinhole
    points = camera.centre + rng.normal([0.0, 0.0, 5.0], 1.0, (20, 3)) @ rotation
    homogeneous = np.column_stack([points, np.ones(20)]) @ matrix.T
    pixels, valid = camera.project(points)
    assert valid.sum() > 10
    assert_allclose(pixels[valid], (homogeneous[:, :2] / homogeneous[:, 2:])[valid], rtol=1e-6)


@pytest.mark.parametrize(
    "left",
    [
        np.zeros((3, 3)),
        np.ones((3, 3)),
        np.diag([1.0, 1.0, 0.0]),
        1e-5 * np.array([[1.0, 2, 3], [2, 4, 6], [0, 0, 1]]),
    ],
)
def test_a_singular_projection_matrix_is_refused(left: ndarray) -> None:
    with pytest.raises(ValueError, match="singular"):
        Camera.from_projection("p", (640, 480), np.column_stack([left, np.ones(3)]))


@LENSES
def test_what_is_behind_the_camera_is_not_drawn(camera: Camera) -> None:
    ahead = camera.rotation[2]
    distances = np.array([-10.0, -0.1, 0.0, NEAREST_DEPTH * 0.99, NEAREST_DEPTH * 1.01, 2.0])
    points = camera.centre + distances[:, None] * ahead
    pixels, jacobians, valid = lens.project_points(points, camera.calibration, True)
    assert_array_equal(valid, [False, False, False, False, True, True])
    assert np.isnan(pixels[~valid]).all()
    assert not jacobians[~valid].any()
    assert_array_equal(camera.sees(points), valid)


@pytest.mark.parametrize("camera", [*CAMERAS, SIXTH], ids=lambda c: c.name)
def test_what_is_far_aside_is_not_folded_back_into_the_picture(camera: Camera) -> None:
    middle = np.array(camera.image_size) / 2.0
    centre_ray = camera.back_project(middle[None])[0]
    folded = 0
    for direction in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
        aside = np.cos(direction) * camera.rotation[0] + np.sin(direction) * camera.rotation[1]
        angles = np.radians(np.linspace(0.0, 89.0, 90))[:, None]
        points = camera.centre + 3.0 * (np.cos(angles) * centre_ray + np.sin(angles) * aside)
        naive = through_opencv(camera, points)
        seen = camera.sees(points)
        pixels, valid = camera.project(points)
        last = int(np.flatnonzero(seen).max())
        assert seen[: last + 1].all()  # once out of the picture, out for good
        folded += int(camera.contains(naive)[last + 1 :].sum())
        # and while it holds, farther aside is farther out
        outward = np.linalg.norm(pixels[valid] - pixels[0], axis=1)
        assert (np.diff(outward) > 0.0).all()
    assert folded > 0, "this lens does not fold, so the test shows nothing"


@given(st.integers(0, 2**32 - 1))
def test_the_box_of_a_target_holds_its_middle(seed: int) -> None:
    points = room_points(20, seed)
    for camera in (*CAMERAS, PINHOLE, CUSHION):
        for half_extents in (HEAD, PERSON):
            boxes, visible = camera.project_boxes(points, half_extents)
            whole = np.isfinite(boxes).all(axis=1)
            assert not visible[~whole].any()
            pixels, valid = camera.project(points)
            assert valid[whole].all()
            low, high = boxes[whole, :2], boxes[whole, :2] + boxes[whole, 2:]
            assert (low < pixels[whole]).all()
            assert (pixels[whole] < high).all()
            # a target whose middle is in the picture has a box there
            assert visible[whole & camera.contains(pixels)].all()


def test_a_target_partly_behind_the_lens_has_no_box() -> None:
    camera = look_at("near", (0.0, -0.2, 1.0), (0.0, 5.0, 1.0))
    centres = np.array([[0.0, 0.0, 1.0], [0.0, 3.0, 1.0], [0.0, -3.0, 1.0]])
    boxes, visible = camera.project_boxes(centres, PERSON)
    assert_array_equal(visible, [False, True, False])
    assert_array_equal(np.isfinite(boxes).all(axis=1), [False, True, False])
    assert camera.project(centres)[1].tolist() == [True, True, False]


def test_no_points() -> None:
    none = np.zeros((0, 3))
    pixels, jacobians, valid = lens.project_points(none, CAMERAS[0].calibration, True)
    assert (pixels.shape, jacobians.shape, valid.shape) == ((0, 2), (0, 2, 3), (0,))
    assert CAMERAS[0].project(none)[0].shape == (0, 2)
    assert CAMERAS[0].sees(none).shape == (0,)
    assert CAMERAS[0].back_project(np.zeros((0, 2))).shape == (0, 3)
    boxes, visible = CAMERAS[0].project_boxes(none, HEAD)
    assert (boxes.shape, visible.shape) == ((0, 4), (0,))


def test_the_edge_of_the_picture_is_half_a_pixel_beyond_the_outer_centres() -> None:
    edge = np.array([[-0.5, -0.5], [-0.51, 0], [359.49, 287.49], [359.5, 0], [np.nan, 0]])
    assert_array_equal(CAMERAS[0].contains(edge), [True, False, True, False, False])


def test_the_centre_is_where_the_camera_was_put() -> None:
    assert_allclose(look_at("here", (1.0, -2.0, 3.0)).centre, [1.0, -2.0, 3.0])


# ── lenses of other models

RATIONAL = look_at(
    "rational", (-3.0, 3.0, 2.5),
    distortion=np.array([0.4, -0.1, 0.002, -0.003, 0.01, 0.7, 0.05, 0.02]),
)  # fmt: skip
FISHEYE = replace(
    look_at("fisheye", (3.0, -3.0, 2.5), distortion=np.array([0.03, -0.01, 0.002, -0.001])),
    fisheye=True,
)


def drawn_by_opencv(camera: Camera, points: ndarray) -> ndarray:
    if not camera.fisheye:
        return through_opencv(camera, points)
    turn, _ = cv2.Rodrigues(camera.rotation)
    pixels, _ = cv2.fisheye.projectPoints(
        points[:, None], turn, camera.translation, camera.intrinsics, camera.distortion
    )
    return np.asarray(pixels).reshape(-1, 2)


@pytest.mark.parametrize("camera", [RATIONAL, FISHEYE], ids=lambda c: c.name)
def test_other_lenses_draw_as_opencv_and_come_back(camera: Camera) -> None:
    points = room_points(300)
    pixels, valid = camera.project(points)
    assert valid.mean() > 0.9
    assert_allclose(pixels[valid], drawn_by_opencv(camera, points[valid]), atol=1e-6)
    rays = camera.back_project(pixels[valid])
    straight = points[valid] - camera.centre
    assert_allclose(rays, straight / np.linalg.norm(straight, axis=1, keepdims=True), atol=1e-6)
    assert not camera.is_pinhole


@pytest.mark.parametrize("camera", [*PLAIN, RATIONAL, FISHEYE], ids=lambda c: c.name)
def test_the_jacobian_is_the_slope_of_the_projection(camera: Camera) -> None:
    points = room_points(200)
    pixels, jacobians, valid = lens.project_points(points, camera.calibration, True)
    again, valid_again = camera.project(points)
    assert_array_equal(pixels, again)
    assert_array_equal(valid, valid_again)
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ahead, behind = camera.project(points + shift)[0], camera.project(points - shift)[0]
        slope = (ahead - behind) / (2.0 * step)
        assert_allclose(jacobians[valid, :, axis], slope[valid], rtol=1e-5, atol=1e-4)


def drawn_radius(camera: Camera, radii: ndarray) -> ndarray:
    """How far from the axis points at these tangents are drawn, by OpenCV, without other bends."""
    at_origin = replace(
        camera, rotation=np.eye(3), translation=np.zeros(3), intrinsics=np.eye(3),
        distortion=camera.distortion * np.array([1, 1, *([1, 1] if camera.fisheye else [0, 0]),
                                                 *[1] * (len(camera.distortion) - 4)]),
    )  # fmt: skip
    points = np.column_stack([radii, np.zeros_like(radii), np.ones_like(radii)])
    return drawn_by_opencv(at_origin, points)[:, 0]


FOLDING = [
    world.look_at("k1", (0, -3, 1), distortion=np.array([-0.2, 0, 0, 0, 0.0])),
    world.look_at("k2", (0, -3, 1), distortion=np.array([0.1, -0.2, 0, 0, 0.0])),
    world.look_at("k3", (0, -3, 1), distortion=np.array([0.0, 0.1, 0, 0, -0.1])),
    SIXTH,
    replace(RATIONAL, distortion=np.array([-0.3, 0, 0, 0, 0, 0.1, 0.02, 0])),
    replace(FISHEYE, distortion=np.array([-0.2, 0.0, 0.0, 0.0])),
    replace(FISHEYE, distortion=np.array([0.1, -0.2, 0.01, 0.0])),
]


@pytest.mark.parametrize("camera", FOLDING, ids=lambda c: str(c.distortion.tolist()))
def test_a_lens_holds_up_to_where_it_folds_back(camera: Camera) -> None:
    largest = camera.largest_radius
    assert np.isfinite(largest)
    radii = largest * np.array([0.9, 0.99, 1.0, 1.01, 1.1])
    drawn = drawn_radius(camera, radii)
    # it rises before, and is flat there; the general lens is asked in steps of an angle alone
    assert drawn[0] < drawn[1] < drawn[2] + 1e-6
    assert drawn[4] < drawn[3] < drawn[2] + 1e-6


def test_a_lens_that_never_folds_holds_everywhere() -> None:
    for camera in (PINHOLE, replace(FISHEYE, distortion=np.zeros(4)),
                   replace(PINHOLE, distortion=np.array([0.1, 0.02, 0, 0, 0.01])),
                   replace(PINHOLE, distortion=np.array([-1e-31, 0, 0, 0, 1e-31]))):  # fmt: skip
        assert camera.largest_radius == np.inf
    # the smaller of two places where it turns counts: 1 - 3 r² + 1.25 r⁴ is 0 at 0.4 and 2
    twice = replace(PINHOLE, distortion=np.array([-1.0, 0.25, 0, 0, 0]))
    assert twice.largest_radius == pytest.approx(np.sqrt(0.4))


def test_a_lens_of_eight_numbers_of_which_five_are_used_folds_as_that_of_five() -> None:
    five = np.array([-0.3, 0.02, 0.001, -0.001, 0.0])
    camera = replace(PINHOLE, distortion=five)
    padded = replace(PINHOLE, distortion=np.r_[five, np.zeros(3)])
    assert np.isfinite(camera.largest_radius)
    assert padded.largest_radius == camera.largest_radius


def test_only_a_plain_lens_without_numbers_is_a_pinhole() -> None:
    assert PINHOLE.is_pinhole
    assert not CAMERAS[0].is_pinhole
    assert not replace(PINHOLE, distortion=np.zeros(4), fisheye=True).is_pinhole


def test_cameras_side_by_side_are_those_one_by_one() -> None:
    cameras = (PINHOLE, FISHEYE, RATIONAL, CAMERAS[1])
    every = stacked(cameras)
    assert every.distortions.shape == (4, lens.GENERAL)
    assert stacked((PINHOLE, CAMERAS[0])).distortions.shape == (2, 5)
    assert stacked(()).distortions.shape[0] == 0
    for row, camera in enumerate(cameras):
        own = camera.calibration
        assert_array_equal(every.image_sizes[row], camera.image_size)
        assert_array_equal(every.rotations[row], camera.rotation)
        assert_array_equal(every.translations[row], camera.translation)
        assert_array_equal(every.intrinsics[row], camera.intrinsics)
        assert_array_equal(every.distortions[row, : len(own.distortion)], own.distortion)
        assert not every.distortions[row, len(own.distortion) :].any()
        assert every.largest_radii[row] == camera.largest_radius


@pytest.mark.parametrize(
    ("x", "y", "visible"),
    [
        (0.0, 0.0, True),
        # 64 pixels a metre: a target that is two metres wide is 128 pixels wide
        (3.0, 0.0, False),  # its left edge is the right one of the picture
        (np.nextafter(3.0, 0.0), 0.0, True),
        (-3.0, 0.0, False),
        (np.nextafter(-3.0, 0.0), 0.0, True),
        (0.0, 2.0, False),
        (0.0, np.nextafter(2.0, 0.0), True),
        (0.0, -2.0, False),
        (0.0, np.nextafter(-2.0, 0.0), True),
    ],
)
def test_a_box_that_only_touches_the_pictures_edge_is_not_visible(
    x: float, y: float, visible: bool
) -> None:
    intrinsics = np.array([[64.0, 0, 127.5], [0, 64.0, 63.5], [0, 0, 1]])
    camera = Camera("c", (256, 128), intrinsics, np.eye(3), np.zeros(3), np.zeros(5))
    half = np.array([1.0, 1.0, 0.0])
    boxes, seen = camera.project_boxes(np.array([[x, y, 1.0]]), half)
    assert_allclose(boxes, [[127.5 + 64.0 * (x - 1.0), 63.5 + 64.0 * (y - 1.0), 128.0, 128.0]])
    assert seen.tolist() == [visible]


def test_a_picture_has_a_whole_number_of_pixels_from_one_to_the_largest() -> None:
    assert checked_size(np.array([1.0, LARGEST_SIDE])) == (1, LARGEST_SIDE)
    assert checked_size(np.array([LARGEST_SIDE, 1.0])) == (LARGEST_SIDE, 1)
    for wrong in (0.0, -1.0, 1.5, LARGEST_SIDE + 1.0):
        for size in ([wrong, 9.0], [9.0, wrong]):
            with pytest.raises(ValueError, match="expected two whole numbers of pixels"):
                checked_size(np.array(size))


def test_a_rotation_may_be_off_by_its_tolerance() -> None:
    sheared = np.eye(3)
    sheared[0, 1] = ROTATION_TOLERANCE
    assert is_rotation(sheared)
    assert checked_rotation(sheared) is sheared
    sheared[0, 1] *= 1.001
    assert not is_rotation(sheared)
    with pytest.raises(ValueError, match="expected a rotation"):
        checked_rotation(sheared)


@pytest.mark.parametrize(
    ("fx", "cx", "accepted"),
    [(LEAST_FOCAL, 0.0, True), (LARGEST_ENTRY, -LARGEST_ENTRY, True), (0.09, 0.0, False),
     (-500.0, 0.0, False), (500.0, -1.1e6, False), (1.1e6, 0.0, False), (math.nan, 0.0, False)],
)  # fmt: skip
def test_a_matrix_k_has_plausible_focal_lengths_and_nothing_larger(
    fx: float, cx: float, accepted: bool
) -> None:
    matrix = np.array([[fx, 0.0, cx], [0.0, 700.0, 240.0], [0.0, 0.0, 1.0]])
    if accepted:
        check_focal_lengths(matrix)
    else:
        with pytest.raises(ValueError, match="expected focal lengths fx and fy from"):
            check_focal_lengths(matrix)


@pytest.mark.parametrize(("row", "column"), [(1, 0), (2, 0), (2, 1), (2, 2)])
def test_a_matrix_k_is_upper_triangular_and_ends_with_one(row: int, column: int) -> None:
    matrix = np.array([[700.0, 0.5, 320.0], [0.0, 710.0, 240.0], [0.0, 0.0, 1.0]])
    assert_array_equal(checked_intrinsics(matrix), matrix)
    small = np.diag([0.4, 0.3, 1.0])  # in parts of the picture, as some programs have it
    assert_array_equal(checked_intrinsics(small), small)
    for axis in (0, 1):
        none = small.copy()
        none[axis, axis] = 0.0
        with pytest.raises(ValueError, match="expected focal lengths fx and fy above 0"):
            checked_intrinsics(none)
    off = matrix.copy()
    off[row, column] += 0.25
    assert_array_equal(checked_intrinsics(off, rounding=0.25), matrix)
    for rounding in (0.0, 0.2):
        with pytest.raises(ValueError, match=r"expected \[\[fx, s, cx\]"):
            checked_intrinsics(off, rounding=rounding)
