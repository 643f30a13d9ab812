"""What a camera's boxes say before anybody knows where the camera stands: rays in its own axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.standing import ends, sides

EDGE = 2.0
"""Pixels: a box that comes this near to the picture's edge may be cut off there."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """D boxes of one camera as rays through the middles of their tops and bottoms."""

    frames: Int[ndarray, " D"]
    """The step of each box."""
    heads: Float[ndarray, "D 3"]
    """Unit directions in camera axes: x right, y down, z ahead."""
    feet: Float[ndarray, "D 3"]
    whole: Bool[ndarray, " D"]
    """False where the box is cut off by the picture's edge, or has no size."""

    @property
    def middles(self) -> Float[ndarray, "D 3"]:
        """Unit directions between head and foot."""
        between = self.heads + self.feet
        return np.asarray(between / np.linalg.norm(between, axis=1, keepdims=True))

    @property
    def extents(self) -> Float[ndarray, " D"]:
        """The angle between head and foot, radians."""
        chord = np.linalg.norm(self.heads - self.feet, axis=1)
        return np.asarray(2.0 * np.arcsin(np.minimum(chord / 2.0, 1.0)))

    def take(self, rows: ndarray) -> Rays:
        """Some of the boxes."""
        return Rays(self.frames[rows], self.heads[rows], self.feet[rows], self.whole[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """Where a camera stands and looks, in world axes and in whatever unit the world has."""

    rotation: Float[ndarray, "3 3"]
    """R of x_camera = R (x_world − centre), OpenCV axes."""
    centre: Float[ndarray, " 3"]


@dataclass(frozen=True, slots=True, eq=False)
class PairsOfBoxes:
    """All pairs of boxes of two cameras at the same steps: rows of the one and of the other."""

    first: Int[ndarray, " P"]
    second: Int[ndarray, " P"]
    most: int
    """How many pairs of one person there can be: over the steps, the smaller number of boxes."""


def pair_up(first: Rays, second: Rays, most_pairs: int = 20_000) -> PairsOfBoxes:
    """The pairs of boxes that two cameras have at the same steps.

    Args:
        first: Of the one camera, sorted by step.
        second: Of the other, sorted by step.
        most_pairs: Where there are more, steps spread evenly over all of them are taken.
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
    return np.searchsorted(frames, steps, "left"), np.searchsorted(frames, steps, "right")


def in_world(pose: Pose, directions: Float[ndarray, "N 3"]) -> Float[ndarray, "N 3"]:
    """Unit directions given in camera axes, turned into world axes."""
    return np.asarray(directions @ pose.rotation)


def uncut(boxes: Float[ndarray, "D 4"], image_size: tuple[int, int] | None) -> Bool[ndarray, " D"]:
    """Which boxes (left, top, width, height) have a size and end inside the picture."""
    good = (boxes[:, 2] > 0.0) & (boxes[:, 3] > 0.0) & np.isfinite(boxes).all(axis=1)
    if image_size is None:
        return np.asarray(good)
    low, high = boxes[:, :2], boxes[:, :2] + boxes[:, 2:]
    size = np.array(image_size)
    inside = (low > EDGE - 0.5).all(axis=1) & (high < size - 0.5 - EDGE).all(axis=1)
    return np.asarray(good & inside)


def pose_of(camera: Camera) -> Pose:
    """Where a calibrated camera stands and looks, metres."""
    return Pose(camera.rotation, camera.centre)


def rays_of(
    frames: ndarray,
    boxes: Float[ndarray, "D 4"],
    lens: Camera,
    known_size: bool = True,
    up: Float[ndarray, " 3"] | None = None,
    turn: int = 0,
) -> Rays:
    """The rays of boxes (left, top, width, height, pixels), sorted by step.

    Args:
        frames: The step of each box.
        boxes: Of one camera.
        lens: Its lens; where it stands does not matter.
        known_size: Whether the picture's size is known, so that boxes may be cut off by its edge.
        up: The way in which people stand, a unit vector in camera axes, where it is known.
        turn: Where it is not, the side of boxes where heads are, as
            :func:`tracker.geometry.consistency.standing.sides` counts.
    """
    order = np.argsort(frames, kind="stable")
    boxes = boxes[order]
    whole = uncut(boxes, lens.image_size if known_size else None)
    if up is None:
        heads, feet = (
            lens.back_project(np.nan_to_num(end)) @ lens.rotation.T for end in sides(boxes, turn)
        )
    else:
        heads, feet, told = ends(boxes, lens, up)
        whole &= told
    whole &= np.isfinite(heads).all(axis=1) & np.isfinite(feet).all(axis=1)
    return Rays(np.asarray(frames)[order], heads, feet, whole)


def upright_rays(frames: ndarray, boxes: Float[ndarray, "D 4"], camera: Camera) -> Rays:
    """The rays of boxes in a calibrated camera of a world in which people stand along z."""
    return rays_of(frames, boxes, camera, up=camera.rotation[:, 2])
