"""The interpretation of calibration and boxes that explains the boxes, or what is open.

Every candidate (direction of poses, axes of cameras, order of angles, layout of boxes, whose
calibration is whose, size of the pictures, handedness of the world) is judged by the evidence E of
:mod:`tracker.geometry.consistency.likelihood` and a log prior. It is *decided* where its log odds
are above ln 1000 over every rival that leads to another scene, *open* where they are not, and there
is *none* where the boxes of many cameras are there and none explains them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass, field, replace
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.geometry.consistency.likelihood import (
    Evidence,
    Moments,
    Scene,
    at_moments,
    evidence,
    fit_floor,
    on_image_plane,
)
from tracker.geometry.consistency.observed import Pose, Rays, rays_of
from tracker.geometry.consistency.odds import DECISIVE, log_odds
from tracker.io.conventions.judge import EVERY_ORDER, Judge, Judged, Open, Seen, restricted
from tracker.io.conventions.level import upwards
from tracker.io.conventions.orders import MOST_CAMERAS, likely_orders
from tracker.io.conventions.reading import Reading, boxes_by, turns_of
from tracker.io.read.pieces import RawCamera, Unit, Up

# Halved and doubled, the constants below leave all interpretations of the random rooms of seeds
# 1300 … 1303 as they are, correct and with one mistake each (camera-to-world poses, y up, frames
# counted from 1, exchanged calibrations); only with twice _MANY_BOXES or half FEW_MOMENTS two of
# these eight results are others.
MOST_MOMENTS = 120
"""Number of steps whose boxes are compared."""

SPACING = 0.5
"""Seconds between two of them, where the recording is long enough for :data:`FEW_MOMENTS`."""

FEW_MOMENTS = 60
"""Number of moments for which a short recording is sampled more densely."""

PART = 3
"""Every so many-th moment is compared first; what is far behind there is compared no further."""

BEHIND = 30.0
"""Nats by which an interpretation is far behind, if its odds are decisive too."""

NAME_PRIOR = {"name": 7.0, "number": 3.0, "order": 1.0}
"""Nats for each camera that keeps the files which belong to it by name, by number or by order."""

Plane = tuple[Float[ndarray, "N 4"], Float[ndarray, " N"]]

RARE = 7.0
"""Nats against a mirrored world, mirrored pictures, pictures of another size than stated, and boxes
of another layout than their files name."""

_MOST_PAIRS, _MOST_PAIRS_FIRST = 2000, 600  # of boxes of two cameras, in all and at first
_MOST_COMPARED = 16  # interpretations that are compared by all moments
_LEAST_FIRST = 20  # moments that are compared first, one for each block of time
_LEAST_RIVALS, _RIVALS = 2, 4  # readings whose pixels, handedness and order are questioned
_LEAST_SHARE = 0.1  # of a camera's boxes that another one explains, below which none is explained
_MANY_BOXES = 200  # least number of boxes that have to be explained
_COARSE, _NEAR, _WIDEST = 0.2, 3.0, 10.0  # seconds between lags, and to the farthest of them
_PLAINLY = 0.4  # share of boxes from which nobody asks whether all calibrations are exchanged
_WELL = 0.7  # share of a camera's boxes from which neither mirror nor turn is looked for
_EXPLAINED = 0.3  # share of boxes with which the calibration is read nearly rightly
_TURNS = (0.32, 0.16, 0.08, 0.04, 0.02)  # radians to and fro about each axis of a camera
_SAME_SCENE = 0.03  # difference of two scenes, in radians and in the size of the rig


_AROUND_JUMP = 4
"""Moments on each side of a jump of a clock between which all steps are looked at."""

_MOST_AROUND = 120
"""Most steps that are looked at around a jump, as many as there are moments."""


@dataclass(frozen=True, slots=True, eq=False)
class Interpretation:
    """A reading, and what the boxes say of it."""

    reading: Reading
    judged: Judged
    scene: Scene
    evidence: Evidence
    prior: float
    """Log prior, nats."""

    @property
    def score(self) -> float:
        """Evidence and prior, nats."""
        return self.evidence.total + self.prior


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What the boxes tell of how they and the calibration are meant."""

    kind: Literal["decided", "open", "none", "unproven"]
    """Unproven: there are too few boxes to tell anything."""
    best: Interpretation
    likelihood: Likelihood
    rival: Interpretation | None = None
    """The likeliest one that leads to another scene."""
    odds: float = math.inf
    """Log odds of the best over the rival."""
    confirmed: Mapping[int, float] = field(default_factory=dict)
    """Log odds by camera that its boxes are of the same moments as those of the others."""
    clocks: Mapping[int, ClockFit] = field(default_factory=dict)
    """Cameras whose clock is not that of the others."""
    moved: Mapping[int, float] = field(default_factory=dict)
    """Angles, radians, by which cameras have to be turned for their boxes to meet the others'."""
    compared: tuple[Interpretation, ...] = ()
    """Those that were compared by all moments; all others were far behind."""
    reach: int = 0
    """The largest lag, steps, that was sought of a camera whose moments are not confirmed."""

    @property
    def judge(self) -> Judge:
        """What judges readings by the boxes that meet."""
        return self.likelihood.judge

    def at_rate(self, fps: float) -> Verdict:
        """The same with the clocks that are found at a number of steps a second."""
        confirmed = confirm_moments(self.likelihood, self.best)
        clocks = fit_clocks(self.likelihood, self.best, confirmed, fps)
        reach = _reach(self.likelihood.moments, fps, _WIDEST)
        return replace(self, confirmed=confirmed, clocks=clocks, reach=reach)

    def outweighs(self, other: Verdict) -> bool:
        """Whether the best one explains the boxes, and is decided over that of other conventions
        by the same boxes."""
        mine, theirs = self.best.evidence.by_moment, other.best.evidence.by_moment
        return self.kind in ("decided", "open") and log_odds(mine, theirs) >= DECISIVE

    def excludes(self, reading: Reading) -> bool:
        """Whether the best one is decided over a reading."""
        return all(
            log_odds(self.best.evidence.by_moment, one.evidence.by_moment) >= DECISIVE
            for one in self.compared
            if one.reading == reading
        )


