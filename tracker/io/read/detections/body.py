"""The box of a person from the joints of a pose, and the layouts that joints come in.

A pose ends at the ankles or toes and at the nose or crown; a detector's box, and the person,
end at the soles and above the hair. Where head and feet are seen, the missing parts follow
from stature: the ankle lies 0.039 of it above the floor, the nose about 0.923 (between eye,
0.936, and chin, 0.870) [W09].

[W09] Winter, "Biomechanics and motor control of human movement", 4th edition, Wiley 2009,
figure 4.1, after Drillis and Contini, 1966.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.source import SourceFile
from tracker.io.read.values import numbers

ANKLE_HEIGHT = 0.039
NOSE_HEIGHT = 0.923
"""Parts of the stature above the floor [W09]."""

FLESH = 0.03
"""Part of the stature from a joint to the skin: shoulders are 0.259 wide over the muscles and
about 0.2 between the joints [W09]."""

LEAST_CONFIDENCE = 0.05
"""Of a joint; a pose estimator writes 0 for what it did not find."""

LEAST_JOINTS = 3
"""Joints that make a person."""


@dataclass(frozen=True)
class Layout:
    """Which number each joint has."""

    head: tuple[int, ...]
    """Nose, eyes, ears: what is at the nose's height."""
    crown: int | None
    ankles: tuple[int, int]
    limbs: tuple[tuple[int, int], ...]
    """Joints that bones join; wrong numbers would make them long."""


_COCO_LIMBS = ((5, 6), (5, 7), (7, 9), (6, 8), (8, 10), (5, 11), (6, 12), (11, 12), (11, 13),
               (13, 15), (12, 14), (14, 16), (0, 5), (0, 6))  # fmt: skip
_BODY_LIMBS = ((0, 1), (1, 2), (2, 3), (3, 4), (1, 5), (5, 6), (6, 7), (1, 8), (8, 9), (9, 10),
               (10, 11), (8, 12), (12, 13), (13, 14), (11, 22), (14, 19), (0, 15),
               (0, 16))  # fmt: skip
_COCO18_LIMBS = ((0, 1), (1, 2), (2, 3), (3, 4), (1, 5), (5, 6), (6, 7), (1, 8), (8, 9), (9, 10),
                 (1, 11), (11, 12), (12, 13), (0, 14), (0, 15))  # fmt: skip

LAYOUTS: dict[int, tuple[Layout, ...]] = {
    17: (Layout((0, 1, 2, 3, 4), None, (15, 16), _COCO_LIMBS),),
    18: (Layout((0, 14, 15, 16, 17), None, (10, 13), _COCO18_LIMBS),),
    # BODY_25, and BODY_25B, which begins as COCO does and has the crown
    25: (
        Layout((0, 15, 16, 17, 18), None, (11, 14), _BODY_LIMBS),
        Layout((0, 1, 2, 3, 4), 18, (15, 16), (*_COCO_LIMBS, (15, 19), (16, 22), (17, 0))),
    ),
    26: (Layout((0, 1, 2, 3, 4), 17, (15, 16), _COCO_LIMBS),),  # Halpe
    133: (Layout((0, 1, 2, 3, 4), None, (15, 16), _COCO_LIMBS),),  # COCO WholeBody
    136: (Layout((0, 1, 2, 3, 4), 17, (15, 16), _COCO_LIMBS),),
}
"""By the count of joints: COCO, OpenPose and AlphaPose."""


@dataclass(frozen=True, eq=False)
class People:
    """Poses and their boxes. D people, J joints."""

    joints: Float[ndarray, "D J 3"]
    """x, y, confidence; NaN where not seen."""
    boxes: Float[ndarray, "D 4"]
    """left, top, width, height, pixels; NaN where too few joints were seen."""


