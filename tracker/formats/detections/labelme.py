"""LabelMe's JSON, a file a picture: the boxes of its rectangles, outlines and circles.

Source: Russell et al., "LabelMe", IJCV 77, 2008; labelme (the program of Wada), its examples.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.formats.columns import number_in, people
from tracker.formats.pieces import DetectionPiece, Piece
from tracker.formats.protocol import Certainty, Kind
from tracker.formats.source import SourceFile
from tracker.formats.values import is_list_of_tables, numbers

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
    frames: list[int] = []
    corners: list[np.ndarray] = []
    labels: list[str] = []
    looked_at = [0]
    size: tuple[int, int] | None = None
    for place, path in enumerate(file.series):
        member = file.member(path)
        shapes = member.json.get("shapes") if isinstance(member.json, dict) else None
        if not is_list_of_tables(shapes):
            raise member.error('expected a list "shapes" of tables')
        assert isinstance(shapes, list)
        number = number_in(path.name)
        frame = place if number is None else number
        looked_at.append(frame)
        sides = [member.json.get(f"image{side}") for side in ("Width", "Height")]
        if all(isinstance(side, int) and 0 < side < 65536 for side in sides):
            size = (sides[0], sides[1])
        for n, shape in enumerate(shapes):
            if shape.get("shape_type", "polygon") in _BOXED:
                points = numbers(member, f"shapes {n} points", shape.get("points", []))
                if len(points) < 4 or len(points) % 2:
                    raise member.error("expected two or more points", f"shapes {n} points")
                table = points.reshape(-1, 2)
                corners.append(np.concatenate([table.min(axis=0), table.max(axis=0)]))
                frames.append(frame)
                labels.append(str(shape.get("label", "")))
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
