"""LabelMe's JSON, a file a picture: the boxes of its rectangles, outlines and circles.

Source: Russell et al., "LabelMe", IJCV 77, 2008; labelme (the program of Wada), its examples.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.io.read.detections.pictured import PicturedBoxes
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import field_of, numbers, tables

NAME = "LabelMe JSON"
KIND: Kind = "detections"
SERIES = True

_BOXED = ("rectangle", "polygon", "mask", "linestrip")
"""Shapes whose points surround somebody; a point or a line does not."""


def recognise(file: SourceFile) -> Certainty:
    """JSON with shapes and the path of their picture."""
    head = file.head_text
    # the picture itself may stand, encoded, before its path
    is_it = head.lstrip()[:1] == "{" and '"shapes"' in head and '"flags"' in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the boxes of all pictures of the series."""
    found = PicturedBoxes(file, NAME)
    for member in found.pictures():
        shapes = tables(member, "shapes", field_of(member.json, "shapes"))
        found.sized(member.json.get("imageWidth"), member.json.get("imageHeight"))
        for n, shape in enumerate(shapes):
            if shape.get("shape_type", "polygon") in _BOXED:
                points = numbers(member, f"shapes {n} points", shape.get("points", []))
                if len(points) < 4 or len(points) % 2:
                    raise member.error("expected two or more points", f"shapes {n} points")
                table = points.reshape(-1, 2)
                corners = np.concatenate([table.min(axis=0), table.max(axis=0)])
                found.add(corners, str(shape.get("label", "")))
    yield from found.pieces()
