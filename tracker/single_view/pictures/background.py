"""A background learnt once from the clip, and memory of motion; the interface of such models.

The background is the median of images spread over the clip, so no empty image
is needed; a person who stands in one place for more than half of the clip becomes part
of it. Cameras with automatic exposure change the whole image: each frame's
tone curve is estimated against the background, and the background is mapped to the
frame's exposure, never the frame to the background, which would change its colours.

People who never leave are learnt as background, however they move their arms. Then many of
the pixels that change at all differ from their median for much of the time, while pixels of a
passage do so seldom. This frequency gives the uncertainty of the median; where it is large, a
memory of recent changes shows people moving in place.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.kernels.pictures.foreground import foreground_mask, level_medians, upper_medians
from tracker.parameters.groups.foreground import ForegroundParams


@dataclass(frozen=True, slots=True, eq=False)
class Segmentation:
    """The segmentation of one image."""

    mask: UInt8[ndarray, "h w"]
    """1 on the foreground, 0 elsewhere."""
    thresholds: Float[ndarray, " 3"]
    """The thresholds in blue, green and red, in the model's own units."""


class ForegroundModel(Protocol):
    """A background model that segments images; a state goes from image to image."""

    def start(self) -> Any:
        """The state before the first image."""
        ...

    def step(self, state: Any, picture: UInt8[ndarray, "h w 3"]) -> tuple[Any, Segmentation]:
        """Segment the next image.

        Args:
            state: The state after the image before.
            picture: The image, BGR, of the background's size.
        """
        ...


def pack(mask: UInt8[ndarray, "h w"]) -> UInt8[ndarray, " bytes"]:
    """Pack a mask into a few hundred bytes: its size, then its bits, compressed."""
    height, width = mask.shape
    size = np.array([height, width], dtype="<u4").tobytes()
    return np.frombuffer(size + zlib.compress(np.packbits(mask).tobytes(), 1), dtype=np.uint8)


def unpack(packed: UInt8[ndarray, " bytes"]) -> UInt8[ndarray, "h w"]:
    """Unpack a mask of :func:`pack`.

    Raises:
        ValueError: If the bytes are no packed mask.
    """
    try:
        height, width = np.frombuffer(packed[:8].tobytes(), dtype="<u4").tolist()
        bits = np.frombuffer(zlib.decompress(packed[8:].tobytes()), dtype=np.uint8)
        return np.unpackbits(bits, count=height * width).reshape(height, width)
    except (ValueError, zlib.error) as error:
        raise ValueError(f"expected a packed mask, got {packed.size} bytes: {error}") from None


LEVELS = 16
"""Number of levels at which a tone curve is measured; between them it is interpolated."""

SAMPLED_PIXELS = 6000
"""Number of pixels from which a tone curve is measured: a few hundred for each level's median."""

MEDIAN_VALUES = 50_000
"""Number of values of an image for which medians are computed between two calls of ``check``."""

OFTEN = 0.3
"""Share of the images above which a pixel is often away from its median: where people pass through,
a pixel shows a person in fewer images.

In six cameras of rooms where people walk about, the share of such pixels was 0.06 to 0.14, and in
two of a room where all stay 0.22 to 0.28, so that the two differ; with 0.2 in place of 0.3 they
overlapped (0.17 to 0.31, and 0.26 to 0.48)."""

AWAY = 24
"""Difference from the median, on the scale 16 √level, above which a pixel is away from it: that
from which it is foreground by default. With half of it the shares of the same rooms overlapped."""

LEAST_CHANGING = 0.005
"""Least share of changing pixels in the image for an estimate of :attr:`changing_share`."""

_ROOTS = np.rint(16.0 * np.sqrt(np.arange(256))).clip(0, 255).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class BackgroundModel:
    """The empty scene of one camera."""

    picture: UInt8[ndarray, "h w 3"]
    """The image, BGR."""
    spread: UInt8[ndarray, "h w"]
    """Typical (median) deviation of a background pixel once exposures are aligned, on the
    scale of 16 √level."""
    changing_share: float = 0.0
    """Share, among the pixels that ever change, of those away from their median in more than
    :data:`OFTEN` of the images."""

    def uncertainty(self, parameters: ForegroundParams) -> float:
        """Compute the uncertainty of the median, 0 … 1, which is large if people stay in one
        place."""
        low, high = parameters.restless_from, parameters.restless_to
        u = float(np.clip((self.changing_share - low) / max(high - low, 1e-6), 0.0, 1.0))
        return u * u * (3.0 - 2.0 * u)

    @staticmethod
    def learn(
        pictures: Iterable[UInt8[ndarray, "h w 3"]], check: Callable[[], None] = lambda: None
    ) -> BackgroundModel | None:
        """Learn the median of images spread over the clip, all brought to one exposure.

        Args:
            pictures: Images, BGR, of one size; 15 to 40 are enough.
            check: A function that is called now and then; an exception of it ends the work.

        Returns:
            The model; None without images.
        """
        stack = list(pictures)
        if not stack:
            return None
        # the first median is blurred by the exposures, but sufficient to align them
        reference = median(stack, check)
        aligned = []
        for picture in stack:
            check()
            aligned.append(cv2.LUT(picture, _inverse(tone_curve(reference, picture))))
        reference = median(aligned, check)
        roots = cv2.LUT(reference, _ROOTS)
        deviations = [
            largest_channel(cv2.absdiff(cv2.LUT(picture, _ROOTS), roots)) for picture in aligned
        ]
        return BackgroundModel(reference, median(deviations, check), _changing_share(deviations))

    def foreground(
        self, picture: UInt8[ndarray, "h w 3"], parameters: ForegroundParams
    ) -> UInt8[ndarray, "h w"]:
        """Segment an image: 1 on the foreground without shadows and single pixels, 0 elsewhere.

        Args:
            picture: The image, BGR, of the background's size.
            parameters: The threshold, on the largest difference of the channels on the scale
                16 √level (0 … 255), to which the variation of a pixel is added; and the bounds
                of a shadow.
        """
        mask = foreground_mask(
            picture,
            self.picture,
            tone_curve(self.picture, picture),
            self.spread,
            parameters.threshold,
            parameters.darkest_shadow,
            parameters.shadow_tint,
        )
        cleaned: ndarray = cv2.medianBlur(mask, 5)
        return cleaned


