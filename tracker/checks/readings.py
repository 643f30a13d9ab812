"""The boxes tell how a calibration is meant: of all usual readings the one that lets them meet.

Which way a pose leads, which axes a camera has, how the four numbers of a box are meant and
whose calibration is whose change where rays meet: only the right reading lets many boxes of
camera pairs triangulate to people. The axes and the unit of the world change nothing of that:
these follow from the way that people stand up and from how tall they are.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.agreement.consensus import Consensus, consensus
from tracker.agreement.observed import PairsOfBoxes, Rays, pair_up, rays_of
from tracker.checks.reading import (
    UPS,
    Reading,
    lens_of,
    likely_size,
    pose,
    read_boxes,
)
from tracker.formats.pieces import METRES, Axes, Direction, Layout, RawCamera, Unit, Up

MOST_PAIRS = 6000
"""Pairs of boxes of two cameras that are looked at."""

LEAST_AGREEING = 20
"""Fewer pairs that agree prove nothing."""

LEAST_SHARE = 0.05
"""A smaller share of agreeing pairs proves nothing."""

CLEARLY = 1.3
"""A reading is better than another where its score is so many times the other's, and"""

SIGMAS = 4.0
"""so many standard deviations of a count above it."""

EVERY_ORDER = 4
"""Up to so many cameras every exchange is tried, above that one pair at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The boxes of one camera, as its file gives them. D boxes."""

    frames: Int[ndarray, " D"]
    four: Float[ndarray, "D 4"]
    """The four numbers of each, as they stand there."""


@dataclass(frozen=True, slots=True)
class Open:
    """What is to be found out: the values that are tried of each part of a reading."""

    directions: tuple[Direction, ...] = get_args(Direction)
    axes: tuple[Axes, ...] = get_args(Axes)
    layouts: tuple[Layout, ...] = get_args(Layout)
    normalised: tuple[bool, ...] = (False, True)
    orders: bool = True
    """Whether calibrations may be exchanged."""


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """A reading, and how well the boxes meet with it."""

    reading: Reading
    consensus: Consensus
    score: float
    """Agreeing pairs, each counting the less the worse it fits."""


@dataclass(frozen=True, slots=True, eq=False)
class Meaning:
    """How calibration and boxes are meant, as far as the boxes tell."""

    best: Judged
    tried: tuple[Judged, ...]
    """All that were tried, the best first."""

    @property
    def reading(self) -> Reading:
        """The best one."""
        return self.best.reading

    @property
    def certain(self) -> bool:
        """Whether enough boxes meet, and clearly fewer with any other reading."""
        agreed = self.best.consensus
        return (
            agreed.agreeing >= LEAST_AGREEING
            and agreed.share >= LEAST_SHARE
            and all(clearly_better(self.best, other) for other in self.tried[1:])
        )

    @property
    def height(self) -> float:
        """Of the usual person's box, metres."""
        return METRES[self.reading.unit] * self.best.consensus.height


def clearly_better(one: Judged, other: Judged) -> bool:
    """Whether a reading fits so much better than another that chance is no explanation."""
    spread = math.sqrt(max(one.score + other.score, 1.0))
    return one.score > CLEARLY * other.score and one.score - other.score > SIGMAS * spread


def find_meaning(
    cameras: Many[RawCamera],
    seen: Many[Seen | None],
    *,
    tried: Open | None = None,
    unit: Unit | None = None,
    up: Up | None = None,
    height: float | None = None,
) -> Meaning | None:
    """Find out how a calibration and its boxes are meant.

    What a camera's :class:`~tracker.formats.pieces.Convention` states is not questioned.

    Args:
        cameras: As their files give them; each needs a lens and a pose.
        seen: The boxes of each, None for a camera without any.
        tried: What is to be found out; everything where it is None.
        unit: Of the poses, where it is known.
        up: The world's axis that points up, where it is known.
        height: Of what is tracked, metres, where it is known.

    Returns:
        None where fewer than two cameras have boxes at the same steps.

    Raises:
        ValueError: If a camera has no lens or no pose.
    """
    judge = Judge(cameras, seen)
    if not judge.possible:
        return None
    open_ = _restricted(tried or Open(), cameras, seen)
    judged = [
        judge(Reading(direction=direction, axes=axes, layout=layout, normalised=normalised))
        for direction, axes, layout, normalised in itertools.product(
            open_.directions, open_.axes, open_.layouts, open_.normalised
        )
    ]
    judged.sort(key=lambda one: -one.score)
    if open_.orders:
        judged = _with_orders(judge, judged)
    conventions = [camera.convention for camera in cameras]
    unit = unit or next((c.unit for c in conventions if c.unit is not None), None)
    up = up or next((c.up for c in conventions if c.up is not None), None)
    best = judged[0]
    rise = best.consensus.rise
    reading = replace(best.reading, up=up or upwards(rise))
    reading = replace(reading, unit=unit or likely_unit(judge.away(best), best.consensus, height))
    return Meaning(Judged(reading, best.consensus, best.score), (*judged,))


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
        self._seen = tuple(seen)
        self.sizes = [likely_size(camera) for camera in cameras]
        self._rays: dict[tuple[int, int, Layout, bool], Rays] = {}
        empty = Rays(np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, bool))
        times = [
            empty
            if own is None
            else Rays(np.sort(own.frames), empty.heads, empty.feet, empty.whole)
            for own in seen
        ]
        self.pairs: Mapping[tuple[int, int], PairsOfBoxes] = {
            (a, b): found
            for a, b in itertools.combinations(range(len(times)), 2)
            if (found := pair_up(times[a], times[b], most_pairs)).most
        }
        self._empty = empty

    @property
    def possible(self) -> int:
        """How many pairs of boxes could be of one person."""
        return sum(own.most for own in self.pairs.values())

    def __call__(self, reading: Reading) -> Judged:
        """How well the boxes meet."""
        order = reading.order or tuple(range(len(self.cameras)))
        poses = [pose(self.cameras[own], reading) for own in order]
        rays = [self._of(camera, own, reading) for camera, own in enumerate(order)]
        agreed = consensus(rays, poses, self.pairs)
        return Judged(reading, agreed, float(agreed.fits.sum()))

    def _of(self, camera: int, calibration: int, reading: Reading) -> Rays:
        """The rays of a camera's boxes through the lens of a calibration."""
        own = self._seen[camera]
        if own is None:
            return self._empty
        key = (camera, calibration, reading.layout, reading.normalised)
        if key not in self._rays:
            size = self.sizes[calibration]
            raw = self.cameras[calibration]
            boxes = read_boxes(own.four, reading.layout, size if reading.normalised else None)
            self._rays[key] = rays_of(
                own.frames, boxes, lens_of(raw, size), raw.image_size is not None
            )
        return self._rays[key]

    def away(self, judged: Judged) -> float:
        """The usual distance from a camera to people, in the world's unit."""
        order = judged.reading.order or tuple(range(len(self.cameras)))
        agreed = judged.consensus
        if not len(agreed.feet):
            return math.nan
        centres = np.array([pose(self.cameras[own], judged.reading).centre for own in order])
        ways = agreed.feet[:, None, :] - centres[agreed.cameras]
        return float(np.median(np.linalg.norm(ways, axis=2)))


