"""The compiled step over all cameras against one camera after another."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.kernels.test_bernoulli_kernels import people
from tests.world import PERSON, gaussians, ring
from tracker.filters import gaussian_mixture
from tracker.filters.gaussian_mixture import GaussianMixture, concatenate
from tracker.fusion.target_model import TargetModel
from tracker.geometry.camera import stacked
from tracker.kernels import labelled, linear_algebra
from tracker.kernels.kalman import Measurements
from tracker.kernels.labelled import CameraRule, Tracks

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
