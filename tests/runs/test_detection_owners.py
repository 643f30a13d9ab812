"""Whose detections are: inside the reported gate are exactly those that the filter associates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests import world
from tracker.fusion.model import FusionModel
from tracker.kernels.kalman import kalman_pairs
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.detection_owners import DetectionOwners, detection_owners
from tracker.runs.run import Run

STEP = 15


def tracked(**fusion: object) -> Run:
    """A run with two people in three cameras."""
    paths = world.together(
        world.walk([(-1, 0), (1, 0.3)], [0, 2], 10), world.walk([(1, 1), (-1, 1)], [0, 2], 10)
    )
    cameras = world.ring(3)
    seen = world.boxes(cameras, paths, sigma=1.5, rng=np.random.default_rng(0))
    sequence = world.sequence(cameras, paths, seen)
    changes = {f"fusion.{name}": value for name, value in fusion.items()}
    chosen = with_values(pipeline.default_parameters(sequence), changes)
    return pipeline.compute(sequence, chosen)


def with_detections(run: Run, boxes: np.ndarray) -> list[DetectionOwners]:
    """The owners at the step if every camera had these detections as well, associated with none."""
    before = run.views
    views = tuple(
        replace(view, measurements=boxes, measurement_scores=np.ones(len(boxes)))
        for view in before[STEP]
    )
    run.views = before.alike([*before[:STEP], views, *before[STEP + 1 :]])
    found = detection_owners(run, STEP)
    run.views = before
    return found


@pytest.mark.parametrize("postures", [0.0, 0.1])
@pytest.mark.parametrize("update", ["extended", "unscented"])
def test_a_detection_is_inside_the_gate_if_and_only_if_the_filter_associates_it(
    postures: float, update: str
) -> None:
    run = tracked(posture_share=postures, update=update)
    model, rng = FusionModel(run.sequence, run.parameters.fusion), np.random.default_rng(1)
    rows = run.tracks.at(STEP)
    components = run.tracks.components[rows]
    posterior = run.fused[STEP].posterior.take(components)
    assert posterior.size == 2
    result = run.fused[STEP]
    unseen = replace(result, sources=np.full_like(result.sources, -1))
    run.fused = run.fused.alike([*run.fused[:STEP], unseen, *run.fused[STEP + 1 :]])
    inside = 0
    for index, camera in enumerate(run.sequence.cameras):
        around = model.target.expected(camera, posterior.means).boxes[rng.integers(0, 2, 200)]
        centres, halves = (around[:, :2] + around[:, 2:]) / 2, (around[:, 2:] - around[:, :2]) / 2
        boxes = np.column_stack([centres, halves * rng.uniform(0.8, 1.2, (200, 2))])
        boxes[:, :2] += rng.normal(size=(200, 2)) * rng.uniform(0.0, 200.0, (200, 1))
        owners = with_detections(run, boxes)[index]
        view = run.views[STEP][index]
        sigmas = np.repeat(view.sigmas.mean(axis=0, keepdims=True), 200, axis=0)
        pairs = kalman_pairs(
            posterior.means,
            posterior.covariances,
            model.expected(index, posterior).expected,
            model.target.measured(boxes, sigmas, run.parameters.fusion.measurement_sigma),
            model.gate,
        )
        near = np.isin(np.arange(200), pairs.measured)
        assert np.array_equal(owners.distances <= owners.gate, near)
        assert set(owners.nearest) == set(run.tracks.ids[rows])
        assert (owners.tracks == -1).all()
        assert owners.gate**2 == pytest.approx(model.gate)
        inside += int(near.sum())
    assert 60 < inside < 590


def test_a_detection_that_overlaps_the_box_of_a_track_by_half_is_the_tracks() -> None:
    run = tracked()
    rows, result = run.tracks.at(STEP), run.fused[STEP]
    component = int(run.tracks.components[rows][0])
    source = int(result.sources[0, component])
    assert source >= 0
    box = run.views[STEP][0].boxes[source]
    shifts = np.array([0.0, 0.6, 0.8, 1.4])  # of the width: 1 / 1, 0.7 / 1.3, 0.6 / 1.4, 0.3 / 1.7
    beside = box + np.outer(shifts * box[2], [1.0, 0.0, 0.0, 0.0])
    owners = with_detections(run, beside)[0]
    assert owners.tracks.tolist()[:2] == [run.tracks.ids[rows][0]] * 2
    assert owners.tracks.tolist()[2:] == [-1, -1]
    # one that is a track's has no nearest one
    assert (owners.nearest >= 0).tolist() == [False, False, True, True]
    assert np.isfinite(owners.distances).tolist() == [False, False, True, True]


def test_without_tracks_no_detection_has_a_nearest_one() -> None:
    run = tracked()
    run.tracks = run.tracks.take(run.tracks.frames != STEP)
    for owners in with_detections(run, np.array([[300.0, 200.0, 20.0, 50.0]])):
        assert owners.nearest.tolist() == owners.tracks.tolist() == [-1]
    assert all(len(owners.tracks) == 0 for owners in with_detections(run, np.zeros((0, 4))))
