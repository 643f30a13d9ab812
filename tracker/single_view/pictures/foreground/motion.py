"""Foreground by difference from the background or by recent motion, for uncertain backgrounds.

People who never leave are learnt as background, however they move their arms. Then many of
the pixels that change at all differ from their median for much of the time, while pixels of a
passage do so seldom. This frequency gives the uncertainty of the median; where it is large, a
memory of recent changes shows people moving in place.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.foreground.exposure import (
    BackgroundModel,
    largest_channel,
    square_roots,
)
from tracker.single_view.pictures.foreground.segmentation import Segmentation

LAG = 0.1
"""Time between two images that are compared, seconds: within it a moving hand leaves its place."""

BLUR = 1.0
"""Standard deviation of the blur against noise and compression, before comparison, pixels."""

BLIND = 0.5
"""Share of an image above which a simultaneous change is one of light and not of motion: light
changes in the whole room, and people who fill half of an image leave no background to learn."""


@dataclass(frozen=True, slots=True, eq=False)
class MotionState:
    """The images of the last moment, and the time since each pixel changed."""

    before: tuple[UInt8[ndarray, "h w 3"], ...]
    """Square-rooted and blurred, the oldest first; empty before the first image."""
    since: UInt8[ndarray, "h w"] | None
    """Number of images since the last change, 255 for never or long ago."""


class MovingForeground:
    """A :class:`BackgroundModel` and a memory of motion.

    A pixel is foreground where it differs from the background, or where it changed by more
    than the threshold within the last moments: |r(t) − r(t − l)| of the square-rooted grey
    levels r, in the channel with the largest difference.
    """

    def __init__(
        self, background: BackgroundModel, parameters: ForegroundParams, step_time: float
    ) -> None:
        """Set the background.

        Args:
            background: The background, whose uncertainty scales the memory.
            parameters: Thresholds, and the length of the memory.
            step_time: Time between two images, seconds.
        """
        self._background = background
        self._parameters = parameters
        self._lag = max(1, round(LAG / step_time))
        self.uncertainty = background.uncertainty(parameters)
        """The uncertainty of the background, 0 … 1."""
        lasting = parameters.motion_memory * self.uncertainty
        self.memory = min(254, round(lasting / step_time))
        """Number of images for which a change counts; with 0 this is the background alone."""

    def start(self) -> MotionState:
        """The state before the first image."""
        return MotionState((), None)

    def step(
        self, state: MotionState, picture: UInt8[ndarray, "h w 3"]
    ) -> tuple[MotionState, Segmentation]:
        """Segment an image."""
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
        difference = largest_channel(cv2.absdiff(old, new))
        changed = (difference > self._parameters.motion_threshold).astype(np.uint8)
        if cv2.countNonZero(changed) > BLIND * changed.size:
            return np.zeros_like(changed)
        return np.asarray(cv2.medianBlur(changed, 5), dtype=np.uint8)