@dataclass(frozen=True, slots=True)
class ClockFit:
    """How late a camera is, steps: it shows later what the others show at a step."""

    begins: int
    """At the first moment."""
    ends: int
    """At the last moment."""
    jump: int | None = None
    """The step of the others from which it is late by ``ends``, where its clock jumps."""
    drifts: tuple[int, int] | None = None
    """The first and the last moment, where its clock drifts from one to the other."""

    @property
    def steady(self) -> bool:
        """Whether the clock goes as those of the others."""
        return self.begins == self.ends

    @property
    def late(self) -> int:
        """The steps by which a steady clock is late; 0 for another one."""
        return self.begins if self.steady else 0

    def frames(self, steps: Int[ndarray, " M"]) -> Int[ndarray, " M"]:
        """Return the camera's frame at each step of the others; −1 where it lost that frame."""
        if self.drifts is not None:
            lags = self.begins + (self.ends - self.begins) * (steps - self.drifts[0]) / max(
                self.drifts[1] - self.drifts[0], 1
            )
            return np.asarray(steps + np.round(lags).astype(np.int64))
        if self.jump is None:
            return np.asarray(steps + self.begins)
        resumes = self.jump + max(0, self.begins - self.ends)
        after = np.where(steps < resumes, -1, steps + self.ends)
        return np.where(steps < self.jump, steps + self.begins, after)

    def of_the_other(self) -> ClockFit:
        """Return the clock of the other one of two cameras, if this one is right."""
        return ClockFit(
            -self.begins, -self.ends, None if self.jump is None else self.jump + self.begins,
            None if self.drifts is None
            else (self.drifts[0] + self.begins, self.drifts[1] + self.ends),
        )  # fmt: skip


