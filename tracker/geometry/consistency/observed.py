"""Boxes of a camera as rays in its own axes, which do not depend on the camera's pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.standing import ends, sides
from tracker.steps.table import Table

EDGE = 2.0
"""Distance from the image's edge within which a box may be clipped there, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays(Table):
    """D boxes of one camera as rays to head and foot of the person."""

    frames: Int[ndarray, " D"]
    """Step of each box."""
    heads: Float[ndarray, "D 3"]
    """Unit directions to the heads in camera axes: x right, y down, z ahead."""
    feet: Float[ndarray, "D 3"]
    """Unit directions to the feet in camera axes."""
    whole: Bool[ndarray, " D"]
    """False where the box is clipped by the image's edge, or has no size."""

    @property
    def middles(self) -> Float[ndarray, "D 3"]:
        """Unit directions to the middle between head and foot, in camera axes."""
        between = self.heads + self.feet
        return np.asarray(between / np.linalg.norm(between, axis=1, keepdims=True))

    @property
    def extents(self) -> Float[ndarray, " D"]:
        """The angle between head and foot, radians."""
        chord = np.linalg.norm(self.heads - self.feet, axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """The pose of a camera, in world axes and in the unit of the world."""

    rotation: Float[ndarray, "3 3"]
    """R of x_camera = R (x_world − centre), OpenCV axes."""
    centre: Float[ndarray, " 3"]
    """Position of the lens."""


@dataclass(frozen=True, slots=True, eq=False)
class PairsOfBoxes:
    """All P pairs of boxes of two cameras at the same steps."""

    first: Int[ndarray, " P"]
    """Index of the box of the first camera."""
    second: Int[ndarray, " P"]
    """Index of the box of the second camera."""
    most: int
    """Largest number of pairs with each box in one pair at most: the smaller one of the two
    cameras' numbers of boxes, summed over the steps."""


def pair_up(first: Rays, second: Rays, most_pairs: int = 20_000) -> PairsOfBoxes:
    """List the pairs of boxes that two cameras have at the same steps.

    Args:
        first: Rays of the first camera's boxes, sorted by step.
        second: Rays of the second camera's boxes, sorted by step.
        most_pairs: Number of pairs above which evenly spread steps are sampled.
    """
    steps = np.intersect1d(first.frames, second.frames)
    begin_first, end_first = _span(first.frames, steps)
    begin_second, end_second = _span(second.frames, steps)
    count_first, count_second = end_first - begin_first, end_second - begin_second
    pairs = int((count_first * count_second).sum())
    if pairs > most_pairs:
        kept = np.unique(
            np.linspace(0, len(steps) - 1, max(1, len(steps) * most_pairs // pairs)).astype(int)
        )
        begin_first, begin_second = begin_first[kept], begin_second[kept]
        count_first, count_second = count_first[kept], count_second[kept]
    spans = zip(
        begin_first.tolist(),
        count_first.tolist(),
        begin_second.tolist(),
        count_second.tolist(),
        strict=True,
    )
    rows = [
        (np.repeat(np.arange(a, a + n), m), np.tile(np.arange(b, b + m), n)) for a, n, b, m in spans
    ]
    if not rows:
        nothing = np.zeros(0, dtype=np.int64)
        return PairsOfBoxes(nothing, nothing, 0)
    return PairsOfBoxes(
        np.concatenate([row for row, _ in rows]),
        np.concatenate([row for _, row in rows]),
        int(np.minimum(count_first, count_second).sum()),
    )


def _span(frames: Int[ndarray, " D"], steps: Int[ndarray, " S"]) -> tuple[ndarray, ndarray]:
    """The first row of each step, and one past the last, in ascending steps of rows."""
    return np.searchsorted(frames, steps, "left"), np.searchsorted(frames, steps, "right")


def in_world(pose: Pose, directions: Float[ndarray, "N 3"]) -> Float[ndarray, "N 3"]:
    """Rotate unit directions from camera axes to world axes."""
    return np.asarray(directions @ pose.rotation)


def uncut(boxes: Float[ndarray, "D 4"], image_size: tuple[int, int] | None) -> Bool[ndarray, " D"]:
    """Whether each box (left, top, width, height) has a size and is not clipped by the image."""
    good = (boxes[:, 2] > 0.0) & (boxes[:, 3] > 0.0) & np.isfinite(boxes).all(axis=1)
    if image_size is None:
        return np.asarray(good)
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    size = np.array(image_size)
    inside = (low > EDGE - 0.5).all(axis=1) & (high < size - 0.5 - EDGE).all(axis=1)
    return np.asarray(good & inside)


def pose_of(camera: Camera) -> Pose:
    """The pose of a calibrated camera, metres."""
    return Pose(camera.rotation, camera.centre)


def rays_of(
    frames: ndarray,
    boxes: Float[ndarray, "D 4"],
    lens: Camera,
    known_size: bool = True,
    up: Float[ndarray, " 3"] | None = None,
    turn: int = 0,
) -> Rays:
    """Convert boxes to rays, sorted by step.

    Args:
        frames: Step of each of D boxes.
        boxes: Left, top, width, height of the boxes of one camera, pixels.
        lens: The camera, whose intrinsics and lens are used; its pose has no effect.
        known_size: Whether the image size is known, so that clipped boxes are recognised.
        up: Vertical direction, a unit vector in camera axes; None if unknown.
        turn: Side of the boxes at which heads are, used without ``up``, as in
            :func:`tracker.geometry.consistency.standing.sides`.
    """
    order = np.argsort(frames, kind="stable")
    boxes = boxes[order]
    whole = uncut(boxes, lens.image_size if known_size else None)
    if up is None:
        heads, feet = (
            lens.back_project(np.nan_to_num(end)) @ lens.rotation.T for end in sides(boxes, turn)
        )
    else:
        heads, feet, visible = ends(boxes, lens, up)
        whole &= visible
    whole &= np.isfinite(heads + feet).all(axis=1)
    return Rays(np.asarray(frames)[order], heads, feet, whole)


def upright_rays(frames: ndarray, boxes: Float[ndarray, "D 4"], camera: Camera) -> Rays:
    """Convert boxes of a calibrated camera to rays, where people stand along the world's z axis."""
    return rays_of(frames, boxes, camera, up=camera.rotation[:, 2])
