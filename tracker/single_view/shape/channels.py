"""What a window on a person is judged by: edges, difference from the background, motion.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, Int32, UInt8
from numpy import ndarray

from tracker.kernels.pictures.channels import channel_sums, gradients
from tracker.single_view.pictures.foreground import BackgroundModel, tone_curve
from tracker.single_view.pictures.foreground.exposure import square_roots

LAG = 0.12
"""Seconds between two pictures that are compared: a moving hand leaves its place."""

MEMORY = 2.0
"""Seconds after which motion has faded to a third."""

BLUR = 1.0
"""Pixels: noise and blocks of compression are smoothed before pictures are compared."""

_AROUND = 0.35
"""Metres to either side over which the strength of edges is set against its mean."""

_CALM = 4.0
"""Levels a pixel that are added to that mean: on a plain wall noise is no edge."""

_EDGE = 64.0
"""Value of an edge as strong as those around it."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelState:
    """The pictures of the last moment, and how much has moved."""

    before: tuple[UInt8[ndarray, "h w 3"], ...]
    """Square-rooted, smoothed, the oldest first."""
    activity: Float32[ndarray, "h w"] | None
    """The fading mean of motion; None before the first picture."""


class Channels:
    """The channels of one camera's pictures, reduced to one size of people.

    Colours are taken as 16 √level, whose noise is alike in dark and light. Edges count by
    their strength relative to those around them, by direction and in all [DTPB09]_. Beside
    them stand the difference from the background, brought to the picture's exposure; the
    difference from a moment ago; its fading mean, which shows who moves in place; and what a
    background pixel varies by itself.
    """

    def __init__(
        self, background: BackgroundModel, factor: float, pixels_per_metre: float, step_time: float
    ) -> None:
        """Prepare for one camera.

        Args:
            background: Of the pictures as they come.
            factor: By which they are reduced, 1 at most.
            pixels_per_metre: Of people in the middle of the room, after that.
            step_time: Seconds between two pictures.
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
        """Reduced pixels in a pixel, across and down."""
        height, width = self._background.picture.shape[:2]
        return self._size[0] / width, self._size[1] / height

    def initial(self) -> ChannelState:
        """Nothing was seen yet."""
        return ChannelState((), None)

    def watch(self, state: ChannelState, picture: UInt8[ndarray, "h w 3"]) -> ChannelState:
        """The state after a picture in which nobody is sought: what moves, and no channels."""
        return self._watch(state, self._reduced(square_roots(picture)))[0]

    def step(
        self, state: ChannelState, picture: UInt8[ndarray, "h w 3"]
    ) -> tuple[ChannelState, Int32[ndarray, "h1 w1 C"]]:
        """The integral images of a picture's channels."""
        empty = self._background.picture
        shown = cv2.LUT(empty, square_roots(tone_curve(empty, picture)))
        roots = self._reduced(square_roots(picture))
        difference = _largest(cv2.absdiff(roots, self._reduced(shown)))
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
    """How much each pixel changed, beyond what most of the picture did: exposure and noise."""
    shift = [int(np.median(new[::4, ::4, c].astype(int) - old[::4, ::4, c])) for c in range(3)]
    if any(shift):
        levels = np.arange(256)[:, None] + shift
        old = cv2.LUT(old, np.clip(levels, 0, 255).astype(np.uint8)[None])
    difference = _largest(cv2.absdiff(old, new))
    noise = np.uint8(min(255, 2 * int(np.median(difference[::2, ::2]))))
    return np.asarray(cv2.subtract(difference, np.full_like(difference, noise)))


def _largest(picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w"]:
    blue, green, red = cv2.split(picture)
    return np.asarray(cv2.max(cv2.max(blue, green), red))
