"""Do the cameras show the same moments, and do boxes and steps count from the same number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.checks.check import Check, Remedy, absent, good, warning
from tracker.checks.synchronisation import CameraOffset, synchronise
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence


def check_time(sequence: Sequence, reader: FrameReader | None = None) -> Iterator[Check]:
    """Is any camera late; from the boxes, or from the motion in the pictures where there are none.

    Args:
        sequence: Read rightly: with a wrong calibration nothing can be said.
        reader: Of the pictures.
    """
    name = "cameras show the same moments"
    if len(sequence.views) < 2:
        yield absent(name, "it needs two cameras")
        return
    found = synchronise(sequence, reader=reader)
    if not found:
        yield absent(name, "neither boxes nor pictures of two cameras can be compared")
        return
    late = [offset for offset in found if offset.sure]
    for offset in late:
        yield warning(
            name,
            offset.sentence,
            Remedy("camera.time_offset", f"{-offset.seconds:.3f}"),
            steps=offset.steps,
            seconds=offset.seconds,
            sharpness=offset.sharpness,
        )
    if not late:
        yield good(name, _agreeing(found))


def _agreeing(found: tuple[CameraOffset, ...]) -> str:
    steps = max(abs(offset.steps) for offset in found)
    if min(offset.sharpness for offset in found) < 3.0:
        return "no camera is seen to be late; too little moves to be sure of all of them"
    return f"all cameras show the same moments, to {max(steps, 0.1):.1f} frames"


def check_counting(sequence: Sequence) -> Check:
    """Do frames of boxes count from 0, as steps do."""
    name = "boxes count from step 0"
    every = [v.detections.frames for v in sequence.views if v.detections is not None]
    every = [frames for frames in every if len(frames)]
    if not every:
        return absent(name, "there are no boxes")
    first = min(int(frames.min()) for frames in every)
    begin_together = sum(int(frames.min()) == 1 for frames in every)
    if first == 1 and begin_together == len(every) and len(every) > 1:
        return warning(
            name,
            "no camera has a box at step 0 and every camera has one at step 1: frames of the boxes "
            "seem to be counted from 1",
            Remedy("--first-index", "1"),
        )
    ahead = _ahead_of_truth(sequence)
    if ahead is not None and abs(ahead - 1.0) < 0.25:
        return warning(
            name,
            f"boxes show where people were {ahead:.1f} steps before, by the ground truth: their "
            "frames seem to be counted from 1",
            Remedy("--first-index", "1"),
            steps=ahead,
        )
    return good(name, "boxes count from step 0")


def _ahead_of_truth(sequence: Sequence) -> float | None:
    """How many steps the boxes of all cameras are later than the ground truth.

    With the truth's place p and velocity v in the picture, per step, and the middle z of the
    nearest box, a box that shows an earlier moment by τ steps has z − p = −τ v + noise: τ is the
    least-squares slope.
    """
    truth = sequence.ground_truth
    if truth is None:
        return None
    offsets: list[float] = []
    moving = _moving(truth.frames, truth.ids)
    for view in sequence.views:
        if view.detections is None:
            continue
        here, valid = view.camera.project(truth.positions)
        rows, before, after = moving
        speed = (here[after, 0] - here[before, 0]) / 2.0
        above = below = 0.0
        for row, v in zip(rows, speed, strict=True):
            own = view.detections.boxes[view.detections.at(int(truth.frames[row]))]
            if not len(own) or not valid[row] or not np.isfinite(v):
                continue
            away = own[:, 0] + own[:, 2] / 2.0 - here[row, 0]
            nearest = int(np.argmin(np.abs(away)))
            if abs(away[nearest]) < max(2.0 * abs(v), own[nearest, 2] / 4.0):
                above -= float(away[nearest] * v)
                below += float(v * v)
        if below > 0.0:
            offsets.append(above / below)
    return float(np.median(offsets)) if len(offsets) >= 2 else None


def _moving(frames: np.ndarray, ids: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the truth with the same person one step before and one after."""
    where = {(int(f), int(i)): row for row, (f, i) in enumerate(zip(frames, ids, strict=True))}
    found = [
        (row, where[f - 1, i], where[f + 1, i])
        for (f, i), row in where.items()
        if (f - 1, i) in where and (f + 1, i) in where
    ]
    rows = np.array(found, dtype=np.int64).reshape(-1, 3)
    return rows[:, 0], rows[:, 1], rows[:, 2]
