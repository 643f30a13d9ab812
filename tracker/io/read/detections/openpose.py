"""OpenPose's key points: JSON a frame, with ``people`` and ``pose_keypoints_2d``.

Pose2Sim's RTMLib writes the same. AlphaPose's ``--format open`` writes it a frame or, in one
file, by the pictures' names; its ``--format cmu`` calls the fields ``bodies`` and ``joints``.
Frames count from 0.

Sources: Cao et al., "OpenPose", IEEE TPAMI 43(1), 2021, and its "Output" page; Fang et al.,
"AlphaPose", IEEE TPAMI 45(6), 2023, and its "Output format" page.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tracker.io.read.detections.body import read_people
from tracker.io.read.pieces import DetectionPiece, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile, number_in
from tracker.io.read.values import field_of, tables

NAME = "OpenPose key points JSON"
KIND: Kind = "detections"
SERIES = True

FIELDS = (("people", "pose_keypoints_2d"), ("bodies", "joints"))
"""What the list of people and a person's joints are called."""


def recognise(file: SourceFile) -> Certainty:
    """JSON with people, who have joints where there is anybody."""
    head = file.head_text.lstrip()
    if head[:1] == "{":
        for people, joints in FIELDS:
            if f'"{people}"' in head[:2000]:
                return Certainty.SURE if f'"{joints}"' in head else Certainty.LIKELY
    return Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the boxes of all frames of the series."""
    frames: list[int] = []
    poses: list[Any] = []
    last = 0
    for place, path in enumerate(file.series):
        for frame, found_there in _people(file.member(path), place):
            last = max(last, frame)
            frames += [frame] * len(found_there)
            poses += found_there
    found = read_people(file, poses)
    boxes = np.zeros((0, 4)) if found is None else found.boxes
    joints = np.zeros((0, 25, 3)) if found is None else found.joints
    keep = np.isfinite(boxes).all(axis=1)
    where = np.array(frames, dtype=np.int64)[: len(boxes)][keep]
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(joints[:, :, 2])
        confidence = np.where(seen, joints[:, :, 2], 0.0).sum(axis=1) / np.maximum(
            seen.sum(axis=1), 1
        )
    yield DetectionPiece(
        source=file.path,
        format=NAME,
        camera="",
        frames=where,
        boxes=boxes[keep],
        scores=np.clip(confidence, 0.0, 1.0)[keep],
        layout="ltwh",
        first_index=0 if len(file.series) > 1 and _frame(file.series[0]) == 0 else None,
        last_frame=last,
        keypoints=joints[keep],
    )


def _people(file: SourceFile, place: int) -> Iterator[tuple[int, list[Any]]]:
    """Each frame of a file with its people's joints; one frame, unless pictures are named."""
    values = file.json
    named = isinstance(values, dict) and not any(people in values for people, _ in FIELDS)
    by_frame: dict[Any, Any] = values if named else {file.path.name: values}
    for at, (name, one) in enumerate(by_frame.items(), place):
        people, joints = next((f for f in FIELDS if field_of(one, f[0]) is not None), FIELDS[0])
        poses = [person.get(joints) for person in tables(file, people, field_of(one, people))]
        frame = _frame(Path(name))
        yield at if frame is None else frame, poses


def _frame(path: Path) -> int | None:
    """``cam1_000000000012_keypoints.json`` is frame 12."""
    return number_in(path.name.replace("_keypoints", ""))