def _with_orders(judge: Judge, judged: list[Judged]) -> list[Judged]:
    """With calibrations exchanged, where that fits better than what fits best without."""
    count = len(judge.cameras)
    found = list(judged)
    # an exchange and a wrong pose together: the poses' readings are all near nothing then
    for start in judged[:1] if judged[0].consensus.share >= LEAST_SHARE else judged[:8]:
        best = start
        for _ in range(1 if count <= EVERY_ORDER else count):
            own = [judge(replace(best.reading, order=order)) for order in _orders(best, count)]
            found += own
            better = max(own, key=lambda one: one.score, default=best)
            if better.score <= best.score:
                break
            best = better
    return sorted(found, key=lambda one: -one.score)


def _orders(best: Judged, count: int) -> Iterable[tuple[int, ...]]:
    own = best.reading.order or tuple(range(count))
    if count <= EVERY_ORDER:
        yield from (order for order in itertools.permutations(range(count)) if order != own)
        return
    for a, b in itertools.combinations(range(count), 2):
        changed = list(own)
        changed[a], changed[b] = changed[b], changed[a]
        yield tuple(changed)


def _restricted(tried: Open, cameras: Many[RawCamera], seen: Many[Seen | None]) -> Open:
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
    if len(tried.normalised) > 1 and len(four):
        # parts of a picture are at most 1, and a box a little beyond the edge a little more
        tried = replace(tried, normalised=(bool(np.quantile(np.abs(four), 0.99) <= 1.5),))
    if "xyxy" in tried.layouts and len(tried.layouts) > 1 and len(four):
        corners = (four[:, 2:] > four[:, :2]).all(axis=1).mean()
        if corners < 0.99:  # a right edge left of the left one
            layouts = tuple(layout for layout in tried.layouts if layout != "xyxy")
            tried = replace(tried, layouts=layouts)
    return tried


def upwards(rise: Float[ndarray, " 3"]) -> Up:
    """The axis of the world that is nearest to the way from foot to head."""
    axis = int(np.argmax(np.abs(rise)))
    return UPS[axis + 3 * int(rise[axis] < 0.0)]


def likely_unit(away: float, agreed: Consensus, height: float | None = None) -> Unit:
    """The unit in which the usual person is as tall, and as far from the cameras, as people are.

    Args:
        away: The usual distance from a camera to people, in the world's unit.
        agreed: On how tall they are, in the world's unit.
        height: Of what is tracked, metres, where it is known.
    """
    if agreed.height <= 0.0:
        return "m"

    def fit(unit: Unit) -> float:
        own = METRES[unit]
        return likelihood_of_size(agreed.height * own, away * own, height)

    units: tuple[Unit, ...] = get_args(Unit)
    return max(units, key=fit)


_USUAL_HEIGHTS = ((1.70, 0.15, 0.0), (1.2, 0.25, -1.5), (0.7, 0.2, -1.5), (0.25, 0.25, -0.5))
"""People standing, seated, head and torso, heads: metres, spread of the logarithm, log weight."""

_USUAL_DISTANCE = (6.0, 0.9)  # metres from a camera, spread of the logarithm


def likelihood_of_size(height: float, away: float, known: float | None = None) -> float:
    """The logarithm of how usual people are of that height, that far from a camera, metres."""
    kinds = _USUAL_HEIGHTS if known is None else ((known, 0.3, 0.0),)
    tall = max(w - 0.5 * (math.log(height / h) / s) ** 2 for h, s, w in kinds)
    if not away > 0.0:
        return tall
    middle, spread = _USUAL_DISTANCE
    return tall - 0.5 * (math.log(away / middle) / spread) ** 2
