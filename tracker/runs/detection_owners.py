"""The tracks that a step's detections belong to, and the gates that the others are outside of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture, gate_distance
from tracker.fusion.target_model import TargetModel
from tracker.geometry.boxes import Boxes, box_overlaps
from tracker.geometry.camera import Camera
from tracker.parameters.groups.fusion import FusionParams
from tracker.runs.run import Run
from tracker.single_view.protocol import ViewResult

SAME = 0.5
"""Intersection over union from which a detection and a box passed to the fusion are of one person:
the threshold of PASCAL VOC (Everingham et al., IJCV 88(2), 2010), which MOTChallenge uses as well.
"""

_SIGMA_SHARE = 0.1
"""Standard deviation of a box as a share of its half sizes, where the camera passed on no box whose
deviations could be taken. An estimate: it scales the displayed distances alone."""


@dataclass(frozen=True, slots=True, eq=False)
class DetectionOwners:
    """The tracks of one camera's D detections at a step."""

    tracks: Int[ndarray, " D"]
    """Id of the track that each detection updated, -1 for none."""
    nearest: Int[ndarray, " D"]
    """Id of the track nearest to a detection that updated none; else -1, as without any track
    before the lens."""
    distances: Float[ndarray, " D"]
    """Mahalanobis distance of the detection from the expected box of its nearest track."""
    gate: float
    """The distance within which the fusion associates a box with a track."""


def detection_owners(run: Run, step: int) -> list[DetectionOwners]:
    """Find the tracks that each camera's detections at a step belong to.

    A detection is a track's where the box associated with the track is that detection, or overlaps
    it by half. For any other one it is the nearest track, by the distance of the fusion's gate

        d = sqrt((z − h(x))ᵀ (H P Hᵀ + R)⁻¹ (z − h(x)))

    with the state x and covariance P of the posterior of this step, and R of the boxes of this
    camera; where another posture than the upright one is assumed, in the posture that is nearer.

    Args:
        run: The run, whose step is computed.
        step: Index of the step.
    """
    p, fused = run.parameters.fusion, run.fused[step]
    target = TargetModel(
        run.sequence.target_half_extents, p.measurement, p.update, p.posture_share, p
    )
    rows = run.tracks.at(step)
    # the filter has no component for a track that smoothing alone found
    own = np.flatnonzero(run.tracks.components[rows] >= 0)
    components, ids = run.tracks.components[rows][own], run.tracks.ids[rows][own]
    posterior = fused.posterior.take(components)
    return [
        _of_camera(camera, view, target, p, posterior, ids, fused.sources[index, components])
        for index, (camera, view) in enumerate(
            zip(run.sequence.cameras, run.views[step], strict=True)
        )
    ]


def _of_camera(
    camera: Camera,
    view: ViewResult,
    target: TargetModel,
    p: FusionParams,
    posterior: GaussianMixture,
    ids: Int[ndarray, " J"],
    sources: Int[ndarray, " J"],
) -> DetectionOwners:
    """The owners of one camera's detections.

    Args:
        camera: The camera.
        view: The result of stage 1 in this camera.
        target: The measurement model.
        p: The parameters of the fusion.
        posterior: The component of each track.
        ids: Id of each track.
        sources: Index of the box associated with each track, -1 for none.
    """
    count = len(view.measurements)
    gate = math.sqrt(gate_distance(p.gate_probability, target.size))
    found = DetectionOwners(np.full(count, -1), np.full(count, -1), np.full(count, np.inf), gate)
    updating = np.flatnonzero((sources >= 0) & (sources < len(view.boxes)))
    if not count or not len(ids):
        return found
    if len(updating):
        overlaps = box_overlaps(
            Boxes(view.measurements).left_top, Boxes(view.boxes[sources[updating]]).left_top
        )
        same = overlaps.max(axis=1) >= SAME
        found.tracks[same] = ids[updating[overlaps.argmax(axis=1)[same]]]
    free = np.flatnonzero(found.tracks < 0)
    distances = _distances(camera, _as_boxes(view, free), target, p, posterior)
    nearest = distances.argmin(axis=1)
    found.distances[free] = distances[np.arange(len(free)), nearest]
    found.nearest[free] = np.where(np.isfinite(found.distances[free]), ids[nearest], -1)
    return found


def _distances(
    camera: Camera,
    view: ViewResult,
    target: TargetModel,
    p: FusionParams,
    posterior: GaussianMixture,
) -> Float[ndarray, "B J"]:
    """Compute the Mahalanobis distance of every box and component, infinite behind the lens."""
    covariances = posterior.covariances
    seen = target.expected(camera, posterior.means, covariances)
    expected = seen.expected
    measured = target.measured(view.boxes, view.sigmas, p.measurement_sigma)
    postures = [(expected.values, expected.jacobians, expected.spreads, covariances)]
    if len(expected.posture_values):
        drifted = covariances + expected.posture_drift
        postures.append(
            (expected.posture_values, expected.posture_jacobians, expected.posture_spreads, drifted)
        )
    squares = np.full((len(view.boxes), posterior.size), np.inf)
    for values, jacobians, spreads, spread in postures:
        own = jacobians @ spread @ jacobians.transpose(0, 2, 1)
        if len(spreads):
            own = own + spreads
        away = measured.values[:, None] - values
        solved = np.linalg.solve(own + measured.noises[:, None], away[..., None])[..., 0]
        squares = np.minimum(squares, (away * solved).sum(axis=-1))
    return np.where(seen.valid, np.sqrt(np.maximum(0.0, squares)), np.inf)


def _as_boxes(view: ViewResult, rows: Int[ndarray, " F"]) -> ViewResult:
    """Select detections as boxes with the mean noise of the camera's boxes at this step.

    Where the camera passed on none, :data:`_SIGMA_SHARE` of their half sizes is taken.
    """
    boxes = view.measurements[rows]
    sigmas = boxes[:, [2, 3, 2, 3]] * _SIGMA_SHARE
    if len(view.sigmas):
        sigmas = np.repeat(view.sigmas.mean(axis=0, keepdims=True), len(boxes), axis=0)
    return ViewResult.of_boxes(boxes, view.measurement_scores[rows], sigmas)
