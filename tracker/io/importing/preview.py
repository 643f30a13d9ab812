"""A settled recording as a sequence in memory, for checks before anything is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from tracker.io.importing.settling import ImportPlan, PlannedView, at_steps_of
from tracker.sequences.sequence import Room, Sequence, View


def as_sequence(settled: ImportPlan, name: str) -> Sequence:
    """What the written folder will be read as; its folder is none.

    Args:
        settled: As it would be written.
        name: Of the sequence.
    """
    views = tuple(
        View(
            camera=view.camera,
            video=None if view.matched.video is None else view.matched.video.path,
            images=() if view.matched.images is None else view.matched.images.files,
            detections=None if view.detections is None else at_steps_of(view.detections, view.time),
            clock=view.time.clock,
            detector_ran=_ran(view, settled.frames),
        )
        for view in settled.views
    )
    room = settled.room
    return Sequence(
        name=name,
        folder=Path(),
        fps=settled.fps,
        frames=settled.frames,
        room=Room(np.asarray(room.minimum), np.asarray(room.maximum), settled.entrances),
        target_half_extents=np.asarray(room.half_extents),
        views=views,
        ground_truth=settled.truth,
    )


def _ran(view: PlannedView, steps: int) -> Bool[ndarray, " steps"] | None:
    """Whether the detector ran, by step; None where it ran at all."""
    if view.looked_at is None:
        return None
    ran = np.zeros(steps, dtype=bool)
    at = view.time.steps_of(view.looked_at)
    ran[at[(at >= 0) & (at < steps)]] = True
    return ran
