"""The hot loops over pixels and boxes, compiled by numba: plain functions of arrays.

Boxes are rows of ``centre_x, centre_y, half_width, half_height`` in pixels. Every
kernel has a NumPy counterpart in the tests that it must agree with.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


class Modes(NamedTuple):
    """Where K climbs ended."""

    boxes: ndarray
    """(K, 4)."""
    densities: ndarray
    """(K,), Σ_i w_i k_i there."""


class Filled(NamedTuple):
    """What the pixels of one box made of a histogram."""

    bins: int
    """How many bins hold something."""
    weight: float
    """Of all pixels together."""


@pixel_kernel
def _fill(
    bin_map: ndarray,
    box: ndarray,
    epanechnikov: bool,
    longest_side: int,
    histogram: ndarray,
    touched: ndarray,
) -> Filled:
    """Add the weights of a box's pixels to a histogram of zeros.

    Args:
        bin_map: As the next two, of :func:`box_histograms`.
        box: (4,), centre x, centre y, half width, half height, pixels.
        histogram: (bins,), zeros; the weights are put in.
        touched: (bins,), to be filled with the bins that hold something.
    """
    height, width = bin_map.shape
    centre_x, centre_y = box[0], box[1]
    # half a pixel at least: the box always holds the pixel that its centre is in
    half_x, half_y = max(box[2], 0.5), max(box[3], 0.5)
    stride_x = math.ceil(2.0 * half_x / longest_side)
    stride_y = math.ceil(2.0 * half_y / longest_side)
    first_x = max(math.ceil(centre_x - half_x), 0)
    first_y = max(math.ceil(centre_y - half_y), 0)
    last_x = min(math.floor(centre_x + half_x), width - 1)
    last_y = min(math.floor(centre_y + half_y), height - 1)
    used = 0
    total = 0.0
    for y in range(first_y, last_y + 1, stride_y):
        v = (y - centre_y) / half_y
        for x in range(first_x, last_x + 1, stride_x):
            weight = 1.0
            if epanechnikov:
                u = (x - centre_x) / half_x
                weight = 1.0 - u * u - v * v
                if weight <= 0.0:
                    continue
            b = bin_map[y, x]
            if histogram[b] == 0.0:
                touched[used] = b
                used += 1
            histogram[b] += weight
            total += weight
    return Filled(used, total)


@pixel_kernel
def box_histograms(
    bin_map: ndarray, boxes: ndarray, bins: int, epanechnikov: bool, longest_side: int
) -> ndarray:
    """The colour histogram of every box, each summing to 1, or all 0 where no pixel lies in it.

    Args:
        bin_map: (h, w), the bin of each pixel.
        boxes: (N, 4), centre x, centre y, half width, half height, pixels.
        bins: The number of bins.
        epanechnikov: Whether pixels weigh 1 - r² on the ellipse in the box, or all the same.
        longest_side: Boxes wider or taller than this many pixels are read with a stride.

    Returns:
        (N, bins).
    """
    count = boxes.shape[0]
    histograms = np.zeros((count, bins))
    touched = np.empty(bins, dtype=np.int64)
    for n in range(count):
        filled = _fill(bin_map, boxes[n], epanechnikov, longest_side, histograms[n], touched)
        for k in range(filled.bins):
            histograms[n, touched[k]] /= filled.weight
    return histograms


@pixel_kernel
def template_distances(
    bin_map: ndarray,
    boxes: ndarray,
    template_roots: ndarray,
    groups: ndarray,
    epanechnikov: bool,
    longest_side: int,
) -> ndarray:
    """Bhattacharyya distance of every box to the nearest template of each group.

    The same as :func:`box_histograms` and the distances to all rows, without the
    histograms being stored: only the bins that a box touches are visited.

    Args:
        bin_map: (h, w), the bin of each pixel.
        boxes: (N, 4), centre x, centre y, half width, half height, pixels.
        template_roots: (n, bins), the square roots of the templates' histograms.
        groups: (n,) the group of each template, 0 … G - 1, each used.
        epanechnikov: As in :func:`box_histograms`.
        longest_side: As in :func:`box_histograms`.

    Returns:
        (N, G) distances, 1 where a box holds no pixel.
    """
    count = boxes.shape[0]
    templates, bins = template_roots.shape
    largest = np.zeros((count, groups.max() + 1))
    histogram = np.zeros(bins)
    touched = np.empty(bins, dtype=np.int64)
    for n in range(count):
        filled = _fill(bin_map, boxes[n], epanechnikov, longest_side, histogram, touched)
        used, total = filled.bins, filled.weight
        if used == 0:
            continue
        for k in range(used):
            histogram[touched[k]] = math.sqrt(histogram[touched[k]] / total)
        for t in range(templates):
            coefficient = 0.0
            for k in range(used):
                coefficient += histogram[touched[k]] * template_roots[t, touched[k]]
            largest[n, groups[t]] = max(largest[n, groups[t]], coefficient)
        for k in range(used):
            histogram[touched[k]] = 0.0
    return np.sqrt(np.maximum(1.0 - largest, 0.0))


@pixel_kernel
def hue_saturation_bins(hsv: ndarray, least_saturation: int, least_value: int) -> ndarray:
    """The bin of each pixel: 16 hues × 16 saturations where it is coloured, else 16 values.

    Args:
        hsv: (h, w, 3) uint8, OpenCV's range (hue 0 … 179).
        least_saturation: A coloured pixel has at least this, 0 … 255 …
        least_value: … and at least this value.

    Returns:
        (h, w) uint16, 0 … 271.
    """
    height, width, _ = hsv.shape
    bins = np.empty((height, width), dtype=np.uint16)
    for y in range(height):
        for x in range(width):
            hue, saturation, value = hsv[y, x, 0], hsv[y, x, 1], hsv[y, x, 2]
            if saturation >= least_saturation and value >= least_value:
                bins[y, x] = (int(hue) * 16) // 180 * 16 + (int(saturation) >> 4)
            else:
                bins[y, x] = 256 + (int(value) >> 4)
    return bins


@pixel_kernel
def box_means(integral: ndarray, edges: ndarray) -> ndarray:
    """The mean of a picture over rectangles, from its integral image.

    Args:
        integral: (h + 1, w + 1), sums above and to the left.
        edges: (N, 4), left, top, right, bottom in pixels, not rounded.

    Returns:
        (N,) means over the pixels whose centres lie inside; 0 where there are none.
    """
    height, width = integral.shape[0] - 1, integral.shape[1] - 1
    count = edges.shape[0]
    means = np.zeros(count)
    for n in range(count):
        left = min(max(math.ceil(edges[n, 0]), 0), width)
        top = min(max(math.ceil(edges[n, 1]), 0), height)
        right = min(max(math.floor(edges[n, 2]) + 1, 0), width)
        bottom = min(max(math.floor(edges[n, 3]) + 1, 0), height)
        if right > left and bottom > top:
            total = (
                integral[bottom, right]
                - integral[top, right]
                - integral[bottom, left]
                + integral[top, left]
            )
            means[n] = total / ((right - left) * (bottom - top))
    return means


@pixel_kernel
def spread_starts(samples: ndarray, weights: ndarray, order: ndarray, most: int) -> ndarray:
    """Heaviest samples that keep a box's distance from each other.

    Args:
        samples: (S, 4), centre x, centre y, half width, half height.
        weights: (S,); samples of weight 0 are never taken.
        order: (S,) indices, heaviest first.
        most: At most so many.

    Returns:
        Indices of the samples taken.
    """
    taken = np.empty(most, dtype=np.int64)
    count = 0
    for rank in range(len(order)):
        if count == most:
            break
        i = order[rank]
        if not weights[i] > 0.0:
            break
        apart = True
        for k in range(count):
            j = taken[k]
            u = (samples[i, 0] - samples[j, 0]) / samples[j, 2]
            v = (samples[i, 1] - samples[j, 1]) / samples[j, 3]
            if u * u + v * v < 1.0:
                apart = False
                break
        if apart:
            taken[count] = i
            count += 1
    return taken[:count].copy()


@pixel_kernel
def mean_shift(
    samples: ndarray,
    weights: ndarray,
    starts: ndarray,
    bandwidth: float,
    iterations: int,
    tolerance: float,
) -> Modes:
    """Climb from each start to a mode of a weighted sample of boxes.

    m ← Σ_i w_i k_i x_i / Σ_i w_i k_i with the Gaussian kernel
    k_i = exp(-½ |x_i - m|²), distances in units of bandwidth × half size of m.

    Args:
        samples: (S, 4), centre x, centre y, half width, half height.
        weights: (S,).
        starts: (K, 4).
        bandwidth: In half sizes, for the centre and for the sizes alike.
        iterations: At most so many.
        tolerance: Stop when a step is shorter than this many half sizes.
    """
    count = len(starts)
    modes = starts.copy()
    densities = np.zeros(count)
    shifted = np.empty(4)
    for k in range(count):
        for _ in range(iterations):
            scale_x = 1.0 / (bandwidth * modes[k, 2])
            scale_y = 1.0 / (bandwidth * modes[k, 3])
            shifted[:] = 0.0
            total = 0.0
            for i in range(len(samples)):
                u = (samples[i, 0] - modes[k, 0]) * scale_x
                v = (samples[i, 1] - modes[k, 1]) * scale_y
                distance = u * u + v * v
                if distance > 12.0:
                    continue
                s = (samples[i, 2] - modes[k, 2]) * scale_x
                t = (samples[i, 3] - modes[k, 3]) * scale_y
                distance += s * s + t * t
                if distance > 12.0:
                    continue
                weight = weights[i] * math.exp(-0.5 * distance)
                total += weight
                for a in range(4):
                    shifted[a] += weight * samples[i, a]
            densities[k] = total
            if not total > 0.0:
                break
            for a in range(4):
                shifted[a] /= total
            u = (shifted[0] - modes[k, 0]) / modes[k, 2]
            v = (shifted[1] - modes[k, 1]) / modes[k, 3]
            s = (shifted[2] - modes[k, 2]) / modes[k, 2]
            t = (shifted[3] - modes[k, 3]) / modes[k, 3]
            modes[k] = shifted
            if u * u + v * v + s * s + t * t < tolerance * tolerance:
                break
    return Modes(modes, densities)


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
    """1 where a pixel is neither the background nor a shadow on it.

    A pixel differs where its square-rooted grey levels (whose noise is the same in
    dark and light) are further apart than threshold + spread. It is a shadow where
    all channels fell by nearly the same share.

    Args:
        picture: (h, w, 3) uint8.
        background: (h, w, 3) uint8.
        curve: (1, 256, 3) uint8, each of its levels at the picture's exposure.
        spread: (h, w), what a pixel varies by itself, in the same units as the threshold.
        threshold: On the scale 16 √level, which runs from 0 to 255.
        darkest_shadow: A shadow leaves at least this share of the light; 1 knows no shadow.
        shadow_tint: The channels' shares differ by at most this in a shadow.

    Returns:
        (h, w) uint8.
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
def keep_apart(boxes: ndarray, densities: ndarray, order: ndarray, distance: float) -> ndarray:
    """Which boxes stay, in the given order: none whose centre is near one that stays already.

    Args:
        boxes: (N, 4).
        densities: (N,); from the first that is not positive on, none stays.
        order: (N,) indices.
        distance: In half sizes of the box that stays.

    Returns:
        Indices of those that stay.
    """
    kept = np.empty(len(order), dtype=np.int64)
    count = 0
    for i in order:
        if not densities[i] > 0.0:
            break
        apart = True
        for k in range(count):
            j = kept[k]
            u = (boxes[j, 0] - boxes[i, 0]) / boxes[j, 2]
            v = (boxes[j, 1] - boxes[i, 1]) / boxes[j, 3]
            if not u * u + v * v >= distance * distance:
                apart = False
                break
        if apart:
            kept[count] = i
            count += 1
    return kept[:count].copy()
