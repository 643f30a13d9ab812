"""YOLO text as Ultralytics' ``save_txt`` writes it: a file a frame, a row a box.

class, x and y of the centre, width, height as parts of the picture, then the confidence
and the track's number where they were asked for. Rows of key points or of an outline are
longer. A frame in which nobody was found has no file; those of a video count from 1.

Source: Ultralytics, "Results.save_txt" and "Detection datasets".
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from tracker.io.read.columns import decimal_points, only_people
from tracker.io.read.pieces import DetectionPiece, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "YOLO text"
KIND: Kind = "detections"
SERIES = True

_ROW = re.compile(r"\d+(\.0+)?(\s+-?[\d.]+(e[-+]?\d+)?){4,}\s*", re.IGNORECASE)
_KEYPOINTS = 17
"""Joints of COCO, in rows of key points."""


def recognise(file: SourceFile) -> Certainty:
    """Rows of a whole number and four or more numbers, of which four are parts of 1."""
    rows = [decimal_points(line) for line in file.head_text.splitlines()[:20] if line.strip()]
    if not rows or not all(_ROW.fullmatch(row.strip()) for row in rows[:-1] or rows):
        return Certainty.NO
    values = [[float(word) for word in row.split()[1:5]] for row in rows[:-1] or rows]
    if any(not 0.0 <= value <= 1.0 for row in values for value in row):
        return Certainty.NO
    return Certainty.SURE if len(file.series) > 1 else Certainty.LIKELY


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the boxes of all frames of the series."""
    frames: list[int] = []
    rows: list[tuple[float, float, float, float, float]] = []
    classes: list[str] = []
    for frame, member in file.frames():
        for line, text in enumerate(member.lines(), 1):
            if not text.strip():
                continue
            try:
                values = [float(word) for word in decimal_points(text).split()]
            except ValueError:
                raise member.error(f"line {line}: expected numbers, found {text[:40]!r}") from None
            if len(values) < 5 or not np.isfinite(values).all():
                raise member.error(
                    f"line {line}: expected class, x, y, width and height, found {len(values)} "
                    "numbers"
                )
            frames.append(frame)
            classes.append(f"{values[0]:g}")
            rows.append(_row(values))
    table = np.array(rows).reshape(-1, 5)
    numbers = np.array(frames, dtype=np.int64)
    first: int | None = 0 if len(numbers) and numbers.min() == 0 else 1
    piece = DetectionPiece(
        source=file.path,
        format=NAME,
        camera="",
        frames=numbers,
        boxes=table[:, :4],
        scores=np.clip(table[:, 4], 0.0, 1.0),
        layout="cxcywh",
        normalised=True,
        first_index=1 if first else 0,
        last_frame=int(numbers.max()) if len(numbers) else None,
    )
    yield only_people(file, piece, classes)


def _row(values: list[float]) -> tuple[float, float, float, float, float]:
    """Centre, size and confidence of one row."""
    count = len(values)
    x, y, width, height = values[1:5]
    if count in (5, 6, 7):
        # a track's number alone is whole and at least 1
        has_score = count == 7 or (count == 6 and values[5] <= 1.0 and values[5] != 1.0)
        return x, y, width, height, values[5] if has_score else 1.0
    if count - 5 in (3 * _KEYPOINTS, 3 * _KEYPOINTS + 1, 2 * _KEYPOINTS):
        return x, y, width, height, values[-1] if (count - 5) % 3 == 1 else 1.0
    outline = np.array(values[1 : 1 + (count - 1) // 2 * 2]).reshape(-1, 2)
    low, high = outline.min(axis=0), outline.max(axis=0)
    centre, size = (low + high) / 2.0, high - low
    return float(centre[0]), float(centre[1]), float(size[0]), float(size[1]), 1.0
