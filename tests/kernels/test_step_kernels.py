"""The compiled steps of one camera and of all against their parts, and against plain NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.world import PERSON, boxes, gaussians, ring, views
from tracker.filters import association, gaussian_mixture, phd, pmb
from tracker.filters.gaussian_mixture import GaussianMixture, concatenate
from tracker.fusion.target_model import MeasurementKind, TargetModel, inside_probability, visibility
from tracker.geometry.camera import stacked
from tracker.kernels import bernoulli, labelled, linear_algebra
from tracker.kernels import bernoulli as marginal_kernels
from tracker.kernels import births as birth_kernels
from tracker.kernels.association import Convergence
from tracker.kernels.bernoulli import LabelledWeights, PairOdds
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.labelled import CameraRule, Tracks
from tracker.kernels.measurement import ExpectedBoxes

CAMERAS = ring(3)
CLUTTER = np.array([1e-6, 3e-6, 2e-6])
GATE, P_D, P_S, CONFIRMED, STRENGTH, NEAR, COVERED = 30.0, 0.9, 0.98, 0.5, 0.8, 0.3, 0.2
TOLD, LEAST, FACTOR = 0.01, 1e-4, 1.3
RULE = CameraRule(
    gate=GATE,
    soft=True,
    detection_probability=P_D,
    confirmed=CONFIRMED,
    near=NEAR,
    strength=STRENGTH,
    reporting_share=COVERED,
    tolerance=1e-6,
    iterations=200,
    reporting_threshold=TOLD,
)
TRANSITION = np.eye(6) + 0.1 * np.eye(6, k=3)
NOISE = np.diag([1e-3, 1e-3, 1e-4, 0.01, 0.01, 1e-3])


def seen(
    model: TargetModel, places: ndarray, rng: np.random.Generator
) -> tuple[list[ndarray], list[ndarray]]:
    """In each camera the boxes of all places, blurred, and one of nobody; σ of each."""
    boxes = []
    for camera in CAMERAS:
        corners = model.expected(camera, places).boxes
        middles, halves = (
            (corners[:, :2] + corners[:, 2:]) / 2,
            (corners[:, 2:] - corners[:, :2]) / 2,
        )
        whole = np.concatenate([middles, halves], axis=1)
        whole += rng.normal(0.0, 2.0, whole.shape)
        boxes.append(np.concatenate([whole, whole[:1] + 25.0]))
    return boxes, [np.full((len(one), 4), 3.0) for one in boxes]


def one_by_one(
    model: TargetModel,
    tracks: GaussianMixture,
    undetected: GaussianMixture,
    births: GaussianMixture,
    boxes: list[ndarray],
    sigmas: list[ndarray],
    next_label: int,
) -> dict[str, Any]:
    """The same step in Python, camera after camera."""
    tracks = gaussian_mixture.predict(tracks, TRANSITION, NOISE, P_S)
    unseen = concatenate([gaussian_mixture.predict(undetected, TRANSITION, NOISE, P_S), births])
    occluding = np.where(tracks.weights > CONFIRMED, tracks.weights, 0.0)
    columns: dict[str, list[ndarray]] = {name: [] for name in ("p_d", "by", "best", "share")}
    told, unexplained = [], []
    for c, camera in enumerate(CAMERAS):
        transform, _ = model.transforms
        values = boxes[c] @ transform.T
        noises = np.einsum("pa,ma,qa->mpq", transform, (FACTOR * sigmas[c]) ** 2, transform)
        expected = model.expected(
            camera,
            np.concatenate([unseen.means, tracks.means]),
            np.concatenate([unseen.covariances, tracks.covariances]),
        )
        found = labelled.update_by_camera(
            unseen.gaussians,
            Tracks(tracks.weights, tracks.means, tracks.covariances, tracks.labels),
            occluding,
            Measurements(values, noises),
            expected,
            camera.calibration.image_size,
            np.full(len(values), CLUTTER[c]),
            np.ones((0, len(values))),
            RULE,
        )
        p_d, by, best, share = found.record
        newcomer, born_means, born_covariances = found.newcomers
        who, what, chance = found.pairs
        free = found.unexplained
        born = np.flatnonzero(free * newcomer > LEAST)
        labels = next_label + np.arange(len(born))
        next_label += len(born)
        told += zip([c] * len(who), tracks.labels[who], what, chance, strict=True)
        told += [
            (c, label, z, free[z] * newcomer[z])
            for label, z in zip(labels, born, strict=True)
            if free[z] * newcomer[z] >= TOLD
        ]
        newborn = GaussianMixture(
            (free * newcomer)[born], born_means[born], born_covariances[born], labels
        )
        tracks = GaussianMixture(found.existences, found.means, found.covariances, tracks.labels)
        tracks = concatenate([tracks, newborn])
        occluding = np.append(occluding, np.zeros(len(born)))
        unseen = GaussianMixture(found.undetected, unseen.means, unseen.covariances, unseen.labels)
        for name, old, new in (
            ("p_d", p_d, np.full(len(born), P_D)),
            ("by", by, np.full(len(born), -1)),
            ("best", best, born),
            ("share", share, np.ones(len(born))),
        ):
            columns[name].append(np.append(old, new))
        unexplained.append(free)
    blank = {"p_d": 0.0, "by": -1, "best": -1, "share": 0.0}
    table = {
        name: np.array(
            [np.append(row, np.full(tracks.size - len(row), blank[name])) for row in rows]
        )
        for name, rows in columns.items()
    }
    return {
        "tracks": tracks, "unseen": unseen, "next": next_label, **table,
        "told": told, "free": np.concatenate(unexplained),
    }  # fmt: skip


@pytest.mark.parametrize("update", ["extended", "unscented"])
@pytest.mark.parametrize(("tracks", "unseen"), [(3, 2), (0, 2), (4, 0)])
@pytest.mark.parametrize("posture_share", [0.0, 0.1])
def test_one_call_is_all_cameras(
    update: Any, tracks: int, unseen: int, posture_share: float
) -> None:
    rng = np.random.default_rng(7 + tracks)
    model = TargetModel(PERSON, "box", update, posture_share)
    known, undetected, births = people(rng, tracks, 10), people(rng, unseen, 0), people(rng, 2, 0)
    births = GaussianMixture(np.full(2, 0.2), births.means, births.covariances, births.labels)
    places = np.concatenate([known.means, undetected.means, births.means[:1]])
    boxes, sigmas = seen(model, places, rng)
    starts = np.cumsum([0, *(len(one) for one in boxes)])
    transform, products = model.transforms
    found = labelled.predict_and_update(
        Tracks(known.weights, known.means, known.covariances, known.labels),
        20,
        undetected.gaussians,
        labelled.CameraBoxes(
            np.concatenate(boxes),
            np.concatenate(sigmas),
            starts,
            np.ones(starts[-1]),
            np.ones((0, starts[-1])),
        ),
        labelled.StepModel(
            transition=TRANSITION,
            motion_noise=NOISE[None],
            survival_probability=P_S,
            birth_weights=births.weights,
            birth_means=births.means,
            birth_covariances=births.covariances,
            transform=transform,
            products=products,
            sigma_factor=FACTOR,
            clutter=CLUTTER,
            least_existence=LEAST,
        ),
        model.target(6),
        stacked(CAMERAS),
        RULE,
    )
    wanted = one_by_one(model, known, undetected, births, boxes, sigmas, 20)
    assert len(found.existences) > tracks, "somebody is new"
    assert found.next_label == wanted["next"]
    assert_array_equal(found.labels, wanted["tracks"].labels)
    for one, other in (
        (found.existences, wanted["tracks"].weights),
        (found.means, wanted["tracks"].means),
        (found.covariances, wanted["tracks"].covariances),
        (found.undetected_weights, wanted["unseen"].weights),
        (found.undetected_means, wanted["unseen"].means),
        (found.undetected_covariances, wanted["unseen"].covariances),
        (found.detection_probabilities, wanted["p_d"]),
        (found.hidden_by, wanted["by"]),
        (found.sources, wanted["best"]),
        (found.shares, wanted["share"]),
        (found.unexplained, wanted["free"]),
        (
            np.column_stack(
                [found.pair_cameras, found.pair_labels, found.pair_boxes, found.pair_probabilities]
            ),
            np.array(wanted["told"]),
        ),
    ):
        assert_allclose(one, other, rtol=1e-8, atol=1e-10)
    assert_allclose(found.values, np.concatenate(boxes) @ transform.T, rtol=1e-12)
    assert found.noises.shape == (len(found.values), 3, 3)


def one_step(
    tracks: GaussianMixture,
    boxes: list[ndarray],
    *,
    unseen: float = 0.0,
    least: float = LEAST,
    survival: float = 1.0,
    **rule: float,
) -> labelled.StepResult:
    """A step of people who stand still, with somebody never yet detected in their midst."""
    model = TargetModel(PERSON, "box")
    transform, products = model.transforms
    whole = np.concatenate(boxes)
    undetected = gaussians(tracks.means[:1, :3], weights=unseen)
    found: labelled.StepResult = labelled.predict_and_update(
        Tracks(tracks.weights, tracks.means, tracks.covariances, tracks.labels), 50,
        undetected.gaussians,
        labelled.CameraBoxes(
            whole, np.full(whole.shape, 9.0), np.cumsum([0, *(len(one) for one in boxes)]),
            np.ones(len(whole)), np.ones((0, len(whole))),
        ),
        labelled.StepModel(
            transition=np.eye(6), motion_noise=1e-6 * np.eye(6)[None],
            survival_probability=survival, birth_weights=np.zeros(0),
            birth_means=np.zeros((0, 6)), birth_covariances=np.zeros((0, 6, 6)),
            transform=transform, products=products, sigma_factor=1.0,
            clutter=np.full(len(boxes), 1e-7), least_existence=least,
        ),
        model.target(6), stacked(CAMERAS[: len(boxes)]), RULE._replace(**rule),
    )  # fmt: skip
    return found


@pytest.mark.parametrize(
    ("existence", "survival", "hides"), [(0.5, 1.0, False), (0.501, 1.0, True), (0.9, 0.55, False)]
)
def test_who_hides_others_is_known_before_the_first_camera(
    existence: float, survival: float, hides: bool
) -> None:
    place = np.array([0.1, 0.2, 0.85])
    ahead = 0.2 * (CAMERAS[0].centre - place) * [1.0, 1.0, 0.0]
    pair = gaussians(np.array([place, place + ahead]), weights=np.array([0.9, existence]))
    found = one_step(pair, [np.zeros((0, 4))], survival=survival)
    assert found.hidden_by.tolist() == [[2 if hides else -1, -1]]


def test_a_track_begins_above_its_least_existence_and_is_a_pair_from_the_least_on() -> None:
    far = gaussians(np.array([[0.0, 0.0, 0.85]]), weights=1e-6)
    model = TargetModel(PERSON, "box")
    corners = model.expected(CAMERAS[0], far.means).boxes
    box = np.concatenate([corners[:, :2] + corners[:, 2:], corners[:, 2:] - corners[:, :2]], 1) / 2
    born = one_step(far, [box], unseen=0.3)
    assert born.labels.tolist() == [1, 50]
    assert born.next_label == 51
    assert born.sources[0, 1] == 0
    assert born.shares[0, 1] == 1.0
    existence = float(born.existences[1])
    for least, count in ((existence, 1), (np.nextafter(existence, 0.0), 2)):
        found = one_step(far, [box], unseen=0.3, least=least)
        assert len(found.existences) == count
        assert found.next_label == 49 + count
    for told, pairs in ((existence, [50]), (np.nextafter(existence, 1.0), [])):
        found = one_step(far, [box], unseen=0.3, reporting_threshold=told)
        assert found.pair_labels.tolist() == pairs
        assert found.pair_probabilities.tolist() == [existence] * len(pairs)


def test_of_many_pairs_none_is_lost() -> None:
    rng = np.random.default_rng(1)
    crowd = gaussians(np.array([0.1, 0.2, 0.85]) + rng.normal(0.0, 0.02, (8, 3)), weights=0.6)
    model = TargetModel(PERSON, "box")
    boxes = []
    for camera in CAMERAS[:2]:
        corners = model.expected(camera, crowd.means[:1]).boxes
        box = np.concatenate([corners[:, :2] + corners[:, 2:], corners[:, 2:] - corners[:, :2]], 1)
        boxes.append(box / 2.0 + rng.normal(0.0, 3.0, (10, 4)))
    found = one_step(crowd, boxes, reporting_threshold=0.0)
    table = np.zeros((2, 8, 10))
    table[found.pair_cameras, found.pair_labels - 1, found.pair_boxes] = found.pair_probabilities
    assert len(found.pair_labels) == np.count_nonzero(table) == table.size
    missed = 1.0 - table.sum(axis=2)
    likeliest = np.where(table.max(axis=2) > missed, table.argmax(axis=2), -1)
    assert_array_equal(found.sources, likeliest)
    places = np.lexsort((found.pair_boxes, found.pair_labels, found.pair_cameras))
    assert_array_equal(places, np.arange(table.size))


def test_the_kept_are_neither_faint_nor_strayed_nor_duplicates_nor_too_many() -> None:
    rng = np.random.default_rng(3)
    low, high = np.full(3, -1.0), np.full(3, 1.0)
    for _ in range(30):
        count = int(rng.integers(0, 12))
        means = rng.choice([-1.001, -1.0, -0.4, 0.3, 1.0, 1.001], (count, 6))
        existences = rng.choice([0.1, 0.2, 0.3, 0.6, 0.9], count)
        labels = rng.permutation(count)
        sources = rng.integers(-1, 3, (2, count))
        alive = [
            i for i in range(count) if existences[i] >= 0.2 and (np.abs(means[i, :3]) <= 1.0).all()
        ]
        order = np.array(sorted(alive, key=lambda i: -existences[i])[:5], dtype=np.int64)
        duplicate = linear_algebra.duplicates(
            means[order], existences[order], labels[order],
            np.ascontiguousarray(sources[:, order]), 0.8, 1.5, CONFIRMED,
        )  # fmt: skip
        found = labelled.kept_tracks(
            existences,
            means,
            labels,
            sources,
            labelled.KeepingRule(0.2, low, high, 5, 0.8, 1.5, CONFIRMED),
        )
        assert found.tolist() == order[~duplicate].tolist()


CAMERA = ring(1)[0]


def people(rng: np.random.Generator, count: int, first_label: int) -> GaussianMixture:
    """Anywhere in the room, known to some decimetres, of any existence."""
    places = rng.uniform([-1.2, -1.2, 0.8], [1.2, 1.2, 0.9], (count, 3))
    weights = rng.uniform(0.05, 1.0, count)
    return gaussians(places, weights=weights, sigma=0.15, first_label=first_label)


@pytest.mark.parametrize("update", ["extended", "unscented"])
@pytest.mark.parametrize(("tracks", "unseen"), [(4, 2), (0, 3), (5, 0)])
@pytest.mark.parametrize("posture_share", [0.0, 0.1])
def test_one_call_is_all_its_parts(
    update: str, tracks: int, unseen: int, posture_share: float
) -> None:
    rng = np.random.default_rng(tracks)
    camera = CAMERA
    model = TargetModel(PERSON, "box", update, posture_share)  # type: ignore[arg-type]
    known, undetected = people(rng, tracks, 10), people(rng, unseen, 0)
    truth = np.concatenate([known.means, undetected.means])
    boxes = model.expected(camera, truth).values + rng.normal(0.0, 2.0, (len(truth), 3))
    boxes = np.concatenate([boxes, boxes[:1] + 25.0])
    noises = np.tile(9.0 * np.eye(3), (len(boxes), 1, 1))
    occluding = np.where(known.weights > 0.5, known.weights, 0.0)
    expected = model.expected(
        camera,
        np.concatenate([undetected.means, known.means]),
        np.concatenate([undetected.covariances, known.covariances]),
    )
    updated_at_once = labelled.update_by_camera(
        undetected.gaussians,
        Tracks(known.weights, known.means, known.covariances, known.labels),
        occluding,
        Measurements(boxes, noises),
        expected,
        camera.calibration.image_size,
        np.full(len(boxes), CLUTTER[0]),
        np.ones((0, len(boxes))),
        RULE,
    )

    seen = model.expected(camera, undetected.means, undetected.covariances)
    new = phd.update(
        undetected,
        boxes,
        expected=seen.expected,
        noise=noises,
        detection_probability=P_D * inside_probability(camera, seen, undetected.covariances),
        clutter_intensity=CLUTTER[0],
        gate=GATE,
    )
    newcomer = np.minimum(new.measurement_weights, 1.0 - 1e-9)
    mine = model.expected(camera, known.means, known.covariances)
    hiding = np.flatnonzero(occluding > 0.5)
    hidden = visibility(
        P_D * inside_probability(camera, mine, known.covariances),
        mine,
        known,
        occluders=hiding,
        weights=occluding[hiding],
        strength=STRENGTH,
        near=NEAR,
    )
    updated = pmb.update(
        known,
        boxes,
        expected=mine.expected,
        noise=noises,
        detection_probability=hidden.detection_probabilities,
        unexplained_intensity=CLUTTER[0] / (1.0 - newcomer),
        gate=GATE,
    )
    marginals = updated.marginals
    pairs = slice(unseen, None)
    born = linear_algebra.merge_moments(
        new.posterior.weights[pairs],
        new.posterior.means[pairs],
        new.posterior.covariances[pairs],
        new.measurements[pairs],
        len(boxes),
    )
    best, share = np.full(tracks, -1), np.zeros(tracks)
    if tracks:
        most = marginals.detected.argmax(axis=1)
        share = marginals.detected[np.arange(tracks), most]
        best = np.where(share > marginals.missed, most, -1)
        share = np.where(share > marginals.missed, share, 0.0)
    who, what = np.nonzero(marginals.detected >= TOLD)
    wanted: tuple[ndarray, ...] = (
        *(updated.tracks.weights, updated.tracks.means, updated.tracks.covariances),
        *(hidden.detection_probabilities, hidden.hidden_by, best, share),
        *(
            new.posterior.weights[:unseen],
            newcomer,
            born.means,
            born.covariances,
            marginals.unexplained,
        ),
        *(who, what, marginals.detected[who, what]),
    )
    assert tracks == 0 or len(who)
    found = (
        *(updated_at_once.existences, updated_at_once.means, updated_at_once.covariances),
        *updated_at_once.record,
        *(updated_at_once.undetected, *updated_at_once.newcomers, updated_at_once.unexplained),
        *updated_at_once.pairs,
    )
    for one, other in zip(found, wanted, strict=True):
        assert one.shape == other.shape
        assert_allclose(one, other, rtol=1e-5, atol=1e-7)


def by_hand(
    existences: tuple[float, ...] = (0.8, 0.7),
    boxes: tuple[float, ...] = (0.0,),
    unseen: float = 0.0,
    clutter: float = 0.05,
    occluding: float = 0.9,
    **rule: float,
) -> labelled.CameraUpdate:
    """Two people in one place of the picture, the second nearer, and boxes so far aside."""
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    mixture = gaussians(places, weights=np.array(existences), speed_sigma=None)
    undetected = gaussians(np.zeros((1, 3)), weights=unseen, speed_sigma=None)
    slope = np.tile(np.eye(2, 3), (3, 1, 1))
    found: labelled.CameraUpdate = labelled.update_by_camera(
        undetected.gaussians,
        Tracks(mixture.weights, mixture.means, mixture.covariances, np.array([4, 6])),
        np.array([0.0, occluding]),
        Measurements(np.column_stack([boxes, np.zeros(len(boxes))]), np.eye(2)[None]),
        ExpectedBoxes(
            Expected.of(np.zeros((3, 2)), slope), np.tile([10.0, 10.0, 30.0, 50.0], (3, 1)),
            np.array([5.0, 4.0, 3.0]), np.ones(3, dtype=np.bool_),
        ),
        np.array([640.0, 480.0]),
        np.full(len(boxes), clutter),
        np.ones((0, len(boxes))),
        RULE._replace(**({"soft": False} | rule)),
    )  # fmt: skip
    return found


@pytest.mark.parametrize(
    ("occluding", "strength", "hidden"),
    [(0.5, 0.8, False), (0.501, 0.8, True), (0.9, 0.0, False), (0.9, 1e-9, True)],
)
def test_who_is_surer_than_the_threshold_hides_others(
    occluding: float, strength: float, hidden: bool
) -> None:
    found = by_hand(occluding=occluding, strength=strength).record
    assert found.hidden_by.tolist() == [6 if hidden else -1, -1]
    wanted = P_D * (1.0 - strength * occluding if hidden else 1.0)
    assert_allclose(found.detection_probabilities, [wanted, P_D])


def test_of_equal_boxes_the_first_is_the_likeliest_and_none_is_where_a_miss_is_likelier() -> None:
    found = by_hand(boxes=(0.1, 0.1), clutter=1e-3)
    assert found.record.sources.tolist() == [0, 0]
    assert_array_equal(found.record.shares, found.pairs.probabilities[[0, 2]])
    missed = by_hand(boxes=(3.0, 3.0), clutter=0.3)
    assert missed.record.sources.tolist() == [-1, -1]
    assert not missed.record.shares.any()


def test_pairs_are_returned_from_their_least_probability_on() -> None:
    everything = by_hand(boxes=(0.1, 2.0, 90.0), reporting_threshold=0.0).pairs
    assert everything.tracks.tolist() == [0, 0, 1, 1], "beyond the gate there is no pair"
    assert everything.boxes.tolist() == [0, 1, 0, 1]
    least = float(np.sort(everything.probabilities)[1])
    for bound, count in ((least, 3), (np.nextafter(least, 1.0), 2)):
        found = by_hand(boxes=(0.1, 2.0, 90.0), reporting_threshold=bound).pairs
        assert_array_equal(
            found.probabilities, everything.probabilities[everything.probabilities >= bound]
        )
        assert len(found.tracks) == len(found.boxes) == count


def test_a_box_that_nothing_else_explains_leaves_next_to_nothing_for_clutter() -> None:
    sure = by_hand(unseen=1.0, clutter=1e-200).newcomers
    assert sure.shares.tolist() == [1.0 - 1e-9]
    likely = by_hand(unseen=0.4, clutter=0.05).newcomers
    density = 1.0 / (2.0 * np.pi * 1.01)  # of N(0; 0, 0.1² + 1) in both axes
    assert likely.shares[0] == pytest.approx(0.36 * density / (0.36 * density + 0.05))


def test_a_track_that_must_have_been_seen_and_was_not_keeps_a_faint_existence() -> None:
    mixture = gaussians(np.zeros((1, 3)), weights=1.0, speed_sigma=None)
    found = bernoulli.bernoulli_update(
        mixture.gaussians, Expected.of(np.zeros((1, 2)), np.eye(2, 3)[None]),
        Measurements(np.zeros((0, 2)), np.eye(2)[None]), np.ones(1), np.zeros(0),
        np.ones((0, 0)), 9.0, Convergence(1e-6, 9),
    )  # fmt: skip
    assert found.existences.tolist() == [1e-12]
    assert_allclose(found.covariances, mixture.covariances)


def reference_duplicates(
    means: ndarray,
    weights: ndarray,
    labels: ndarray,
    sources: ndarray,
    near: float,
    height: float,
) -> ndarray:
    """The same rule over the whole table of pairs."""
    apart = means[:, None, :3] - means[None, :, :3]
    distances, on_floor = (apart**2).sum(axis=2), (apart[:, :, :2] ** 2).sum(axis=2)
    np.fill_diagonal(distances, np.inf)
    np.fill_diagonal(on_floor, np.inf)
    both = (sources[:, :, None] >= 0) & (sources[:, None, :] >= 0)
    parted = (both & (sources[:, :, None] != sources[:, None, :])).any(axis=0)
    sure = weights > 0.5
    older = labels[:, None] > labels[None, :]
    yields = np.where(sure[:, None] == sure[None, :], older, sure[None, :])
    in_one_place = (on_floor < (near / 2.0) ** 2) & (np.abs(apart[:, :, 2]) < height)
    one = in_one_place | ((distances < near**2) & ~parted)
    return np.asarray((one & yields).any(axis=1))


@pytest.mark.parametrize("count", [0, 1, 2, 12])
def test_duplicates_are_those_of_the_table_of_pairs(count: int) -> None:
    rng = np.random.default_rng(count)
    found = 0
    for _ in range(40):
        means = rng.uniform(0.0, 1.0, (count, 6))
        weights, labels = rng.uniform(0.0, 1.0, count), rng.permutation(count)
        sources = rng.integers(-1, 4, (3, count))
        given = means, weights, labels, sources, 0.5, 0.7
        duplicate = linear_algebra.duplicates(*given, 0.5)
        assert_array_equal(duplicate, reference_duplicates(*given))
        found += int(duplicate.sum())
    assert found > 0 or count < 2


seeds = st.integers(0, 10_000)


def reference_shares(
    weights: ndarray,
    labels: ndarray,
    p_d: ndarray,
    births: range,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    boxes: int,
) -> tuple[ndarray, ndarray]:
    """Label by label: the factors of the missed and the weights of the pairs."""
    names = sorted(set(labels.tolist()))
    people = [name for name in names if name not in births]
    scale = {name: 1.0 / max(weights[labels == name].sum(), 1.0) for name in names}
    missed = [
        max(1.0 - (weights * p_d)[labels == name].sum() * scale[name], 1e-9) for name in people
    ]
    odds = np.exp(np.minimum(log_odds, 600.0)) * [scale[labels[j]] for j in parents]
    table = np.array(
        [
            [odds[(labels[parents] == name) & (measured == z)].sum() for z in range(boxes)]
            for name in people
        ]
    ).reshape(len(people), boxes)
    born = np.isin(labels[parents], list(births))
    nobody = 1.0 + np.array([odds[born & (measured == z)].sum() for z in range(boxes)])
    found = association.marginals(np.array(missed), table, nobody)
    factors = np.array(
        [
            scale[name]
            * (
                found.missed[people.index(name)] / missed[people.index(name)]
                if name in people
                else 1
            )
            for name in labels.tolist()
        ]
    )
    shares = np.zeros(len(parents))
    for pair, (j, z) in enumerate(zip(parents, measured, strict=True)):
        if labels[j] in births:
            shares[pair] = odds[pair] * found.unexplained[z] / nobody[z]
        else:
            row = people.index(labels[j])
            shares[pair] = odds[pair] * found.detected[row, z] / table[row, z]
    return factors, shares


@given(seeds, st.integers(1, 8), st.integers(0, 5))
def test_shared_boxes(seed: int, size: int, boxes: int) -> None:
    rng = np.random.default_rng(seed)
    weights = rng.choice([0.01, 0.3, 0.7, 1.0], size)
    p_d = rng.choice([0.0, 0.5, 0.99, 1.0], size)
    labels, births = rng.integers(1, 7, size), range(4, 6)  # label 6 is a person's again
    pairs = [(j, z) for z in range(boxes) for j in range(size) if rng.random() < 0.7]
    parents = np.array([j for j, _ in pairs], dtype=np.int64)
    measured = np.array([z for _, z in pairs], dtype=np.int64)
    log_odds = rng.normal(0.0, 3.0, len(pairs))
    log_odds[rng.random(len(pairs)) < 0.1] = 650.0  # as good as certain
    factors, shares, known = marginal_kernels.share_boxes(
        LabelledWeights(weights, labels, p_d),
        births.start,
        births.stop,
        PairOdds(parents, measured, log_odds, boxes),
        600.0,
        association.CONVERGENCE,
    )
    expected = reference_shares(weights, labels, p_d, births, parents, measured, log_odds, boxes)
    assert_allclose(factors, expected[0], rtol=1e-9)
    assert_allclose(shares, expected[1], rtol=1e-9)
    assert_array_equal(known, ~np.isin(labels[parents], list(births)))


@given(seeds, st.lists(st.integers(0, 4), min_size=1, max_size=4))
def test_free_boxes_are_those_that_nobody_explains(seed: int, counts: list[int]) -> None:
    unexplained = np.random.default_rng(seed).choice([0.2, 0.5, 0.501, 0.9], sum(counts))
    starts = np.cumsum([0, *counts])
    free, begins, cameras = birth_kernels.free_boxes(unexplained, starts, 0.5)
    by_camera = [np.flatnonzero(part > 0.5) for part in np.split(unexplained, starts[1:-1])]
    assert_array_equal(free, np.flatnonzero(unexplained > 0.5))
    assert np.diff(begins).tolist() == [len(part) for part in by_camera]
    assert cameras == sum(len(part) > 0 for part in by_camera)


@given(seeds, st.integers(0, 4), st.integers(0, 4))
def test_rays_meet_where_two_lines_are_nearest(seed: int, first: int, second: int) -> None:
    rng = np.random.default_rng(seed)
    rays = rng.normal(size=(first + second, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    centres = rng.uniform(-2.0, 2.0, (2, 3))
    starts = np.array([0, first, first + second])
    points, gaps, pairs = birth_kernels.meeting_points(rays, starts, centres, 1.5)
    expected = []
    for i, u in enumerate(rays[:first]):
        for j, v in enumerate(rays[first:], first):
            along, _, _, _ = np.linalg.lstsq(
                np.stack([u, -v], axis=1), centres[1] - centres[0], rcond=None
            )
            on_a, on_b = centres[0] + along[0] * u, centres[1] + along[1] * v
            if (along > 0.1).all() and np.linalg.norm(on_a - on_b) < 1.5:
                expected.append((*(on_a + on_b) / 2.0, np.linalg.norm(on_a - on_b), i, j))
    found = np.column_stack([points, gaps, pairs])
    assert_allclose(found, np.array(expected).reshape(-1, 6), atol=1e-6)


@pytest.mark.parametrize(
    ("place", "largest_gap", "meets"),
    [
        # behind a lens or hardly ahead of it nobody stands, before either camera
        ((0.1, -1.0, 0.0), 1.0, False),
        ((0.101, -1.0, 0.0), 1.0, True),
        ((1.0, -0.1, 0.0), 1.0, False),
        ((1.0, -0.101, 0.0), 1.0, True),
        ((1.0, 1.0, 0.0), 1.0, False),
        # so far apart is too far
        ((1.0, -1.0, 0.5), 0.5, False),
        ((1.0, -1.0, -0.5), 0.501, True),
    ],
)
def test_rays_meet_ahead_of_both_lenses_and_close_by(
    place: tuple[float, ...], largest_gap: float, meets: bool
) -> None:
    rays, centres = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0.0] * 3, place])
    points, gaps, _ = birth_kernels.meeting_points(rays, np.arange(3), centres, largest_gap)
    assert gaps.tolist() == ([abs(place[2])] if meets else [])
    assert points.tolist() == ([[place[0], 0.0, place[2] / 2.0]] if meets else [])


def test_nearly_parallel_rays_meet_as_those_a_thousandth_apart_do() -> None:
    half = 2.5e-4  # so sin² of the angle between is a quarter of the millionth that counts
    rays = np.array([[np.cos(half), sign * np.sin(half), 0.0] for sign in (1.0, -1.0)])
    points, _, _ = birth_kernels.meeting_points(
        rays, np.arange(3), np.array([[0.0, 0.0, 0.0], [0.0, 0.001, 0.0]]), 9.0
    )
    # 0.001 / (2 sin ½α) = 2 m ahead, of which a quarter
    assert_allclose(points, [[0.5, 0.0005, 0.0]], rtol=1e-3)


UPDATE_CAMERAS = ring(4, 4.4)
NOTHING = 2
"""The camera that has no box."""

NO_PAIR = np.full((1, 2), -1)
"""A seed that was not found by two boxes."""


def seen_by(camera: int, model: TargetModel, places: ndarray) -> Any:
    """What a camera should measure of people."""
    return model.expected(UPDATE_CAMERAS[camera], places)


def reference_fit(
    start: ndarray,
    pair: list[tuple[int, int]],
    boxes: list[tuple[ndarray, ndarray, ndarray]],
    model: TargetModel,
    refinement: birth_kernels.Refinement,
) -> tuple[ndarray, ndarray, list[int]]:
    """Gauss-Newton of one place, with NumPy's inverse; first by a pair of cameras and boxes."""
    place, bound = start, np.eye(3) / refinement.start_sigma**2
    covariance, chosen = np.linalg.inv(bound), [-1] * len(boxes)
    for turn in range(refinement.passes + 1):
        information, pull = bound.copy(), bound @ start
        for c, (values, noises, free) in enumerate(boxes):
            expected = seen_by(c, model, place[None])
            slope, best, chosen[c] = expected.jacobians[0], refinement.gate, -1
            for box in (
                [one for camera, one in pair if camera == c] if turn == 0 else np.flatnonzero(free)
            ):
                residual = values[box] - expected.values[0]
                spread = noises[box] + slope @ covariance @ slope.T
                distance = residual @ np.linalg.inv(spread) @ residual
                if expected.valid[0] and distance <= best:
                    best, chosen[c] = distance, int(box)
            if chosen[c] >= 0:
                weight = slope.T @ np.linalg.inv(noises[chosen[c]])
                residual = values[chosen[c]] - expected.values[0]
                information = information + weight @ slope
                pull = pull + weight @ (residual + slope @ place)
        covariance = np.linalg.inv(information)
        place = covariance @ pull
    return place, covariance, chosen