def read_people(file: SourceFile, poses: Sequence[Any]) -> People | None:
    """Poses given as flat lists x, y, confidence, …; None where there is none.

    Raises:
        FormatError: If a list is not of three numbers a joint.
    """
    flat = [
        numbers(file, "keypoints", pose, missing=True)
        for pose in poses
        if pose is not None and len(pose)
    ]
    if not flat:
        return None
    count = len(flat[0])
    if count % 3 or any(len(pose) != count for pose in flat):
        counts = ", ".join(map(str, sorted({len(pose) for pose in flat})))
        raise file.error(
            "expected x, y and confidence of the same count of joints for every person, found "
            f"{counts} numbers; export one model's joints alone",
            "keypoints",
        )
    joints = np.full((len(poses), count // 3, 3), np.nan)
    rows = [n for n, pose in enumerate(poses) if pose is not None and len(pose)]
    joints[rows] = np.reshape(flat, (len(flat), -1, 3))
    joints[~(joints[:, :, 2] > LEAST_CONFIDENCE) | np.isnan(joints).any(axis=2)] = np.nan
    return People(joints, boxes_of(joints))


def boxes_of(joints: Float[ndarray, "D J 3"]) -> Float[ndarray, "D 4"]:
    """Boxes of people: around what was seen, up to crown and soles where those follow.

    Args:
        joints: x, y, confidence; NaN where not seen.

    Returns:
        left, top, width, height in pixels; NaN where fewer than three joints were seen.
    """
    points = joints[:, :, :2]
    seen = np.isfinite(points).all(axis=2)
    boxes = np.full((len(joints), 4), np.nan)
    layout = _layout(points)
    extra = np.full((len(joints), 2, 2), np.nan)
    stature = np.full(len(joints), np.nan)
    if layout is not None:
        extra, stature = _ends(points, layout)
    everything = np.concatenate([points, extra], axis=1)
    for person in np.flatnonzero(seen.sum(axis=1) >= LEAST_JOINTS):
        there = everything[person][np.isfinite(everything[person]).all(axis=1)]
        low, high = there.min(axis=0), there.max(axis=0)
        flesh = FLESH * stature[person] if np.isfinite(stature[person]) else 0.0
        # crown and soles are where they are; flesh stands out to the sides of the body
        side = np.array([flesh, 0.0]) if high[1] - low[1] > high[0] - low[0] else [0.0, flesh]
        low, high = low - side, high + side
        boxes[person] = [*low, *(high - low)]
    boxes[~(boxes[:, 2:] > 0.0).all(axis=1)] = np.nan
    return boxes


def _ends(
    points: Float[ndarray, "D J 2"], layout: Layout
) -> tuple[Float[ndarray, "D 2 2"], Float[ndarray, " D"]]:
    """Crown and sole of everybody whose head and ankles were seen, and the stature, pixels."""
    head = _mean(points[:, list(layout.head)])
    ankles = _mean(points[:, list(layout.ankles)])
    along = head - ankles  # from the ankles' height to the nose's
    per_stature = along / (NOSE_HEIGHT - ANKLE_HEIGHT)
    crown = head + (1.0 - NOSE_HEIGHT) * per_stature
    if layout.crown is not None:
        known = points[:, layout.crown]
        crown = np.where(np.isfinite(known), known, crown)
    sole = points[:, list(layout.ankles)] - ANKLE_HEIGHT * per_stature[:, None]
    # the foot that is farther from the head stands
    far = np.linalg.norm(sole - head[:, None], axis=2)
    lower = np.take_along_axis(
        sole, np.argmax(np.nan_to_num(far, nan=-1.0), axis=1)[:, None, None], axis=1
    )[:, 0]
    return np.stack([crown, lower], axis=1), np.linalg.norm(per_stature, axis=1)


def _mean(points: Float[ndarray, "D n 2"]) -> Float[ndarray, "D 2"]:
    """Of the points that were seen; NaN where none was."""
    seen = np.isfinite(points).all(axis=2)
    count = seen.sum(axis=1)[:, None]
    total = np.where(seen[:, :, None], points, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _layout(points: Float[ndarray, "D J 2"]) -> Layout | None:
    """The layout for this count of joints whose bones are shortest."""
    layouts = LAYOUTS.get(points.shape[1], ())
    if len(layouts) < 2:
        return layouts[0] if layouts else None
    lengths = []
    for layout in layouts:
        first, second = np.array(layout.limbs).T
        bones = np.linalg.norm(points[:, first] - points[:, second], axis=2)
        bones = bones[np.isfinite(bones)]
        lengths.append(float(bones.mean()) if len(bones) else np.inf)
    return layouts[int(np.argmin(lengths))]
