"""The boxes tell how a calibration is meant: of all usual readings the one that lets them meet.

Which way a pose leads, which axes a camera has, how the four numbers of a box are meant and
whose calibration is whose change where rays meet: only the right reading lets many boxes of
camera pairs triangulate to people. The axes and the unit of the world change nothing of that:
these follow from the way that people stand up and from how tall they are.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.geometry.consistency.consensus import Consensus, consensus
from tracker.geometry.consistency.observed import PairsOfBoxes, Pose, Rays, pair_up, rays_of, uncut
from tracker.geometry.consistency.standing import turn_of
from tracker.io.conventions.level import reversed_, standing, turns_tried, upside_down, upwards
from tracker.io.conventions.reading import (
    Reading,
    boxes_by,
    lens_of,
    likely_size,
    pose,
    upright,
    with_pixels,
)
from tracker.io.conventions.sizes import likely_unit
from tracker.io.read.pieces import METRES, Axes, Direction, Layout, RawCamera, Unit, Up

# Halved and doubled, the constants below leave all interpretations of the random rooms of seeds
# 1300 … 1303 as they are, correct and with one mistake each (camera-to-world poses, y up, frames
# counted from 1, exchanged calibrations).
MOST_PAIRS = 6000
"""Pairs of boxes of two cameras that are looked at, and"""

MOST_IN_ALL = 60_000
"""of all cameras."""

_PLAIN = 0.5
"""Share of boxes that meet with heads at their tops with which nobody asks for another side: how
broad people are agrees between cameras too, but of fewer."""

_LEAST_BREADTH = -0.2
"""Logarithm: who lies across the picture is not so much taller there than broad."""

LEAST_SHARE = 0.05
"""A smaller share of agreeing pairs proves nothing."""

_SAME_SIZE = 0.05
"""By how much the sides of a picture may differ from thousand pixels that lead to one scene with
boxes in thousandths."""

LEAST_SCORE = 0.3
"""The score of a box below which it is not compared."""

EVERY_ORDER = 4
"""Up to so many cameras every exchange is tried, above that one pair at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The boxes of one camera, as its file gives them. D boxes."""

    frames: Int[ndarray, " D"]
    four: Float[ndarray, "D 4"]
    """The four numbers of each, as they stand there."""

    def by_step(self, chosen: Int[ndarray, " K"]) -> Seen:
        """Some of the boxes, by their index once they are sorted by step."""
        rows = np.argsort(self.frames, kind="stable")[chosen]
        return Seen(self.frames[rows], self.four[rows])


def compared(scores: Float[ndarray, " D"]) -> Bool[ndarray, " D"]:
    """Which boxes of a camera are compared: an import and the check of what it wrote take the same.

    Args:
        scores: Of its boxes, 0 … 1.

    Returns:
        Those of at least :data:`LEAST_SCORE`; all where none has as much.
    """
    sure = scores >= LEAST_SCORE
    return np.asarray(sure if sure.any() else ~sure)


@dataclass(frozen=True, slots=True)
class Open:
    """What is to be found out: the values that are tried of each part of a reading."""

    directions: tuple[Direction, ...] = get_args(Direction)
    axes: tuple[Axes, ...] = get_args(Axes)
    layouts: tuple[Layout, ...] = get_args(Layout)
    alternatives: tuple[Layout, ...] = ()
    """Layouts that are tried though the files name another one."""
    parts: tuple[int, ...] = (0, 1)
    finer: tuple[int, ...] = (100, 1000)
    """Parts of the picture's size that are tried besides pixels."""
    orders: bool = True
    """Whether calibrations may be exchanged."""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A reading, and how well the boxes meet with it."""

    reading: Reading
    consensus: Consensus
    score: float
    """Agreeing pairs, each counting the less the worse it fits."""
    pictured: Float[ndarray, " 3"]
    """The common vector from foot to head with both at sides of the boxes: it leans in rolled
    cameras, and in worlds that lean."""
    turns: tuple[int, ...]
    """Where heads are in boxes, as :func:`tracker.geometry.consistency.standing.sides` counts."""


class Judge:
    """Judges readings of one set of cameras and boxes."""

    def __init__(
        self,
        cameras: Many[RawCamera],
        seen: Many[Seen | None],
        most_pairs: int = MOST_PAIRS,
    ) -> None:
        """Prepare.

        Args:
            cameras: As their files give them.
            seen: The boxes of each, None for a camera without any.
            most_pairs: Of boxes of two cameras.
        """
        self.cameras = tuple(cameras)
        self.sizes = [likely_size(camera) for camera in cameras]
        self._rays: dict[tuple[object, ...], Rays] = {}
        self._lenses: dict[tuple[int, float], Camera] = {}
        self._breadths: dict[tuple[object, ...], float] = {}
        empty = Rays(np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool))
        times = [
            empty
            if own is None
            else Rays(np.sort(own.frames), empty.heads, empty.feet, empty.whole)
            for own in seen
        ]
        count = len(times) * (len(times) - 1) // 2
        most = max(MOST_IN_ALL // max(count, 1), MOST_PAIRS // 4)
        most = min(most, most_pairs)
        pairs = {
            (a, b): found
            for a, b in itertools.combinations(range(len(times)), 2)
            if (found := pair_up(times[a], times[b], most)).most
        }
        self._empty = empty
        # of a long recording most boxes are in no pair, and need no rays
        kept = [_in_pairs(camera, pairs) for camera in range(len(times))]
        self._paired = [
            None if own is None else own.by_step(chosen)
            for own, chosen in zip(seen, kept, strict=True)
        ]
        self.pairs: Mapping[tuple[int, int], PairsOfBoxes] = {
            (a, b): PairsOfBoxes(
                np.searchsorted(kept[a], found.first),
                np.searchsorted(kept[b], found.second),
                found.most,
            )
            for (a, b), found in pairs.items()
        }

    @property
    def has_boxes(self) -> list[bool]:
        """Whether each camera has boxes at a step at which another one has some."""
        return [own is not None and len(own.frames) > 0 for own in self._paired]

    @property
    def possible(self) -> int:
        """How many pairs of boxes could be of one person."""
        return sum(own.most for own in self.pairs.values())

    def __call__(self, reading: Reading) -> Judged:
        """How well the boxes meet, as exactly as can be told."""
        return self.refined(self.turned(reading))

    def turned(self, reading: Reading) -> Judged:
        """How well they meet with heads at that side of the boxes where most of them do."""
        poses = self.poses(reading)
        best: Judged | None = None
        for turns in turns_tried(poses):
            aside = [self._breadth(n, reading) for n, turn in enumerate(turns) if turn % 2]
            if aside and np.mean(aside) < _LEAST_BREADTH:
                continue
            rays = [
                self._of(camera, own, reading, turn)
                for (camera, own), turn in zip(enumerate(self.order(reading)), turns, strict=True)
            ]
            agreed = consensus(rays, poses, self.pairs)
            score = float(agreed.fits.sum())
            judged = Judged(reading, agreed, score, agreed.rise, turns)
            if best is None or score > best.score:
                best = judged
            if not any(best.turns) and best.consensus.share > _PLAIN:
                break
        assert best is not None
        return best

    def _breadth(self, camera: int, reading: Reading) -> float:
        """The logarithm of how many times as broad as tall the usual box of a camera is."""
        own, calibration = self._paired[camera], self.order(reading)[camera]
        if own is None or not len(own.four):
            return 0.0
        key = (camera, calibration, reading.layout, reading.parts, reading.pixels)
        if key not in self._breadths:
            size = self.lens_at(calibration, reading)[0].image_size
            boxes = boxes_by(own.four, reading, size)
            sides = np.log(boxes[uncut(boxes, size), 2:])
            broad = float(np.median(sides[:, 0] - sides[:, 1])) if len(sides) else 0.0
            self._breadths[key] = broad
        return self._breadths[key]

    def refined(self, judged: Judged) -> Judged:
        """With heads and feet where people who stand upright have them in the boxes."""
        up = standing(judged.consensus)
        if up is None:
            return judged
        poses = self.poses(judged.reading)
        rays = [
            self._of(camera, own, judged.reading, pose.rotation @ up)
            for (camera, own), pose in zip(
                enumerate(self.order(judged.reading)), poses, strict=True
            )
        ]
        agreed = consensus(rays, poses, self.pairs)
        score = float(agreed.fits.sum())
        return replace(judged, consensus=agreed, score=score) if score > judged.score else judged

    def along(self, reading: Reading, axis: Float[ndarray, " 3"]) -> Judged:
        """How well the boxes meet of people who stand along an axis of the world."""
        poses = self.poses(reading)
        up = axis * (1.0 if sum(pose.rotation[1] @ axis for pose in poses) <= 0.0 else -1.0)
        rays = [
            self._of(camera, calibration, reading, pose.rotation @ up)
            for (camera, calibration), pose in zip(
                enumerate(self.order(reading)), poses, strict=True
            )
        ]
        agreed = consensus(rays, poses, self.pairs)
        turns = tuple(turn_of(pose.rotation @ up) for pose in poses)
        return Judged(reading, agreed, float(agreed.fits.sum()), agreed.rise, turns)

    def righted(self, judged: Judged, up: Up | None, unit: Unit | None = None) -> Judged:
        """With heads above feet, where the cameras hang upside down.

        Args:
            judged: What boxes agree on.
            up: The axis that the file claims to point up.
            unit: Of the poses, where it is known.
        """
        agreed = judged.consensus
        metres = METRES[unit or likely_unit(self.away(judged), agreed)]
        claimed = None if up is None else upright(up).T @ np.array([0.0, 0.0, 1.0])
        if not upside_down(agreed, self.poses(judged.reading), metres, claimed):
            return judged
        turns = tuple((turn + 2) % 4 for turn in judged.turns)
        return replace(judged, consensus=reversed_(agreed), pictured=-judged.pictured, turns=turns)

    def meant(self, judged: Judged, up: Up | None, unit: Unit | None = None) -> Reading:
        """The reading with the axis that points up and the unit, where the file states neither."""
        agreed = judged.consensus
        reading = replace(judged.reading, up=up or upwards(agreed.rise))
        return replace(reading, unit=unit or likely_unit(self.away(judged), agreed))

    def poses(self, reading: Reading) -> list[Pose]:
        """Where the cameras stand."""
        return [pose(self.cameras[own], reading) for own in self.order(reading)]

    def order(self, reading: Reading) -> tuple[int, ...]:
        """The index of the calibration of each camera's boxes."""
        return reading.order or tuple(range(len(self.cameras)))

    def _of(
        self, camera: int, calibration: int, reading: Reading, heads: int | Float[ndarray, " 3"]
    ) -> Rays:
        """The rays of a camera's boxes through the lens of a calibration.

        Heads are at a side of the boxes, or where they are of people who stand this way.
        """
        own = self._paired[camera]
        if own is None:
            return self._empty
        told = heads if isinstance(heads, int) else tuple(np.round(heads, 9).tolist())
        key = (
            camera,
            calibration,
            reading.layout,
            reading.parts,
            reading.pixels,
            reading.flipped,
            told,
        )
        if key not in self._rays:
            lens, known = self.lens_at(calibration, reading)
            boxes = boxes_by(own.four, reading, lens.image_size)
            turn, up = (heads, None) if isinstance(heads, int) else (0, heads)
            self._rays[key] = rays_of(own.frames, boxes, lens, known, up, turn)
        return self._rays[key]

    def lens_at(self, calibration: int, reading: Reading) -> tuple[Camera, bool]:
        """A lens for the pictures in which boxes are given, and whether their size is known."""
        key = calibration, reading.pixels
        if key not in self._lenses:
            factor = reading.pixels
            raw = with_pixels(self.cameras[calibration], factor)
            width, height = self.sizes[calibration]
            self._lenses[key] = lens_of(raw, (round(factor * width), round(factor * height)))
        return self._lenses[key], self.cameras[calibration].image_size is not None

    def away(self, judged: Judged) -> float:
        """The usual distance from a camera to people, in the world's unit."""
        agreed = judged.consensus
        if not len(agreed.feet):
            return math.nan
        centres = np.array([own.centre for own in self.poses(judged.reading)])
        ways = agreed.feet[:, None, :] - centres[agreed.cameras]
        return float(np.median(np.linalg.norm(ways, axis=2)))