@pytest.mark.parametrize("kind", ["centre", "box", "box_and_width"])
@pytest.mark.parametrize(("seed", "sigma", "passes"), [(0, 0.6, 3), (1, 1.0, 1), (2, 0.3, 2)])
def test_places_are_fitted_as_by_numpy(
    kind: MeasurementKind, seed: int, sigma: float, passes: int
) -> None:
    rng, model = np.random.default_rng(seed), TargetModel(PERSON, kind)
    people = np.append(rng.uniform(-1.8, 1.8, (4, 2)), np.full((4, 1), 0.85), axis=1)
    seen = boxes(
        UPDATE_CAMERAS,
        people[None],
        3.0,
        rng,
        clutter=2.0,
        hidden=lambda c, person, step: c == NOTHING,
    )
    measured = []
    for c, view in enumerate(views(seen, 4.0)[0]):
        values, noises = model.measured(view.boxes, view.sigmas, 1.0)
        noises = noises * rng.uniform(0.5, 2.0, (len(values), 1, 1))
        chosen = np.zeros(len(values)) if c == NOTHING else rng.random(len(values))
        measured.append((values, noises, chosen > 0.2))
    values, noises, free = (np.concatenate([one[k] for one in measured]) for k in range(3))
    starts = people[rng.integers(0, 4, 8)] + rng.normal(0.0, 0.3, (8, 3))
    starts[7] = np.add(UPDATE_CAMERAS[0].centre, [0.5, 0.0, 0.0])  # behind its lens
    counts = np.array([len(one[0]) for one in measured])
    pairs = [[(0, n % 3), (1, n % 4)] if n % 2 else [] for n in range(8)]
    if seed == 1:  # no box at all, rather than none that may be a newcomer's
        keep = np.repeat(np.arange(4), counts) != NOTHING
        values, noises, free = values[keep], noises[keep], free[keep]
        counts[NOTHING], measured[NOTHING] = 0, (values[:0], noises[:0], free[:0])
    refinement = birth_kernels.Refinement(start_sigma=sigma, passes=passes, gate=21.0)
    begins = np.cumsum([0, *counts])
    among_all = np.array(
        [[begins[camera] + box for camera, box in pair] or [-1, -1] for pair in pairs]
    )
    places, covariances, sources, fits = birth_kernels.fit_places(
        starts, among_all, Measurements(values, noises), free, begins, model.target(3),
        stacked(UPDATE_CAMERAS), refinement,
    )  # fmt: skip
    for n, start in enumerate(starts):
        place, covariance, chosen = reference_fit(start, pairs[n], measured, model, refinement)
        assert_allclose(places[n], place, atol=1e-7)
        assert_allclose(covariances[n], covariance, atol=1e-9)
        assert sources[:, n].tolist() == chosen
        for c, box in enumerate(chosen):
            if box < 0:
                assert fits[c, n] == 0.0
                continue
            residual = measured[c][0][box] - seen_by(c, model, place[None]).values[0]
            noise = measured[c][1][box]
            _, size = np.linalg.slogdet(2.0 * np.pi * noise)
            fit = -0.5 * (residual @ np.linalg.inv(noise) @ residual + size)
            assert fits[c, n] == pytest.approx(fit, abs=1e-6)
    assert (sources >= 0).sum() > 8


