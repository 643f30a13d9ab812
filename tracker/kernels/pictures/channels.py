"""Sums over rectangles of an image's channels, and boosted trees over them, compiled.

[DTPB09] Dollár, Tu, Perona, Belongie, "Integral channel features", BMVC 2009.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel

ORIENTATIONS = 6
"""Number of bins for the direction of edges, over half a turn."""

COLUMNS, ROWS = 8, 10
"""Number of cells of a window across and down."""


class Gradients(NamedTuple):
    """The gradients of an image."""

    bins: ndarray
    """(h, w) uint8, bin of each pixel's direction, 0 … ORIENTATIONS - 1."""
    magnitudes: ndarray
    """(h, w) float32, levels per pixel, of the channel with the largest gradient."""


@pixel_kernel
def gradients(picture: ndarray) -> Gradients:
    """Compute central differences of the channel with the largest gradient, as size and direction.

    Args:
        picture: (h, w, 3) uint8.
    """
    height, width, _ = picture.shape
    bins = np.zeros((height, width), dtype=np.uint8)
    magnitudes = np.zeros((height, width), dtype=np.float32)
    for y in range(1, height - 1):
        for x in range(1, width - 1):
            best, across, down = -1, 0, 0
            for c in range(3):
                # bytes are subtracted as signed integers
                right = int(np.int64(picture[y, x + 1, c]) - np.int64(picture[y, x - 1, c]))
                below = int(np.int64(picture[y + 1, x, c]) - np.int64(picture[y - 1, x, c]))
                size = right * right + below * below
                if size > best:
                    best, across, down = size, right, below
            magnitudes[y, x] = 0.5 * math.sqrt(best)
            if best > 0:
                turn = math.atan2(down, across) / math.pi  # edges have no sign: half a turn
                bins[y, x] = int((turn + 1.0) * ORIENTATIONS + 0.5) % ORIENTATIONS
    return Gradients(bins, magnitudes)


@pixel_kernel
def channel_sums(bins: ndarray, magnitudes: ndarray, planes: ndarray) -> ndarray:
    """Compute the integral image of all channels: sums above and to the left of each pixel corner.

    The first channels are the magnitudes by direction, the next one that of all directions, and
    the last ones the planes.

    Args:
        bins: (h, w) uint8, as in :class:`Gradients`.
        magnitudes: (h, w) uint8.
        planes: (h, w, P) uint8.

    Returns:
        (h + 1, w + 1, ORIENTATIONS + 1 + P) int32.
    """
    height, width, others = planes.shape
    first = ORIENTATIONS + 1
    sums = np.zeros((height + 1, width + 1, first + others), dtype=np.int32)
    row = np.zeros(first + others, dtype=np.int32)
    for y in range(height):
        row[:] = 0
        for x in range(width):
            size = magnitudes[y, x]
            row[bins[y, x]] += size
            row[ORIENTATIONS] += size
            for p in range(others):
                row[first + p] += planes[y, x, p]
            for c in range(first + others):
                sums[y + 1, x + 1, c] = sums[y, x + 1, c] + row[c]
    return sums


@pixel_kernel
def _edges(low: float, high: float, limit: int, edges: ndarray) -> None:
    """Divide a range into equal cells, with borders at whole pixels inside an image."""
    cells = len(edges) - 1
    for k in range(cells + 1):
        place = low + (high - low) * k / cells
        edges[k] = min(max(math.floor(place + 1.0), 0), limit)


@pixel_kernel
def _mean(sums: ndarray, xs: ndarray, ys: ndarray, feature: int) -> int:
    """The mean of one channel over one cell, rounded; 0 for a cell without pixels."""
    channels = sums.shape[2]
    cell, channel = feature // channels, feature % channels
    row, column = cell // COLUMNS, cell % COLUMNS
    left, right, top, bottom = xs[column], xs[column + 1], ys[row], ys[row + 1]
    area = (right - left) * (bottom - top)
    if area <= 0:
        return 0
    total = (
        sums[bottom, right, channel]
        - sums[top, right, channel]
        - sums[bottom, left, channel]
        + sums[top, left, channel]
    )
    return int((total + area // 2) // area)


@pixel_kernel
def cell_means(sums: ndarray, windows: ndarray) -> ndarray:
    """Compute the mean of every channel over every cell of windows.

    Args:
        sums: Integral image of :func:`channel_sums`.
        windows: (N, 4), left, top, right and bottom edge, pixels.

    Returns:
        (N, ROWS * COLUMNS * channels) uint8, the channels of a cell next to each other.
    """
    height, width, channels = sums.shape
    count = ROWS * COLUMNS * channels
    means = np.empty((len(windows), count), dtype=np.uint8)
    xs, ys = np.empty(COLUMNS + 1, dtype=np.int64), np.empty(ROWS + 1, dtype=np.int64)
    for n in range(len(windows)):
        _edges(windows[n, 0], windows[n, 2], width - 1, xs)
        _edges(windows[n, 1], windows[n, 3], height - 1, ys)
        for feature in range(count):
            means[n, feature] = _mean(sums, xs, ys, feature)
    return means


@pixel_kernel
def tree_scores(
    sums: ndarray,
    windows: ndarray,
    features: ndarray,
    thresholds: ndarray,
    leaves: ndarray,
    least: ndarray,
) -> ndarray:
    """Sum boosted trees of depth 3 over windows; a window is rejected where the sum is too low.

    Args:
        sums: Integral image of :func:`channel_sums`.
        windows: (N, 4), left, top, right and bottom edge, pixels.
        features: (T, 7), feature of :func:`cell_means` of each node, breadth first.
        thresholds: (T, 7); features up to the threshold go left.
        leaves: (T, 8), the score that each tree adds.
        least: (T,), score after each tree below which a window is rejected.

    Returns:
        (N,) float32 scores, minus infinity where a window was rejected.
    """
    height, width, channels = sums.shape
    scores = np.full(len(windows), -np.inf, dtype=np.float32)
    xs, ys = np.empty(COLUMNS + 1, dtype=np.int64), np.empty(ROWS + 1, dtype=np.int64)
    # divisions are the slowest operation of a node, so none is left in the loop over windows
    rows, columns = np.empty(features.shape, np.int64), np.empty(features.shape, np.int64)
    planes = np.empty(features.shape, np.int64)
    for t in range(len(features)):
        for k in range(7):
            cell = features[t, k] // channels
            planes[t, k] = features[t, k] - cell * channels
            rows[t, k] = cell // COLUMNS
            columns[t, k] = cell - rows[t, k] * COLUMNS
    for n in range(len(windows)):
        _edges(windows[n, 0], windows[n, 2], width - 1, xs)
        _edges(windows[n, 1], windows[n, 3], height - 1, ys)
        total = 0.0
        lost = False
        for t in range(len(features)):
            node = 0
            for _ in range(3):
                row, column, channel = rows[t, node], columns[t, node], planes[t, node]
                left, right = xs[column], xs[column + 1]
                top, bottom = ys[row], ys[row + 1]
                area = (right - left) * (bottom - top)
                limit = np.int64(thresholds[t, node])
                low = limit >= 0
                if area > 0:
                    inside = (
                        sums[bottom, right, channel]
                        - sums[top, right, channel]
                        - sums[bottom, left, channel]
                        + sums[top, left, channel]
                    )
                    # whether the rounded mean of `_mean` is at most the threshold
                    low = inside + (area >> 1) < (limit + 1) * area
                node = 2 * node + (1 if low else 2)
            total += leaves[t, node - 7]
            if total < least[t]:
                lost = True
                break
        if not lost:
            scores[n] = total
    return scores
