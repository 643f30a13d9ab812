"""Motion, birth, clutter and the visible area: what a sequence and its frame rate determine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import expm
from scipy.spatial import ConvexHull

from tests import world
from tests.world import look_at, volume
from tracker.filters import models
from tracker.filters.models import Motion, visible_area
from tracker.geometry.camera import Camera
from tracker.parameters.groups.fusion import FusionParams
from tracker.sequences.sequence import Room

ROOM = world.volume(1.5, 2.0, [(-1.2, 0.0, 1.0), (1.2, 0.1, 1.0)], (0.25, 0.3, 0.15))
CAMERAS = world.ring(3, 4.4, distortion=world.BARREL)
NO_DOORS = Room(ROOM.minimum, ROOM.maximum)


@pytest.mark.parametrize("dimension", [1, 3, 6])
def test_a_random_walk_strays_the_same_at_any_frame_rate(dimension: int) -> None:
    second = models.random_walk_noise(0.4, 1.0, dimension)
    assert_allclose(second, 0.16 * np.eye(dimension))
    for fps in (4.0, 25.0):
        assert_allclose(fps * models.random_walk_noise(0.4, 1.0 / fps, dimension), second)


@pytest.mark.parametrize("memory", [0.1, 2.0, 100.0])
@pytest.mark.parametrize("fps", [4.0, 25.0, 60.0])
def test_constant_velocity_is_the_integral_of_its_equation(fps: float, memory: float) -> None:
    sigmas, dt = np.array([1.0, 1.5, 0.2]), 1.0 / fps
    transition, noise = models.constant_velocity(sigmas, dt, memory)
    drift = np.zeros((6, 6))
    drift[:3, 3:] = np.eye(3)
    drift[3:, 3:] = -np.eye(3) / memory
    diffusion = np.zeros((6, 6))
    diffusion[3:, 3:] = np.diag(sigmas**2)
    # F and Q at once from one matrix exponential (Van Loan)
    block = expm(np.block([[-drift, diffusion], [np.zeros((6, 6)), drift.T]]) * dt)
    assert_allclose(transition, block[6:, 6:].T, atol=1e-12)
    assert_allclose(noise, block[6:, 6:].T @ block[:6, 6:], rtol=1e-4, atol=1e-16)
    assert_array_equal(noise, noise.T)
    assert (np.linalg.eigvalsh(noise) > 0.0).all()


def test_two_steps_of_constant_velocity_are_one_of_twice_the_length() -> None:
    sigmas = np.array([1.0, 1.0, 0.2])
    f1, q1 = models.constant_velocity(sigmas, 0.04, 2.0)
    f2, q2 = models.constant_velocity(sigmas, 0.08, 2.0)
    assert_allclose(f1 @ f1, f2, atol=1e-12)
    assert_allclose(f1 @ q1 @ f1.T + q1, q2, atol=1e-12)


@pytest.mark.parametrize("step_time", [0.04, 0.5])
def test_the_motion_is_the_one_that_the_parameters_name(step_time: float) -> None:
    walk = Motion.of(FusionParams(motion="random_walk", motion_sigma=0.3), step_time)
    assert (walk.dimension, walk.start_velocity) == (3, 0.0)
    assert_array_equal(walk.transition, np.eye(3))
    assert_allclose(walk.noise, 0.09 * step_time * np.eye(3))
    p = FusionParams(motion="constant_velocity", acceleration_sigma=1.5, velocity_memory=1.7)
    straight = Motion.of(p, step_time)
    transition, noise = models.constant_velocity(np.array([1.5, 1.5, 0.15]), step_time, 1.7)
    assert (straight.dimension, straight.start_velocity) == (6, 0.7)
    assert_array_equal(straight.transition, transition)
    assert_allclose(straight.noise, noise)
    state = world.gaussians(np.array([[1.0, 2.0, 0.85]]), weights=0.7)
    moved = straight.predict(state, 0.9)
    assert_allclose(moved.weights, [0.63])
    assert_allclose(moved.covariances[0], transition @ state.covariances[0] @ transition.T + noise)


def test_a_newcomer_is_at_rest_and_how_fast_it_may_be_is_stated() -> None:
    places = world.gaussians(
        np.array([[1.0, 2.0, 0.85], [0.0, 1.0, 0.8]]), weights=0.3, sigma=0.2, speed_sigma=None
    )
    walk = Motion(np.eye(3), np.eye(3), 0.0)
    assert walk.at_rest(places) is places
    newcomers = Motion(np.eye(6), np.eye(6), 0.7).at_rest(places)
    wanted = world.gaussians(places.means, weights=0.3, sigma=0.2, speed_sigma=0.7)
    assert_array_equal(newcomers.labels, wanted.labels)
    assert_array_equal(newcomers.weights, wanted.weights)
    assert_array_equal(newcomers.means, wanted.means)
    assert_allclose(newcomers.covariances, wanted.covariances)


def test_everybody_is_born_at_an_entrance() -> None:
    births = models.entrance_births(ROOM, 0.02)
    assert births.size == len(ROOM.entrances)
    assert_array_equal(births.weights, [0.02, 0.02])
    for j, entrance in enumerate(ROOM.entrances):
        assert_array_equal(births.means[j], entrance.position)
        assert_allclose(births.covariances[j], np.diag(entrance.sigma**2))


def test_a_room_without_entrances_has_births_all_over() -> None:
    births = models.entrance_births(NO_DOORS, 0.02)
    assert births.size == 1
    points = np.random.default_rng(0).uniform(ROOM.minimum, ROOM.maximum, (200_000, 3))
    assert_allclose(births.means[0], points.mean(axis=0), atol=0.01)
    assert_allclose(births.covariances[0], np.cov(points.T), atol=0.01)


def test_each_birth_has_a_label_of_its_own() -> None:
    births = models.entrance_births(ROOM, 0.02)
    assert_array_equal(models.label_births(births, 41).labels, [41, 42])
    assert_array_equal(births.labels, [0, 0])


def test_the_visible_area_is_that_of_the_room_in_the_picture() -> None:
    width, height = CAMERAS[0].image_size
    for camera in CAMERAS:
        area = models.visible_area(camera, ROOM)
        # counted pixel by pixel: those whose ray meets the room's volume
        across, down = np.meshgrid(np.arange(0.0, width, 24.0), np.arange(0.0, height, 24.0))
        rays = camera.back_project(np.stack([across, down], axis=-1).reshape(-1, 2))
        with np.errstate(divide="ignore"):
            near = (ROOM.minimum - camera.centre) / rays
            far = (ROOM.maximum - camera.centre) / rays
        entry = np.minimum(near, far).max(axis=1)
        leaving = np.maximum(near, far).min(axis=1)
        counted = 576.0 * float(((entry < leaving) & (leaving > 0.0)).sum())
        assert area == pytest.approx(counted, rel=0.05)
        assert area <= width * height


def test_a_camera_that_looks_elsewhere_still_has_an_area() -> None:
    away = look_at("away", (-3.4, -3.2, 2.6), (-9.0, -9.0, 1.0))
    assert models.visible_area(away, ROOM) == pytest.approx(0.01 * 1280 * 800)


def test_a_camera_within_the_room_sees_at_most_its_picture() -> None:
    inside = look_at("inside", (0.0, -1.0, 1.2), (0.0, 1.0, 1.0), focal=1390.0)
    area = models.visible_area(inside, ROOM)
    assert 0.5 * 1280 * 800 < area <= 1280 * 800


@pytest.mark.parametrize("size", [2, 3, 4])
def test_the_space_of_boxes_grows_with_what_is_measured(size: int) -> None:
    camera = CAMERAS[0]
    volume = models.measurement_volume(camera, ROOM, size)
    factors = [800 / 2, 1280 / 2][: size - 2]
    assert volume == pytest.approx(models.visible_area(camera, ROOM) * np.prod(factors))


WIDE_ROOM = volume(2.0, 2.5)


def seen(camera: Camera) -> ndarray:
    """The points of a grid of 12 × 12 × 12 over the room that are in the picture."""
    axes = np.linspace(WIDE_ROOM.minimum, WIDE_ROOM.maximum, 12).T
    pixels, _ = camera.project(np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3))
    return np.asarray(pixels[camera.contains(pixels)])


@pytest.mark.parametrize("place", [(4.5, 1.0, 2.0), (1.0, 0.3, 1.2), (0.1, -1.7, 2.4)])
def test_the_area_is_the_hull_of_what_is_seen_of_the_room(place: tuple[float, ...]) -> None:
    camera = look_at("one", place, (-0.5, 0.2, 0.9), focal=400.0, image_size=(640, 480))
    assert visible_area(camera, WIDE_ROOM) == pytest.approx(
        ConvexHull(seen(camera)).volume, rel=1e-4
    )


@pytest.mark.parametrize("count", [2, 3])
def test_three_points_span_an_area_and_two_do_not(count: int) -> None:
    camera = look_at("one", (4.5, 1.0, 2.0), (0.0, 0.0, 1.0), focal=3000.0, image_size=(90, 90))
    rng = np.random.default_rng(0)
    while True:  # another part of what a large picture would show
        shift = np.array([[0.0, 0.0, rng.uniform(-900, 900)], [0.0, 0.0, rng.uniform(-900, 900)]])
        part = replace(camera, intrinsics=camera.intrinsics + np.vstack([shift, np.zeros(3)]))
        points = seen(part)
        if len(points) == count:
            break
    least = 0.01 * 90 * 90
    area = ConvexHull(points).volume if count == 3 else 0.0
    assert visible_area(part, WIDE_ROOM) == pytest.approx(max(area, least), rel=1e-4)
    assert (area > least) == (count == 3)
