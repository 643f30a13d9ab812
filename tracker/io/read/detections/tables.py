"""The tables of boxes whose columns are declared: rows without a header that mean something by
place.

Sources: NVIDIA DeepStream, ``deepstream_app.c``, ``write_kitti_output`` and
``write_kitti_track_output``; KITTI's development kit for tracking (Geiger et al., CVPR 2012);
VATIC's text (Vondrick et al., IJCV 101, 2013), which the CAMPUS data set has (Xu et al., CVPR
2016); AI City Challenge, "Multi-camera people tracking", which has the columns of DukeMTMC (Ristani
et al., ECCV workshops 2016).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from tracker.io.read.columns import Column, decimal_points, read_table
from tracker.io.read.pieces import DetectionPiece, Piece, TruthPiece, Unit
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, number_in

_LOOKED_AT = 50
"""Rows by which a file is recognised."""

_WHOLE = ("frame", "id", "camera")

ZERO = "0"
"""A column in which the program that writes the format has nothing but zeros."""

LOST = "lost"
"""A column that has 1 in rows whose box is out of sight, which are left out."""

_UNREAD = ("", ZERO, LOST)


@dataclass(frozen=True, slots=True)
class TableFormat:
    """Rows of boxes, and of places if there are columns x and y, with blanks between the cells."""

    KIND: ClassVar[Kind] = "detections"

    NAME: str
    columns: tuple[str, ...]
    """The meaning of each column, as :data:`tracker.io.read.columns.WORDS` calls it; :data:`ZERO`;
    :data:`LOST`; or empty. A class that stands first may have several words, any class quotes."""
    optional: int = 0
    """How many of the last columns may be missing."""
    SERIES: bool = False
    """Whether each frame has a file, whose name ends with the frame's number."""
    unit: Unit | None = None
    """The unit of places."""

    def recognise(self, file: SourceFile) -> Certainty:
        """Rows with as many cells, each of the kind that its column demands."""
        lines = file.head_text.splitlines()
        lines = lines[:-1] if len(lines) > 1 and file.size > len(file.head) else lines
        rows = [self._cells(line) for line in lines[:_LOOKED_AT] if line.strip()]
        if not rows or not all(self._fits(row) for row in rows):
            return Certainty.NO
        return Certainty.SURE if ZERO in self.columns else Certainty.LIKELY

    def read(self, file: SourceFile) -> Iterator[Piece]:
        """One piece of boxes a camera, and the places; of a series all frames together."""
        table: dict[str, list[Any]] = {name: [] for name in self.columns if name not in _UNREAD}
        if self.SERIES:
            table["frame"] = []
        for frame, member in file.frames():
            for line, text in enumerate(member.lines(), 1):
                if not text.strip():
                    continue
                row = self._cells(text)
                if not len(self.columns) - self.optional <= len(row) <= len(self.columns):
                    raise member.error(
                        f"line {line}: expected {len(self.columns)} columns, found {len(row)}"
                    )
                if LOST in self.columns and row[self.columns.index(LOST)] == "1":
                    continue
                for name, cell in zip(self.columns, row, strict=False):
                    if name not in _UNREAD:
                        table[name].append(cell.strip('"'))
                if self.SERIES:
                    table["frame"].append(frame)
        yield from self._pieces(file, table)

    def _pieces(self, file: SourceFile, table: dict[str, list[Any]]) -> Iterator[Piece]:
        rows = len(table["frame"])
        boxes: dict[str, Column] = {
            name: column
            for name, column in table.items()
            if name not in ("x", "y") and len(column) == rows
        }
        looked_at = [number for path in file.series if (number := number_in(path.name)) is not None]
        for piece in read_table(file, self.NAME, boxes):
            if self.SERIES and looked_at and isinstance(piece, DetectionPiece):
                piece = replace(piece, last_frame=max(looked_at))
                piece = replace(piece, first_index=0 if min(looked_at) == 0 else None)
            yield piece
        if "x" in table and rows:
            yield from self._places(file, table)

    def _places(self, file: SourceFile, table: dict[str, list[Any]]) -> Iterator[Piece]:
        """The place of each person in each frame once, though several cameras have a row of it."""
        keys = list(zip(table["frame"], table["id"], strict=True))
        first = {key: row for row, key in reversed(list(enumerate(keys)))}
        known = sorted(row for row in first.values() if table["x"][row] != "-1")
        places = {name: [table[name][row] for row in known] for name in ("frame", "id", "x", "y")}
        for piece in read_table(file, self.NAME, places) if known else ():
            if isinstance(piece, TruthPiece):
                yield replace(piece, unit=self.unit, up="z")

    def _cells(self, line: str) -> list[str]:
        words = decimal_points(line).split()
        if self.columns[0] != "class":
            return words
        count = next((n for n, word in enumerate(words) if n and _number(word) is not None), 1)
        return [" ".join(words[:count]), *words[count:]]

    def _fits(self, row: list[str]) -> bool:
        if not len(self.columns) - self.optional <= len(row) <= len(self.columns):
            return False
        values: dict[str, float] = {}
        for name, cell in zip(self.columns, row, strict=False):
            if name == "class":
                continue
            value = _number(cell)
            if value is None or (name in _WHOLE and value != round(value)):
                return False
            if name == ZERO and value != 0.0:
                return False
            values[name] = value
        width = values.get("width", values.get("right", np.inf) - values["left"])
        height = values.get("height", values.get("bottom", np.inf) - values["top"])
        return width > 1.0 and height > 1.0


def _number(word: str) -> float | None:
    try:
        value = float(word)
    except ValueError:
        return None
    return value if np.isfinite(value) else None


_BOX = ("left", "top", "right", "bottom")

DEEPSTREAM = TableFormat(
    "KITTI text of DeepStream",
    ("class", *[ZERO] * 3, *_BOX, *[ZERO] * 7, "score"),
    optional=1,
    SERIES=True,
)

DEEPSTREAM_TRACKS = TableFormat(
    "KITTI text of DeepStream's tracker",
    ("class", "id", *[ZERO] * 3, *_BOX, *[ZERO] * 7, "score"),
    optional=1,
    SERIES=True,
)

KITTI_TRACKING = TableFormat(
    "KITTI tracking labels",
    ("frame", "id", "class", *[""] * 3, *_BOX, *[""] * 7, "score"),
    optional=1,
)

VATIC = TableFormat("VATIC text", ("id", *_BOX, "frame", LOST, "", "", "class"))

AI_CITY = TableFormat(
    "NVIDIA ground truth (AI City text)",
    ("camera", "id", "frame", "left", "top", "width", "height", "x", "y"),
    unit="m",
)

FORMATS = (DEEPSTREAM, DEEPSTREAM_TRACKS, KITTI_TRACKING, VATIC, AI_CITY)
