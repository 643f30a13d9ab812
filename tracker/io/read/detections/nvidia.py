"""NVIDIA's ``ground_truth.json``: by frame the objects, their places and boxes in each camera.

Frames count from 0, boxes are corners, places metres; an object has a type.

Source: NVIDIA, Physical AI Smart Spaces data set (AI City Challenge 2025) and AutoMagicCalib,
"Ground truth data format".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tracker.files.text import shown
from tracker.io.read.columns import people, read_table
from tracker.io.read.pieces import DetectionPiece, Piece, TruthPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import number, tables, vector

NAME = "NVIDIA ground truth (AI City JSON)"
KIND: Kind = "detections"
SERIES = False

ON_FLOOR = 0.3
"""A median z below which places lie on the floor and are not the middle of a body, metres."""


def recognise(file: SourceFile) -> Certainty:
    """JSON with objects that have a place and visible boxes."""
    head = file.head_text
    marks = ("object id", "3d location", "2d bounding box visible")
    is_it = head.lstrip()[:1] == "{"
    is_it &= any(all(f'"{m.replace(" ", sign)}"' in head for m in marks) for sign in (" ", "_"))
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece of boxes a camera, and the places."""
    boxes: list[tuple[object, ...]] = []
    places: list[tuple[float, ...]] = []
    kinds: list[str] = []
    for frame, objects in file.json.items():
        if not str(frame).isdigit():
            raise file.error(f"expected the numbers of frames, found {shown(frame)}")
        for one in tables(file, f"frame {frame}", objects):
            own = {key.replace("_", " "): value for key, value in one.items()}
            where = f"frame {frame}, object {own.get('object id')}"
            kinds.append(str(own.get("object type", "person")))
            who = number(file, f"{where} object id", own.get("object id"))
            place = vector(file, f"{where} 3d location", own.get("3d location"), 3, "x y z")
            places.append((int(frame), who, *place))
            seen = own.get("2d bounding box visible")
            for camera, box in seen.items() if isinstance(seen, dict) else ():
                corners = vector(file, f"{where} {camera}", box, 4, "a box")
                boxes.append((int(frame), camera, kinds[-1], *corners))
    names = ("frame", "camera", "class", "left", "top", "right", "bottom")
    columns = dict(zip(names, zip(*boxes, strict=True), strict=True)) if boxes else {}
    last = max((int(frame) for frame in file.json), default=None)
    for piece in read_table(file, NAME, columns) if columns else ():
        if isinstance(piece, DetectionPiece):
            yield replace(piece, first_index=0, last_frame=last)
    rows = np.array(places).reshape(-1, 5)[people(kinds)]
    if len(rows) and abs(np.median(rows[:, 4])) < ON_FLOOR:
        rows[:, 4] = np.nan
    yield TruthPiece(
        source=file.path,
        format=NAME,
        frames=rows[:, 0].astype(np.int64),
        ids=rows[:, 1].astype(np.int64),
        positions=rows[:, 2:],
        unit="m",
        up="z",
        first_index=0,
    )
