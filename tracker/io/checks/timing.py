"""The check of time: do cameras show the same moments, and do boxes count from 0 as steps do.

[ZBS17] Zhang, Benenson, Schiele, "CityPersons: a diverse dataset for pedestrian detection", CVPR
2017.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from tracker.io.checks.boxes import AS_GIVEN, raw_cameras, seen_boxes
from tracker.io.checks.synchronisation import (
    LEAST_SHARPNESS,
    LEAST_STEPS,
    CameraOffset,
    synchronise,
)
from tracker.io.conventions.questions import (
    Unconfirmed,
    describe_clocks,
    describe_unconfirmed,
)
from tracker.io.conventions.search import Verdict, clocks_by
from tracker.sequences.fields import listed
from tracker.sequences.finding import Check, Remedy, absent, good, warning
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

_SHIFTS = (-3, -2, -1, 0, 1, 2, 3)  # steps: those of counting from 1 and two beyond, for the bend
_NEAR = 0.4  # heights of a box: a box's usual breadth, 0.41 [ZBS17], is where another's begins
_LEAST_NEAR = 100  # places: in the random rooms of seeds 0 … 11 boxes are off by 0.09 steps at most
_APART = 0.6  # steps by which each camera, and
_APART_IN_ALL = 0.4  # by which the median may be off a whole step: more than four times as much


def check_time(
    sequence: Sequence,
    reader: FrameReader | None = None,
    found: tuple[CameraOffset, ...] | None = None,
    verdict: Verdict | None = None,
) -> Iterator[Check]:
    """Is any camera late; from the boxes, or from the motion in the pictures where there are none.

    Args:
        sequence: Read rightly: with a wrong calibration nothing can be said.
        reader: Of the pictures.
        found: What :func:`synchronise` found, where it is known.
        verdict: What the boxes tell, of the moments that they show, too.
    """
    name = "cameras show the same moments"
    if len(sequence.views) < 2:
        yield absent(name, "it needs two cameras")
        return
    found = synchronise(sequence, reader=reader) if found is None else found
    if not found:
        yield absent(name, "neither boxes nor pictures of two cameras can be compared")
        return
    names = [camera.name for camera in sequence.cameras]
    uneven = [] if verdict is None else describe_clocks(verdict.clocks, names, sequence.fps)
    for sentence in uneven:
        yield warning(name, sentence)
    unconfirmed = None if verdict is None else describe_unconfirmed(verdict, names, sequence.fps)
    # beside a clock that jumps or drifts a constant delay says nothing
    late = [offset for offset in found if offset.sure and not uneven]
    for offset in late:
        yield warning(
            name,
            offset.sentence,
            Remedy("camera.time_offset", f"{-offset.seconds:.3f}", offset.camera),
            steps=offset.steps,
            seconds=offset.seconds,
            sharpness=offset.sharpness,
        )
    if not late and not uneven:
        yield _agreeing(name, found, unconfirmed)
    elif unconfirmed is not None and unconfirmed.others:
        yield absent(name, unconfirmed.others)


@lru_cache(maxsize=1)
def uneven_clocks(sequence: Sequence) -> tuple[str, ...]:
    """Return a sentence for each camera whose clock jumps or drifts, as the check says it.

    The runs of a recording differ in parameters, which say nothing of its clocks: the last one that
    was asked for is remembered.

    Args:
        sequence: Read rightly. Its boxes tell; without boxes there is nothing to say.
    """
    clocks = clocks_by(raw_cameras(sequence), seen_boxes(sequence), AS_GIVEN, sequence.fps)
    names = [camera.name for camera in sequence.cameras]
    return tuple(describe_clocks(clocks, names, sequence.fps))


def _agreeing(name: str, found: tuple[CameraOffset, ...], unconfirmed: Unconfirmed | None) -> Check:
    """Of which cameras it is known that they show the same moments, and of which it is not.

    Args:
        name: Of the check.
        found: How late each camera is, as far as that can be told.
        unconfirmed: What the boxes do not confirm; None without boxes.
    """
    apart = () if unconfirmed is None else (*unconfirmed.without, *unconfirmed.doubtful)
    rest = [offset for offset in found if offset.camera not in apart]
    if unconfirmed is not None and len(rest) < 2:
        return absent(name, unconfirmed.others or "too few cameras agree to compare their moments")
    steps = max(abs(offset.steps) for offset in rest)
    sharp = min(offset.sharpness for offset in rest) >= LEAST_SHARPNESS
    if sharp and steps < LEAST_STEPS:
        words = f"to within {max(steps, 0.1):.1f} frames"
    elif unconfirmed is not None:
        words = "no camera is seen to be late"
    else:
        return absent(name, "too little moves to tell")
    if apart:
        words = f"{listed([offset.camera for offset in rest])}: {words}"
    if unconfirmed is not None and unconfirmed.others:
        return absent(name, f"{words}; {unconfirmed.others}")
    return good(name, words)


def check_counting(sequence: Sequence, *, places: bool = True) -> Check:
    """Do frames of boxes count from 0, as steps do.

    Args:
        sequence: With boxes.
        places: Whether the calibration is read rightly, so that the truth can be compared.
    """
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
    behind = steps_behind_truth(sequence) if places else ()
    late = float(np.median(behind)) if behind else 0.0
    # one camera may be late for other reasons: counting is the same in all, and by one step
    for side, when, right in ((1.0, "before", "1"), (-1.0, "later", "0")):
        near = all(abs(steps - side) < _APART for steps in behind)
        if len(behind) > 1 and near and abs(late - side) < _APART_IN_ALL:
            return warning(
                name,
                f"boxes show people as they are {abs(late):.1f} steps {when}, by the ground truth: "
                f"their frames seem to be counted from {right}",
                Remedy("--first-index", right),
                steps=late,
            )
    return good(name, "the first is at step 0" if first == 0 else "nothing says otherwise")


def steps_behind_truth(sequence: Sequence) -> tuple[float, ...]:
    """How many steps the boxes of each camera are later than the ground truth.

    The least of the mean distance, in heights of a box and truncated, between the middle of a
    person in the picture some steps before and the nearest box; between whole steps by a parabola.

    Returns:
        One for each camera of which enough boxes are near the truth; none without truth.
    """
    truth = sequence.ground_truth
    if truth is None:
        return ()
    row_of = {
        (frame, who): row
        for row, (frame, who) in enumerate(
            zip(truth.frames.tolist(), truth.ids.tolist(), strict=True)
        )
    }
    rows = [
        [row_of.get((frame - shift, who), -1) for shift in _SHIFTS]
        for frame, who in zip(truth.frames.tolist(), truth.ids.tolist(), strict=True)
    ]
    before = np.array(rows, dtype=np.int64).reshape(-1, len(_SHIFTS))
    here = np.flatnonzero((before >= 0).all(axis=1))
    found: list[float] = []
    for view in sequence.views:
        own = view.detections
        if own is None or not len(here):
            continue
        first, last = np.searchsorted(own.frames, [truth.frames[here], truth.frames[here] + 1])
        some = here[last > first]
        first, counts = first[last > first], (last - first)[last > first]
        if not len(some):
            continue
        starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
        boxes = own.boxes[np.repeat(first - starts, counts) + np.arange(counts.sum())]
        middles = boxes[:, :2] + boxes[:, 2:] / 2.0
        places, _ = view.camera.project(truth.positions)
        away = np.stack(
            [
                np.minimum.reduceat(
                    np.linalg.norm(
                        middles - np.repeat(places[before[some, column]], counts, axis=0), axis=1
                    )
                    / boxes[:, 3],
                    starts,
                )
                for column in range(len(_SHIFTS))
            ]
        )
        near = np.isfinite(away).all(axis=0) & (away.min(axis=0) < _NEAR)
        total = np.minimum(away[:, near], _NEAR).sum(axis=1)
        best = int(np.argmin(total))
        if near.sum() < _LEAST_NEAR or best in (0, len(_SHIFTS) - 1):
            continue
        below, least, above = (float(value) for value in total[best - 1 : best + 2])
        bend = below - 2.0 * least + above
        if bend > 0.0:
            found.append(_SHIFTS[best] + 0.5 * (below - above) / bend)
    return tuple(found)