def _in_pairs(camera: int, pairs: Mapping[tuple[int, int], PairsOfBoxes]) -> Int[ndarray, " K"]:
    """The boxes of a camera that are in any pair, ascending."""
    first = [found.first for (one, _), found in pairs.items() if one == camera]
    second = [found.second for (_, other), found in pairs.items() if other == camera]
    return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *first, *second]))


def restricted(tried: Open, cameras: Many[RawCamera], seen: Many[Seen | None]) -> Open:
    """Without what the files state, and what their numbers exclude."""
    conventions = [camera.convention for camera in cameras]
    directions = {c.direction for c in conventions if c.direction is not None}
    axes = {c.axes for c in conventions if c.axes is not None}
    if len(directions) == 1:
        tried = replace(tried, directions=tuple(directions))
    if len(axes) == 1:
        tried = replace(tried, axes=tuple(axes))
    if all(camera.projection is not None for camera in cameras):
        tried = replace(tried, directions=("world-to-camera",), axes=("opencv",))
    four = np.concatenate([np.zeros((0, 4)), *(own.four for own in seen if own is not None)])
    if len(tried.parts) > 1 and len(four):
        # parts of a picture are at most 1, and a box a little beyond the edge a little more
        tried = replace(tried, parts=(int(np.quantile(np.abs(four), 0.99) <= 1.5),))
    largest = np.quantile(np.abs(four), 0.99) if len(four) else 0.0
    known = [camera.image_size for camera in cameras if camera.image_size is not None]
    finer = tuple(
        parts
        for parts in tried.finer
        if largest <= parts and any(abs(side / parts - 1.0) > _SAME_SIZE for side in sum(known, ()))
    )
    tried = replace(tried, finer=finer)
    if len(four) and (four[:, 2:] > four[:, :2]).all(axis=1).mean() < 0.99:
        # a right edge left of the left one, or a lower one above the upper
        named, alternatives = (
            tuple(layout for layout in own if layout not in ("xyxy", "yxyx"))
            for own in (tried.layouts, tried.alternatives)
        )
        tried = replace(tried, layouts=named or tried.layouts, alternatives=alternatives)
    return tried
