"""Cameras without a frame at a step: they give no evidence there, neither a box nor a miss.

A person is not less likely to exist for a picture that was never taken: such a camera's p_D
is 0. What nobody explained in its last frame is remembered for a moment, so that cameras whose
frames fall on different steps can still begin a track together.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.measurement_births import Evidence, Newborns
from tracker.fusion.record import Record
from tracker.kernels.gating import Measurements
from tracker.kernels.labelled.step import CameraBoxes
from tracker.single_view.protocol import ViewResult

LONGEST = 0.2
"""Seconds within which boxes of two cameras may start a person."""

WALKING = 1.0
"""Metres a second that somebody may have walked meanwhile, one standard deviation."""

_UNEXPLAINED = 0.5


def seeing(views: Many[ViewResult]) -> Int[ndarray, " S"] | None:
    """The cameras that have a frame at this step; None where all have."""
    if not any(view.blind for view in views):
        return None
    return np.array([c for c, view in enumerate(views) if not view.blind], dtype=np.int64)


def boxes_of(seen: CameraBoxes, cameras: Int[ndarray, " S"]) -> CameraBoxes:
    """The boxes of all C cameras, listed for the S cameras that have a frame: others have none."""
    return seen._replace(starts=np.append(seen.starts[:-1][cameras], seen.starts[-1]))


def spread(record: Record, cameras: Int[ndarray, " S"], count: int) -> Record:
    """The record of some cameras extended to all C: the others gave no evidence, with p_D 0.

    Args:
        record: Of the cameras that had a frame.
        cameras: Their indices.
        count: C.
    """
    every = Record.blank(count, record.sources.shape[1])
    if len(cameras):
        every.detection_probabilities[cameras] = record.detection_probabilities
        every.sources[cameras] = record.sources
        every.source_weights[cameras] = record.source_weights
        every.hidden_by[cameras] = record.hidden_by
    return every


@dataclass(frozen=True, slots=True, eq=False)
class Glimpse:
    """What all cameras left unexplained at one step."""

    evidence: Evidence
    boxes: Float[ndarray, "B 4"]
    """centre_x, centre_y, half_width, half_height, pixels."""
    blind: Bool[ndarray, " C"]
    """Which cameras had no frame."""

    def of(self, camera: int) -> slice:
        """The boxes of one camera."""
        starts = self.evidence.starts
        return slice(int(starts[camera]), int(starts[camera + 1]))


Recent = tuple[Glimpse, ...]
"""The last steps, the latest first, as far back as they may still begin a track."""


def remember(recent: Recent, glimpse: Glimpse, step_time: float) -> Recent:
    """The last steps at the end of this one: as many as lie within :data:`LONGEST` seconds."""
    return (glimpse, *recent)[: int(LONGEST / step_time + 1e-9)]


def with_recent(now: Glimpse, recent: Recent, step_time: float, half_height: float) -> Evidence:
    """The evidence of a step, with that of the last frames of the cameras that have none now.

    Args:
        now: This step.
        recent: Those before it.
        step_time: Seconds.
        half_height: Of what is tracked, metres: it makes metres walked into pixels.
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
    camera: int, now: Glimpse, recent: Recent, step_time: float, half_height: float
) -> Evidence:
    """One camera's part: of this step, or of its last frame, known the less well the older."""
    age, seen = 0, now
    if now.blind[camera]:
        found = ((n, g) for n, g in enumerate(recent, 1) if not g.blind[camera])
        age, seen = next(found, (0, now))
    own, evidence = seen.of(camera), seen.evidence
    rows = np.arange(own.start, own.stop)
    if age:
        rows = rows[evidence.unexplained[rows] > _UNEXPLAINED]
    walked = WALKING * age * step_time / half_height * seen.boxes[rows, 3]
    values, noises = evidence.measurements
    looser = walked[:, None, None] ** 2 * np.eye(values.shape[1])
    return Evidence(
        evidence.centres[rows],
        Measurements(values[rows], noises[rows] + looser),
        evidence.unexplained[rows],
        evidence.starts,
        evidence.clutter_factors[rows],
    )


def of_this_step(found: Newborns, blind: Bool[ndarray, " C"]) -> Newborns:
    """The newcomers with a box of this step; boxes of earlier frames are no sources of theirs.

    Args:
        found: Proposed from this step's boxes and remembered ones.
        blind: Which cameras have no frame now, so that their boxes were remembered.
    """
    now = (found.sources[~blind] >= 0).any(axis=0)
    sources = np.where(blind[:, None], -1, found.sources)
    return replace(found, sources=sources).take(np.flatnonzero(now))
