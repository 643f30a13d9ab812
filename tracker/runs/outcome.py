"""The explanation of a run without tracks, by the output of each of its stages."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from tracker.geometry.consistency.suggestion import LEAST_POSSIBLE
from tracker.runs.gates import count_gates, decisive_gate
from tracker.runs.run import Run
from tracker.single_view.protocol import OUTSIDE

_NEARLY_NONE = 0.02
"""Share of the boxes passed on to the fusion below which the others are named as the reason. An
estimate: it chooses between two sentences, and no result depends on it."""


@dataclass(frozen=True, slots=True)
class StageCounts:
    """The output of each stage of a run, over all steps and cameras."""

    frames: int
    """The number of pictures, or frames of an outside detector, that were available."""
    found: int
    """The number of boxes that stage 1 detected or was given."""
    outside: int
    """The number of boxes that stage 1 rejected, since nobody in the room looks like them by size
    and place."""
    passed: int
    """The number of boxes that stage 1 passed on; a method's own estimates may be more than it
    found."""
    together: int
    """The number of steps at which two cameras or more passed on a box."""
    pairs: int
    """The number of pairs of boxes passed on that could be of one person."""
    begun: int
    """The number of tracks that the fusion began, whatever their existence."""
    surest: float
    """The largest existence probability or weight of these."""
    tracks: int
    """The number of tracks that were reported, above the threshold and in the room."""


def count_stages(run: Run) -> StageCounts:
    """Count the output of each stage of a run."""
    cameras = range(len(run.sequence.views))
    passed = np.zeros((len(cameras), len(run.views)), dtype=np.int64)
    for camera in cameras:
        passed[camera] = run.views.column("boxes", camera).counts
    outside = sum(one.dropped.get(OUTSIDE, 0.0) * one.pictures for one in count_gates(run))
    return StageCounts(
        frames=sum(not blind for camera in cameras for blind in run.views.values("blind", camera)),
        found=sum(len(run.views.column("measurements", camera).values) for camera in cameras),
        outside=round(outside),
        passed=int(passed.sum()),
        together=int(((passed > 0).sum(axis=0) > 1).sum()),
        pairs=sum(int(np.minimum(*two).sum()) for two in itertools.combinations(passed, 2)),
        begun=len(np.unique(run.fused.column("posterior.labels").values)),
        surest=float(run.fused.column("posterior.weights").values.max(initial=0.0)),
        tracks=len(set(run.tracks.ids.tolist())),
    )


def why_no_tracks(run: Run) -> str | None:
    """Explain in a sentence which stage of a run lost all people, and at which gate most candidates
    of stage 1 fell; None if the run has tracks."""
    if len(run.tracks):
        return None
    if not run.from_pictures and not any(
        view.detections is not None and len(view.detections.frames) for view in run.sequence.views
    ):
        return (
            "no tracks: the files of boxes hold no box of the steps "
            f"0 … {run.sequence.frames - 1}; see detections and detections_first_frame in "
            "sequence.toml"
        )
    n = count_stages(run)
    gate = decisive_gate(run) if n.frames else None
    return _losing_stage(run, n) + (f"; in the cameras {gate}" if gate is not None else "")


def _losing_stage(run: Run, n: StageCounts) -> str:
    """Explain which stage of a run without tracks lost all people."""
    kind = "pictures" if run.from_pictures else "frames of boxes"
    if not n.frames:
        return f"no tracks: not one of the {kind} could be read; see that the files are there"
    head = f"no tracks: {n.frames} {kind}, {n.found} boxes found"
    if not n.found:
        if run.parameters.method("single_view").used(run.parameters).detector:
            return (
                f"{head}; lower the detector's least score, or see which class it has for people "
                "and what values it wants its pictures in"
            )
        return f"{head}; lower what a box must have to count, or teach what people look like"
    head += f", {n.passed} passed on to the fusion"
    if n.passed < _NEARLY_NONE * n.found:
        if 2 * n.outside < n.found:
            return f"{head}: {run.parameters.single_view} itself holds them back; see its values"
        return (
            f"{head}: nearly none can stand in [room] by its size and place; "
            "multiview-phd check tells whether calibration, unit, room or size are wrong"
        )
    alone = len(run.sequence.views) == 1
    if not alone:
        head += f", {n.together} steps with boxes of two cameras"
    if not alone and not n.together:
        return f"{head}: a track begins where boxes of two cameras meet; see the cameras' clocks"
    head += f", {n.begun} tracks begun"
    if len(run.filtered):
        return (
            f"{head}: the smoothing removed all tracks of the filter as clutter; choose the "
            "smoothing none to see them"
        )
    if not alone and n.pairs < LEAST_POSSIBLE:
        return f"{head}: these are too few boxes to tell why; track more steps of the recording"
    if not n.begun:
        where = "the boxes are" if alone else "boxes of different cameras meet"
        late = "" if alone else ", or which camera is late"
        return (
            f"{head}: {where} nowhere in [room]; multiview-phd check tells how the calibration is "
            f"meant{late}"
        )
    return (
        f"{head}, the surest with existence {n.surest:.2f}, below the extraction threshold or "
        "outside [room]; see [target], [room] and multiview-phd check"
    )
