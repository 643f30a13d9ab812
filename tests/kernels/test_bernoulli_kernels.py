"""The compiled step of one camera against its parts, called one by one; and who is a duplicate."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.engine.synthetic import CAMERAS, people
from tracker.filters import phd, pmb
from tracker.fusion.target_model import TargetModel
from tracker.fusion.visibility import inside_probability, visibility
from tracker.kernels import linear_algebra
from tracker.kernels.gating import Measurements
from tracker.kernels.labelled import camera_update
from tracker.kernels.labelled.camera_update import CameraRule, Tracks
from tracker.kernels.measurement import ExpectedBoxes

CLUTTER, GATE, P_D, NEAR, STRENGTH, TOLD = 1e-6, 30.0, 0.9, 0.3, 0.8, 0.01


@pytest.mark.parametrize("update", ["extended", "unscented"])
@pytest.mark.parametrize(("tracks", "unseen"), [(4, 2), (0, 3), (5, 0)])
@pytest.mark.parametrize("posture_share", [0.0, 0.1])
def test_one_call_is_all_its_parts(
    update: str, tracks: int, unseen: int, posture_share: float
) -> None:
    rng = np.random.default_rng(tracks)
    camera = CAMERAS[0]
    model = TargetModel(np.array([0.3, 0.3, 0.84]), "box", update, posture_share)  # type: ignore[arg-type]
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
    updated_at_once = camera_update.update_by_camera(
        undetected.gaussians,
        Tracks(known.weights, known.means, known.covariances, known.labels),
        occluding,
        Measurements(boxes, noises),
        ExpectedBoxes(expected.expected, expected.boxes, expected.depths, expected.valid),
        camera.calibration.image_size,
        np.full(len(boxes), CLUTTER),
        np.ones((0, len(boxes))),
        CameraRule(GATE, True, P_D, 0.5, NEAR, STRENGTH, 0.2, 1e-6, 200, TOLD),
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
