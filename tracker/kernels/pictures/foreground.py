"""Segmentation of foreground, and medians of levels, compiled.

Every kernel must agree with a NumPy counterpart in the tests.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


class ClassThresholds(NamedTuple):
    """The K iterations of a c-means on differences."""

    thresholds: ndarray
    """(K, 3), one for each channel, grey levels."""
    counts: ndarray
    """(K,) numbers of foreground pixels n(k)."""


class Background(NamedTuple):
    """A background that adapts to the illumination."""

    levels: ndarray
    """(h, w, 3) uint16, 256 times the level."""
    still: ndarray
    """(h, w) uint8, number of images for which each pixel has been away from the foreground."""


class LevelMedians(NamedTuple):
    """Medians of a target image at groups of a source's levels: (3, groups) each, by channel."""

    totals: ndarray
    """Number of pixels of the group."""
    sums: ndarray
    """Sum of their levels in the source."""
    medians: ndarray
    """Lower median of their levels in the target, 0 for an empty group."""


@pixel_kernel
def two_classes(
    difference: ndarray,
    background_centre: float,
    foreground_centre: float,
    ratio: float,
    least: float,
    enough: int,
    iterations: int,
) -> ClassThresholds:
    """Split differences into background and foreground by the modified c-means.

    Each class has one centre for each channel. A difference d belongs to the background
    where (d - m_b) / r <= m_f - d, that is up to the threshold

        t = (m_b + r m_f) / (1 + r)

    and a pixel where all its channels do. The means of both classes are the next
    centres; a class too small for a mean retains its centres.

    Args:
        difference: (h, w, 3) uint8.
        background_centre: Initial m_b of every channel, grey levels.
        foreground_centre: Initial m_f of every channel, grey levels.
        ratio: r, the background's deviation over the foreground's.
        least: Lower bound of the thresholds, grey levels.
        enough: Number of pixels of a class below which it retains its centres.
        iterations: Largest number of iterations; fewer where the thresholds converge.
    """
    height, width, _ = difference.shape
    total = np.zeros(3)
    for y in range(height):
        row = np.zeros(3, dtype=np.int64)
        for x in range(width):
            for c in range(3):
                row[c] += difference[y, x, c]
        for c in range(3):
            total[c] += row[c]
    thresholds = np.empty((iterations, 3))
    counts = np.empty(iterations, dtype=np.int64)
    m_b = np.full(3, background_centre)
    m_f = np.full(3, foreground_centre)
    before = np.full(3, -1)
    for k in range(iterations):
        for c in range(3):
            thresholds[k, c] = max((m_b[c] + ratio * m_f[c]) / (1.0 + ratio), least)
        # differences are integers: above t is above its floor
        t0, t1, t2 = int(thresholds[k, 0]), int(thresholds[k, 1]), int(thresholds[k, 2])
        count, s0, s1, s2 = 0, np.int64(0), np.int64(0), np.int64(0)
        for y in range(height):
            for x in range(width):
                # bytes are summed with more bits
                d0 = np.int64(difference[y, x, 0])
                d1 = np.int64(difference[y, x, 1])
                d2 = np.int64(difference[y, x, 2])
                if d0 > t0 or d1 > t1 or d2 > t2:
                    count += 1
                    s0 += d0
                    s1 += d1
                    s2 += d2
        counts[k] = count
        if before[0] == t0 and before[1] == t1 and before[2] == t2:
            return ClassThresholds(thresholds[: k + 1].copy(), counts[: k + 1].copy())
        before[0], before[1], before[2] = t0, t1, t2
        rest = height * width - count
        sums = (s0, s1, s2)
        for c in range(3):
            if count >= enough:
                m_f[c] = sums[c] / count
            if rest >= enough:
                m_b[c] = (total[c] - sums[c]) / rest
    return ClassThresholds(thresholds, counts)


