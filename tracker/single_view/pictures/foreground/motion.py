"""Foreground where the background cannot be known: what has changed lately counts as well.

People who never leave are learnt as background, however they move their arms. Then many of
the pixels that change at all show something else than their median for much of the time. A
background that is passed by does so seldom. How often tells how far the median is to be
believed; where it is not, a memory of the last moments' changes shows who moves in place.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.foreground.exposure import BackgroundModel, square_roots
from tracker.single_view.pictures.foreground.segmentation import Segmentation

LAG = 0.1
"""Seconds between two pictures that are compared: within it a moving hand leaves its place."""

BLUR = 1.0
"""Pixels: noise and blocks of compression are smoothed before pictures are compared."""

BLIND = 0.5
"""A picture of which more than this share changed at once shows another light: nobody moved."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """The pictures of the last moment, and how long ago each pixel changed."""

    before: tuple[UInt8[ndarray, "h w 3"], ...]
    """Square-rooted and smoothed, the oldest first; empty before the first picture."""
    since: UInt8[ndarray, "h w"] | None
    """Pictures since the last change, 255 for never or long ago."""


class MovingForeground:
    """A :class:`BackgroundModel` and a memory of motion.

    A pixel is foreground where it differs from the background, or where it changed by more
    than the threshold within the last moments: |r(t) − r(t − l)| of the square-rooted grey
    levels r, in the channel that differs most.
    """

    def __init__(
        self, background: BackgroundModel, parameters: ForegroundParams, step_time: float
    ) -> None:
        """Take the background.

        Args:
            background: As learnt; its doubt scales the memory.
            parameters: Thresholds, and the length of the memory.
            step_time: Seconds between two pictures.
        """
        self._background = background
        self._parameters = parameters
        self._lag = max(1, round(LAG / step_time))
        self.doubt = background.doubt(parameters)
        """How little the background is believed, 0 … 1."""
        lasting = parameters.motion_memory * self.doubt
        self.memory = min(254, round(lasting / step_time))
        """Pictures for which a change counts; with 0 this is the background alone."""

    def start(self) -> MotionState:
        """Nothing has moved yet."""
        return MotionState((), None)

    def step(
        self, state: MotionState, picture: UInt8[ndarray, "h w 3"]
    ) -> tuple[MotionState, Segmentation]:
        """The foreground of a picture."""
        p = self._parameters
        mask = self._background.foreground(picture, p)
        smooth = cv2.GaussianBlur(square_roots(picture), (0, 0), BLUR)
        before = (*state.before, smooth)
        since = state.since
        if since is None:
            since = np.full(picture.shape[:2], 255, dtype=np.uint8)
        changed = self._changed(before[0], smooth)
        since = np.minimum(since, 254) + np.uint8(1)
        since[changed > 0] = 0
        recent = (since < self.memory).astype(np.uint8)
        after = MotionState(before[-self._lag :], since)
        return after, Segmentation(cv2.max(mask, recent), np.full(3, p.threshold))

    def _changed(
        self, old: UInt8[ndarray, "h w 3"], new: UInt8[ndarray, "h w 3"]
    ) -> UInt8[ndarray, "h w"]:
        difference = cv2.absdiff(old, new).max(axis=2)
        changed = (difference > self._parameters.motion_threshold).astype(np.uint8)
        if cv2.countNonZero(changed) > BLIND * changed.size:
            return np.zeros_like(changed)
        return np.asarray(cv2.medianBlur(changed, 5), dtype=np.uint8)
