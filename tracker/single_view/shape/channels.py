"""Channels of the windows: edges, difference from the background, and motion.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Int32, UInt8
from numpy import ndarray

from tracker.kernels.pictures.channels import channel_sums, gradients
from tracker.single_view.pictures.background import (
    BLUR,
    BackgroundModel,
    largest_channel,
    square_roots,
    tone_curve,
)

LAG = 0.12
"""Time between two images that are compared, seconds: a moving hand leaves its place. The trees
are trained on it, so that it is not the one of
:class:`~tracker.single_view.pictures.background.MovingForeground`."""

MEMORY = 2.0
"""Time constant of the fading mean of motion, seconds."""

_AROUND = 0.35
"""Distance to either side over which edges are averaged for normalisation, metres."""

_CALM = 4.0
"""Constant added to that average, levels per pixel: on a plain wall noise is no edge."""

_EDGE = 64.0
"""Value of an edge as strong as the average around it."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelState:
    """The images of the last moment, and the mean motion."""

    before: tuple[UInt8[ndarray, "h w 3"], ...]
    """Square-rooted and blurred, the oldest first."""
    activity: Float32[ndarray, "h w"] | None
    """The fading mean of motion; None before the first image."""


class Channels:
    """The channels of one camera's images, reduced to one resolution of people.

    Colours are 16 √level, whose noise is equal in dark and light. Edges are normalised by
    those around them, by direction and in total [DTPB09]_. Further channels are the
    difference from the background at the image's exposure; the
    difference from a moment ago; its fading mean, which shows people moving in place; and the
    variation of a background pixel.
    """

    def __init__(
        self, background: BackgroundModel, factor: float, pixels_per_metre: float, step_time: float
    ) -> None:
        """Prepare the channels of one camera.

        Args:
            background: The background, at the resolution of the images.
            factor: Factor of the reduction, at most 1.
            pixels_per_metre: Resolution at people in the middle of the room, after the reduction.
            step_time: Time between two images, seconds.
        """
        self._background = background
        height, width = background.picture.shape[:2]
        self._size = max(1, round(width * factor)), max(1, round(height * factor))
        self._spread = self._reduced(background.spread)
        self._around = 2 * max(1, round(_AROUND * pixels_per_metre)) + 1
        self._lag = max(1, round(LAG / step_time))
        self._fading = float(np.exp(-step_time / MEMORY))

    @property
    def factors(self) -> tuple[float, float]:
        """Reduced pixels per pixel, across and down."""
        height, width = self._background.picture.shape[:2]
        return self._size[0] / width, self._size[1] / height

    def initial(self) -> ChannelState:
        """The state before the first image."""
        return ChannelState((), None)

    def watch(self, state: ChannelState, picture: UInt8[ndarray, "h w 3"]) -> ChannelState:
        """Update the state by an image without computing its channels.

        Args:
            state: The state after the image before.
            picture: The image, BGR, of the background's size.
        """
        return self._watch(state, self._reduced(square_roots(picture)))[0]

    def step(
        self, state: ChannelState, picture: UInt8[ndarray, "h w 3"]
    ) -> tuple[ChannelState, Int32[ndarray, "h1 w1 C"]]:
        """Compute the integral images of an image's channels.

        Args:
            state: The state after the image before.
            picture: The image, BGR, of the background's size.

        Returns:
            The next state, and the sums of :func:`tracker.kernels.pictures.channels.channel_sums`
            over the reduced image.
        """
        empty = self._background.picture
        shown = cv2.LUT(empty, square_roots(tone_curve(empty, picture)))
        roots = self._reduced(square_roots(picture))
        difference = largest_channel(cv2.absdiff(roots, self._reduced(shown)))
        after, motion, activity = self._watch(state, roots)
        found = gradients(roots)
        mean = cv2.blur(found.magnitudes, (self._around, self._around))
        edges = np.minimum(_EDGE * found.magnitudes / (mean + _CALM), 255.0).astype(np.uint8)
        planes = np.stack(
            [
                np.minimum(difference, 63) * np.uint8(4),
                np.minimum(motion, 31) * np.uint8(8),
                np.minimum(32.0 * activity, 255.0).astype(np.uint8),
                np.minimum(self._spread, 63) * np.uint8(4),
            ],
            axis=2,
        )
        sums: Int32[ndarray, "h1 w1 C"] = channel_sums(found.bins, edges, planes)
        return after, sums

    def _watch(
        self, state: ChannelState, roots: UInt8[ndarray, "h1 w1 3"]
    ) -> tuple[ChannelState, UInt8[ndarray, "h1 w1"], Float32[ndarray, "h1 w1"]]:
        """The next state, the difference from a moment ago, and its fading mean."""
        smooth = cv2.GaussianBlur(roots, (0, 0), BLUR)
        before = (*state.before, smooth)
        motion = _moved(before[0], smooth)
        activity = state.activity
        if activity is None:
            activity = np.zeros(motion.shape, dtype=np.float32)
        activity = self._fading * activity + (1.0 - self._fading) * motion.astype(np.float32)
        return ChannelState(before[-self._lag :], activity), motion, activity

    def _reduced(self, picture: UInt8[ndarray, "h w *c"]) -> UInt8[ndarray, "h2 w2 *c"]:
        return np.asarray(cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA))


def _moved(old: UInt8[ndarray, "h w 3"], new: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w"]:
    """The change of each pixel beyond that of most of the image: exposure and noise."""
    shift = [int(np.median(new[::4, ::4, c].astype(int) - old[::4, ::4, c])) for c in range(3)]
    if any(shift):
        levels = np.arange(256)[:, None] + shift
        old = cv2.LUT(old, np.clip(levels, 0, 255).astype(np.uint8)[None])
    difference = largest_channel(cv2.absdiff(old, new))
    noise = np.uint8(min(255, 2 * int(np.median(difference[::2, ::2]))))
    return np.asarray(cv2.subtract(difference, np.full_like(difference, noise)))