@pixel_kernel
def above(difference: ndarray, thresholds: ndarray) -> ndarray:
    """Mark the pixels where any channel differs by more than its threshold.

    Args:
        difference: (h, w, 3) uint8.
        thresholds: (3,), grey levels.

    Returns:
        (h, w) uint8, 1 where a pixel is marked.
    """
    height, width, _ = difference.shape
    mask = np.empty((height, width), dtype=np.uint8)
    t0, t1, t2 = int(thresholds[0]), int(thresholds[1]), int(thresholds[2])
    for y in range(height):
        for x in range(width):
            mask[y, x] = (
                difference[y, x, 0] > t0 or difference[y, x, 1] > t1 or difference[y, x, 2] > t2
            )
    return mask


@pixel_kernel
def clear_shadows(
    difference: ndarray,
    picture: ndarray,
    background: ndarray,
    darkest: float,
    tint: float,
    least: float,
) -> None:
    """Set the difference to 0 where all channels decreased by nearly the same share.

    Args:
        difference: (h, w, 3) uint8; changed in place.
        picture: (h, w, 3) uint8.
        background: (h, w, 3) uint8, at the image's exposure.
        darkest: Least share of the light that a shadow leaves, 0 … 1.
        tint: Largest difference of the channels' shares in a shadow.
        least: Differences up to this are left unchanged, grey levels.
    """
    height, width, _ = difference.shape
    for y in range(height):
        for x in range(width):
            if max(difference[y, x, 0], difference[y, x, 1], difference[y, x, 2]) <= least:
                continue
            low, high = 1e9, 0.0
            for c in range(3):
                share = (picture[y, x, c] + 4.0) / (background[y, x, c] + 4.0)
                low, high = min(low, share), max(high, share)
            if low >= darkest and high <= 1.0 and high - low <= tint:
                for c in range(3):
                    difference[y, x, c] = 0


@pixel_kernel
def update_background(
    background: ndarray,
    still: ndarray,
    picture: ndarray,
    shown: ndarray,
    near: ndarray,
    limit: int,
    frames: int,
    rate: float,
) -> Background:
    """Adapt the background where a pixel has been background for long enough.

        M ← M + α (I - M)

    where a pixel has not been near the foreground for ``frames`` images, and no
    channel differs by ``limit`` or more.

    Args:
        background: (h, w, 3) uint16, 256 times the level.
        still: (h, w) uint8, number of images for which each pixel has been
            away from the foreground, 255 at most.
        picture: (h, w, 3) uint8, I.
        shown: (h, w, 3) uint8, the background as it was compared with the image.
        near: (h, w) uint8, 1 on and near the foreground.
        limit: Largest difference, grey levels.
        frames: Number of images.
        rate: α, 0 … 1.

    Returns:
        The background and the counts after this image.
    """
    height, width, _ = background.shape
    after = background.copy()
    counts = np.empty_like(still)
    steps = np.empty((2 * limit + 1), dtype=np.int64)
    for i in range(2 * limit + 1):
        steps[i] = round(rate * 256.0 * (i - limit))
    for y in range(height):
        for x in range(width):
            counts[y, x] = 0
            if near[y, x]:
                continue
            d0 = np.int64(picture[y, x, 0]) - np.int64(shown[y, x, 0])
            d1 = np.int64(picture[y, x, 1]) - np.int64(shown[y, x, 1])
            d2 = np.int64(picture[y, x, 2]) - np.int64(shown[y, x, 2])
            counts[y, x] = min(np.int64(still[y, x]) + 1, 255)
            if counts[y, x] < frames or max(abs(d0), abs(d1), abs(d2)) >= limit:
                continue
            after[y, x, 0] = min(max(np.int64(after[y, x, 0]) + steps[d0 + limit], 0), 65280)
            after[y, x, 1] = min(max(np.int64(after[y, x, 1]) + steps[d1 + limit], 0), 65280)
            after[y, x, 2] = min(max(np.int64(after[y, x, 2]) + steps[d2 + limit], 0), 65280)
    return Background(after, counts)


