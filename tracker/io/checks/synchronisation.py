"""How late each camera is, from its boxes or from the motion in its pictures.

Offset o of a camera is how late it is: what the others show at step k, it shows at k + o. A
pair (a, b) agrees best at the difference o_b − o_a; the offsets are those with the greatest
agreement of all pairs together, up to a common one, which is chosen so that most cameras have
none.

An import looks for another clock by the evidence for a reading
(:func:`tracker.io.conventions.search.fit_clocks`), which also tells jumps and drift. It does not
replace this search: of 24 cameras in the random rooms of seeds 1100 … 1117 that are 2.5 to 40 steps
late it finds 15, to within 2 steps; this search finds all, to within 0.7, and takes pictures too.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.observed import Rays, upright_rays
from tracker.geometry.consistency.odds import BLOCKS
from tracker.geometry.consistency.sliding import LinkedBoxes, agreement_by_offset, link_boxes
from tracker.geometry.consistency.suggestion import LEAST_AGREEING, consensus_of_cameras
from tracker.io.checks.motion import MOST_STEPS, motion_pairings
from tracker.io.conventions.judge import compared
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Detections, Sequence

FINE = 0.1
"""Steps between the offsets of the final, fine search."""

# three thresholds of which no offset in the random rooms of seeds 1100 … 1117 depends on the value,
# between 1.5 and 5, 0.5 and 1, and 0.2 and 0.5
_AROUND = 2.5  # steps on either side of the best whole offset that are searched finely
_SAME = 0.75  # steps within which two cameras have the same clock
_LEAST_COVERED = 0.35  # of the comparisons without a shift: with fewer an offset is not judged
_RIPPLE = round(1.0 / FINE)  # offsets in a step: boxes between two steps are less noisy
_ROUNDS = 20  # at most; the ascent ends where no camera moves


class Pairing(Protocol):
    """How well two cameras agree when the second is shifted."""

    def scores(
        self, offsets: Float[ndarray, " O"], *, fine: bool = False
    ) -> tuple[Float[ndarray, "O S"], Float[ndarray, "O S"]]:
        """Of each offset, steps, and each part of the recording: agreement, and how much could be.

        Args:
            offsets: How much later the second camera shows the same as the first.
            fine: Whether more of the recording is to be looked at.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """How well one camera agrees with all others, by its offset. O offsets."""

    offsets: Float[ndarray, " O"]
    """Steps; positive where the camera is late."""
    agreement: Float[ndarray, " O"]
    """1 where everything agrees, 0 or less where nothing does; NaN where too little is left to
    compare."""


@dataclass(frozen=True, slots=True, eq=False)
class Offset:
    """The time offset found for one camera."""

    steps: float
    curve: Curve
    sharpness: float
    """How far the curve's peak stands above its median, in its median absolute deviations."""
    gain: float
    """By how many standard deviations the agreement with the cameras that have no offset is better
    than with no offset, over the parts of the recording."""


def solve(
    pairings: Mapping[tuple[int, int], Pairing], cameras: int, widest: int
) -> tuple[Offset | None, ...]:
    """The offsets of all cameras.

    Args:
        pairings: Of pairs of cameras (a, b), a < b.
        cameras: How many there are.
        widest: The largest offset that is searched, steps.

    Returns:
        None for a camera that can be compared with no other.
    """
    grid = np.arange(-2 * widest, 2 * widest + 1, dtype=float)
    inner = np.abs(grid) <= widest
    curves: dict[tuple[int, int], ndarray] = {}
    weights: dict[tuple[int, int], float] = {}
    for key, pairing in pairings.items():
        curve, weight = _curve(pairing, grid[inner])
        if weight > 0.0:
            whole = np.full(len(grid), np.nan)
            whole[inner] = curve
            curves[key], weights[key] = whole, weight
    found = _joined(curves, weights, grid, cameras)
    found = _ascend(found, curves, weights, grid, grid[inner])
    fine = FINE * np.arange(-round(_AROUND / FINE), round(_AROUND / FINE) + 1)
    near: dict[tuple[int, int], tuple[ndarray, ndarray]] = {}
    for a, b in curves:
        near[a, b] = _near(pairings[a, b], found[b] - found[a])
    found = _ascend_finely(found, near, weights, fine)
    found = found - common_offset(found)
    offsets: list[Offset | None] = []
    for camera in range(cameras):
        if any(camera in key for key in curves):
            own = _of_camera(camera, found, curves, weights, grid, grid[inner])
            gain = _gain(camera, found, pairings, list(curves))
            offsets.append(Offset(float(found[camera]), own, _sharpness(own), gain))
        else:
            offsets.append(None)
    return tuple(offsets)


