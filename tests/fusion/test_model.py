"""What the fusion methods share: gate, clutter, births, the target's box, who sees it, heights."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import logit, logsumexp
from scipy.stats import multivariate_normal, norm

from tests import world
from tests.fusion.rooms import (
    CAMERAS,
    HALF_EXTENTS,
    NO_BOXES,
    ROOM,
    births,
    empty_room,
    evidence,
    filtered,
)
from tests.random_rooms import looking_camera
from tests.world import BARREL, look_at
from tracker.filters import models
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.measurement_births import Newborns
from tracker.fusion.model import FusionModel
from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.fusion.target_model import (
    SIZES,
    HeightBounds,
    MeasurementKind,
    TargetModel,
    UpdateKind,
    inside_probability,
    visibility,
)
from tracker.geometry.camera import Camera
from tracker.kernels import kalman
from tracker.kernels.boxes import Hidden
from tracker.kernels.kalman import Measurements
from tracker.kernels.measurement import ExpectedBoxes
from tracker.parameters.groups.fusion import FusionParams
from tracker.single_view.protocol import ViewResult

KINDS: Many[MeasurementKind] = ("centre", "box", "box_and_width")
every_kind = pytest.mark.parametrize("kind", KINDS)


def model(fps: float = 10.0, **changes: object) -> FusionModel:
    """Of the room with a door and four cameras."""
    return FusionModel(empty_room(fps), FusionParams().model_copy(update=changes))


@every_kind
def test_the_gate_holds_the_share_of_true_boxes_that_it_promises(
    kind: MeasurementKind,
) -> None:
    made, probability = model(measurement=kind), FusionParams.gate_probability
    innovations = np.random.default_rng(0).standard_normal((200_000, SIZES[kind]))
    share = float(((innovations**2).sum(axis=1) <= made.gate).mean())
    assert share == pytest.approx(probability, abs=4.0 * np.sqrt((1.0 - probability) / 200_000))


@every_kind
def test_clutter_is_spread_over_the_whole_measurement_space(kind: MeasurementKind) -> None:
    room = empty_room(10.0)
    found = model(measurement=kind, clutter_rate=3.0).clutter
    for camera, clutter in zip(room.cameras, found, strict=True):
        volume = models.visible_area(camera, room.room)
        width, height = camera.image_size
        volume *= {2: 1.0, 3: height / 2.0, 4: height / 2.0 * width / 2.0}[SIZES[kind]]
        assert clutter * volume == pytest.approx(3.0), "as many false boxes a picture as are said"


@pytest.mark.parametrize("fps", [5.0, 25.0])
def test_newcomers_are_expected_by_the_second(fps: float) -> None:
    made = model(fps, birth_rate=0.05)
    assert made.births.cardinality * fps == pytest.approx(0.05 * len(made.room.entrances))


def test_two_within_a_share_of_a_persons_width_are_one_unless_each_has_a_box() -> None:
    made = model(duplicate_distance=0.5)
    width = 2.0 * float(HALF_EXTENTS[:2].mean())
    nobodys, their_own = np.full((4, 2), -1), np.array([[-1, -1], [3, 4], [0, -1], [2, 2]])
    height = 2.0 * float(HALF_EXTENTS[2])
    for apart, above, sources, duplicate in (
        (0.49 * width, 0.0, nobodys, True),
        (0.51 * width, 0.0, nobodys, False),
        (0.49 * width, 0.0, their_own, False),  # the second camera gave each a box
        (0.24 * width, 0.0, their_own, True),  # but two people cannot stand in one place
        (0.24 * width, 0.9 * height, their_own, True),  # with one box drawn higher, too
        (0.24 * width, 1.1 * height, their_own, False),  # unless one is above the other
        (0.26 * width, 0.2 * height, their_own, False),
    ):
        means = np.array([[0.0, 0.0, 0.85], [apart, 0.0, 0.85 + above]])
        found = made.duplicates(means, np.array([0.9, 0.9]), np.array([1, 2]), sources)
        assert found.tolist() == [False, duplicate]


def test_the_middle_of_who_lies_is_the_lowest_and_who_stands_on_the_floor_is_free() -> None:
    low = model(posture_share=0.1).heights
    assert low is not None
    assert low.low == pytest.approx(FusionParams().posture_height * HALF_EXTENTS[2])
    assert low.high == pytest.approx(2.2 - low.low)
    assert model(posture_share=0.0).heights is None


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


@pytest.mark.parametrize(("height", "sigma"), [(0.05, 0.03), (1.0, 0.03), (0.05, 0.0)])
def test_a_certain_height_stays_beyond_the_bounds_and_between_them(
    height: float, sigma: float
) -> None:
    """Somebody lies on the floor, and several cameras see it."""
    before = track(height, sigma)
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


BIRTH_RATE, P_D = 0.005, 0.95


def seen(places: ndarray, clutter: float = 0.0, seed: int = 0) -> tuple[ViewResult, ...]:
    """One step's boxes of people at some places, each side known to three pixels."""
    rng = np.random.default_rng(seed)
    return world.views(world.boxes(CAMERAS, places[None], 3.0, rng, clutter=clutter))[0]


