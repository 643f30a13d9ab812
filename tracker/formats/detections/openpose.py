"""OpenPose's key points: JSON a frame, with ``people`` and ``pose_keypoints_2d``.

AlphaPose's ``--format open`` and Pose2Sim's RTMLib write the same. Frames count from 0.

Source: Cao et al., "OpenPose", IEEE TPAMI 43(1), 2021, and its "Output" page.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tracker.formats.columns import number_in
from tracker.formats.detections.body import read_people
from tracker.formats.pieces import DetectionPiece, Piece
from tracker.formats.protocol import Certainty, Kind
from tracker.formats.source import SourceFile
from tracker.formats.values import is_list_of_tables

NAME = "OpenPose key points JSON"
KIND: Kind = "detections"
SERIES = True

FIELD = "pose_keypoints_2d"


def recognise(file: SourceFile) -> Certainty:
    """JSON with people, who have pose_keypoints_2d where there is anybody."""
    head = file.head_text.lstrip()
    if head[:1] != "{" or '"people"' not in head[:2000]:
        return Certainty.NO
    return Certainty.SURE if FIELD in head else Certainty.LIKELY


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the boxes of all frames of the series."""
    frames: list[int] = []
    poses: list[Any] = []
    last = 0
    for place, path in enumerate(file.series):
        member = file.member(path)
        frame = _frame(path)
        frame = place if frame is None else frame
        last = max(last, frame)
        values = member.json
        people = values.get("people") if isinstance(values, dict) else None
        if not is_list_of_tables(people):
            raise member.error('expected a list "people" of tables')
        assert isinstance(people, list)
        for person in people:
            frames.append(frame)
            poses.append(person.get(FIELD))
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


def _frame(path: Path) -> int | None:
    """``cam1_000000000012_keypoints.json`` is frame 12."""
    return number_in(path.name.replace("_keypoints", ""))
