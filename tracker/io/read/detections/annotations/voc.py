"""Pascal VOC's XML, a file a picture, as LabelImg and many others write it.

Source: Everingham et al., "The Pascal visual object classes challenge", IJCV 88, 2010.
"""

from __future__ import annotations

from collections.abc import Iterator

from tracker.io.read.detections.pictured import PicturedBoxes
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import numbers

NAME = "Pascal VOC XML"
KIND: Kind = "detections"
SERIES = True

_CORNERS = ("xmin", "ymin", "xmax", "ymax")


def recognise(file: SourceFile) -> Certainty:
    """XML of one annotation with a picture's name or size."""
    head = file.head_text
    is_it = "<annotation" in head and "<annotations" not in head
    is_it &= "<bndbox>" in head or ("<filename>" in head and "<size>" in head)
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the boxes of all pictures of the series."""
    found = PicturedBoxes(file, NAME)
    for member in found.pictures():
        found.sized(member.xml.findtext("size/width"), member.xml.findtext("size/height"))
        for n, one in enumerate(member.xml.iter("object")):
            given = [one.findtext(f"bndbox/{corner}") for corner in _CORNERS]
            if None in given:
                raise member.error(f"expected a bndbox with {', '.join(_CORNERS)}", f"object {n}")
            found.add(numbers(member, f"object {n} bndbox", given), one.findtext("name", ""))
    yield from found.pieces()
