"""CSV with a row a camera: ``camera,fx,fy,cx,cy,k1,…,tx,ty,tz`` under their usual names."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

from tracker.io.read.calibration.camera_fields import by_camera, camera
from tracker.io.read.columns import delimiter_of
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "table with a row a camera (CSV)"
KIND: Kind = "calibration"
SERIES = False

MOST_BYTES = 2**20


def recognise(file: SourceFile) -> Certainty:
    """A header with a lens or a pose, and rows of as many cells."""
    lines = file.head_text.splitlines()
    if len(lines) < 2 or file.size > MOST_BYTES or not any(sign in lines[0] for sign in ",;\t"):
        return Certainty.NO
    try:
        first = next(_rows(file.head_text), None)
    except csv.Error:
        return Certainty.NO
    return Certainty.SURE if first is not None and "" in by_camera(first) else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with a camera a row; nothing is known of the convention."""
    try:
        rows = list(_rows(file.text(MOST_BYTES)))
    except csv.Error as error:
        raise file.error(f"is not a CSV table ({error})") from None
    found = []
    for place, row in enumerate(rows):
        fields = by_camera(row)
        if "" not in fields:
            raise file.error("expected a number in each column of a camera", f"row {place + 1}")
        found.append(camera(file, str(place + 1), fields[""], Convention()))
    yield CalibrationPiece(file.path, NAME, tuple(found))


def _rows(text: str) -> Iterator[dict[str, Any]]:
    """Rows with their cells as numbers, where they are."""
    first = text.split("\n", 1)[0]
    delimiter = delimiter_of(first)
    for row in csv.DictReader(io.StringIO(text), delimiter=delimiter, skipinitialspace=True):
        yield {name.strip(): _cell(cell) for name, cell in row.items() if name and cell is not None}


def _cell(text: str | list[str]) -> Any:
    try:
        return float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return text
