"""CVAT's XML, "CVAT for video" and "CVAT for images" 1.1. Frames count from 0.

Source: CVAT, "CVAT annotation format".
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np

from tracker.io.read.columns import only_people
from tracker.io.read.pieces import DetectionPiece, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import numbers, stated_size

NAME = "CVAT XML"
KIND: Kind = "detections"
SERIES = False

_CORNERS = ("xtl", "ytl", "xbr", "ybr")


def recognise(file: SourceFile) -> Certainty:
    """XML of annotations with tracks or images and boxes by their corners."""
    head = file.head_text
    if not re.search(r"<annotations>", head):
        return Certainty.NO
    return Certainty.SURE if "<track" in head or "<image" in head else Certainty.LIKELY


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every box that is not outside the picture."""
    frames: list[int] = []
    corners: list[np.ndarray] = []
    labels: list[str] = []

    def add(frame: str | None, box: ElementTree.Element, label: str) -> None:
        field = f"box of frame {frame}"
        given = [box.get(name) for name in _CORNERS]
        if None in given:
            raise file.error(f"expected {', '.join(_CORNERS)}", field)
        frames.append(int(numbers(file, field, [frame])[0]))
        corners.append(numbers(file, field, given))
        labels.append(label)

    root = file.xml
    for track in root.findall("track"):
        for box in track.findall("box"):
            if box.get("outside") != "1":
                add(box.get("frame"), box, track.get("label", ""))
    for image in root.findall("image"):
        for box in image.findall("box"):
            add(image.get("id"), box, box.get("label", ""))
    sides = (root.findtext(f".//original_size/{side}") for side in ("width", "height"))
    last = root.findtext(".//task/stop_frame") or root.findtext(".//task/size")
    piece = DetectionPiece(
        source=file.path,
        format=NAME,
        camera=root.findtext(".//source") or root.findtext(".//task/name") or "",
        frames=np.array(frames, dtype=np.int64),
        boxes=np.array(corners).reshape(-1, 4),
        scores=np.ones(len(frames)),
        layout="xyxy",
        first_index=0,
        last_frame=int(last) if last is not None and last.strip().isdigit() else None,
        image_size=stated_size(*sides),
    )
    yield only_people(file, piece, labels)
