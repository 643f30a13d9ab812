"""COCO: results (a list of image_id, bbox, score) or a data set with images and annotations.

Boxes are left, top, width, height. AlphaPose writes the same with key points and ``box``.

Source: Lin et al., "Microsoft COCO", ECCV 2014; cocodataset.org, "Data format", "Results
format"; AlphaPose, "Output format".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from tracker.files.text import shown
from tracker.io.read.columns import only_people, to_unit
from tracker.io.read.detections.body import read_people
from tracker.io.read.pieces import DetectionPiece, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, camera_of, number_in
from tracker.io.read.values import numbers, stated_size, tables

NAME = "COCO results or annotations JSON"
KIND: Kind = "detections"
SERIES = False


def recognise(file: SourceFile) -> Certainty:
    """A list of records with image_id, or a table with images and annotations."""
    head = file.head_text.lstrip()
    if head[:1] == "[" and '"image_id"' in head and ('"bbox"' in head or '"keypoints"' in head):
        return Certainty.SURE
    if head[:1] != "{" or not re.search(r'"(images|annotations)"\s*:', head):
        return Certainty.NO
    values = file.json
    return Certainty.SURE if {"images", "annotations"} <= values.keys() else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """A piece a folder of the images' names, which is a camera; one where there are no names."""
    values = file.json
    images: dict[Any, Any] = {}
    classes: dict[Any, str] = {}
    if isinstance(values, dict):
        images = {one.get("id"): one for one in tables(file, "images", values["images"])}
        categories = values.get("categories", [])
        classes = {c.get("id"): str(c.get("name")) for c in categories if isinstance(c, dict)}
        records = tables(file, "annotations", values["annotations"])
    else:
        records = tables(file, "", values)
    unknown = [r for r in records if r.get("image_id") not in images] if images else []
    left_out = ""
    if 2 * len(unknown) > len(records):
        # a known fault of exporters: the number of the frame stands in place of the image's id
        share = 100.0 * len(unknown) / len(records)
        left_out = (
            f"{file.path.name}: the image_id of {share:.0f} % of the annotations is no id of an "
            "image; it is taken for the number of the frame"
        )
        first = next(iter(images.values()))
        camera = camera_of(str(first.get("file_name", "")))
        rows = [(str(record.get("image_id")), first, record) for record in records]
        yield replace(_piece(file, camera, rows, classes), left_out=left_out)
        return
    if unknown:
        left_out = (
            f"{file.path.name}: {len(unknown)} of {len(records)} annotations are of no image of "
            "the file; they are left out"
        )
        records = [record for record in records if record.get("image_id") in images]
    by_camera: dict[str, list[Any]] = {}
    for record in records:
        image = images.get(record.get("image_id"), {})
        name = str(image.get("file_name", record.get("image_id")))
        by_camera.setdefault(camera_of(name), []).append((name, image, record))
    for camera, rows in (by_camera or {"": []}).items():
        piece = _piece(file, camera, rows, classes)
        yield replace(piece, left_out=" ".join(filter(None, (piece.left_out, left_out))))


def _piece(
    file: SourceFile, camera: str, rows: list[Any], classes: dict[Any, str]
) -> DetectionPiece:
    frames = np.zeros(len(rows), dtype=np.int64)
    boxes = np.full((len(rows), 4), np.nan)
    scores = np.ones(len(rows))
    for place, (name, _, record) in enumerate(rows):
        frame = number_in(name)
        if frame is None:
            raise file.error(f"expected a name with the frame's number, found {shown(name)}")
        frames[place] = frame
        box = record.get("bbox", record.get("box"))
        if box is not None:
            found = numbers(file, f"record {place} bbox", box)
            if len(found) != 4:
                raise file.error(f"expected 4 numbers, found {len(found)}", f"record {place} bbox")
            boxes[place] = found
        scores[place] = numbers(file, f"record {place} score", [record.get("score", 1.0)])[0]
    kinds = [str(classes.get(r.get("category_id"), r.get("category_id", 1))) for *_, r in rows]
    keypoints = read_people(file, [record.get("keypoints") for *_, record in rows])
    if keypoints is not None:
        boxes = np.where(np.isfinite(keypoints.boxes), keypoints.boxes, boxes)
    # AlphaPose's score is a sum over box and joints, and above 1
    scores = to_unit(np.minimum(scores, 1.0) if keypoints is not None else scores)
    image = rows[0][1] if rows else {}
    piece = DetectionPiece(
        source=file.path,
        format="AlphaPose JSON" if keypoints is not None else NAME,
        camera=camera,
        frames=frames,
        boxes=boxes,
        scores=scores,
        layout="ltwh",
        keypoints=None if keypoints is None else keypoints.joints,
        last_frame=int(frames.max()) if len(frames) else None,
        image_size=stated_size(image.get("width"), image.get("height")),
    )
    return only_people(file, piece, kinds)
