"""MOTChallenge's det.txt, gt.txt and track files: frame, id, left, top, width, height, …

Frames count from 1. Det files end with confidence and x, y, z (−1 where unknown); ground
truth from 2016 on with a flag (0: not counted), a class and the visible part.

Source: Milan et al., "MOT16: A benchmark for multi-object tracking", arXiv 1603.00831, 2016.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.columns import to_unit
from tracker.io.read.pieces import DetectionPiece, Piece, TruthPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "MOTChallenge text"
KIND: Kind = "detections"
SERIES = False

PEOPLE = (1, 2, 7)
"""Classes of the ground truth: pedestrian, person on a vehicle, static person."""


def recognise(file: SourceFile) -> Certainty:
    """Rows of 6 to 10 numbers with commas, or blanks, the first two whole and no header."""
    rows = [line for line in file.head_text.splitlines()[:50] if line.strip()]
    rows = rows[:-1] if len(rows) == 50 else rows
    widths = set()
    for row in rows:
        words = [word for word in re.split(r"[,\s]+", row.strip()) if word]
        whole = all(re.fullmatch(r"-?\d+(\.0*)?", word) for word in words[:2])
        if not whole or not all(re.fullmatch(r"-?[\d.]+(e[-+]?\d+)?", w.lower()) for w in words):
            return Certainty.NO
        widths.add(len(words))
    if len(widths) != 1 or not 6 <= (width := widths.pop()) <= 10:
        return Certainty.NO
    has_commas = all("," in row for row in rows)
    return Certainty.LIKELY if has_commas and width >= 7 else Certainty.POSSIBLE


def read(file: SourceFile) -> Iterator[Piece]:
    """The boxes; and the places, where the last three columns are given."""
    table = _table(file)
    frames, ids, boxes = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64), table[:, 2:6]
    columns = table.shape[1]
    is_truth = columns in (8, 9) and set(np.unique(table[:, 6])) <= {0.0, 1.0}
    keep = np.ones(len(table), dtype=bool)
    scores = np.ones(len(table))
    if is_truth:
        keep = (table[:, 6] == 1.0) & np.isin(table[:, 7], PEOPLE)
    elif columns >= 7:
        scores = to_unit(table[:, 6])
    first = 0 if len(frames) and frames.min() == 0 else 1
    yield DetectionPiece(
        source=file.path,
        format="MOTChallenge ground truth" if is_truth else "MOTChallenge detections",
        camera="",
        frames=frames[keep],
        boxes=boxes[keep],
        scores=scores[keep],
        layout="ltwh",
        first_index=1 if first else 0,
    )
    placed = np.zeros(len(table), dtype=bool)
    if columns == 10:
        placed = (table[:, 7:10] != -1.0).any(axis=1) & (ids >= 0)
    if placed.any():
        yield TruthPiece(
            source=file.path,
            format="MOTChallenge 3D",
            frames=frames[placed],
            ids=ids[placed],
            positions=table[placed, 7:10],
            up="z",
            first_index=1 if first else 0,
        )


def _table(file: SourceFile) -> Float[ndarray, "N C"]:
    lines = [line.replace(",", " ").replace(";", " ") for line in file.lines() if line.strip()]
    try:
        table = np.loadtxt(lines, ndmin=2, comments=None)
    except ValueError as error:
        raise file.error(f"expected rows of the same count of numbers ({error})") from None
    if not np.isfinite(table).all() or (np.abs(table) > 2**53).any():
        raise file.error("expected finite numbers")
    return table
