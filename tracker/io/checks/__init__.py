"""The checks of a recording: each finding is one sentence, with the remedy.

``check(sequence)`` runs every check that costs no more than a few seconds a camera; nothing is
changed by it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tracker.io.checks.boxes import check_boxes, judge_boxes
from tracker.io.checks.cameras import check_lenses, check_places
from tracker.io.checks.timing import check_counting, check_time
from tracker.io.checks.truth import check_truth
from tracker.io.conventions.judge import EVERY_ORDER
from tracker.sequences.finding import Check, Remedy, Status, absent
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Detections, Sequence

__all__ = ["Check", "Remedy", "Status", "check"]


def check(
    sequence: Sequence,
    *,
    pictures: bool = True,
    quick: bool = False,
    reader: FrameReader | None = None,
) -> list[Check]:
    """Every check of a recording, the ones that matter most first.

    What a wrong reading of the calibration would make nonsense of is left out where the boxes
    say that it is read wrongly.

    Args:
        sequence: As it was read.
        pictures: Whether pictures may be looked at, for the motion where there are no boxes.
        quick: Whether to leave out what takes more than a second or so: the cameras' clocks, and
            calibrations exchanged among many cameras.
        reader: Of the pictures; one is opened where it is needed and none is given.
    """
    truth = check_truth(sequence)
    sequence = _surest(sequence)
    judged = judge_boxes(sequence, exchanges=not quick or len(sequence.views) <= EVERY_ORDER)
    found = [*check_boxes(sequence, judged)]
    lenses = check_lenses(sequence.cameras)
    if judged is not None and judged.mistaken:
        return [*found, lenses, check_counting(sequence, places=False)]
    found += [lenses, *check_places(sequence.cameras, sequence.room)]
    if judged is not None and judged.verdict.moved:
        found.append(absent("cameras show the same moments", "a camera that was moved comes first"))
    elif not quick and (sequence.has_detections or pictures):
        verdict = None if judged is None else judged.verdict
        found += check_time(sequence, reader, verdict=verdict)
    if judged is not None:
        found.append(check_counting(sequence))
    found.append(truth)
    return found


_MOST_BOXES = 60
"""Of one camera at one step that the checks look at: the pairs of two cameras are their product."""


def _surest(sequence: Sequence) -> Sequence:
    """With no more boxes at a step than the checks need, those of the highest scores."""
    views = []
    for view in sequence.views:
        own = view.detections
        if own is not None and len(own.frames) > _MOST_BOXES:
            order = np.lexsort([-own.scores, own.frames])
            frames = own.frames[order]
            rank = np.arange(len(frames)) - np.searchsorted(frames, frames)
            kept = np.sort(order[rank < _MOST_BOXES])
            if len(kept) < len(frames):
                fewer = Detections(own.frames[kept], own.boxes[kept], own.scores[kept])
                view = replace(view, detections=fewer)
        views.append(view)
    return replace(sequence, views=tuple(views))
