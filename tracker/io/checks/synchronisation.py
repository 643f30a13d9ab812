"""How late each camera is, from its boxes or from the motion in its pictures."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.consistency.observed import Rays, upright_rays
from tracker.geometry.consistency.sliding import LinkedBoxes, agreement_by_offset, link_boxes
from tracker.geometry.consistency.suggestion import LEAST_AGREEING, consensus_of_cameras
from tracker.io.checks.motion import MOST_STEPS, motion_pairings
from tracker.io.checks.offsets import Curve, Offset, Pairing, solve
from tracker.io.conventions.judge import compared
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Detections, Sequence

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
