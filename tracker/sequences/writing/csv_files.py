"""The tables of a sequence folder as they are written: boxes of a camera, and ground truth."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.files.atomic import write_whole
from tracker.sequences.sequence import Detections, GroundTruth


def write_boxes(
    path: Path, boxes: Detections, empty: Int[ndarray, " E"], *, decimals: tuple[str, str]
) -> None:
    """Write the boxes of a camera, and a row without a box for each step without any.

    Args:
        path: The file to write.
        boxes: The boxes.
        empty: The steps at which the detector ran and found no box, if these are listed.
        decimals: The formats of the box's numbers and of its score.
    """
    side, score = decimals
    columns = (boxes.frames.tolist(), boxes.boxes.tolist(), boxes.scores.tolist())
    rows = [
        ",".join([str(frame), *(f"{value:{side}}" for value in box), f"{own:{score}}"])
        for frame, box, own in zip(*columns, strict=True)
    ]
    rows += [f"{step},,,,," for step in empty.tolist()]
    _write(path, "frame,left,top,width,height,score", rows)


def write_truth(path: Path, truth: GroundTruth, *, decimals: str) -> None:
    """Write the ground truth.

    Args:
        path: The file to write.
        truth: The positions of people.
        decimals: The format of the coordinates.
    """
    columns = (truth.frames, truth.ids, truth.positions, truth.valid.astype(int))
    rows = (
        ",".join([str(frame), str(who), *(f"{value:{decimals}}" for value in place), str(valid)])
        for frame, who, place, valid in zip(*(one.tolist() for one in columns), strict=True)
    )
    _write(path, "frame,id,x,y,z,valid", rows)


def steps_without_boxes(boxes: Detections, steps: Int[ndarray, " K"]) -> Int[ndarray, " E"]:
    """Return those of the steps at which the detector ran that have no box."""
    return np.setdiff1d(steps, boxes.frames).astype(np.int64)


def _write(path: Path, head: str, rows: Iterable[str]) -> None:
    write_whole(path, "".join(f"{row}\n" for row in (head, *rows)).encode())
