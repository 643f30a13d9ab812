"""SceneScape's JSON lines: a frame a line, its objects by category, with boxes or with places.

A camera's lines have boxes in pixels (``bounding_box_px``: left, top, width, height), those of
the scene places in metres (``translation``); a line has a time, a camera's its frame, too.

Source: Intel, SceneScape, "Detection and scene data formats", and its tracker metric set.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np

from tracker.io.read.columns import people, read_table
from tracker.io.read.pieces import DetectionPiece, Piece, TruthPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import need, number, tables, vector

NAME = "SceneScape JSON lines"
KIND: Kind = "detections"
SERIES = False

_SIDES = {"left": "x", "top": "y", "width": "width", "height": "height"}


def recognise(file: SourceFile) -> Certainty:
    """JSON lines with a time and objects that have a box in pixels or a translation."""
    first = file.head_text.split("\n", 1)[0]
    is_it = first.startswith("{") and '"timestamp"' in first and '"objects"' in first
    is_it &= '"bounding_box_px"' in file.head_text or '"translation"' in file.head_text
    return Certainty.SURE if is_it and file.json_lines is not None else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the boxes of the camera, or with the places."""
    boxes: list[tuple[Any, ...]] = []
    places: list[tuple[Any, ...]] = []
    lines = file.json_lines or []
    for line, values in enumerate(lines):
        where = f"line {line + 1}"
        need(file, values, ("timestamp", "objects"), where)
        frame = int(number(file, f"{where} frame", values.get("frame", line)))
        for one in _objects(file, where, values["objects"]):
            kind = str(one.get("category", "person"))
            if isinstance(one.get("bounding_box_px"), dict):
                sides = [one["bounding_box_px"].get(side) for side in _SIDES.values()]
                score = one.get("confidence", 1.0)
                boxes.append((frame, kind, score, *vector(file, where, sides, 4, "a box")))
            elif "translation" in one:
                place = vector(file, f"{where} translation", one["translation"], 3, "x y z")
                places.append((kind, frame, one.get("id"), *place[:2]))
    fps = _rate(file, lines)
    if boxes:
        names = ("frame", "class", "score", *_SIDES)
        columns = dict(zip(names, zip(*boxes, strict=True), strict=True))
        last = int(number(file, "frame", lines[-1].get("frame", len(lines) - 1)))
        for piece in read_table(file, NAME, columns):
            if isinstance(piece, DetectionPiece):
                yield replace(piece, fps=fps, first_index=0, last_frame=last)
    if places:
        known = [row[1:] for row, keep in zip(places, people([p[0] for p in places]), strict=True)
                 if keep]  # fmt: skip
        columns = dict(zip(("frame", "id", "x", "y"), zip(*known, strict=True), strict=True))
        for piece in read_table(file, NAME, columns):
            if isinstance(piece, TruthPiece):
                yield replace(piece, unit="m", up="z", fps=fps, first_index=0)


def _objects(file: SourceFile, where: str, objects: Any) -> Iterator[dict[str, Any]]:
    """The objects of a line, in one list or in a list a category."""
    for own in objects.values() if isinstance(objects, dict) else (objects,):
        yield from tables(file, f"{where} objects", own)


def _rate(file: SourceFile, lines: list[Any]) -> float | None:
    """Frames a second by the times of the lines; None of a single one."""
    try:
        first, last = (
            datetime.fromisoformat(str(lines[place]["timestamp"]).replace("Z", "+00:00"))
            for place in (0, -1)
        )
    except ValueError:
        raise file.error("expected times as 2014-09-08T04:00:00.033Z", "timestamp") from None
    counted = [line.get("frame", place) for place, line in enumerate(lines)]
    seconds = (last - first).total_seconds()
    steps = float(np.subtract(counted[-1], counted[0]))
    return round(steps / seconds, 3) if seconds > 0.0 and steps > 0.0 else None