def _curve(
    pairing: Pairing, offsets: Float[ndarray, " O"], *, fine: bool = False
) -> tuple[Float[ndarray, " O"], float]:
    """Mean agreement by offset, NaN where too little is compared, and how much there is."""
    fits, counts = pairing.scores(offsets, fine=fine)
    total = counts.sum(axis=1)
    most = float(total.max(initial=0.0))
    enough = total > _LEAST_COVERED * most
    curve = np.full(len(offsets), np.nan)
    curve[enough] = fits.sum(axis=1)[enough] / total[enough]
    return curve, most


def _near(pairing: Pairing, offset: float) -> tuple[Float[ndarray, " O"], Float[ndarray, " O"]]:
    """The curve around one offset, in parts of steps, without a ripple that steps leave."""
    reach = round(_AROUND / FINE) * 2 + _RIPPLE
    offsets = offset + FINE * np.arange(-reach, reach + 1)
    curve = _curve(pairing, offsets, fine=True)[0]
    kernel = np.ones(_RIPPLE + 1)
    kernel[[0, -1]] = 0.5
    smooth = np.convolve(curve, kernel / _RIPPLE, mode="valid")
    half = _RIPPLE // 2
    return offsets[half:-half], smooth


def _at(
    curve: Float[ndarray, " O"], grid: Float[ndarray, " O"], offsets: ndarray
) -> Float[ndarray, " N"]:
    """A curve at any offset; where it is not known, as its median is."""
    known = np.isfinite(curve)
    if not known.any():
        return np.zeros(len(offsets))
    usual = float(np.median(curve[known]))
    filled = np.where(known, curve, usual)
    return np.asarray(np.interp(offsets, grid, filled, left=usual, right=usual))


def _joined(
    curves: Mapping[tuple[int, int], ndarray],
    weights: Mapping[tuple[int, int], float],
    grid: Float[ndarray, " O"],
    cameras: int,
) -> Float[ndarray, " C"]:
    """A start: the pairs with the highest peaks, as far as they join cameras."""
    found = np.zeros(cameras)
    group = np.arange(cameras)

    def height(key: tuple[int, int]) -> float:
        curve = curves[key]
        return float((np.nanmax(curve) - np.nanmedian(curve)) * np.sqrt(weights[key]))

    for a, b in sorted(curves, key=height, reverse=True):
        if group[a] == group[b]:
            continue
        best = grid[int(np.nanargmax(curves[a, b]))]
        moved = group == group[b]
        found[moved] += found[a] + best - found[b]
        group[moved] = group[a]
    return found


def _of_camera(
    camera: int,
    found: Float[ndarray, " C"],
    curves: Mapping[tuple[int, int], ndarray],
    weights: Mapping[tuple[int, int], float],
    grid: Float[ndarray, " O"],
    offsets: Float[ndarray, " N"],
) -> Curve:
    """Agreement of one camera with all others, by its own offset."""
    total, weight = np.zeros(len(offsets)), 0.0
    for (a, b), curve in curves.items():
        if camera == b:
            total += weights[a, b] * _at(curve, grid, offsets - found[a])
        elif camera == a:
            total += weights[a, b] * _at(curve, grid, found[b] - offsets)
        else:
            continue
        weight += weights[a, b]
    return Curve(offsets, total / weight if weight else total)


def _ascend(
    found: Float[ndarray, " C"],
    curves: Mapping[tuple[int, int], ndarray],
    weights: Mapping[tuple[int, int], float],
    grid: Float[ndarray, " O"],
    offsets: Float[ndarray, " N"],
) -> Float[ndarray, " C"]:
    """Camera after camera to its best offset, until none moves."""
    found = found.copy()
    for _ in range(_ROUNDS):
        before = found.copy()
        for camera in range(len(found)):
            tried = before.mean().round() + offsets
            own = _of_camera(camera, found, curves, weights, grid, tried)
            here = _of_camera(camera, found, curves, weights, grid, found[camera : camera + 1])
            best = int(np.argmax(own.agreement))
            if own.agreement[best] > here.agreement[0] + 1e-12:
                found[camera] = tried[best]
        if (found == before).all():
            break
    return found


