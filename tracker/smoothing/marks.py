"""Boxes that somebody marked by hand: what they say of where stage 1's boxes lie.

Stage 1 finds everybody a little too high or too low, each by the own clothes, and alike in every
camera: the filter takes that for the person's height above the floor. A marked box is the only
thing that says where the middle is.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.sequences.sequence import Sequence
from tracker.smoothing.calibration import ODD
from tracker.smoothing.paths import Paths

RIDGE = 1.0
"""As many marked boxes as the prior of a person's shift is worth: how far stage 1's boxes lie off
differs from person to person about as much as hand-drawn boxes from one to the next, 0.1 half
heights."""

_AROUND = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_AROUND), np.sin(_AROUND), np.ones(16)])
_OUTLINE = np.concatenate([[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], _CIRCLE, _CIRCLE * [1, 1, -1]])
"""(34, 3), both ends of an upright cylinder's axis, and its upper and lower edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """M marked boxes of people."""

    steps: Int[ndarray, " M"]
    cameras: Int[ndarray, " M"]
    boxes: Float[ndarray, "M 4"]
    """Centre and half sizes, pixels."""

    @staticmethod
    def of(sequence: Sequence) -> Marks:
        """The templates of a recording."""
        names = [camera.name for camera in sequence.cameras]
        known = [one for one in sequence.templates if one.camera in names]
        return Marks(
            np.array([one.frame for one in known], dtype=np.int64),
            np.array([names.index(one.camera) for one in known], dtype=np.int64),
            Boxes.from_left_top(
                np.array([one.box for one in known], dtype=float).reshape(-1, 4)
            ).centred,
        )


def shifts(
    marks: Marks,
    cameras: Many[Camera],
    half_extents: Float[ndarray, " 3"],
    paths: Paths,
) -> Float[ndarray, " n"]:
    """d: how far below each path's middle stage 1's boxes lie, in half heights.

    A marked box is that of the path in whose middle it lies, the nearest one's at its step. Of a
    path fitted to the boxes of stage 1 the middle lies as far off as they do, so that

        d = Σ (y − y_m) / h / (M + 1)

    over the M marked boxes of the path, with the marked middle y_m, the middle y of the bounds of
    a cylinder of the target's size there, and half the height h of its axis: who draws a box around
    somebody bounds the whole body, which from above reaches lower in the picture than its axis.

    Args:
        marks: Boxes marked by hand.
        cameras: Of the recording.
        half_extents: Of the target, metres.
        paths: Fitted to the boxes of stage 1 as they are.
    """
    steps, owners = paths.steps, paths.owners
    total, count = np.zeros(len(paths.labels)), np.zeros(len(paths.labels))
    for step, index, box in zip(marks.steps, marks.cameras, marks.boxes, strict=True):
        rows = np.flatnonzero(steps == step)
        own, half_axes = _bounds(cameras[index], paths.states[rows, :3], half_extents)
        off = (own.centres - box[:2]) / own.half_sizes
        taller = np.abs(box[3] / own.half_sizes[:, 1] - 1.0)
        # who lies, is bent or stretches out is no witness of where an upright target's middle is
        odd = np.abs(off).max(axis=1)
        standing = (odd < ODD) & (taller < ODD)
        # nor is a camera that sees people from above, or is turned on its side
        half_heights = half_axes[:, 1]
        standing &= (half_heights > half_axes[:, 0]) & (half_heights > own.half_sizes[:, 1] / 2.0)
        nearest = int(odd.argmin()) if len(rows) else -1
        if nearest >= 0 and standing[nearest]:
            lower = own.centres[nearest, 1] - box[1]
            total[owners[rows[nearest]]] += lower / half_heights[nearest]
            count[owners[rows[nearest]]] += 1.0
    return np.asarray(total / (count + RIDGE))


def _bounds(
    camera: Camera, places: Float[ndarray, "N 3"], half_extents: Float[ndarray, " 3"]
) -> tuple[Boxes, Float[ndarray, "N 2"]]:
    """The bounds of upright cylinders, and half their axes' extent along x and y, pixels.

    NaN where one is not wholly before the lens.
    """
    outline = _OUTLINE * [*np.full(2, half_extents[:2].mean()), half_extents[2]]
    pixels, _ = camera.project((places[:, None] + outline).reshape(-1, 3))
    pixels = pixels.reshape(len(places), len(outline), 2)
    around = pixels[:, 2:]
    half_axes = np.abs(pixels[:, 0] - pixels[:, 1]) / 2.0
    return Boxes.from_corners(around.min(axis=1), around.max(axis=1)), half_axes
