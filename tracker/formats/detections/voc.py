"""Pascal VOC's XML, a file a picture, as LabelImg and many others write it.

Source: Everingham et al., "The Pascal visual object classes challenge", IJCV 88, 2010.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.formats.columns import number_in, people
from tracker.formats.pieces import DetectionPiece, Piece
from tracker.formats.protocol import Certainty, Kind
from tracker.formats.source import SourceFile
from tracker.formats.values import numbers

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
    frames: list[int] = []
    corners: list[np.ndarray] = []
    labels: list[str] = []
    looked_at = [0]
    size: tuple[int, int] | None = None
    for place, path in enumerate(file.series):
        member = file.member(path)
        number = number_in(path.name)
        frame = place if number is None else number
        looked_at.append(frame)
        sides = [member.xml.findtext(f"size/{side}", "") for side in ("width", "height")]
        if all(side.strip().isdigit() and 0 < int(side) < 65536 for side in sides):
            size = (int(sides[0]), int(sides[1]))
        for n, one in enumerate(member.xml.iter("object")):
            given = [one.findtext(f"bndbox/{corner}") for corner in _CORNERS]
            if None in given:
                raise member.error(f"expected a bndbox with {', '.join(_CORNERS)}", f"object {n}")
            corners.append(numbers(member, f"object {n} bndbox", given))
            frames.append(frame)
            labels.append(one.findtext("name", ""))
    keep = people(labels)
    yield DetectionPiece(
        source=file.path,
        format=NAME,
        camera="",
        frames=np.array(frames, dtype=np.int64)[keep],
        boxes=np.array(corners).reshape(-1, 4)[keep],
        scores=np.ones(int(keep.sum())),
        layout="xyxy",
        first_index=0 if 0 in looked_at[1:] else None,
        last_frame=max(looked_at),
        image_size=size,
    )
