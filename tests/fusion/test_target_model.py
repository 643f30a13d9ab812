"""The box of an upright target: its derivative, the picture's edge, and the bend near a lens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose

from tests.fusion.rooms import CAMERAS, HALF_EXTENTS
from tests.world import BARREL, look_at
from tracker.fusion.target_model import SIZES, MeasurementKind, TargetModel, UpdateKind
from tracker.geometry.camera import Camera
from tracker.kernels import kalman
from tracker.kernels.kalman import Measurements
from tracker.single_view.protocol import ViewResult

KINDS: tuple[MeasurementKind, ...] = ("centre", "box", "box_and_width")
every_kind = pytest.mark.parametrize("kind", KINDS)


def places(seed: int, count: int = 40) -> ndarray:
    """Positions in the room."""
    rng = np.random.default_rng(seed)
    return rng.uniform([-1.5, -1.5, 0.8], [1.5, 1.5, 1.0], (count, 3))


def rolled(camera: Camera, quarters: int) -> Camera:
    """A camera whose picture is turned about its middle."""
    cos, sin = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarters % 4]
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    intrinsics = camera.intrinsics.copy()
    width, height = camera.image_size
    if quarters % 2:
        width, height = height, width
    intrinsics[:2, 2] = (width - 1) / 2.0, (height - 1) / 2.0
    return replace(
        camera,
        name=f"{camera.name} turned {90 * quarters}°",
        image_size=(width, height),
        intrinsics=intrinsics,
        rotation=turn @ camera.rotation,
        translation=turn @ camera.translation,
        distortion=np.zeros(5),
    )


ROLLED = [*CAMERAS[:2], *(rolled(CAMERAS[0], quarters) for quarters in (1, 2, 3))]


@every_kind
@pytest.mark.parametrize("camera", ROLLED, ids=lambda camera: camera.name)
def test_the_derivative_is_that_of_finite_differences(
    kind: MeasurementKind, camera: Camera
) -> None:
    model = TargetModel(HALF_EXTENTS, kind)
    states = np.concatenate([places(1), np.ones((40, 3))], axis=1)
    found = model.expected(camera, states)
    assert found.valid.all()
    assert found.jacobians.shape == (40, SIZES[kind], 6)
    assert not found.jacobians[:, :, 3:].any(), "velocity does not show in one picture"
    for axis in range(3):
        step = np.zeros(6)
        step[axis] = 1e-5
        up, down = (model.expected(camera, states + s).values for s in (step, -step))
        free = (found.values[:, 1:3] > 0.0).all(axis=1) & (
            found.values[:, 1:3] < camera.image_size[1] - 1
        ).all(axis=1)
        assert_allclose(
            found.jacobians[free, :, axis], ((up - down) / 2e-5)[free], rtol=1e-4, atol=1e-3
        )


def test_the_box_spans_the_axis() -> None:
    camera, states = CAMERAS[0], places(2)
    found = TargetModel(HALF_EXTENTS, "box").expected(camera, states)
    rise = np.array([0.0, 0.0, HALF_EXTENTS[2]])
    head, foot = camera.project(states + rise)[0], camera.project(states - rise)[0]
    assert_allclose(found.boxes[:, 1], head[:, 1])
    assert_allclose(found.boxes[:, 3], foot[:, 1])
    assert_allclose(found.boxes[:, ::2].mean(axis=1), (head[:, 0] + foot[:, 0]) / 2.0)
    assert_allclose(found.depths, np.linalg.norm(states - camera.centre, axis=1))
    centre = TargetModel(HALF_EXTENTS, "centre").expected(camera, states)
    assert_allclose(centre.values, camera.project(states)[0])


def test_a_camera_upside_down_sees_the_same_box_turned() -> None:
    upright, states = rolled(CAMERAS[0], 0), places(3)
    model = TargetModel(HALF_EXTENTS, "box_and_width")
    boxes = model.expected(upright, states).boxes
    turned = model.expected(rolled(upright, 2), states)
    width, height = upright.image_size
    assert_allclose(turned.boxes[:, [2, 3]], [width - 1, height - 1] - boxes[:, [0, 1]])
    assert_allclose(turned.boxes[:, [0, 1]], [width - 1, height - 1] - boxes[:, [2, 3]])
    assert (turned.values[:, 1] <= turned.values[:, 2]).all()


@pytest.mark.parametrize("quarters", [1, 3])
def test_in_a_picture_turned_by_a_quarter_a_box_is_as_high_as_the_target_is_wide(
    quarters: int,
) -> None:
    camera, states = rolled(CAMERAS[0], quarters), places(4)
    found = TargetModel(HALF_EXTENTS, "box_and_width").expected(camera, states)
    rise = np.array([0.0, 0.0, HALF_EXTENTS[2]])
    head, foot = camera.project(states + rise)[0], camera.project(states - rise)[0]
    along = np.abs(head[:, 0] - foot[:, 0])
    share = HALF_EXTENTS[:2].mean() / HALF_EXTENTS[2]
    sideways = along * share > np.abs(head[:, 1] - foot[:, 1])
    assert sideways.mean() > 0.8, "of those at the picture's edge the axis leans"
    sizes = found.boxes[sideways, 2:] - found.boxes[sideways, :2]
    assert_allclose(sizes[:, 0], along[sideways])
    assert_allclose(sizes[:, 1], share * along[sideways])
    middles = (found.boxes[:, :2] + found.boxes[:, 2:]) / 2.0
    assert_allclose(middles, (head + foot) / 2.0)


def test_beyond_the_edge_a_box_ends_and_tells_nothing() -> None:
    camera = look_at("low", (0.0, -2.0, 1.0), (0.0, 0.0, 1.0), focal=600.0, image_size=(800, 600))
    near = TargetModel(HALF_EXTENTS, "box").expected(camera, np.array([[0.0, -0.8, 0.85]]))
    assert near.boxes[0, 1] < 0.0
    assert near.boxes[0, 3] > 600.0
    assert_allclose(near.values[0, 1:], [0.0, 599.0])
    assert not near.jacobians[0, 1:].any()
    assert near.jacobians[0, 0].any()


@every_kind
def test_boxes_become_measurements_with_their_noise(kind: MeasurementKind) -> None:
    boxes = np.array([[100.0, 80.0, 10.0, 30.0], [50.0, 60.0, 7.0, 20.0]])
    sigmas = np.array([[1.0, 2.0, 3.0, 4.0], [0.5, 0.6, 0.7, 0.8]])
    view = ViewResult.of_boxes(boxes, np.ones(2), sigmas)
    values, noises = TargetModel(HALF_EXTENTS, kind).measured(view.boxes, view.sigmas, 2.0)
    rows = {
        "centre": [100.0, 80.0],
        "box": [100.0, 50.0, 110.0],
        "box_and_width": [100.0, 50.0, 110.0, 20.0],
    }[kind]
    assert_allclose(values[0], rows)
    # by drawing: the same linear map of noisy boxes
    draws = np.random.default_rng(0).normal(size=(200_000, 4)) * 2.0 * sigmas[0] + boxes[0]
    many = ViewResult.of_boxes(draws, np.ones(len(draws)), np.ones_like(draws))
    drawn, _ = TargetModel(HALF_EXTENTS, kind).measured(many.boxes, many.sigmas, 1.0)
    assert_allclose(noises[0], np.cov(drawn.T), rtol=0.03, atol=1.0)
    empty = ViewResult.of_boxes(np.zeros((0, 4)), np.zeros(0), np.zeros((0, 4)))
    values, noises = TargetModel(HALF_EXTENTS, kind).measured(empty.boxes, empty.sigmas, 1.0)
    assert values.shape == (0, SIZES[kind])
    assert noises.shape == (0, SIZES[kind], SIZES[kind])


NEAR = look_at(
    "near", (0.0, -2.0, 2.2), (0.0, 0.0, 0.6), focal=700.0, image_size=(1920, 1080),
    distortion=BARREL,
)  # fmt: skip


def update(
    kind: UpdateKind, mean: ndarray, covariance: ndarray, z: ndarray, noise: ndarray
) -> tuple[ndarray, ndarray]:
    """One Gaussian updated by one box."""
    model = TargetModel(HALF_EXTENTS, "box", kind)
    expected = model.expected(NEAR, mean[None], covariance[None])
    found = kalman.kalman_pairs(
        mean[None],
        covariance[None],
        expected.expected,
        Measurements(z[None], noise[None]),
        np.inf,
    )
    return found.means[0], found.covariances[0]


def particles(
    mean: ndarray, covariance: ndarray, z: ndarray, noise: ndarray, rng: np.random.Generator
) -> tuple[ndarray, ndarray]:
    """Mean and covariance of the posterior by weighted draws."""
    draws = rng.multivariate_normal(mean, covariance, 8_000)
    expected = TargetModel(HALF_EXTENTS, "box").expected(NEAR, draws)
    off = z - expected.values
    distance = np.einsum("na,ab,nb->n", off, np.linalg.inv(noise), off)
    weights = np.exp(-distance / 2.0) * expected.valid
    weights /= weights.sum()
    centre = weights @ draws
    return centre, (draws - centre).T @ ((draws - centre) * weights[:, None])


def divergence(found: tuple[ndarray, ndarray], reference: tuple[ndarray, ndarray]) -> float:
    """Kullback-Leibler divergence of the reference from what was found, both as Gaussians."""
    precision = np.linalg.inv(found[1])
    off = found[0] - reference[0]
    return (
        float(
            np.trace(precision @ reference[1])
            + off @ precision @ off
            - 3.0
            + np.linalg.slogdet(found[1])[1]
            - np.linalg.slogdet(reference[1])[1]
        )
        / 2.0
    )


def against_particles(distance: float, sigma: float) -> ndarray:
    """Mean error and divergence of both updates, as medians over twenty boxes: (2, 2)."""
    rng = np.random.default_rng(11)
    mean = np.array([0.2, -2.0 + distance, 0.85])
    covariance = np.diag([sigma, sigma, 0.2 * sigma + 0.02]) ** 2
    rows = []
    while len(rows) < 20:
        truth = rng.multivariate_normal(mean, covariance)
        expected = TargetModel(HALF_EXTENTS, "box").expected(NEAR, truth[None])
        if not expected.valid[0]:
            continue
        half = (expected.boxes[0, 3] - expected.boxes[0, 1]) / 2.0
        noise = np.diag([0.08, 0.14, 0.14]) ** 2 * half**2
        z = rng.multivariate_normal(expected.values[0], noise)
        reference = particles(mean, covariance, z, noise, rng)
        kinds: tuple[UpdateKind, UpdateKind] = ("extended", "unscented")
        found = [update(kind, mean, covariance, z, noise) for kind in kinds]
        rows.append(
            [[np.linalg.norm(f[0] - reference[0]), divergence(f, reference)] for f in found]
        )
    return np.median(rows, axis=0)


def test_of_a_newcomer_the_unscented_update_is_nearer_to_the_particles() -> None:
    extended, unscented = against_particles(3.0, 0.4)
    assert unscented[0] < extended[0]
    assert unscented[1] < extended[1]
    assert extended[0] < 0.08, "and the extended one is not far off"


def test_of_a_person_who_is_followed_both_updates_agree_with_the_particles() -> None:
    for distance in (1.2, 5.0):
        extended, unscented = against_particles(distance, 0.08)
        assert max(extended[0], unscented[0]) < 0.005
        assert max(extended[1], unscented[1]) < 0.02


def test_where_a_point_falls_behind_the_lens_the_straight_line_stays() -> None:
    mean = np.array([[0.0, -1.2, 0.85]])
    covariance = np.eye(3)[None] * 0.8**2
    straight = TargetModel(HALF_EXTENTS, "box").expected(NEAR, mean, covariance)
    bent = TargetModel(HALF_EXTENTS, "box", "unscented").expected(NEAR, mean, covariance)
    assert_allclose(bent.values, straight.values)
    assert_allclose(bent.jacobians, straight.jacobians)
    assert not bent.spreads.any()


@pytest.mark.parametrize("kind", ["box", "box_and_width"])
def test_who_lies_or_bends_has_a_low_and_broad_box(kind: MeasurementKind) -> None:
    # a box of half the height and a width of 1.2 half heights, loosely: what a person gives on
    # average over the sides from which he may be seen
    states = np.array([[0.3, 0.4, 0.3, 0.0, 0.0, 0.0], [-0.5, 1.0, 0.25, 0.0, 0.0, 0.0]])
    expected = TargetModel(HALF_EXTENTS, kind, posture_share=0.2).expected(NEAR, states)
    low = expected.expected
    assert low.posture_share == 0.2
    heights = expected.boxes[:, 3] - expected.boxes[:, 1]
    flat = TargetModel(HALF_EXTENTS * [1.0, 1.0, 0.5], kind).expected(NEAR, states)
    assert_allclose(low.posture_values[:, :3], flat.values[:, :3])
    assert_allclose(low.posture_jacobians[:, :3], flat.jacobians[:, :3])
    spreads = low.posture_spreads
    assert_allclose(np.sqrt(spreads[:, 0, 0]), 0.15 * heights / 2.0)
    assert (spreads[:, 1, 1] > spreads[:, 0, 0]).all()
    assert np.linalg.eigvalsh(spreads).min() > 0.0
    assert_allclose(
        np.flatnonzero(low.posture_drift), [2 * 6 + 2], err_msg="only the height may jump"
    )
    if kind == "box_and_width":
        values = low.posture_values
        assert_allclose(values[:, 3] / (values[:, 2] - values[:, 1]), 1.2)


def test_a_centre_looks_the_same_in_any_posture_and_behind_the_lens_there_is_none() -> None:
    states = np.array([[0.3, 0.4, 0.85], [0.0, -3.0, 0.85]])
    for model in (
        TargetModel(HALF_EXTENTS, "centre", posture_share=0.2),
        TargetModel(HALF_EXTENTS, "box"),
    ):
        one = model.expected(NEAR, states).expected
        assert len(one.values) == 2
        assert (
            len(one.posture_values) == len(one.posture_jacobians) == len(one.posture_spreads) == 0
        )
    low = TargetModel(HALF_EXTENTS, "box", posture_share=0.2).expected(NEAR, states).expected
    assert np.isfinite(low.posture_values[0]).all()
    assert np.isinf(low.posture_values[1]).all(), "beyond every gate"


def test_nobody_has_no_box() -> None:
    for update_kind in ("extended", "unscented"):
        model = TargetModel(HALF_EXTENTS, "box", update_kind, 0.1)  # type: ignore[arg-type]
        found = model.expected(NEAR, np.zeros((0, 6)), np.zeros((0, 6, 6)))
        assert found.values.shape == (0, 3)
        assert found.jacobians.shape == (0, 3, 6)
        assert found.boxes.shape == (0, 4)