def fit_one(
    offsets: ndarray, noise: ndarray, sigma: float, gate: float, free: bool = True
) -> list[int]:
    """The box that a place in the middle of the room takes, of those so far off what it should be.

    Far off in the first camera's pixels; with ``sigma`` next to nothing the place is certain.
    """
    model, start = TargetModel(PERSON, "box"), np.array([[0.1, 0.2, 0.85]])
    expected = seen_by(0, model, start).values
    found = birth_kernels.fit_places(
        start, NO_PAIR, Measurements(expected + offsets, np.tile(noise, (len(offsets), 1, 1))),
        np.full(len(offsets), free), np.array([0, len(offsets)]), model.target(3),
        stacked(UPDATE_CAMERAS[:1]), birth_kernels.Refinement(sigma, 1, gate),
    )  # fmt: skip
    return [int(found.sources[0, 0])]


@pytest.mark.parametrize(("gate", "found"), [(15.999, -1), (16.0, 0), (16.001, 0)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_box_at_the_gate_is_within_and_of_two_as_near_the_first_counts(
    gate: float, found: int, axis: int
) -> None:
    offsets = 8.0 * np.array([1.0, -1.0])[:, None] * np.eye(3)[axis]
    assert fit_one(offsets, 4.0 * np.eye(3), 1e-12, gate) == [found]
    assert fit_one(offsets, 4.0 * np.eye(3), 1e-12, gate + 1.0, free=False) == [-1]
    nearer = np.concatenate([offsets, 0.5 * offsets])
    assert fit_one(nearer, 4.0 * np.eye(3), 1e-12, gate) == [2]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("share", "found"), [(0.8, 0), (1.25, -1)])
def test_a_place_too_uncertain_for_a_box_s_noise_takes_none(
    axis: int, share: float, found: int
) -> None:
    slope = seen_by(0, TargetModel(PERSON, "box"), np.array([[0.1, 0.2, 0.85]])).jacobians[0]
    own = np.diag(slope @ slope.T)
    noise = 2.0 * own / birth_kernels.STEEPEST
    noise[axis] = own[axis] / birth_kernels.STEEPEST / share
    assert fit_one(np.zeros((1, 3)), np.diag(noise), 1.0, 9.0) == [found]
