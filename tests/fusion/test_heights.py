"""Heights at which targets can be: the truncation against numerical integration, and its use."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from tests import world
from tests.fusion.rooms import filtered
from tests.random_rooms import looking_camera
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.heights import HeightBounds
from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.single_view.protocol import ViewResult

BOUNDS = HeightBounds(0.4, 1.6, 0.1)


def track(height: float, sigma: float, along: float = 0.0) -> GaussianMixture:
    """One track of which x and the height are correlated."""
    covariance = 0.01 * np.eye(6)
    covariance[2, 2] = sigma**2
    covariance[0, 0], covariance[0, 2] = 0.01 + along**2 * sigma**2, along * sigma**2
    covariance[2, 0] = covariance[0, 2]
    return GaussianMixture(
        np.array([0.8]), np.array([[1.0, 2.0, height, 0.1, 0.2, 0.0]]), covariance[None],
        np.array([7]),
    )  # fmt: skip


def integrated(height: float, sigma: float, bounds: HeightBounds) -> tuple[float, float]:
    """Mean and variance of the density that is ``outside`` as large beyond the bounds."""
    z = np.linspace(height - 9.0 * sigma, height + 9.0 * sigma, 400_001)
    density = norm.pdf(z, height, sigma)
    density *= np.where((z < bounds.low) | (z > bounds.high), bounds.outside, 1.0)
    density /= density.sum()
    mean = float(density @ z)
    return mean, float(density @ (z - mean) ** 2)


@given(
    height=st.floats(-1.0, 3.0),
    sigma=st.floats(0.05, 2.0),
    outside=st.sampled_from([0.01, 0.1, 0.5]),
)
def test_the_moments_are_those_of_the_truncated_density(
    height: float, sigma: float, outside: float
) -> None:
    bounds = HeightBounds(0.4, 1.6, outside)
    after = bounds.truncate(track(height, sigma))
    if min(height - 0.4, 1.6 - height) >= sigma:
        assert_array_equal(after.means, track(height, sigma).means)
        return
    mean, variance = integrated(height, sigma, bounds)
    assert_allclose(after.means[0, 2], mean, atol=2e-4)
    assert_allclose(after.covariances[0, 2, 2], variance, rtol=1e-2, atol=2e-5)


@pytest.mark.parametrize("sigma", [0.05, 0.5])
@pytest.mark.parametrize(("bound", "inwards"), [(0.4, 1.0), (1.6, -1.0)])
def test_a_height_within_one_standard_deviation_of_a_bound_is_truncated(
    bound: float, inwards: float, sigma: float
) -> None:
    near = track(bound + inwards * 0.99 * sigma, sigma)
    moved = BOUNDS.truncate(near).means[0, 2] - near.means[0, 2]
    assert inwards * moved > 1e-3 * sigma
    away = track(bound + inwards * 1.01 * sigma, sigma)
    assert_array_equal(BOUNDS.truncate(away).means, away.means)


def test_the_rest_of_the_state_follows_the_height() -> None:
    before = track(0.2, 0.5, along=2.0)
    after = BOUNDS.truncate(before)
    moved = after.means[0] - before.means[0]
    assert moved[2] > 0.1
    assert_allclose(moved[0], 2.0 * moved[2])
    assert_array_equal(after.means[0, [1, 3, 4, 5]], before.means[0, [1, 3, 4, 5]])
    assert after.covariances[0, 0, 0] < before.covariances[0, 0, 0]
    assert (np.linalg.eigvalsh(after.covariances[0]) > 0.0).all()
    assert_array_equal(after.labels, before.labels)
    assert_array_equal(after.weights, before.weights)


@pytest.mark.parametrize("height", [0.05, 1.0])
def test_a_certain_height_stays_beyond_the_bounds_and_between_them(height: float) -> None:
    """Somebody lies on the floor, and several cameras see it."""
    before = track(height, 0.03)
    after = BOUNDS.truncate(before)
    assert_allclose(after.means, before.means, atol=1e-6)
    assert_allclose(after.covariances, before.covariances, rtol=1e-4, atol=1e-9)


def test_without_density_outside_a_height_far_beyond_the_bounds_stays_as_it_is() -> None:
    before = track(-5.0, 0.1)
    after = HeightBounds(0.4, 1.6, 0.0).truncate(before)
    assert_array_equal(after.means, before.means)
    assert_array_equal(after.covariances, before.covariances)


def test_no_tracks_and_a_room_lower_than_its_targets() -> None:
    assert BOUNDS.truncate(GaussianMixture.empty(6)).size == 0
    low = HeightBounds.of(world.volume(), 5.0, 0.1)
    assert low.low == low.high == 5.0
    assert np.isfinite(low.truncate(track(0.2, 0.5)).means).all()


def far_away(shrunk: float) -> tuple[ndarray, tuple[tuple[ViewResult, ...], ...], object]:
    """Somebody crosses a room, seen by one high camera far away in boxes that are too small."""
    camera = looking_camera(
        "cam1", np.array([0.0, -12.0, 12.0]), np.array([0.0, 0.0, 0.85]), 1000.0, (1280, 720)
    )
    steps = 90
    paths = np.zeros((steps, 1, 3))
    paths[:, 0, 0] = np.linspace(-1.5, 1.5, steps)
    paths[:, 0, 2] = world.PERSON[2]
    views = []
    for step in range(steps):
        box = world.upright(camera, paths[step])
        box[:, 2:] *= shrunk
        sigmas = np.concatenate([np.full((1, 2), 4.0), 0.2 * box[:, 2:]], axis=1)
        views.append((ViewResult.of_boxes(box, np.ones(1), sigmas),))
    return paths, tuple(views), camera


@pytest.mark.parametrize("shrunk", [1.0, 0.9])
def test_somebody_whom_one_camera_sees_keeps_one_track_though_boxes_are_small(
    shrunk: float,
) -> None:
    paths, views, camera = far_away(shrunk)
    found = filtered(
        MultiBernoulli, views, cameras=(camera,), fps=30.0, room=world.volume(entrances=[])
    )
    labels = set()
    for step in range(30, len(views)):
        sure = found[step].posterior.take(found[step].posterior.weights > 0.5)
        assert sure.size == 1, step
        labels.update(sure.labels.tolist())
        assert np.linalg.norm(sure.means[0, :3] - paths[step, 0]) < 0.9
    assert len(labels) == 1
