"""The motion in the pictures of two cameras, compared on common epipolar planes.

A plane through two camera centres is seen by either camera as one line. The motion on these lines,
by plane and step, is therefore similar in both cameras, whatever people look like, if their times
agree.

[BA16] Ben-Artzi, Halperin, Werman, Peleg, "Epipolar geometry based on line similarity",
ICPR 2016, whose motion barcodes of epipolar lines these are.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence

# Halved and doubled (the number of steps: 250), none of the constants below changes the offset of
# any of the built-in rooms by more than 0.1 steps, where a camera is late by 7, −10 and 20 steps.
PLANES = 64
"""Number of epipolar planes through the common field of view."""

WIDTH = 160
"""Width to which pictures are reduced, pixels."""

MOST_STEPS = 1500
"""Default of the largest number of steps that are compared, in the middle of the recording."""

_NOISE = 8  # grey levels: smaller changes of a pixel count as noise
_BLOCK = 25  # number of steps of one part of the recording


@dataclass(frozen=True, slots=True, eq=False)
class MotionPairing:
    """Motion by step and epipolar plane of two cameras. T steps, K planes."""

    first: Float[ndarray, "T K"]
    second: Float[ndarray, "T K"]
    """Both have mean 0 over the steps, and NaN rows where there is no picture."""

    def scores(
        self, offsets: Float[ndarray, " O"], *, fine: bool = False
    ) -> tuple[Float[ndarray, "O S"], Float[ndarray, "O S"]]:
        """Correlation and energy, of each offset and part of the recording."""
        whole = np.unique(np.concatenate([np.floor(offsets), np.floor(offsets) + 1.0]))
        made = [self._whole(int(offset)) for offset in whole]
        fits, counts = (np.array(part) for part in zip(*made, strict=True))
        at = np.searchsorted(whole, np.floor(offsets))
        part = (offsets - np.floor(offsets))[:, None]
        return (
            (1.0 - part) * fits[at] + part * fits[at + 1],
            (1.0 - part) * counts[at] + part * counts[at + 1],
        )

    def _whole(self, offset: int) -> tuple[ndarray, ndarray]:
        steps = len(self.first)
        parts = -(-steps // _BLOCK)
        fits, counts = np.zeros(parts * _BLOCK), np.zeros(parts * _BLOCK)
        begin, end = max(0, -offset), min(steps, steps - offset)
        if begin < end:
            one, other = self.first[begin:end], self.second[begin + offset : end + offset]
            fits[begin:end] = np.nan_to_num((one * other).sum(axis=1))
            counts[begin:end] = np.nan_to_num((one**2 + other**2).sum(axis=1) / 2.0)
        return fits.reshape(parts, -1).sum(axis=1), counts.reshape(parts, -1).sum(axis=1)


def motion_pairings(
    sequence: Sequence, reader: FrameReader, most_steps: int = MOST_STEPS
) -> dict[tuple[int, int], MotionPairing]:
    """Compute the motion of the pairs of cameras that share epipolar planes.

    Args:
        sequence: The sequence, with calibrated cameras.
        reader: The reader of its pictures.
        most_steps: Largest number of steps, in the middle of the recording.
    """
    first = max(0, (sequence.frames - most_steps) // 2)
    steps = min(sequence.frames, most_steps)
    moving = [_motion(reader, c, first, steps) for c in range(len(sequence.views))]
    pairings: dict[tuple[int, int], MotionPairing] = {}
    for a, b in itertools.combinations(range(len(moving)), 2):
        one, other = moving[a], moving[b]
        if one is None or other is None:
            continue
        planes = _planes(sequence.cameras[a], sequence.cameras[b], one.shape[1:], other.shape[1:])
        if planes is not None:
            pairings[a, b] = MotionPairing(_profile(one, planes[0]), _profile(other, planes[1]))
    return pairings


def _motion(
    reader: FrameReader, camera: int, first: int, steps: int
) -> UInt8[ndarray, "T h w"] | None:
    """The change from picture to picture, reduced; all 255 where a picture is missing."""
    before: ndarray | None = None
    changes: list[ndarray | None] = []
    shape: tuple[int, int] | None = None
    for picture in itertools.islice(reader.iterate(camera, first), steps):
        small = None
        if picture is not None:
            height, width = picture.shape[:2]
            shape = (max(2, round(height * WIDTH / width)), WIDTH)
            grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
            small = cv2.resize(grey, shape[::-1], interpolation=cv2.INTER_AREA)
        if small is None or before is None or small.shape != before.shape:
            changes.append(None)
        else:
            changes.append(np.minimum(cv2.absdiff(small, before), 254))
        before = small
    if shape is None:
        return None
    missing = np.full(shape, 255, dtype=np.uint8)
    return np.stack([missing if change is None else change for change in changes])


def _planes(
    one: Camera, other: Camera, shape_one: tuple[int, ...], shape_other: tuple[int, ...]
) -> tuple[Int[ndarray, " P"], Int[ndarray, " Q"]] | None:
    """The epipolar plane of each pixel of two small pictures, -1 where only one camera sees it."""
    base = other.centre - one.centre
    length = float(np.linalg.norm(base))
    if length < 1e-6:
        return None
    axis = base / length
    aside = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    third = np.cross(axis, aside)
    angles = [
        np.arctan2(rays @ third, rays @ aside)
        for rays in (_pixel_rays(one, shape_one), _pixel_rays(other, shape_other))
    ]
    counts = [np.histogram(angle, 720, (-np.pi, np.pi))[0] for angle in angles]
    shared = (counts[0] > 0) & (counts[1] > 0)
    if shared.sum() < 8:
        return None
    # planes of equal numbers of pixels, so that no line is but a pixel long
    weight = np.cumsum(np.where(shared, np.minimum(*counts), 0).astype(float))
    number = np.minimum((weight / weight[-1] * PLANES).astype(int), PLANES - 1)
    number[~shared] = -1
    bins = [np.clip(((a + np.pi) / (2 * np.pi) * 720).astype(int), 0, 719) for a in angles]
    return number[bins[0]], number[bins[1]]


def _pixel_rays(camera: Camera, shape: tuple[int, ...]) -> Float[ndarray, "P 3"]:
    height, width = shape
    scale = np.array(camera.image_size) / [width, height]
    places = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    return camera.back_project((places + 0.5) * scale - 0.5)


def _profile(moving: UInt8[ndarray, "T h w"], planes: Int[ndarray, " P"]) -> Float[ndarray, "T K"]:
    """How much moves on each plane at each step, as deviations from its mean."""
    seen = planes >= 0
    sizes = np.maximum(np.bincount(planes[seen], minlength=PLANES), 1)
    rows = np.empty((len(moving), PLANES))
    for step, picture in enumerate(moving):
        change = picture.reshape(-1)[seen]
        if len(change) and change.min() == 255:
            rows[step] = np.nan
            continue
        strong = np.where(change > _NOISE, change, 0)
        rows[step] = np.bincount(planes[seen], strong, PLANES) / sizes
    rows = np.sqrt(rows)
    present = np.isfinite(rows).all(axis=1)
    if not present.any():
        return rows
    rows -= rows[present].mean(axis=0)
    spread = rows[present].std(axis=0)
    return np.asarray(rows / (spread + 0.5 * np.median(spread) + 1e-6))