def tone_curve(
    source: UInt8[ndarray, "h w 3"], target: UInt8[ndarray, "h w 3"]
) -> UInt8[ndarray, "1 256 3"]:
    """Estimate the look-up table of each channel that maps one image to another's exposure.

    At each of some levels of the source the median of the target's values there is
    used, which is robust while less than half of those pixels show something else;
    the levels between are interpolated. The curve never decreases: where medians do, a
    person hides most of the pixels of a level, and the more frequent levels determine it. Levels
    beyond those measured have the last one's shift.

    Args:
        source: An image of the background alone, whose levels make the groups.
        target: An image of the same size and view.
    """
    from scipy import optimize  # slow to import, and a server starts without it

    height, width = source.shape[:2]
    stride = max(1, int(np.sqrt(height * width / SAMPLED_PIXELS)))
    few = source[::stride, ::stride].reshape(-1, 3)
    other = target[::stride, ::stride].reshape(-1, 3)
    levels = np.arange(256)
    curve = np.empty((1, 256, 3), dtype=np.uint8)
    enough = max(4, len(few) // 400)
    found = level_medians(few, other, LEVELS)
    for channel in range(3):
        total = found.totals[channel]
        used = (total >= enough).nonzero()[0]
        if not len(used):
            curve[0, :, channel] = levels
            continue
        centres = found.sums[channel, used] / total[used]
        rising = optimize.isotonic_regression(found.medians[channel, used], weights=total[used]).x
        mapped = levels + np.interp(levels, centres, rising - centres)
        curve[0, :, channel] = np.clip(np.rint(mapped), 0, 255)
    return curve


def square_roots(picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w 3"]:
    """Compute 16 √level, whose noise is the same in dark and light."""
    return np.asarray(cv2.LUT(picture, _ROOTS), dtype=np.uint8)


def largest_channel(picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w"]:
    """Compute the largest value of each pixel's channels."""
    blue, green, red = cv2.split(picture)
    return np.asarray(cv2.max(cv2.max(blue, green), red), dtype=np.uint8)


def _changing_share(deviations: list[UInt8[ndarray, "h w"]]) -> float:
    """Compute :attr:`BackgroundModel.changing_share`.

    Args:
        deviations: Deviation of each image from the median, on the scale 16 √level.
    """
    counts = np.zeros(deviations[0].shape, dtype=np.int64)
    for deviation in deviations:
        counts += deviation > AWAY
    ever = counts >= 2
    if ever.mean() < LEAST_CHANGING:
        return 0.0
    return float((counts[ever] > OFTEN * len(deviations)).mean())


def _inverse(curve: UInt8[ndarray, "1 256 3"]) -> UInt8[ndarray, "1 256 3"]:
    """The inverse of a rising curve, as far as it is invertible."""
    levels = np.arange(256)
    inverse = np.empty_like(curve)
    for channel in range(3):
        # the middle of levels that became one; np.interp needs strictly increasing points
        values, first = np.unique(curve[0, :, channel], return_index=True)
        last = np.append(first[1:], 256) - 1
        inverse[0, :, channel] = np.rint(np.interp(levels, values, (first + last) / 2.0))
    return inverse


def median(
    pictures: list[ndarray], check: Callable[[], None] = lambda: None
) -> UInt8[ndarray, "h w *c"]:
    """Compute each value's median over images of one size, the upper one for an even number.

    Args:
        pictures: At least one image.
        check: A function that is called before every few rows; an exception of it ends the work.
    """
    result = np.empty_like(pictures[0])
    rows = max(1, MEDIAN_VALUES // pictures[0][0].size)
    for top in range(0, len(result), rows):
        check()
        stack = np.stack([picture[top : top + rows] for picture in pictures])
        medians: ndarray = upper_medians(stack.reshape(len(stack), -1))
        result[top : top + rows] = medians.reshape(stack.shape[1:])
    return result


class LearntForeground:
    """A :class:`BackgroundModel` that does not change, with one threshold."""

    def __init__(self, background: BackgroundModel, parameters: ForegroundParams) -> None:
        """Set the background."""
        self._background = background
        self._parameters = parameters

    def start(self) -> None:
        """The model has no state."""
        return None

    def step(self, state: None, picture: UInt8[ndarray, "h w 3"]) -> tuple[None, Segmentation]:
        """Segment an image."""
        mask = self._background.foreground(picture, self._parameters)
        return None, Segmentation(mask, np.full(3, self._parameters.threshold))


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