class Likelihood:
    """E of readings of one set of cameras and boxes."""

    def __init__(
        self,
        cameras: Many[RawCamera],
        seen: Many[Seen | None],
        fps: float,
        moments: Int[ndarray, " M"] | None = None,
    ) -> None:
        """Prepare.

        Args:
            cameras: As their files give them.
            seen: Boxes of each camera.
            fps: Steps a second.
            moments: Steps that alone are looked at; chosen among all where they are not given.
        """
        self.moments = choose_moments(seen, fps) if moments is None else moments
        self._seen = [None if own is None else _at(own, self.moments) for own in seen]
        most = _MOST_PAIRS if moments is None else _MOST_PAIRS_FIRST
        self.judge = Judge(cameras, seen if moments is None else self._seen, most)
        self.fps = fps
        self._every = list(seen)
        self._boxes: dict[tuple[object, ...], tuple[Rays, Plane]] = {}
        self._chosen: dict[tuple[object, ...], Moments] = {}

    def thinned(self) -> Likelihood:
        """The same of every third moment."""
        count = len(self.moments)
        part = max(1, min(PART, count // _LEAST_FIRST))
        return self.of_moments(self.moments[::part])

    def of_moments(self, moments: Int[ndarray, " M"]) -> Likelihood:
        """The same of other moments."""
        return Likelihood(self.judge.cameras, self._every, self.fps, moments)

    @property
    def boxes(self) -> int:
        """The number of boxes at the moments."""
        return sum(len(own.frames) for own in self._seen if own is not None)

    def boxes_at(
        self,
        reading: Reading,
        poses: Many[Pose],
        scene: Scene,
        steps: Many[Int[ndarray, " M"] | None],
    ) -> list[Moments | None]:
        """The boxes of each camera at its own steps, of people who stand along the rise.

        Args:
            reading: How calibration and boxes are meant.
            poses: Of the cameras.
            scene: How people stand.
            steps: Of each camera; None for the moments.
        """
        up = scene.rise / np.linalg.norm(scene.rise)
        found: list[Moments | None] = []
        for camera, calibration in enumerate(self.judge.order(reading)):
            own = self._seen[camera] if steps[camera] is None else self._every[camera]
            if own is None:
                found.append(None)
                continue
            way = poses[camera].rotation @ up
            key = (steps[camera] is None, camera, calibration, reading.layout, reading.parts,
                   reading.flipped, reading.pixels, tuple(np.round(way, 7).tolist()))  # fmt: skip
            if key not in self._boxes:
                lens, known = self.judge.lens_at(calibration, reading)
                four = boxes_by(own.four, reading, lens.image_size)
                rays = rays_of(own.frames, four, lens, known, way)
                self._boxes[key] = rays, on_image_plane(rays)
            rays, plane = self._boxes[key]
            at = steps[camera]
            if at is not None:
                found.append(at_moments(rays, at, plane))
                continue
            if key not in self._chosen:
                self._chosen[key] = at_moments(rays, self.moments, plane)
            found.append(self._chosen[key])
        return found

    def score(
        self, judged: Judged, prior: float = 0.0, *, axes: bool = False
    ) -> Interpretation | None:
        """Fit the scene and compute E; None where no boxes meet.

        Args:
            judged: The reading.
            prior: Log prior.
            axes: Whether people are tried along every axis of the world.
        """
        best: Interpretation | None = None
        for judged_, rise in self._rises(judged, axes):
            scene = fit_floor(rise, judged_.consensus.feet)
            found = self.at(judged_, scene, prior)
            if best is None or found.score > best.score:
                best = found
        return best

    def unmet(self, reading: Reading) -> Interpretation:
        """A reading by which no boxes meet."""
        nothing = Evidence({}, {}, len(self.judge.cameras), len(self.moments))
        judged = self.judge.turned(reading)
        return Interpretation(reading, judged, Scene(np.zeros(3), 0.0, 0.0), nothing, 0.0)

    def at(self, judged: Judged, scene: Scene, prior: float) -> Interpretation:
        """Compute E of a reading with a given scene.

        Args:
            judged: The reading.
            scene: How people stand.
            prior: Log prior.
        """
        poses = self.judge.poses(judged.reading)
        boxes = self.boxes_at(judged.reading, poses, scene, [None] * len(poses))
        return Interpretation(judged.reading, judged, scene, evidence(boxes, poses, scene), prior)

    def of_camera(
        self,
        best: Interpretation,
        camera: int,
        steps: Iterable[Int[ndarray, " M"]],
        clocks: Mapping[int, ClockFit] | None = None,
    ) -> Float[ndarray, "L M"]:
        """Evidence of the pairs with one camera by the steps at which its boxes are taken.

        Args:
            best: The reading.
            camera: Which camera.
            steps: What of its boxes is compared with the others' at the moments.
            clocks: Those of other cameras that are not as the others'.
        """
        poses = self.judge.poses(best.reading)
        at: list[Int[ndarray, " M"] | None] = [None] * len(poses)
        for other, clock in (clocks or {}).items():
            at[other] = clock.frames(self.moments)
        among = np.zeros((len(poses), len(poses)), dtype=bool)
        among[camera], among[:, camera] = True, True
        boxes = self.boxes_at(best.reading, poses, best.scene, at)
        rows = []
        for own in steps:
            at = [None] * len(poses)
            at[camera] = own
            boxes[camera] = self.boxes_at(best.reading, poses, best.scene, at)[camera]
            rows.append(evidence(boxes, poses, best.scene, among=among).of_camera(camera))
        return np.array(rows)

    def of_poses(
        self, best: Interpretation, poses: Many[Pose], camera: int | None = None
    ) -> Evidence:
        """Compute E where the cameras stand otherwise.

        Args:
            best: The reading.
            poses: The poses of all cameras.
            camera: The camera whose pairs alone are compared; None compares all pairs.
        """
        among = np.full((len(poses), len(poses)), camera is None)
        if camera is not None:
            among[camera], among[:, camera] = True, True
        boxes = self.boxes_at(best.reading, poses, best.scene, [None] * len(poses))
        return evidence(boxes, poses, best.scene, among=among)

    def likely_orders(
        self, reading: Reading, axes: Many[int]
    ) -> list[tuple[float, tuple[int, ...]]]:
        """The assignments of calibrations with which most boxes meet, the best first."""
        return likely_orders(self.judge, self._seen, self.moments, reading, axes)

    def _rises(self, judged: Judged, axes: bool) -> Iterator[tuple[Judged, Float[ndarray, " 3"]]]:
        """The common rise, and the same turned to the nearest axis of the world."""
        others = [self.judge.along(judged.reading, axis) for axis in np.eye(3)] if axes else []
        for one in (judged, self.judge.refined(judged), *others):
            rise = one.consensus.rise
            height = float(np.linalg.norm(rise))
            if height <= 0.0 or not one.consensus.agreeing:
                continue
            axis = np.zeros(3)
            nearest = int(np.argmax(np.abs(rise)))
            axis[nearest] = math.copysign(height, rise[nearest])
            if one is judged:
                yield one, rise
            yield one, axis


def _at(own: Seen, moments: Int[ndarray, " M"]) -> Seen:
    """The boxes of some steps, sorted by step."""
    rows = np.flatnonzero(np.isin(own.frames, moments))
    rows = rows[np.argsort(own.frames[rows], kind="stable")]
    return Seen(own.frames[rows], own.four[rows])


def choose_moments(seen: Many[Seen | None], fps: float) -> Int[ndarray, " M"]:
    """Choose steps at which at least two cameras have boxes, at most :data:`MOST_MOMENTS`."""
    own = [np.unique(one.frames) for one in seen if one is not None and len(one.frames)]
    steps, counts = np.unique(np.concatenate([np.zeros(0, int), *own]), return_counts=True)
    steps = steps[counts >= 2]
    if not len(steps):
        return np.asarray(steps)
    seconds = (steps[-1] - steps[0] + 1) / fps
    wanted = int(min(MOST_MOMENTS, max(seconds / SPACING, FEW_MOMENTS), len(steps)))
    return np.asarray(steps[np.unique(np.linspace(0, len(steps) - 1, wanted).astype(int))])


def find_reading(
    cameras: Many[RawCamera],
    seen: Many[Seen | None],
    *,
    fps: float,
    tried: Open | None = None,
    names: Literal["name", "number", "order"] = "name",
    pixels: Many[float] = (),
) -> Verdict | None:
    """Judge all interpretations of a calibration and its boxes.

    What a camera's :class:`~tracker.io.read.pieces.Convention` states is not questioned.

    Args:
        cameras: As their files give them; each needs a lens and a pose.
        seen: The boxes of each, None for a camera without any.
        fps: Steps a second.
        tried: What is to be found out; everything where it is None.
        names: By what files belong to the cameras.
        pixels: Widths of the pictures that are tried besides, in that of the calibration's.

    Returns:
        None where fewer than two cameras have boxes at the same steps.
    """
    likelihood = Likelihood(cameras, seen, fps)
    judge = likelihood.judge
    if not judge.possible:
        return None
    open_ = restricted(tried or Open(), cameras, seen)
    first = _candidates(likelihood.thinned(), open_, NAME_PRIOR[names], pixels)
    found = _compared(likelihood, first)
    kind: Literal["decided", "open", "none", "unproven"]
    if not found:
        kind = "unproven" if likelihood.boxes < _MANY_BOXES else "none"
        return Verdict(kind, likelihood.unmet(next(_readings(open_, cameras))), likelihood)
    best = found[0]
    others = [one for one in found[1:] if not same_scene(judge, best, one)]
    odds = [
        log_odds(best.evidence.by_moment, one.evidence.by_moment) + best.prior - one.prior
        for one in others
    ]
    nearest = int(np.argmin(odds)) if odds else -1
    rival = others[nearest] if others else None
    least = odds[nearest] if odds else math.inf
    nothing = log_odds(best.evidence.by_moment, np.zeros(len(likelihood.moments)))
    kind = "decided" if least >= DECISIVE else "open"
    if likelihood.boxes < _MANY_BOXES and nothing < DECISIVE:
        kind = "unproven"
    elif best.evidence.share < _LEAST_SHARE or nothing < DECISIVE:
        kind = "none"
    verdict = Verdict(kind, best, likelihood, rival, least, compared=(*found,)).at_rate(fps)
    moved: dict[int, float] = {}
    if kind == "decided":
        moved, turned = find_moved(likelihood, best)
        late = {camera: fit.late for camera, fit in verdict.clocks.items() if fit.late}
        if moved and late:
            # boxes of other moments meet badly, as those of a turned camera do
            shifted = Likelihood(cameras, _shifted(seen, late), fps)
            timed = replace(best, evidence=shifted.of_poses(best, judge.poses(best.reading)))
            if timed.evidence.by_moment.mean() > turned.by_moment.mean():
                moved, _ = find_moved(shifted, timed)
    return replace(verdict, moved=moved)


def _shifted(seen: Many[Seen | None], late: Mapping[int, int]) -> list[Seen | None]:
    """The boxes at the steps at which they were seen, by the steps that cameras are late."""
    return [
        own if own is None or camera not in late else Seen(own.frames - late[camera], own.four)
        for camera, own in enumerate(seen)
    ]


def _candidates(
    likelihood: Likelihood, open_: Open, each: float, pixels: Many[float]
) -> list[Interpretation]:
    """Every interpretation in which any boxes meet, the likeliest first."""
    cameras = likelihood.judge.cameras
    readings = list(_readings(open_, cameras))
    found = _scored(likelihood, readings, 0.0)
    rivals = [
        one.reading
        for number, one in enumerate(found[:_RIVALS])
        if number < _LEAST_RIVALS or not _far_behind(found[0], one)
    ]
    if not found or found[0].evidence.share < _EXPLAINED:
        rivals = readings  # any of them may explain the boxes in a mirror or of other pictures
    found += _scored(likelihood, list(_questioned(rivals, pixels, open_)), -RARE)
    if open_.orders:
        best = max(found, key=lambda one: one.score, default=None)
        if best is None or best.prior < 0.0 or best.evidence.share < _PLAINLY:
            found += _reassigned(likelihood, readings, each)
    found.sort(key=lambda one: -one.score)
    if open_.orders and found:
        starts = found[:1]
        if found[0].evidence.share < _EXPLAINED and len(cameras) < EVERY_ORDER:
            starts = found[:_RIVALS]  # of few cameras nothing agrees before they are exchanged
        for start in starts:
            found += _with_orders(likelihood, start, each)
        found.sort(key=lambda one: -one.score)
    leaders = found[:1]
    if open_.orders and found:
        worst = min(found[0].evidence.of_cameras().values(), default=0.0)
        if worst < _WELL and each < NAME_PRIOR["name"]:
            # a mirror and an exchange together: most cameras of a regular rig agree without both,
            # some with boxes that are read wrongly
            own, up = replace(found[0].reading, order=None), np.abs(found[0].scene.rise)
            mirrors = [
                mirror
                for layout in open_.layouts
                for mirror in (
                    replace(own, layout=layout, flipped=not own.flipped),
                    replace(own, layout=layout, mirrored=not own.mirrored),
                )
            ]
            found += _reassigned(likelihood, mirrors, each, -RARE, (int(np.argmax(up)),))
            found.sort(key=lambda one: -one.score)
            leaders += found[:1]
    for leader in leaders:
        if again := _reread(likelihood, readings, found, leader):
            found = sorted((*found, *again), key=lambda one: -one.score)
            if open_.orders and found[0] is again[0]:
                found += _with_orders(likelihood, found[0], each)
                found.sort(key=lambda one: -one.score)
    return found


def _reread(
    likelihood: Likelihood,
    readings: Many[Reading],
    found: Many[Interpretation],
    leader: Interpretation,
) -> list[Interpretation]:
    """Every reading with what a leading one alone was questioned in, the likeliest first.

    An exchange and another size of the pictures let many boxes meet although they are read
    wrongly; it is not before these are right that the right reading of the boxes is the likeliest.
    """
    known = {one.reading for one in found}
    parts = ("order", "parts", "pixels", "mirrored", "flipped")
    questioned = {part: getattr(leader.reading, part) for part in parts}
    others = [replace(reading, **questioned) for reading in readings]
    return _scored(likelihood, [one for one in others if one not in known], leader.prior)


def _reassigned(
    likelihood: Likelihood,
    readings: Many[Reading],
    each: float,
    base: float = 0.0,
    axes: Many[int] = (0, 1, 2),
) -> list[Interpretation]:
    """Interpretations with calibrations assigned anew, none of which need be its own camera's."""
    count = len(likelihood.judge.cameras)
    if count > MOST_CAMERAS:
        return []
    if count == 2:
        exchanged = [replace(one, order=(1, 0)) for one in readings]
        return _scored(likelihood, exchanged, base - 2.0 * each)
    orders = sorted(
        ((score, order, reading) for reading in readings
         for score, order in likelihood.likely_orders(reading, axes)), key=lambda one: -one[0],
    )  # fmt: skip
    found = []
    for _, order, reading in orders[:_RIVALS]:
        if moved := _moved(order):
            found += _scored(likelihood, [replace(reading, order=order)], base - each * moved)
    return found


def _compared(likelihood: Likelihood, first: Many[Interpretation]) -> list[Interpretation]:
    """By all moments those that are not far behind by some of them, the likeliest first."""
    found: dict[Reading, Interpretation] = {}
    near = [one for one in first if not _far_behind(first[0], one)][:_MOST_COMPARED]
    for one in sorted(near, key=lambda one: one.reading.order is not None):
        parent = found.get(replace(one.reading, order=None))
        own: Interpretation | None
        if one.reading.order and parent is not None and parent.evidence.share >= _PLAINLY:
            own = _exchanged(likelihood, parent, one.reading.order, one.prior)
        else:
            own = likelihood.score(likelihood.judge.turned(one.reading), one.prior, axes=True)
        if own is not None:
            found[one.reading] = own
    return sorted(found.values(), key=lambda one: -one.score)


def _far_behind(best: Interpretation, one: Interpretation) -> bool:
    odds = log_odds(best.evidence.by_moment, one.evidence.by_moment) + best.prior - one.prior
    return best.score - one.score > BEHIND and odds > DECISIVE


def _readings(open_: Open, cameras: Many[RawCamera]) -> Iterator[Reading]:
    parts = (open_.directions, open_.axes, open_.layouts, open_.parts, turns_of(cameras))
    for direction, axes, layout, share, turns in itertools.product(*parts):
        yield Reading(direction, axes, layout, share, turns=turns)


def _scored(likelihood: Likelihood, readings: Many[Reading], prior: float) -> list[Interpretation]:
    """The interpretations in which any boxes meet, the likeliest first."""
    found = [likelihood.score(likelihood.judge.turned(reading), prior) for reading in readings]
    return sorted((one for one in found if one is not None), key=lambda one: -one.score)


def _questioned(readings: Many[Reading], pixels: Many[float], open_: Open) -> Iterator[Reading]:
    """Readings in a mirrored world, with mirrored pictures, with boxes of another layout, for
    pictures of another size, and with boxes in parts of it."""
    for reading in readings:
        yield replace(reading, mirrored=True)
        yield replace(reading, flipped=True)
        yield from (replace(reading, layout=layout) for layout in open_.alternatives)
        if not reading.parts:
            yield from (replace(reading, pixels=factor) for factor in pixels)
            yield from (replace(reading, parts=parts) for parts in open_.finer)


def _with_orders(likelihood: Likelihood, best: Interpretation, each: float) -> list[Interpretation]:
    """The best reading with calibrations exchanged; a camera that keeps its own has a prior."""
    count = len(likelihood.judge.cameras)
    found: list[Interpretation] = []
    start = best.reading.order or tuple(range(count))
    known = {start}
    base = best.prior + each * _moved(start)
    for _ in range(1 if count <= EVERY_ORDER else count):
        better: Interpretation | None = None
        for order in _orders(start, count):
            if order in known:
                continue
            known.add(order)
            prior = base - each * _moved(order)
            other = _exchanged(likelihood, best, order, prior)
            if other is None:
                continue
            found.append(other)
            if better is None or other.score > better.score:
                better = other
        if better is None or better.score <= best.score:
            break
        best = better
        start = best.reading.order or start
    return found


def _moved(order: Many[int]) -> int:
    """The number of cameras that have the calibration of another one."""
    return sum(own != camera for camera, own in enumerate(order))


def _exchanged(
    likelihood: Likelihood, best: Interpretation, order: tuple[int, ...], prior: float
) -> Interpretation | None:
    reading = replace(best.reading, order=order if _moved(order) else None)
    judged = replace(best.judged, reading=reading)
    found = likelihood.at(judged, best.scene, prior)
    # the scene of a wrong order is wrong, unless most cameras are right
    if len(order) <= EVERY_ORDER and best.evidence.share < _EXPLAINED:
        own = likelihood.score(likelihood.judge.turned(reading), prior)
        if own is not None and own.score > found.score:
            return own
    return found


def _orders(own: tuple[int, ...], count: int) -> Iterator[tuple[int, ...]]:
    if count <= EVERY_ORDER:
        yield from itertools.permutations(range(count))
        return
    for a, b in itertools.combinations(range(count), 2):
        changed = list(own)
        changed[a], changed[b] = changed[b], changed[a]
        yield tuple(changed)


def same_scene(judge: Judge, one: Interpretation, other: Interpretation) -> bool:
    """Whether the cameras with boxes differ by a turn, shift or scale of the world alone."""
    parts = ("layout", "parts", "pixels", "flipped", "mirrored")
    if any(getattr(one.reading, part) != getattr(other.reading, part) for part in parts):
        return False
    first, second = (
        [own for own, has in zip(judge.poses(each.reading), judge.has_boxes, strict=True) if has]
        for each in (one, other)
    )
    turn = first[0].rotation.T @ second[0].rotation
    away = [a.rotation.T @ b.rotation - turn for a, b in zip(first, second, strict=True)]
    if max(float(np.abs(own).max()) for own in away) > _SAME_SCENE:
        return False
    centres = np.array([own.centre for own in first])
    others = np.array([own.centre for own in second]) @ turn.T
    centres, others = centres - centres.mean(axis=0), others - others.mean(axis=0)
    size, other_size = (float(np.linalg.norm(own)) for own in (centres, others))
    if size == 0.0 or other_size == 0.0:
        return size == other_size
    return float(np.abs(centres / size - others / other_size).max()) < _SAME_SCENE


def as_meant(
    verdict: Verdict, claimed: Up | None, up: Up | None = None, unit: Unit | None = None
) -> tuple[Judged, Reading]:
    """The likeliest reading with heads above feet, and with the way up and the unit.

    Args:
        verdict: What the boxes tell.
        claimed: The axis that the file claims to point up, which cameras may contradict.
        up: The axis that points up, where that is known.
        unit: The unit, where that is known.
    """
    best = verdict.judge.righted(verdict.best.judged, claimed, unit)
    rise = verdict.best.scene.rise
    up = up or upwards(rise if rise @ best.consensus.rise >= 0.0 else -rise)
    return best, verdict.judge.meant(best, up, unit)


def confirm_moments(
    likelihood: Likelihood, best: Interpretation, clocks: Mapping[int, ClockFit] | None = None
) -> dict[int, float]:
    """Log odds by camera that its boxes show the same moments as those of the other cameras.

    The evidence of its pairs is compared with their mean evidence when its clock is turned by a
    quarter to three quarters of the recording: people who stand about one room agree by chance.

    Args:
        likelihood: Of the boxes.
        best: The reading.
        clocks: Those of cameras that are not as the others'.
    """
    clocks = clocks or {}
    count = len(likelihood.moments)
    turns = sorted({round(share * count) for share in (0.25, 0.4, 0.5, 0.6, 0.75)} - {0, count})
    found = {}
    for camera in sorted({camera for pair in best.evidence.terms for camera in pair}):
        own = clocks.get(camera, ClockFit(0, 0)).frames(likelihood.moments)
        rolled = [np.roll(own, -turn) for turn in (0, *turns)]
        others = {other: clock for other, clock in clocks.items() if other != camera}
        nats = likelihood.of_camera(best, camera, rolled, others)
        found[camera] = log_odds(nats[0], nats[1:].mean(axis=0)) if turns else 0.0
    return found


def find_moved(likelihood: Likelihood, best: Interpretation) -> tuple[dict[int, float], Evidence]:
    """Find the cameras that were turned since they were calibrated, by the same evidence.

    Each camera whose boxes are not well explained is turned about each of its axes to and fro, and
    from the best of these poses in ever smaller steps. It was turned where the evidence of its
    pairs is decisively greater then, which pays the logarithm of the number of poses tried, and
    where the scene is another one. The camera that gains most is turned first, and the others are
    looked at again.

    Args:
        likelihood: The likelihood of the boxes.
        best: The reading.

    Returns:
        The angle of each such camera, radians; and the evidence with these turned.
    """
    poses = likelihood.judge.poses(best.reading)
    evidence = best.evidence
    shares = evidence.of_cameras()
    found: dict[int, float] = {}
    while len(found) <= (len(shares) - 1) // 2:
        gains: dict[int, tuple[float, Pose, float]] = {}
        for camera, share in shares.items():
            poor = share < _WELL and camera not in found
            if poor and (turned := _turned(likelihood, best, camera, poses)):
                gains[camera] = turned
        if not gains:
            break
        camera = max(gains, key=lambda one: gains[one][0])
        _, poses[camera], found[camera] = gains[camera]
        evidence = likelihood.of_poses(best, poses)
        shares = evidence.of_cameras()
    return found, evidence


def _turned(
    likelihood: Likelihood, best: Interpretation, camera: int, poses: Many[Pose]
) -> tuple[float, Pose, float] | None:
    """How many nats a camera gains if it is turned, its pose then, and the angle, radians."""

    def nats(turn: Float[ndarray, " 3"]) -> Float[ndarray, " M"]:
        own = list(poses)
        own[camera] = turn_pose(poses[camera], turn)
        return likelihood.of_poses(best, own, camera).of_camera(camera)

    given = nats(np.zeros(3))
    turn, gained, tried = np.zeros(3), given, 0
    for step in _TURNS:
        centre, peak = turn, gained
        for axis in np.eye(3):
            for size in (-step, step):
                tried += 1
                other = nats(centre + size * axis)
                if other.sum() > peak.sum():
                    turn, peak = centre + size * axis, other
        gained = peak
    angle = float(np.linalg.norm(turn))
    clear = log_odds(gained, given) >= DECISIVE + math.log(tried)
    if angle <= _SAME_SCENE or not clear:
        return None
    return float((gained - given).sum()), turn_pose(poses[camera], turn), angle


def turn_pose(own: Pose, turn: Float[ndarray, " 3"]) -> Pose:
    """Turn a camera where it stands.

    Args:
        own: Its pose.
        turn: Rotation vector in its own axes, radians.
    """
    return replace(own, rotation=cv2.Rodrigues(turn)[0] @ own.rotation)


def clocks_by(
    cameras: Many[RawCamera], seen: Many[Seen | None], reading: Reading, fps: float
) -> dict[int, ClockFit]:
    """Find the clocks by one reading alone, which is not questioned; none where no boxes meet.

    Args:
        cameras: The cameras as their files give them.
        seen: The boxes of each, None for a camera without any.
        reading: The way in which both are meant.
        fps: Steps a second.
    """
    likelihood = Likelihood(cameras, seen, fps)
    if not likelihood.judge.possible:
        return {}
    best = likelihood.score(likelihood.judge.turned(reading), axes=True)
    if best is None:
        return {}
    return fit_clocks(likelihood, best, confirm_moments(likelihood, best), fps)


def _reach(moments: Int[ndarray, " M"], fps: float, seconds: float) -> int:
    """The largest lag, steps, that is sought: of a longer one than a third of the recording a third
    has nothing to compare."""
    return min(round(seconds * fps), int(np.ptp(moments)) // 3)


def fit_clocks(
    likelihood: Likelihood, best: Interpretation, confirmed: dict[int, float], fps: float
) -> dict[int, ClockFit]:
    """Find the cameras that are late, or whose clocks jump or drift, by the same evidence.

    A camera whose moments are confirmed is searched 3 s around, the others 10 s. Every camera that
    is shifted pays the logarithm of the number of lags, and at most half of them are shifted.

    Args:
        likelihood: Of the boxes.
        best: The reading.
        confirmed: Log odds by camera; where a clock is another one, they are set to those with it.
        fps: Steps a second.
    """
    found: dict[int, ClockFit] = {}
    coarse = max(1, round(_COARSE * fps))
    third = len(likelihood.moments) // 3
    # of two cameras either may be meant
    by_doubt = sorted(confirmed, key=lambda one: (len(confirmed) > 2) * confirmed[one] - 1e-6 * one)
    for camera in by_doubt:
        if not third or len(found) > (len(confirmed) - 1) // 2:
            break
        widest = _NEAR if confirmed[camera] >= DECISIVE else _WIDEST
        reach = _reach(likelihood.moments, fps, widest)
        lags = coarse * np.arange(-(reach // coarse), reach // coarse + 1)
        nats = likelihood.of_camera(best, camera, likelihood.moments + lags[:, None], found)
        usual = np.mean(nats, axis=0)
        parts = (slice(None), slice(None, third), slice(-third, None))
        peaks = [int(np.argmax(nats[:, part].sum(axis=1))) for part in parts]
        here = len(lags) // 2
        penalty = math.log(len(lags))
        line = _line(likelihood.moments, nats)
        along = nats[line, np.arange(len(line))]
        uneven = abs(peaks[1] - peaks[2]) > 1 and any(
            _differ(first, last, nats[peaks[1]], nats[peaks[2]], third, penalty)
            for first, last in ((nats[peaks[1]], nats[peaks[2]]), (along, along))
        )
        moved = nats[peaks[0]]
        clear = min(log_odds(moved, usual), log_odds(moved, nats[here])) >= DECISIVE + penalty
        if uneven:
            begins, ends = (
                _fine(likelihood, best, camera, int(lags[peak]), coarse, found, part)
                for peak, part in zip(peaks[1:], parts[1:], strict=True)
            )
            slope = int(lags[line[0]]), int(lags[line[-1]])
            tried = [
                _jumping(likelihood, best, camera, begins, ends, coarse, found),
                _drifting(likelihood, best, camera, slope, coarse, found),
            ]
            found[camera] = max(tried, key=lambda own: _nats(likelihood, best, camera, own, found))
        elif peaks[0] != here and clear:
            lag = int(lags[peaks[0]])
            steps = _fine(likelihood, best, camera, lag, coarse, found, slice(None))
            found[camera] = ClockFit(steps, steps)
    if len(confirmed) == 2 and found:
        # frames are lost more often than any are there twice
        ((camera, clock),) = found.items()
        if clock.jump is not None and clock.ends > clock.begins:
            (other,) = set(confirmed) - {camera}
            found = {other: clock.of_the_other()}
    if found:
        confirmed.update(confirm_moments(likelihood, best, found))
    return found


def _differ(
    first: Float[ndarray, " M"], last: Float[ndarray, " M"],
    by_first: Float[ndarray, " M"], by_last: Float[ndarray, " M"], third: int, penalty: float,
) -> bool:  # fmt: skip
    """Whether a clock is another one in the first third than in the last: in each of them the other
    one's lag is wrong.

    Args:
        first: Evidence by moment of the clock that is supposed in the first third.
        last: That of the last third.
        by_first: That of the best constant lag of the first third.
        by_last: That of the last third.
        third: The number of moments in each.
        penalty: What each of the two lags pays, nats.
    """
    better = first[:third] - by_last[:third], last[-third:] - by_first[-third:]
    nothing = np.zeros(third)
    each = min(log_odds(own, nothing) for own in better)
    both = log_odds(np.concatenate(better), np.zeros(2 * third))
    return each >= DECISIVE and both >= DECISIVE + 2.0 * penalty


def _nats(
    likelihood: Likelihood, best: Interpretation, camera: int, clock: ClockFit,
    clocks: Mapping[int, ClockFit],
) -> float:  # fmt: skip
    """Evidence of the pairs with a camera by its clock."""
    steps = clock.frames(likelihood.moments)
    return float(likelihood.of_camera(best, camera, [steps], clocks).sum())


def _jumping(
    likelihood: Likelihood, best: Interpretation, camera: int, begins: int, ends: int, reach: int,
    clocks: Mapping[int, ClockFit],
) -> ClockFit:  # fmt: skip
    """The clock that jumps from about one lag to about another."""
    jump = _jump(likelihood, best, camera, begins, ends, clocks)
    at = int(np.searchsorted(likelihood.moments, jump))
    begins = _fine(likelihood, best, camera, begins, reach, clocks, slice(None, at))
    ends = _fine(likelihood, best, camera, ends, reach, clocks, slice(at, None))
    return ClockFit(begins, ends, _jump(likelihood, best, camera, begins, ends, clocks))


def _line(moments: Int[ndarray, " M"], nats: Float[ndarray, "L M"]) -> Int[ndarray, " M"]:
    """The index of the lag at each moment, on the line through the lags that has most evidence."""
    count = len(nats)
    along = (moments - moments[0]) / max(int(np.ptp(moments)), 1)
    columns = np.arange(len(moments))
    best, most = np.zeros(len(moments), dtype=np.int64), -math.inf
    for begins in range(count):
        slopes = np.arange(count)[:, None] - begins
        rows = np.round(begins + slopes * along).astype(np.int64)
        totals = nats[rows, columns].sum(axis=1)
        ends = int(np.argmax(totals))
        if totals[ends] > most:
            best, most = rows[ends], float(totals[ends])
    return best


def _drifting(
    likelihood: Likelihood, best: Interpretation, camera: int, about: tuple[int, int], reach: int,
    clocks: Mapping[int, ClockFit],
) -> ClockFit:  # fmt: skip
    """The clock that drifts from about one lag at the first moment to about another at the last."""
    moments = likelihood.moments
    own = ClockFit(*about, drifts=(int(moments[0]), int(moments[-1])))
    for _ in range(2):
        for part in ("begins", "ends"):
            near = range(getattr(own, part) - reach, getattr(own, part) + reach + 1)
            tried = [
                replace(own, begins=lag) if part == "begins" else replace(own, ends=lag)
                for lag in near
            ]
            rows = [each.frames(moments) for each in tried]
            nats = likelihood.of_camera(best, camera, rows, clocks).sum(axis=1)
            own = tried[int(np.argmax(nats))]
    return own


def _jump(
    likelihood: Likelihood, best: Interpretation, camera: int, begins: int, ends: int,
    clocks: Mapping[int, ClockFit],
) -> int:  # fmt: skip
    """The step from which a camera's boxes are explained no more by its first lag: sought among the
    moments, then among all steps of the moments around. Of the steps whose frames the camera lost
    nothing is expected."""
    moments = likelihood.moments
    around = _AROUND_JUMP * int(np.median(np.diff(moments))) + abs(ends - begins)
    for dense in (False, True):
        some = likelihood if not dense else likelihood.of_moments(moments)
        steps = moments + np.array([[begins], [ends]])
        first, last = some.of_camera(best, camera, steps, clocks)
        before, after = np.append(0.0, np.cumsum(first)), np.append(np.cumsum(last[::-1])[::-1], 0)
        resumed = np.searchsorted(moments, moments + max(0, begins - ends))
        jump = int(moments[int(np.argmax(before[:-1] + after[resumed]))])
        low, high = max(jump - around, int(moments[0])), min(jump + around, int(moments[-1]))
        moments = np.unique(np.linspace(low, high, _MOST_AROUND).round().astype(np.int64))
    return jump


def _fine(
    likelihood: Likelihood, best: Interpretation, camera: int, lag: int, reach: int,
    clocks: Mapping[int, ClockFit], part: slice,
) -> int:  # fmt: skip
    """The best lag around one, step by step, in a part of the recording."""
    lags = np.arange(lag - reach, lag + reach + 1)
    nats = likelihood.of_camera(best, camera, likelihood.moments + lags[:, None], clocks)
    return int(lags[int(np.argmax(nats[:, part].sum(axis=1)))])
