"""A background learnt once from the clip, brought to each picture's exposure; shadows left out.

The background is the median of pictures spread over the clip, so no empty picture
is needed; whoever stands in one place for more than half of the clip becomes part
of it. Cameras that expose automatically change the whole picture: each frame's
tone curve is estimated against the background, and the background is mapped to the
frame's exposure, never the frame to the background, whose colours it would spoil.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8
from numpy import ndarray

from tracker.kernels.pictures import images
from tracker.kernels.pictures.foreground import level_medians, upper_medians
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.foreground.segmentation import Segmentation

LEVELS = 16
"""Levels of the source at which a tone curve is measured; between them it is interpolated."""

SAMPLED_PIXELS = 6000
"""About so many pixels a tone curve is measured on: a few hundred for each level's median."""

MEDIAN_VALUES = 50_000
"""Values of a picture of which medians are taken between two looks at whether to stop."""

OFTEN = 0.3
"""Share of the pictures in which a pixel that is only passed by seldom shows who passes."""

AWAY = 24
"""On the scale 16 √level: what differs more than this from the median shows something else."""

LEAST_CHANGING = 0.005
"""Of the picture: of fewer changing pixels nothing is said."""

_ROOTS = np.rint(16.0 * np.sqrt(np.arange(256))).clip(0, 255).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class BackgroundModel:
    """The empty scene as one camera sees it."""

    picture: UInt8[ndarray, "h w 3"]
    """BGR."""
    spread: UInt8[ndarray, "h w"]
    """Typical (median) deviation of a background pixel once exposures are aligned, on the
    scale of 16 √level."""
    restlessness: float = 0.0
    """Share of the pixels that change at all which are away from their median in more than
    :data:`OFTEN` of the pictures."""

    def doubt(self, parameters: ForegroundParams) -> float:
        """How little the median is to be believed, 0 … 1: people who stay made it."""
        low, high = parameters.restless_from, parameters.restless_to
        u = float(np.clip((self.restlessness - low) / max(high - low, 1e-6), 0.0, 1.0))
        return u * u * (3.0 - 2.0 * u)

    @staticmethod
    def learn(
        pictures: Iterable[UInt8[ndarray, "h w 3"]], check: Callable[[], None] = lambda: None
    ) -> BackgroundModel | None:
        """The median of pictures spread over the clip, all brought to one exposure.

        Args:
            pictures: BGR, of one size; 15 to 40 are enough.
            check: Called every so often; what it raises ends the work.

        Returns:
            None where there is no picture.
        """
        stack = list(pictures)
        if not stack:
            return None
        # the first median is blurred by the exposures, but good enough to align them by
        reference = median(stack, check)
        aligned = []
        for picture in stack:
            check()
            aligned.append(cv2.LUT(picture, _inverse(tone_curve(reference, picture))))
        reference = median(aligned, check)
        roots = cv2.LUT(reference, _ROOTS)
        deviations = [_largest(cv2.absdiff(cv2.LUT(picture, _ROOTS), roots)) for picture in aligned]
        return BackgroundModel(reference, median(deviations, check), _restlessness(deviations))

    def foreground(
        self, picture: UInt8[ndarray, "h w 3"], parameters: ForegroundParams
    ) -> UInt8[ndarray, "h w"]:
        """1 where a pixel is neither background nor shadow, 0 elsewhere; single pixels cleaned off.

        Args:
            picture: BGR, of the background's size.
            parameters: The threshold, a difference in the channel that differs most on the scale
                16 √level (0 … 255), on which comes what a pixel varies by itself; and what a
                shadow may do.
        """
        mask = images.foreground_mask(
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
    """The look-up table, one a channel, that maps one picture to another's exposure.

    At each of some levels of the source the median of the target's values there is
    taken, which holds while less than half of those pixels show something else;
    the levels between are interpolated. The curve never falls: where medians do, a
    person hides most of what has that level, and the commoner levels decide. Levels
    beyond those measured follow the last one's shift.

    Args:
        source: A picture of the background alone; its levels make the groups.
        target: Of the same size and view.
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
    """16 √level, whose noise is the same in dark and light."""
    return np.asarray(cv2.LUT(picture, _ROOTS), dtype=np.uint8)


def _restlessness(deviations: list[UInt8[ndarray, "h w"]]) -> float:
    """Share of the changing pixels that are often away from their median.

    Args:
        deviations: Of each picture from the median, on the scale 16 √level.
    """
    counts = np.zeros(deviations[0].shape, dtype=np.int64)
    for deviation in deviations:
        counts += deviation > AWAY
    ever = counts >= 2
    if ever.mean() < LEAST_CHANGING:
        return 0.0
    return float((counts[ever] > OFTEN * len(deviations)).mean())


def _inverse(curve: UInt8[ndarray, "1 256 3"]) -> UInt8[ndarray, "1 256 3"]:
    """The curve that undoes a rising one, as far as it can be undone."""
    levels = np.arange(256)
    inverse = np.empty_like(curve)
    for channel in range(3):
        # of levels that became one, the middle; np.interp needs strictly rising points
        values, first = np.unique(curve[0, :, channel], return_index=True)
        last = np.append(first[1:], 256) - 1
        inverse[0, :, channel] = np.rint(np.interp(levels, values, (first + last) / 2.0))
    return inverse


def median(
    pictures: list[ndarray], check: Callable[[], None] = lambda: None
) -> UInt8[ndarray, "h w *c"]:
    """Each value's median over pictures of one size; of an even number the upper one.

    Args:
        pictures: At least one.
        check: Called before every few rows: a median of large pictures takes its time.
    """
    result = np.empty_like(pictures[0])
    rows = max(1, MEDIAN_VALUES // pictures[0][0].size)
    for top in range(0, len(result), rows):
        check()
        stack = np.stack([picture[top : top + rows] for picture in pictures])
        medians: ndarray = upper_medians(stack.reshape(len(stack), -1))
        result[top : top + rows] = medians.reshape(stack.shape[1:])
    return result


def _largest(picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w"]:
    """The largest of each pixel's channels."""
    blue, green, red = cv2.split(picture)
    largest: ndarray = cv2.max(cv2.max(blue, green), red)
    return largest


class LearntForeground:
    """A :class:`BackgroundModel` that stays as it was learnt, and one threshold."""

    def __init__(self, background: BackgroundModel, parameters: ForegroundParams) -> None:
        """Take the background.

        Args:
            background: As learnt.
            parameters: As :meth:`BackgroundModel.foreground` takes them.
        """
        self._background = background
        self._parameters = parameters

    def start(self) -> None:
        """Nothing changes from picture to picture."""
        return None

    def step(self, state: None, picture: UInt8[ndarray, "h w 3"]) -> tuple[None, Segmentation]:
        """The foreground of a picture."""
        mask = self._background.foreground(picture, self._parameters)
        return None, Segmentation(mask, np.full(3, self._parameters.threshold))
