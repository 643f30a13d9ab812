"""Foreground by thresholds from each image, with a background that adapts to the illumination.

[CMQ07] Chang, Ma, Qiao, "Human oriented multi-target tracking algorithm in video
sequence", Control and Decision 22(4), 2007.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8, UInt16
from numpy import ndarray

from tracker.kernels.pictures.foreground import above, clear_shadows, two_classes, update_background
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.single_view.pictures.background import (
    BackgroundModel,
    Segmentation,
    median,
    tone_curve,
)

ITERATIONS = 20
"""Largest number of iterations of the c-means; the thresholds usually converge well before."""

BACKGROUND_CENTRE, FOREGROUND_CENTRE = 5.0, 50.0
"""Initial m_b and m_f, grey levels. The iteration moves them to the means of the classes: from 0 to
50 and from 10 to 200, recall changes by less than 0.005, and false positives by one, in 90 steps of
room44-3p."""

UPDATE_LIMIT, UPDATE_FRAMES, UPDATE_RATE = 6, 10, 0.1
"""Th, grey levels: only pixels that differ by less change the background; w, for how many images a
pixel must have been background; α, the share of the way to each image. Over their whole
ranges, recall changes by less than 0.005, and false positives by one, in 90 steps of room44-3p."""

CLOSING = np.ones((3, 3), dtype=np.uint8)
"""Structuring element of the closing, as published."""

AROUND_FOREGROUND = np.ones((5, 5), dtype=np.uint8)
"""Neighbourhood of the foreground in which the background is not updated."""


@dataclass(frozen=True, slots=True, eq=False)
class AdaptiveState:
    """The background of one camera, and how long each pixel has shown it."""

    background: UInt16[ndarray, "h w 3"]
    """256 times the grey level, BGR: slow changes are below one level per image."""
    still: UInt8[ndarray, "h w"]
    """Number of images for which each pixel has been away from the foreground, 255 at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Iterations:
    """The iterations of the c-means, and the one that is chosen."""

    thresholds: Float[ndarray, "K 3"]
    """Thresholds of each iteration, grey levels in B, G, R."""
    counts: Int[ndarray, " K"]
    """n(k): number of foreground pixels of each iteration."""
    chosen: int
    """k*, the chosen iteration."""


def choose_iteration(counts: Int[ndarray, " K"]) -> int:
    """Choose k* = argmin (n(k) - n(k - 1)) over the k with n(k) > n(k - 1), [CMQ07].

    Where the foreground grows least it has reached its border: before, parts of people
    are missing, after, noise is included. Without any growth it is the last iteration.
    """
    growth = np.diff(counts)
    growing = np.flatnonzero(growth > 0)
    return int(growing[growth[growing].argmin()]) + 1 if len(growing) else len(counts) - 1


def cluster(difference: UInt8[ndarray, "h w 3"], parameters: ForegroundParams) -> Iterations:
    """Cluster the difference of an image and its background by the modified c-means of [CMQ07].

    The distances to the classes' centres m_b and m_f are in units of the classes'
    deviations, whose ratio r is given: |d - m_b| / r against |d - m_f|. Differences
    beyond the foreground's centre are foreground, and below the background's are background.

    Args:
        difference: |I - M|, grey levels.
        parameters: Ratio r, least threshold, least number of pixels.
    """
    found = two_classes(
        difference,
        BACKGROUND_CENTRE,
        FOREGROUND_CENTRE,
        parameters.deviation_ratio,
        parameters.least_threshold,
        parameters.minimum_area,
        ITERATIONS,
    )
    return Iterations(found.thresholds, found.counts, choose_iteration(found.counts))


def first_background(
    pictures: list[UInt8[ndarray, "h w 3"]],
    *,
    follow_exposure: bool,
    check: Callable[[], None] = lambda: None,
) -> UInt8[ndarray, "h w 3"] | None:
    """Compute the median of images spread over the clip; None without any.

    Args:
        pictures: Images, BGR, of one size.
        follow_exposure: Whether they are brought to one exposure first.
        check: A function that is called now and then; an exception of it ends the work.
    """
    if not follow_exposure:
        return median(pictures, check) if pictures else None
    learnt = BackgroundModel.learn(pictures, check)
    return None if learnt is None else learnt.picture


