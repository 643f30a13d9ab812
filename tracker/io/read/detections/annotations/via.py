"""VGG Image Annotator's project, its annotations as JSON, or as CSV: boxes of its regions.

Rectangles, polygons, circles and ellipses count; of points and lines there is no box. Regions
may be a list or, as version 1 has them, a table.

Source: Dutta, Zisserman, "The VIA annotation software", ACM Multimedia 2019.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from typing import Any

from tracker.files.text import shown
from tracker.io.read.detections.pictured import PicturedBoxes
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, camera_of, number_in
from tracker.io.read.values import number, numbers

NAME = "VGG Image Annotator JSON or CSV"
KIND: Kind = "detections"
SERIES = False

_COLUMNS = ("filename", "region_shape_attributes", "region_attributes")
_Row = tuple[str, Mapping[str, Any], Mapping[str, Any]]
"""The picture's name, the shape and what is said of it."""


def recognise(file: SourceFile) -> Certainty:
    """Its CSV's header, or a JSON table with regions that have shapes."""
    head = file.head_text.lstrip()
    if head[:1] == "{":
        is_it = '"regions"' in head and '"filename"' in head
        is_it &= '"shape_attributes"' in head or '"_via_' in head or '"file_attributes"' in head
        return Certainty.SURE if is_it else Certainty.NO
    first = head.split("\n", 1)[0].lstrip("#")
    return Certainty.SURE if all(name in first for name in _COLUMNS) else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """A piece a folder of the pictures' names, or beginning of theirs, which is a camera."""
    is_json = file.head_text.lstrip()[:1] == "{"
    found = PicturedBoxes(file, NAME)
    for picture, shape, told in _of_json(file) if is_json else _of_csv(file):
        frame = number_in(picture)
        if frame is None:
            raise file.error(f"expected a name with the frame's number, found {shown(picture)}")
        found.look_at(camera_of(picture), frame)
        corners = _corners(file, picture, shape)
        if corners is not None:
            found.add(corners, _label(told))
    yield from found.pieces()


def _of_json(file: SourceFile) -> Iterator[_Row]:
    """Every region; a picture without any once, with no shape."""
    values = file.json
    pictures = values.get("_via_img_metadata", values) if isinstance(values, dict) else None
    if not isinstance(pictures, dict):
        raise file.error(f"expected a table of pictures, found {shown(values)}")
    for key, picture in pictures.items():
        if not isinstance(picture, dict) or "filename" not in picture:
            raise file.error("expected a table with filename and regions", str(key)[:60])
        regions = picture.get("regions", [])
        listed = list(regions.values()) if isinstance(regions, dict) else regions
        for region in listed or [{}]:
            if not isinstance(region, dict):
                raise file.error(f"expected a region, found {shown(region)}", str(key)[:60])
            yield (
                str(picture["filename"]),
                _table(region.get("shape_attributes")),
                _table(region.get("region_attributes")),
            )


def _of_csv(file: SourceFile) -> Iterator[_Row]:
    header, *lines = [line for line in file.lines() if line.strip()]
    names = [name.strip() for name in next(csv.reader([header.lstrip("#")]))]
    for place, cells in enumerate(csv.reader(lines), 2):
        if len(cells) != len(names):
            raise file.error(
                f"expected {len(names)} columns as in the header, found {len(cells)}",
                f"row {place}",
            )
        row = dict(zip(names, cells, strict=True))
        try:
            shape, told = (json.loads(row[name] or "{}") for name in _COLUMNS[1:])
        except (ValueError, RecursionError):
            raise file.error("expected shape and attributes as JSON", f"row {place}") from None
        yield row["filename"], _table(shape), _table(told)


def _table(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _corners(file: SourceFile, picture: str, shape: Mapping[str, Any]) -> list[float] | None:
    """left, top, right, bottom of a shape; None of one that surrounds nothing."""

    def values(*names: str) -> list[float]:
        return [number(file, f"{picture} {name}", shape.get(name)) for name in names]

    match shape.get("name"):
        case "rect":
            x, y, width, height = values("x", "y", "width", "height")
            return [x, y, x + width, y + height]
        case "circle":
            x, y, radius = values("cx", "cy", "r")
            return [x - radius, y - radius, x + radius, y + radius]
        case "ellipse":
            x, y, wide, high = values("cx", "cy", "rx", "ry")
            return [x - wide, y - high, x + wide, y + high]
        case "polygon":
            across, down = (
                numbers(file, f"{picture} {name}", shape.get(name, []))
                for name in ("all_points_x", "all_points_y")
            )
            if len(across) < 2 or len(across) != len(down):
                raise file.error("expected as many x as y, two or more", f"{picture} all_points_x")
            return [across.min(), down.min(), across.max(), down.max()]
    return None


def _label(told: Mapping[str, Any]) -> str:
    """What a region is of: the first attribute that is a word; none where it has only others."""
    words = (value for value in told.values() if isinstance(value, str) and value)
    return next(words, "")