def _ascend_finely(
    found: Float[ndarray, " C"],
    near: Mapping[tuple[int, int], tuple[ndarray, ndarray]],
    weights: Mapping[tuple[int, int], float],
    fine: Float[ndarray, " F"],
) -> Float[ndarray, " C"]:
    """As :func:`_ascend` with parts of steps, around what was found."""
    start, moves = found, np.zeros(len(found))
    for _ in range(_ROUNDS):
        before = moves.copy()
        for camera in range(len(found)):
            total = np.zeros(len(fine))
            for (a, b), (offsets, curve) in near.items():
                if camera == b:
                    total += weights[a, b] * _at(curve, offsets, start[b] - start[a] + fine - moves[a])  # fmt: skip  # noqa: E501
                elif camera == a:
                    total += weights[a, b] * _at(curve, offsets, start[b] + moves[b] - start[a] - fine)  # fmt: skip  # noqa: E501
            moves[camera] = fine[int(np.argmax(total))] if total.any() else 0.0
        if (moves == before).all():
            break
    return start + moves


def common_offset(found: Float[ndarray, " C"]) -> float:
    """The offset, steps, that most cameras share; of two cameras that of the first."""
    same = np.abs(found[:, None] - found[None, :]) < _SAME
    reference = int(np.argmax(same.sum(axis=1)))
    return (
        float(np.median(found[same[reference]]))
        if same[reference].sum() > 2
        else float(found[reference])
    )


def _gain(
    camera: int,
    found: Float[ndarray, " C"],
    pairings: Mapping[tuple[int, int], Pairing],
    keys: Many[tuple[int, int]],
) -> float:
    """By how many standard deviations the camera's offset is better than none.

    It is compared with the cameras that have no offset. Where another one that has an offset
    agrees with it, both may be late by any common amount.
    """
    if found[camera] == 0.0:
        return 0.0
    on_time = np.abs(found) < _SAME
    gains: list[ndarray] = []
    for a, b in keys:
        other = {a: b, b: a}.get(camera)
        if other is None or not on_time[other]:
            continue
        own = found[b] - found[a]
        without = found[b] if camera == a else -found[a]
        fits, counts = pairings[a, b].scores(np.array([own, without]), fine=True)
        parts = np.array_split(np.arange(fits.shape[1]), min(BLOCKS, max(1, fits.shape[1])))
        fits = np.stack([fits[:, part].sum(axis=1) for part in parts], axis=1)
        counts = np.stack([counts[:, part].sum(axis=1) for part in parts], axis=1)
        both = (counts > 0.0).all(axis=0)
        means = fits[:, both] / counts[:, both]
        gains.append((means[0] - means[1]) * np.minimum(*counts[:, both]))
    every = np.concatenate([np.zeros(0), *gains])
    if len(every) < 4:
        return 0.0
    spread = float(every.std(ddof=1)) * np.sqrt(len(every))
    return float(every.sum() / spread) if spread > 0.0 else 0.0


def _sharpness(curve: Curve) -> float:
    values = curve.agreement[np.isfinite(curve.agreement)]
    if len(values) < 5:
        return 0.0
    usual = float(np.median(values))
    deviation = 1.4826 * float(np.median(np.abs(values - usual)))
    return (float(values.max()) - usual) / max(deviation, 1e-3)


WIDEST = 10.0
"""Seconds: the largest offset that is searched."""

LEAST_STEPS = 1.5
"""An offset of fewer steps is not worth telling: people hardly move in between."""

LEAST_GAIN = 4.0
"""Standard deviations by which an offset must be better than none to be told. In the random rooms
of seeds 1120 … 1159 a camera with the boxes of other people has at most 2.8, and 32 of 33 cameras
that are 2.5 to 30 steps late have at least 4."""

