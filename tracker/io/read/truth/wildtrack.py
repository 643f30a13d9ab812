"""WILDTRACK's ``annotations_positions``: JSON a frame, places on a grid and boxes of each view.

A ``positionID`` is the number of a cell of the data set's grid, which the files do not define:
MultiviewX and others write the same with their own. Boxes are corners, −1 where a view does not
see.

Sources: Chavdarova et al., "WILDTRACK", CVPR 2018, and its notes on the annotations; Hou, Zheng,
Gould, "Multiview detection with feature perspective transformation" (MultiviewX), ECCV 2020.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.pieces import GRIDS, DetectionPiece, Piece, TruthPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, number_in
from tracker.io.read.values import need, tables, vector

NAME = "WILDTRACK annotations"
KIND: Kind = "truth"
SERIES = True

VIDEO_RATE = 10.0
"""The numbers of WILDTRACK's files count frames at this rate: 0, 5, 10 … are two a second."""


def recognise(file: SourceFile) -> Certainty:
    """JSON records with personID, positionID and views."""
    head = file.head_text
    is_it = all(f'"{word}"' in head for word in ("personID", "positionID", "views"))
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """The truth, and the boxes of each view."""
    rows: list[tuple[int, int, int]] = []
    boxes: dict[int, list[tuple[int, int, list[float]]]] = {}
    numbers = [number_in(path.name) for path in file.series]
    known = [n for n in numbers if n is not None]
    stride = int(np.gcd.reduce(np.diff(known))) if len(known) > 1 else 1
    stride = stride or 1
    for place, path in enumerate(file.series):
        member = file.member(path)
        number = numbers[place]
        frame = place if number is None else (number - known[0]) // stride
        for person in tables(member, "", member.json):
            need(member, person, ("personID", "positionID", "views"))
            who, cell = vector(
                member, "personID and positionID", [person["personID"], person["positionID"]], 2, ""
            )
            rows.append((frame, int(who), int(cell)))
            for view in person["views"]:
                need(member, view, ("viewNum", "xmin", "ymin", "xmax", "ymax"), "views")
                found = vector(
                    member,
                    "views",
                    [view[side] for side in ("viewNum", "xmin", "ymin", "xmax", "ymax")],
                    5,
                    "a box",
                )
                seen = boxes.setdefault(int(found[0]), [])
                if found[1] != -1 or found[3] != -1:
                    seen.append((len(rows) - 1, frame, found[1:].tolist()))
    table = np.array(rows, dtype=np.int64).reshape(-1, 3)
    yield TruthPiece(
        source=file.path,
        format=NAME,
        frames=table[:, 0],
        ids=table[:, 1],
        positions=np.column_stack([GRIDS[0].places(table[:, 2]), np.full(len(table), np.nan)]),
        unit="m",
        up="z",
        fps=None if stride == 1 else VIDEO_RATE / stride,
        first_index=0,
        cells=table[:, 2],
        feet={str(view): _feet(len(table), seen) for view, seen in boxes.items()},
    )
    for view in sorted(boxes):
        yield DetectionPiece(
            source=file.path,
            format=NAME,
            camera=str(view),
            frames=np.array([frame for _, frame, _ in boxes[view]], dtype=np.int64),
            boxes=np.array([box for *_, box in boxes[view]], dtype=float).reshape(-1, 4),
            scores=np.ones(len(boxes[view])),
            layout="xyxy",
            first_index=0,
            last_frame=len(file.series) - 1,
        )


def _feet(
    count: int, seen: Sequence[tuple[int, int, Sequence[float]]]
) -> Float[ndarray, "count 2"]:
    """The middles of the lower edges of boxes, each at its row."""
    feet = np.full((count, 2), np.nan)
    for row, _, (left, _, right, bottom) in seen:
        feet[row] = (left + right) / 2.0, bottom
    return feet
