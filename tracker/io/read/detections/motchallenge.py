"""MOTChallenge's det.txt, gt.txt and track files: frame, id, left, top, width, height, …

Frames count from 1. Det files end with confidence and x, y, z (−1 where unknown); ground
truth from 2016 on with a flag (0: not counted), a class and the visible part. Pixels of the
challenge's own files count from 1 too (sec. 4.2), those of the detectors and annotation tools that
borrow the form from 0.

Source: Milan et al., "MOT16: A benchmark for multi-object tracking", arXiv 1603.00831, 2016.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.io.read.columns import PEOPLE, decimal_points, no_people, to_unit
from tracker.io.read.pieces import DetectionPiece, Piece, TruthPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "MOTChallenge text"
KIND: Kind = "detections"
SERIES = False

_PEOPLE_NUMBERS = (1, 2, 7)
"""Classes of the ground truth: pedestrian, person on a vehicle, static person."""

LABELS = "labels.txt"
"""The names of the classes beside the ground truth, one a line, as annotation tools write them."""

SEQUENCE = "seqinfo.ini"
"""The description that lies beside the folders ``gt`` and ``det`` of the challenge's sequences."""

TRACKEVAL = "mot_challenge"
"""The folder of the challenge's sequences and results in TrackEval's folders; below it are a folder
of the benchmark, one of the sequence or tracker, ``gt`` or ``data``, and the file."""

GROUND_PLANE = "ground-plane"
"""The last words of the name of a sequence whose boxes are outlines on the floor in metres, as this
program exports them; the last column of its tracks is z."""

_MOST_LABELS = 2**16  # bytes


def recognise(file: SourceFile) -> Certainty:
    """Rows of 6 to 10 numbers with commas, or blanks, the first two whole and no header."""
    rows = [decimal_points(line) for line in file.head_text.splitlines()[:50] if line.strip()]
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
    # the ninth number of the ground truth is how much of a person is seen; -1 is of a tracker's
    is_truth &= columns < 9 or bool((table[:, 8] >= 0.0).all())
    challenge = file.path.parent.parent / SEQUENCE
    if challenge.is_file():
        file.companions.append(challenge)
    name = file.path.parent.parent.name if is_truth else file.path.stem
    if name.endswith(f"-{GROUND_PLANE}") and (is_truth or columns == 10):
        middles = boxes[:, :2] + boxes[:, 2:] / 2.0
        heights = np.full(len(middles), np.nan) if is_truth else table[:, 9]
        yield TruthPiece(
            source=file.path,
            format="MOTChallenge ground plane",
            frames=frames,
            ids=ids,
            positions=np.column_stack([middles, heights]),
            unit="m",
            up="z",
            first_index=1,
            valid=table[:, 6] == 1.0 if is_truth else None,
        )
        return
    keep = np.ones(len(table), dtype=bool)
    scores = np.ones(len(table))
    left_out = ""
    if is_truth:
        labels = _labels(file)
        named = [n for n, name in labels.items() if name.lower() in PEOPLE]
        of_people = np.isin(table[:, 7], named or _PEOPLE_NUMBERS)
        keep = (table[:, 6] == 1.0) & of_people
        others = [
            "with 0 in column 7, not to count"
            if person
            else labels.get(int(number)) or f"of class {number:.0f}"
            for number, person in zip(table[~keep, 7], of_people[~keep], strict=True)
        ]
        left_out = no_people(file, others, len(table)) if others else ""
    elif columns >= 7:
        scores = to_unit(table[:, 6])
        if not scores.any():  # a tracker that writes none
            scores = np.ones(len(table))
    first = 0 if len(frames) and frames.min() == 0 else 1
    placed = np.zeros(len(table), dtype=bool)
    if columns == 10:
        placed = (table[:, 7:10] != -1.0).any(axis=1) & (ids >= 0)
    if placed.any() or challenge.is_file() or file.path.parts[-5:-4] == (TRACKEVAL,):
        boxes = boxes - [1.0, 1.0, 0.0, 0.0]
    yield DetectionPiece(
        source=file.path,
        format="MOTChallenge ground truth" if is_truth else "MOTChallenge detections",
        camera="",
        frames=frames[keep],
        boxes=boxes[keep],
        scores=scores[keep],
        layout="ltwh",
        first_index=1 if first else 0,
        left_out=left_out,
    )
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


def _labels(file: SourceFile) -> Mapping[int, str]:
    """The names of the classes by their numbers, of the labels beside the file."""
    labels = file.path.parent / LABELS
    if labels.is_symlink() or not labels.is_file() or labels.stat().st_size > _MOST_LABELS:
        return {}
    file.companions.append(labels)
    names = labels.read_text("utf-8", "replace").splitlines()
    return {number: name.strip() for number, name in enumerate(names, 1)}


def _table(file: SourceFile) -> Float[ndarray, "N C"]:
    lines = [decimal_points(line) for line in file.lines() if line.strip()]
    lines = [line.replace(",", " ").replace(";", " ") for line in lines]
    try:
        table = np.loadtxt(lines, ndmin=2, comments=None)
    except ValueError as error:
        raise file.error(f"expected rows of the same count of numbers ({error})") from None
    odd = ~(np.abs(table) <= 2.0**53)
    if odd.any():
        row = int(np.argmax(odd.any(axis=1)))
        raise file.error(
            f"expected finite numbers, found {shown(lines[row])}; correct or remove the row",
            f"row {row + 1}",
        )
    return table
