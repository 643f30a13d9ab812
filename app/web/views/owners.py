"""Whose a camera's detections are: the track that each feeds, else the nearest one."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from app import models
from tracker.filters.gaussian_mixture import gate_distance
from tracker.fusion.target_model import TargetModel
from tracker.geometry.boxes import Boxes, box_overlaps
from tracker.runs.pipeline import Run
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult

SAME = 0.5
"""Overlap (intersection over union) from which on a detection and a box are of one person."""


def tell_owners(message: models.Step, sequence: Sequence, run: Run, step: int) -> None:
    """Write beside each detection of a step whose it is.

    A detection is a track's where the box that fed the track is that detection, or overlaps it
    by half. Any other one is nobody's, and the nearest track is told with its distance

        d = sqrt((z − h(x))ᵀ (H P Hᵀ + R)⁻¹ (z − h(x)))

    in the measurement space of the fusion, with the track's state x and covariance P as they
    are after the step's update, and R of the boxes of this camera; and so is the gate, the root
    of the χ² quantile of P_G with as many degrees of freedom as a box has numbers.

    Args:
        message: Its cameras have their detections and tracks.
        sequence: That the run is of.
        run: Has the step.
        step: 0-based.
    """
    p = run.parameters.fusion
    target = TargetModel(sequence.target_half_extents, p.measurement, p.update, p.posture_share, p)
    gate = round(math.sqrt(gate_distance(p.gate_probability, target.size)), 2)
    tracks, posterior = run.tracks, run.fused[step].posterior
    rows = tracks.at(step)
    # the filter knew nothing of whom the smoothing alone found
    known = tracks.components[rows] >= 0
    components, ids = tracks.components[rows][known], tracks.ids[rows][known]
    states, covariances = posterior.means[components], posterior.covariances[components]
    for index, (camera, view) in enumerate(zip(message.cameras, run.views[step], strict=True)):
        if not len(view.measurements):
            continue
        feeding = [(t.id, t.fed_by.box) for t in camera.tracks if t.fed_by is not None]
        shares = box_overlaps(
            Boxes(view.measurements).left_top, np.array([b for _, b in feeding]).reshape(-1, 4)
        )
        best = shares.argmax(axis=1) if feeding else np.zeros(len(shares), dtype=np.int64)
        owned = shares.max(axis=1, initial=0.0) >= SAME
        for i in np.flatnonzero(owned).tolist():
            camera.measurements[i].track = feeding[best[i]][0]
        free = np.flatnonzero(~owned)
        if not len(free) or not len(states):
            continue
        expected = target.expected(sequence.cameras[index], states, covariances)
        measured = target.measured(_as_boxes(view, free), p.measurement_sigma)
        spread = expected.jacobians @ covariances @ expected.jacobians.transpose(0, 2, 1)
        away = measured.values[:, None] - expected.values[None]
        solved = np.linalg.solve(spread[None] + measured.noises[:, None], away[..., None])[..., 0]
        distances = np.sqrt(np.maximum(0.0, (away * solved).sum(axis=-1)))
        distances[:, ~expected.valid] = np.inf
        for i, row in zip(free.tolist(), distances, strict=True):
            nearest = int(row.argmin())
            if np.isfinite(row[nearest]):
                camera.measurements[i].nearest = int(ids[nearest])
                camera.measurements[i].sigmas = round(float(row[nearest]), 2)
                camera.measurements[i].gate = gate


def _as_boxes(view: ViewResult, rows: Int[ndarray, " F"]) -> ViewResult:
    """Some detections as boxes to fuse, trusted as the camera's boxes of this step are.

    Where it has passed on none, a tenth of their half sizes is taken.
    """
    usual = view.sigmas.mean(axis=0, keepdims=True) if len(view.sigmas) else None
    boxes = view.measurements[rows]
    sigmas = boxes[:, [2, 3, 2, 3]] * 0.1 if usual is None else np.repeat(usual, len(boxes), axis=0)
    return ViewResult.of_boxes(boxes, view.measurement_scores[rows], sigmas)
