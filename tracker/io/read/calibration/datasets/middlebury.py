"""The ``_par.txt`` of Middlebury's multi-view data: a row a picture, its name, K, R and t.

A point is seen at K (R x + t), without distortion; the unit is the data set's own.

Source: Seitz et al., "A comparison and evaluation of multi-view stereo reconstruction
algorithms", CVPR 2006, and the README of its data sets.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath

from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import intrinsics, matrix, rotation, vector

NAME = "Middlebury _par.txt"
KIND: Kind = "calibration"
SERIES = False

_CONVENTION = Convention(direction="world-to-camera", axes="opencv")
_NUMBERS = 21
"""K, R and t of a row."""
MOST_BYTES = 2**22


def recognise(file: SourceFile) -> Certainty:
    """The count of rows, and a first one with a picture's name and 21 numbers."""
    first, *rest = file.head_text.split("\n", 2)
    if not first.strip().isdigit() or not rest:
        return Certainty.NO
    row = rest[0].split()
    return Certainty.SURE if len(row) == 1 + _NUMBERS and "." in row[0] else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with a camera a row."""
    first, *lines = file.text(MOST_BYTES).splitlines()
    rows = [line.split() for line in lines if line.strip()]
    if not first.strip().isdigit() or int(first) != len(rows):
        raise file.error(f"line 1: expected the count of rows below it, found {first.strip()[:20]}")
    cameras = []
    for number, (picture, *values) in enumerate(rows, 2):
        where = f"line {number}"
        given = vector(file, where, values, _NUMBERS, "K, R and t")
        cameras.append(
            RawCamera(
                name=PurePosixPath(picture).stem,
                intrinsics=intrinsics(file, f"{where} K", matrix(file, where, given[:9], 3, 3)),
                rotation=rotation(file, f"{where} R", given[9:18]),
                translation=given[18:],
                convention=_CONVENTION,
            )
        )
    yield CalibrationPiece(file.path, NAME, tuple(cameras))
