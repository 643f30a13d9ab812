"""Asynchronous cameras: one without a frame at a step gives neither detections nor a miss there.

Such a camera has p_D = 0, so that the existence of a target does not decrease. The unexplained
boxes of its last frame are stored for :data:`LONGEST` seconds, so that cameras whose frames fall on
different steps can begin a track together.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.measurement_births import UNEXPLAINED, Evidence, Newborns
from tracker.fusion.record import Record
from tracker.kernels.kalman import Measurements
from tracker.kernels.labelled import CameraBoxes
from tracker.single_view.protocol import ViewResult

LONGEST = 0.2
"""Largest time between the boxes of two cameras that begin a track together, seconds. In it a
person walks 0.3 m, less than a body's width."""

SPEED_SIGMA = 1.0
"""Standard deviation of a person's displacement along each axis per time between these frames,
metres per second. That of the mean walking speed, 1.34 m/s (Weidmann, "Transporttechnik der
Fussgänger", ETH Zürich 1993), in an unknown direction is 0.95 m/s."""


def cameras_with_frame(views: Many[ViewResult]) -> Int[ndarray, " S"] | None:
    """The indices of the S cameras that have a frame at this step; None where all have."""
    if not any(view.blind for view in views):
        return None
    return np.array([c for c, view in enumerate(views) if not view.blind], dtype=np.int64)


def boxes_of_cameras(seen: CameraBoxes, cameras: Int[ndarray, " S"]) -> CameraBoxes:
    """Restrict the boxes of all C cameras to the S cameras that have a frame."""
    return seen._replace(starts=np.append(seen.starts[:-1][cameras], seen.starts[-1]))


def extend_record(record: Record, cameras: Int[ndarray, " S"], count: int) -> Record:
    """Extend the record of S cameras to all C; the others have no sources, and p_D = 0.

    Args:
        record: Evidence of the S cameras that have a frame.
        cameras: Indices of these cameras.
        count: C, the number of cameras.
    """
    every = Record.blank(count, record.sources.shape[1])
    if len(cameras):
        every.detection_probabilities[cameras] = record.detection_probabilities
        every.sources[cameras] = record.sources
        every.source_weights[cameras] = record.source_weights
        every.hidden_by[cameras] = record.hidden_by
    return every


@dataclass(frozen=True, slots=True, eq=False)
class StepEvidence:
    """The boxes of all cameras at one step and how far tracks explain them."""

    evidence: Evidence
    """Measurements and probabilities of the B boxes."""
    boxes: Float[ndarray, "B 4"]
    """centre_x, centre_y, half_width, half_height, pixels."""
    blind: Bool[ndarray, " C"]
    """Which cameras have no frame at this step."""

    def of(self, camera: int) -> slice:
        """Return the slice of the rows of one camera's boxes."""
        starts = self.evidence.starts
        return slice(int(starts[camera]), int(starts[camera + 1]))


Recent = tuple[StepEvidence, ...]
"""The evidence of the last steps, the latest first, of at most :data:`LONGEST` seconds."""


def remember(recent: Recent, latest: StepEvidence, step_time: float) -> Recent:
    """Prepend a step to the recent ones and drop those older than :data:`LONGEST` seconds.

    Args:
        recent: The evidence of the steps before, the latest first.
        latest: The evidence of this step.
        step_time: Time between two steps, seconds.
    """
    return (latest, *recent)[: int(LONGEST / step_time + 1e-9)]


def with_recent(
    now: StepEvidence, recent: Recent, step_time: float, half_height: float
) -> Evidence:
    """Combine the evidence of a step with the last frames of the cameras that have none now.

    Args:
        now: The evidence of this step.
        recent: The evidence of the steps before, the latest first.
        step_time: Time between two steps, seconds.
        half_height: Half height of a target, metres, which converts metres to pixels.
    """
    parts = [_last(camera, now, recent, step_time, half_height) for camera in range(len(now.blind))]
    starts = np.cumsum([0, *(len(part.centres) for part in parts)])
    return Evidence(
        np.concatenate([part.centres for part in parts]),
        Measurements(
            np.concatenate([part.measurements.values for part in parts]),
            np.concatenate([part.measurements.noises for part in parts]),
        ),
        np.concatenate([part.unexplained for part in parts]),
        starts,
        np.concatenate([part.clutter_factors for part in parts]),
        ~now.blind,
    )


def _last(
    camera: int, now: StepEvidence, recent: Recent, step_time: float, half_height: float
) -> Evidence:
    """Return one camera's evidence, of this step or else of its last frame.

    The noise of earlier boxes is increased by the displacement of a person since then.

    Args:
        camera: Index of the camera.
        now: The evidence of this step.
        recent: The evidence of the steps before, the latest first.
        step_time: Time between two steps, seconds.
        half_height: Half height of a target, metres, which converts metres to pixels.
    """
    age, seen = 0, now
    if now.blind[camera]:
        found = ((n, g) for n, g in enumerate(recent, 1) if not g.blind[camera])
        age, seen = next(found, (0, now))
    own, evidence = seen.of(camera), seen.evidence
    rows = np.arange(own.start, own.stop)
    if age:
        rows = rows[evidence.unexplained[rows] > UNEXPLAINED]
    walked = SPEED_SIGMA * age * step_time / half_height * seen.boxes[rows, 3]
    values, noises = evidence.measurements
    looser = walked[:, None, None] ** 2 * np.eye(values.shape[1])
    return Evidence(
        evidence.centres[rows],
        Measurements(values[rows], noises[rows] + looser),
        evidence.unexplained[rows],
        evidence.starts,
        evidence.clutter_factors[rows],
    )


def with_present_boxes(found: Newborns, blind: Bool[ndarray, " C"]) -> Newborns:
    """Select the newborn targets with a box of this step, and remove earlier boxes as sources.

    Args:
        found: N targets proposed from the boxes of this step and of earlier frames.
        blind: Which cameras have no frame now, so that their boxes are of earlier frames.
    """
    now = (found.sources[~blind] >= 0).any(axis=0)
    sources = np.where(blind[:, None], -1, found.sources)
    return replace(found, sources=sources).take(np.flatnonzero(now))
