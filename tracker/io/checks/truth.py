"""Does the truth stand where the boxes show people."""

from __future__ import annotations

from collections.abc import Sequence as Many
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.sequences.finding import Check, absent, good, percent, warning
from tracker.sequences.sequence import Detections, Sequence

# The sensitivities below are of the random rooms of seeds 1500 … 1515 and four recordings, whose
# truth has a share of at least 0.91, and of 176 wrong truths: with exchanged axes, mirrored, moved
# by 0.5 to 2 m, in another unit, of another time or room.
_LEAST_INSIDE = 0.2
"""Share of places in boxes below which the truth contradicts them. 139 of the wrong ones are named,
135 with half of it and 145 with twice. The right truth is named, too, if a detector has boxes of
15 % of the people, and not with half; if it has boxes of 25 %, only with twice."""

_BY_CHANCE = 1.5
"""The ratio to the share in the boxes of another time below which a share of less than half is one
by chance, as of places that all lie in the middle of the room. With 1.2, 120 of the wrong ones are
named, with 2 147 and with 3 151; but then the right truth is named in 9 of 20, if a detector has
boxes of 30 % of the people, and in one with 1.5 and 2."""

_SAMPLED = 300
"""Places that are compared with the boxes: the standard error of a share is at most 0.03. From 150
to 1200 no share changes by more."""


@lru_cache(maxsize=1)
def check_truth(sequence: Sequence) -> Check:
    """Compare the places of the truth with the boxes of the cameras that see them.

    Every score of a run says it, and the runs of a recording have one truth: the last recording
    that was asked for is remembered.

    Args:
        sequence: With a calibration that is read rightly.
    """
    name = "the truth stands where the boxes are"
    truth = sequence.ground_truth
    detections = [view.detections for view in sequence.views]
    if truth is None or not len(truth.frames):
        return absent(name, "there is no truth")
    if not any(own is not None and len(own.frames) for own in detections):
        return absent(name, "there are no boxes")
    share = share_in_boxes(truth.frames, truth.positions, sequence.cameras, detections)
    if contradicts(share, truth.frames, truth.positions, sequence.cameras, detections):
        return warning(
            name,
            f"{percent(share)} of the truth's places lie in boxes of the cameras that see them: "
            "its origin, axes, grid, unit or frame numbers may be others than the calibration's "
            "and the boxes', and figures against it mean nothing",
            share=share,
        )
    return good(name, f"{percent(share)} of the truth's places lie in boxes", share=share)


def contradicts(
    share: float,
    frames: Int[ndarray, " G"],
    places: Float[ndarray, "G 3"],
    cameras: Many[Camera],
    detections: Many[Detections | None],
) -> bool:
    """Whether places lie in so few boxes that they are elsewhere than people are.

    Args:
        share: The places' share in boxes, of :func:`share_in_boxes`.
        frames, places, cameras, detections: The arguments of that function.
    """
    first = int(frames.min())
    length = int(frames.max()) - first + 1
    if share < _LEAST_INSIDE or share >= 0.5 or length < 2:
        return share < _LEAST_INSIDE
    other = first + (frames - first + length // 2) % length
    return share < _BY_CHANCE * share_in_boxes(other, places, cameras, detections)


def share_in_boxes(
    frames: Int[ndarray, " G"],
    places: Float[ndarray, "G 3"],
    cameras: Many[Camera],
    detections: Many[Detections | None],
) -> float:
    """The share of places in a box, of those that a camera with boxes sees.

    Args:
        frames: The step of each place.
        places: World metres.
        cameras: The cameras.
        detections: The boxes of each camera; None for none.

    Returns:
        0 … 1; 0 where hardly any place is in sight of a camera.
    """
    rows = np.unique(np.linspace(0, len(frames) - 1, min(_SAMPLED, len(frames))).astype(int))
    seen = inside = 0
    for camera, own in zip(cameras, detections, strict=True):
        if own is None:
            continue
        pixels, _ = camera.project(places[rows])
        visible = camera.contains(pixels)
        for row in np.flatnonzero(visible):
            boxes = own.boxes[own.at(int(frames[rows[row]]))]
            low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
            seen += 1
            inside += bool(((pixels[row] >= low) & (pixels[row] <= high)).all(axis=1).any())
    return inside / seen if seen >= min(10, len(rows)) else 0.0
