"""The compiled step of one camera against its parts, called one by one; and who is a duplicate."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.world import PERSON, gaussians, ring
from tracker.filters import phd, pmb
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.target_model import TargetModel
from tracker.fusion.visibility import inside_probability, visibility
from tracker.kernels import bernoulli, labelled, linear_algebra
from tracker.kernels.association import Convergence
from tracker.kernels.kalman import Expected, Measurements
from tracker.kernels.labelled import CameraRule, Tracks
from tracker.kernels.measurement import ExpectedBoxes

CAMERA = ring(1)[0]
CLUTTER, GATE, P_D, NEAR, STRENGTH, TOLD = 1e-6, 30.0, 0.9, 0.3, 0.8, 0.01
RULE = CameraRule(GATE, True, P_D, 0.5, NEAR, STRENGTH, 0.2, 1e-6, 200, TOLD)


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
        np.full(len(boxes), CLUTTER),
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
        clutter_intensity=CLUTTER,
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
        unexplained_intensity=CLUTTER / (1.0 - newcomer),
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