LEAST_SHARPNESS = 3.5
"""Deviations by which the peak must stand above the curve. In these rooms every camera of the
same people has more than 10, and one with the boxes of other people at most 5."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraOffset:
    """How late a camera is against the others."""

    camera: str
    seconds: float
    """Positive where it is late: what the others show, it shows so much later."""
    steps: float
    curve: Curve
    sharpness: float
    """How far the curve's peak stands above its median, in its median absolute deviations."""
    sure: bool
    """Whether the curve has one clear peak, and it is not at no offset."""

    @property
    def sentence(self) -> str:
        """In words, as a check tells it."""
        late = "late" if self.steps > 0.0 else "early"
        return f"{self.camera} is {abs(self.steps):.1f} frames {late} ({abs(self.seconds):.2f} s)"


def synchronise(
    sequence: Sequence,
    *,
    source: Literal["boxes", "motion"] | None = None,
    reader: FrameReader | None = None,
    most_steps: int = MOST_STEPS,
) -> tuple[CameraOffset, ...]:
    """Find out how late each camera is. Nothing is applied.

    Args:
        sequence: With calibrated cameras.
        source: What is compared; boxes where every camera has them, else the pictures' motion.
        reader: Of the pictures; one is opened where none is given.
        most_steps: Of which pictures are looked at.

    Returns:
        One for each camera that can be compared; none where nothing can be.
    """
    source = source or ("boxes" if sequence.has_detections else "motion")
    pairings: dict[tuple[int, int], Pairing] = {}
    if source == "boxes":
        pairings = {**box_pairings(sequence)}
    elif sequence.has_pictures:
        own = reader or FrameReader(sequence)
        try:
            pairings = {**motion_pairings(sequence, own, most_steps)}
        finally:
            if reader is None:
                own.close()
    if not pairings:
        return ()
    widest = min(round(WIDEST * sequence.fps), int(0.65 * sequence.frames))
    found = solve(pairings, len(sequence.views), max(1, widest))
    return tuple(
        _told(view.camera.name, offset, sequence.fps)
        for view, offset in zip(sequence.views, found, strict=True)
        if offset is not None
    )


def _told(name: str, offset: Offset, fps: float) -> CameraOffset:
    sure = (
        abs(offset.steps) >= LEAST_STEPS
        and offset.gain >= LEAST_GAIN
        and offset.sharpness >= LEAST_SHARPNESS
    )
    return CameraOffset(
        name, offset.steps / fps, offset.steps, offset.curve, offset.sharpness, sure
    )


@dataclass(frozen=True, slots=True, eq=False)
class BoxPairing:
    """The boxes of two cameras, each shifted in time against the predictions from the other."""

    first: LinkedBoxes
    second: LinkedBoxes
    height: float

    def scores(
        self, offsets: Float[ndarray, " O"], *, fine: bool = False
    ) -> tuple[Float[ndarray, "O S"], Float[ndarray, "O S"]]:
        """Fits and their numbers, of each offset and sampled step."""
        most = 600 if fine else 150
        there = agreement_by_offset(self.first, self.second, offsets, self.height, most)
        back = agreement_by_offset(self.second, self.first, -offsets, self.height, most)
        return (
            np.concatenate([there[0], back[0]], axis=1),
            np.concatenate([there[1], back[1]], axis=1),
        )


def box_pairings(sequence: Sequence) -> dict[tuple[int, int], BoxPairing]:
    """The pairs of cameras that both have boxes, as high as the boxes tell.

    Args:
        sequence: With calibrated cameras.
    """
    rays: list[Rays] = []
    linked: list[LinkedBoxes | None] = []
    for view in sequence.views:
        own = view.boxes_above(0.0)
        kept = compared(own.scores)
        own = Detections(own.frames[kept], own.boxes[kept], own.scores[kept])
        rays.append(upright_rays(own.frames, own.boxes, view.camera))
        linked.append(
            link_boxes(view.camera, rays[-1], own.boxes, sequence.frames)
            if len(own.frames)
            else None
        )
    agreed = consensus_of_cameras(sequence.cameras, rays)
    known = 2.0 * float(sequence.target_half_extents[2])
    near = 0.5 < agreed.height / known < 2.0 and agreed.agreeing >= LEAST_AGREEING
    height = agreed.height if near else known
    return {
        (a, b): BoxPairing(one, other, height)
        for (a, one), (b, other) in itertools.combinations(enumerate(linked), 2)
        if one is not None and other is not None
    }