class AdaptiveForeground:
    """The segmentation of [CMQ07] in one camera.

    The difference D = |I - M| of each channel is divided into two classes by a c-means
    iteration (:func:`cluster`); a pixel is background only if all three channels
    are. Small components are dropped and gaps closed (3×3). The background is updated by
    M ← M + α (I - M), where a pixel is away from the foreground (5×5), differs by
    less than Th and has been background for w images.

    Beyond the paper, and switched off by the preset ``published``: the background is
    brought to each image's exposure first, and the difference of a shadow is ignored.
    """

    def __init__(self, first: UInt8[ndarray, "h w 3"], parameters: ForegroundParams) -> None:
        """Set the initial background.

        Args:
            first: Result of :func:`first_background`, or another image of the empty scene, BGR.
            parameters: The parameters of the segmentation.
        """
        self._first = first
        self._parameters = parameters

    def start(self) -> AdaptiveState:
        """The initial background, which counts as shown for long enough."""
        still = np.full(self._first.shape[:2], 255, dtype=np.uint8)
        return AdaptiveState(self._first.astype(np.uint16) * 256, still)

    def thresholds(self, difference: UInt8[ndarray, "h w 3"]) -> Float[ndarray, " 3"]:
        """The thresholds of each channel, grey levels: those of iteration k*."""
        found = cluster(difference, self._parameters)
        chosen: ndarray = found.thresholds[found.chosen]
        return chosen

    def step(
        self, state: AdaptiveState, picture: UInt8[ndarray, "h w 3"]
    ) -> tuple[AdaptiveState, Segmentation]:
        """Segment one image and update the background.

        A blank image has no foreground and does not change the background.

        Args:
            state: The state after the image before.
            picture: The image, BGR, of the background's size.
        """
        p = self._parameters
        shown = cv2.convertScaleAbs(state.background, alpha=1.0 / 256.0)
        if p.follow_exposure:
            shown = cv2.LUT(shown, tone_curve(shown, picture))
        difference = cv2.absdiff(picture, shown)
        if p.drop_shadows:
            clear_shadows(
                difference, picture, shown, p.darkest_shadow, p.shadow_tint, p.least_threshold
            )
        thresholds = self.thresholds(difference)
        different = above(difference, thresholds)
        if cv2.meanStdDev(picture)[1].max() < p.blank_deviation:
            return state, Segmentation(np.zeros_like(different), thresholds)
        mask = clean(different, p.minimum_area)
        after = update_background(
            state.background,
            state.still,
            picture,
            shown,
            cv2.dilate(mask, AROUND_FOREGROUND),
            UPDATE_LIMIT,
            UPDATE_FRAMES,
            UPDATE_RATE,
        )
        return AdaptiveState(after.levels, after.still), Segmentation(mask, thresholds)


def clean(mask: UInt8[ndarray, "h w"], minimum_area: int) -> UInt8[ndarray, "h w"]:
    """Drop connected components of fewer pixels, then close gaps (morphological closing, 3×3).

    Args:
        mask: The foreground mask, not 0 on the foreground.
        minimum_area: Number of pixels below which a component is dropped.

    Returns:
        A mask with 1 on the foreground, 0 elsewhere.
    """
    left, top, width, height = cv2.boundingRect(mask)
    cleaned = np.zeros_like(mask)
    if width == 0:
        return cleaned
    # most of an image is empty; the closing needs a pixel more on every side
    rows, columns = (
        slice(max(0, top - 1), top + height + 1),
        slice(max(0, left - 1), left + width + 1),
    )
    part = mask[rows, columns]
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(part, connectivity=8)
    kept = (statistics[:, cv2.CC_STAT_AREA] >= minimum_area).astype(np.uint8)
    kept[0] = 0
    cleaned[rows, columns] = cv2.morphologyEx(kept[labels], cv2.MORPH_CLOSE, CLOSING)
    return cleaned