def proposed(newborns: Newborns | None) -> Newborns:
    assert newborns is not None
    return newborns


@pytest.mark.parametrize("kind", ["centre", "box"])
def test_people_are_found_where_they_stand(kind: MeasurementKind) -> None:
    places = np.array([[0.5, -0.8, 0.85], [-1.2, 1.0, 0.85]])
    found = proposed(births(kind).propose(evidence(seen(places), kind)))
    sure = found.take(np.flatnonzero(found.existences > 0.9))
    order = np.argsort(-sure.positions[:, 0])
    assert_allclose(sure.positions[order], places, atol=0.12)
    assert (sure.sources >= 0).sum(axis=0).tolist() == [4, 4]
    sigmas = np.sqrt(np.diagonal(sure.covariances, axis1=1, axis2=2))
    assert (np.abs(sure.positions[order] - places) < 5.0 * sigmas[order]).all()


@pytest.mark.parametrize("kind", ["centre", "box"])
@pytest.mark.parametrize("missing", [None, 1, 2])
def test_the_odds_are_the_integral_over_the_room(
    kind: MeasurementKind, missing: int | None
) -> None:
    """Λ by importance sampling, term by term as the class says it."""
    views = tuple(
        NO_BOXES if c == missing else view
        for c, view in enumerate(seen(np.array([[0.5, -0.3, 0.85]]), seed=3))
    )
    found = proposed(births(kind).propose(evidence(views, kind))).take(np.array([0]))
    assert (found.sources[:, 0] >= 0).tolist() == [c != missing for c in range(4)]

    proposal = multivariate_normal(found.positions[0], 2.0 * found.covariances[0], seed=1)
    places = np.atleast_2d(proposal.rvs(4_000))
    model = TargetModel(HALF_EXTENTS, kind)
    log_terms = np.full(len(places), np.log(BIRTH_RATE / np.prod(ROOM.maximum - ROOM.minimum)))
    for camera, view in zip(CAMERAS, views, strict=True):
        if not len(view.boxes):
            log_terms += np.log(1.0 - P_D)
            continue
        (value,), (noise,) = model.measured(view.boxes, view.sigmas, 1.0)
        residuals = model.expected(camera, places).values - value
        density = multivariate_normal(np.zeros(len(value)), noise).logpdf(residuals)
        log_terms += np.log(P_D) + density - np.log(1e-8 if kind != "centre" else 1e-6)
    log_odds = logsumexp(log_terms - proposal.logpdf(places)) - np.log(len(places))
    assert logit(found.existences[0]) == pytest.approx(log_odds, abs=0.1)


def test_what_a_box_looks_like_adds_to_the_odds() -> None:
    views = seen(np.array([[0.5, -0.3, 0.85]]), seed=3)
    before = proposed(births().propose(evidence(views))).take(np.array([0]))
    told = [1.5, -4.0, 0.0, -2.0]
    looks = tuple(
        replace(view, log_ratios=np.full(len(view.boxes), ratio))
        for view, ratio in zip(views, told, strict=True)
    )
    after = proposed(births().propose(evidence(looks))).take(np.array([0]))
    assert after.sources.tolist() == before.sources.tolist()
    change = logit(after.existences[0]) - logit(before.existences[0])
    assert change == pytest.approx(sum(told), abs=0.02)  # but for what misses have in Λ


def test_no_box_is_used_twice() -> None:
    rng = np.random.default_rng(1)
    for seed in range(10):
        places = np.append(rng.uniform(-2, 2, (5, 2)), np.full((5, 1), 0.85), axis=1)
        found = proposed(births().propose(evidence(seen(places, 2.0, seed))))
        for row in found.sources:
            used = row[row >= 0]
            assert len(set(used.tolist())) == len(used)
        assert (np.diff(found.existences) <= 0.0).all(), "the surest first"


def test_the_more_cameras_agree_the_surer() -> None:
    views = seen(np.array([[0.3, 0.2, 0.85]]))
    odds = []
    for count in (2, 3, 4):
        some = tuple(view if c < count else NO_BOXES for c, view in enumerate(views))
        found = proposed(births().propose(evidence(some)))
        odds.append(found.existences[0] / (1.0 - found.existences[0] + 1e-15))
    assert odds[0] < odds[1] < odds[2]


def test_a_box_that_somebody_made_is_no_source_of_a_newcomer() -> None:
    mixed = evidence(seen(np.array([[0.5, -0.8, 0.85]])))
    mixed.unexplained[mixed.starts[2]] = 0.0
    found = proposed(births().propose(mixed))
    assert found.sources[:, 0].tolist() == [0, 0, -1, 0]