@pixel_kernel
def foreground_mask(
    picture: ndarray,
    background: ndarray,
    curve: ndarray,
    spread: ndarray,
    threshold: float,
    darkest_shadow: float,
    shadow_tint: float,
) -> ndarray:
    """Mark the pixels that are neither the background nor a shadow on it.

    A pixel differs where its square-rooted grey levels (whose noise is the same in
    dark and light) are further apart than threshold + spread. It is a shadow where
    all channels decreased by nearly the same share.

    Args:
        picture: (h, w, 3) uint8.
        background: (h, w, 3) uint8.
        curve: (1, 256, 3) uint8, each level of the background at the image's exposure.
        spread: (h, w), variation of each pixel, in the units of the threshold.
        threshold: Threshold on the scale 16 √level, which runs from 0 to 255.
        darkest_shadow: Least share of the light that a shadow leaves; 1 for no shadows.
        shadow_tint: Largest difference of the channels' shares in a shadow.

    Returns:
        (h, w) uint8, 1 where a pixel is foreground.
    """
    height, width, _ = picture.shape
    roots = np.empty(256)
    for level in range(256):
        roots[level] = 16.0 * math.sqrt(level)
    expected = np.empty((256, 3))
    for level in range(256):
        for c in range(3):
            expected[level, c] = roots[curve[0, level, c]]
    mask = np.zeros((height, width), dtype=np.uint8)
    for y in range(height):
        for x in range(width):
            largest = 0.0
            for c in range(3):
                difference = abs(roots[picture[y, x, c]] - expected[background[y, x, c], c])
                largest = max(largest, difference)
            if largest <= threshold + spread[y, x]:
                continue
            low, high = 1e9, 0.0
            for c in range(3):
                share = (picture[y, x, c] + 4.0) / (curve[0, background[y, x, c], c] + 4.0)
                low, high = min(low, share), max(high, share)
            if low < darkest_shadow or high > 1.0 or high - low > shadow_tint:
                mask[y, x] = 1
    return mask


@pixel_kernel
def level_medians(source: ndarray, target: ndarray, groups: int) -> LevelMedians:
    """Compute the medians of a target image at groups of a source's levels, channel by channel.

    Args:
        source: (N, 3) uint8, pixels of the source.
        target: (N, 3) uint8, the same pixels of the target.
        groups: Number of groups that the source's 256 levels are divided into.
    """
    totals = np.zeros((3, groups), dtype=np.int64)
    sums = np.zeros((3, groups))
    medians = np.zeros((3, groups))
    for c in range(3):
        joint = np.zeros((groups, 256), dtype=np.int64)
        for i in range(len(source)):
            level = int(source[i, c])
            group = level * groups // 256
            joint[group, target[i, c]] += 1
            totals[c, group] += 1
            sums[c, group] += level
        for group in range(groups):
            if totals[c, group] == 0:
                continue
            below = 0
            for level in range(256):
                below += joint[group, level]
                if below >= 0.5 * totals[c, group]:
                    medians[c, group] = level
                    break
    return LevelMedians(totals, sums, medians)


@pixel_kernel
def upper_medians(values: ndarray) -> ndarray:
    """Compute the median of each column of (N, P) uint8, the upper one for an even number.

    It is found by two counts over four bits each: of the upper half of a value, and then, among
    those with the same upper half, of the lower half.
    """
    count, size = values.shape
    rank = count // 2
    medians = np.empty(size, dtype=np.uint8)
    tile = 1024
    upper = np.empty((tile, 16), dtype=np.int64)
    lower = np.empty((tile, 16), dtype=np.int64)
    chosen = np.empty(tile, dtype=np.int64)
    left = np.empty(tile, dtype=np.int64)
    for begin in range(0, size, tile):
        width = min(tile, size - begin)
        upper[:] = 0
        lower[:] = 0
        for n in range(count):
            for k in range(width):
                upper[k, values[n, begin + k] >> 4] += 1
        for k in range(width):
            left[k] = rank
            half = 0
            while left[k] >= upper[k, half]:
                left[k] -= upper[k, half]
                half += 1
            chosen[k] = half
        for n in range(count):
            for k in range(width):
                value = values[n, begin + k]
                if value >> 4 == chosen[k]:
                    lower[k, value & 15] += 1
        for k in range(width):
            half = 0
            while left[k] >= lower[k, half]:
                left[k] -= lower[k, half]
                half += 1
            medians[begin + k] = chosen[k] * 16 + half
    return medians
