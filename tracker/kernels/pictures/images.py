"""Colour histograms, means and mean shift of boxes in an image, compiled.

Boxes are rows of ``centre_x, centre_y, half_width, half_height`` in pixels. Every
kernel must agree with a NumPy counterpart in the tests.

[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


class Modes(NamedTuple):
    """The ends of K climbs."""

    boxes: ndarray
    """(K, 4), the boxes."""
    densities: ndarray
    """(K,), density Σ_i w_i k_i at each end."""


class Filled(NamedTuple):
    """The contribution of one box's pixels to a histogram."""

    bins: int
    """Number of bins that are not empty."""
    weight: float
    """Weight of all pixels together."""


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
        bin_map: As the next two arguments, of :func:`box_histograms`.
        box: (4,), centre x, centre y, half width, half height, pixels.
        histogram: (bins,), zeros; receives the weights.
        touched: (bins,), receives the bins that are not empty.
    """
    height, width = bin_map.shape
    centre_x, centre_y = box[0], box[1]
    # at least half a pixel: the box always contains the pixel of its centre
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
    """Compute the colour histogram of every box, with sum 1, or 0 for a box without pixels.

    Args:
        bin_map: (h, w), the bin of each pixel.
        boxes: (N, 4), centre x, centre y, half width, half height, pixels.
        bins: The number of bins.
        epanechnikov: Whether pixels have the weight 1 - r² on the ellipse in the box, or all equal.
        longest_side: Side in pixels above which a box is sampled with a stride.

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
    """Compute the Bhattacharyya distance of every box to the nearest template of each group.

    The result equals :func:`box_histograms` and the distances to all rows, without
    storing the histograms: only the bins that a box touches are visited.

    Args:
        bin_map: (h, w), the bin of each pixel.
        boxes: (N, 4), centre x, centre y, half width, half height, pixels.
        template_roots: (n, bins), the square roots of the templates' histograms.
        groups: (n,) the group of each template, 0 … G - 1, each used.
        epanechnikov: An argument of :func:`box_histograms`.
        longest_side: An argument of :func:`box_histograms`.

    Returns:
        (N, G) distances, 1 for a box without pixels.
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
    """Compute the bin of each pixel: 16 hues × 16 saturations if coloured, else 16 values.

    Args:
        hsv: (h, w, 3) uint8, OpenCV's range (hue 0 … 179).
        least_saturation: Least saturation of a coloured pixel, 0 … 255.
        least_value: Least value of a coloured pixel, 0 … 255.

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
    """Compute the mean of an image over rectangles, from its integral image.

    Args:
        integral: (h + 1, w + 1), sums above and to the left.
        edges: (N, 4), left, top, right, bottom in pixels, not rounded.

    Returns:
        (N,) means over the pixels whose centres lie inside; 0 for no pixel.
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
def mean_shift(
    samples: ndarray,
    weights: ndarray,
    starts: ndarray,
    bandwidth: float,
    iterations: int,
    tolerance: float,
) -> Modes:
    """Climb from each start to a mode of a weighted sample of boxes.

        m ← Σ_i w_i k_i x_i / Σ_i w_i k_i,  k_i = exp(-½ |x_i - m|²)

    with distances in units of bandwidth × half size of m. Samples further away than √12 of them,
    with k_i below 0.0025, are left out.

    Args:
        samples: (S, 4), centre x, centre y, half width, half height.
        weights: (S,), weights of the samples.
        starts: (K, 4), boxes at which the climbs start.
        bandwidth: Bandwidth in half sizes, for the centre and for the sizes alike.
        iterations: Largest number of steps.
        tolerance: Length of a step, in half sizes, below which a climb stops.
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
def keep_apart(
    boxes: ndarray, densities: ndarray, order: ndarray, distance: float, most: int
) -> ndarray:
    """Select boxes in the given order, none with a centre near one that is selected already.

    Args:
        boxes: (N, 4), centre x, centre y, half width, half height, pixels.
        densities: (N,) densities; the first that is not positive ends the selection.
        order: (N,) indices.
        distance: Least distance, in half sizes of the box that is selected already.
        most: Largest number of boxes.

    Returns:
        Indices of the selected boxes.
    """
    kept = np.empty(len(order), dtype=np.int64)
    count = 0
    for i in order:
        if count == most or not densities[i] > 0.0:
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


@pixel_kernel
def follow_colours(
    bins: ndarray,
    moving: ndarray,
    box: ndarray,
    histogram: ndarray,
    iterations: int,
    tolerance: float,
) -> ndarray:
    """The centre at which the climb from a box ends ([CRM03]_), or that of the box.

    The equation is in :func:`tracker.single_view.association_matrix.track_transfer.follow`.

    Args:
        bins: (h, w), the histogram bin of each pixel.
        moving: (h, w), whether a pixel is in the foreground.
        box: (4,), box of the target before, centre and half sizes, pixels.
        histogram: (bins,), q, the target's histogram.
        iterations: Largest number of shifts.
        tolerance: Length of a shift below which the climb ends, pixels.

    Returns:
        (2,), x and y, pixels.
    """
    height, width = bins.shape
    x, y = box[0], box[1]
    half_x, half_y = max(box[2], 0.5), max(box[3], 0.5)
    here = np.zeros(len(histogram))
    for _ in range(iterations):
        first_x, last_x = max(math.ceil(x - half_x), 0), min(math.floor(x + half_x), width - 1)
        first_y, last_y = max(math.ceil(y - half_y), 0), min(math.floor(y + half_y), height - 1)
        here[:] = 0.0
        total = 0.0
        for row in range(first_y, last_y + 1):
            v = (row - y) / half_y
            for column in range(first_x, last_x + 1):
                u = (column - x) / half_x
                weight = 1.0 - u * u - v * v
                if moving[row, column] and weight > 0.0:
                    here[bins[row, column]] += weight
                    total += weight
        if total == 0.0:
            break
        sum_x, sum_y, mass = 0.0, 0.0, 0.0
        for row in range(first_y, last_y + 1):
            v = (row - y) / half_y
            for column in range(first_x, last_x + 1):
                u = (column - x) / half_x
                if moving[row, column] and u * u + v * v < 1.0:
                    b = bins[row, column]
                    weight = math.sqrt(histogram[b] * total / here[b])
                    sum_x += weight * column
                    sum_y += weight * row
                    mass += weight
        if mass == 0.0:
            break
        shift = math.hypot(sum_x / mass - x, sum_y / mass - y)
        x, y = sum_x / mass, sum_y / mass
        if shift < tolerance:
            break
    return np.array([x, y])


class FixedPoints(NamedTuple):
    """The ends of S climbs."""

    points: ndarray
    """(S, 4), centre x, centre y, half width, half height, pixels."""
    densities: ndarray
    """(S,), density at each end."""


class JoinedModes(NamedTuple):
    """M modes of S fixed points."""

    owners: ndarray
    """(S,), index of the mode of each point, -1 for none."""
    leaders: ndarray
    """(M,), index of the densest point of each mode."""


@pixel_kernel
def epanechnikov_climb(
    boxes: ndarray,
    counts: ndarray,
    groups: ndarray,
    bandwidth: float,
    iterations: int,
    tolerance: float,
) -> FixedPoints:
    """Climb from every box to a fixed point of the mean shift with the Epanechnikov kernel.

    The density is Σ_i c_i max(0, 1 - r_i²), r_i the distance between the centres in units of
    bandwidth × half size of the current box. Its gradient points to the mean of the boxes
    with r_i < 1, which is where each step goes.

    Args:
        boxes: (S, 4), centre x, centre y, half width, half height.
        counts: (S,), number of particles at each box; boxes of 0 are ignored.
        groups: (S,), group of each box; boxes of other groups are ignored.
        bandwidth: Bandwidth, in half sizes.
        iterations: Largest number of steps.
        tolerance: Length of a step, in half sizes, below which the climb stops.
    """
    size = len(boxes)
    points = boxes.copy()
    densities = np.zeros(size)
    shifted = np.empty(4)
    for k in range(size):
        if not counts[k] > 0.0:
            continue
        for _ in range(iterations):
            scale_x = 1.0 / (bandwidth * points[k, 2])
            scale_y = 1.0 / (bandwidth * points[k, 3])
            shifted[:] = 0.0
            total, density = 0.0, 0.0
            for i in range(size):
                if groups[i] != groups[k] or not counts[i] > 0.0:
                    continue
                u = (boxes[i, 0] - points[k, 0]) * scale_x
                v = (boxes[i, 1] - points[k, 1]) * scale_y
                distance = u * u + v * v
                if distance >= 1.0:
                    continue
                total += counts[i]
                density += counts[i] * (1.0 - distance)
                for a in range(4):
                    shifted[a] += counts[i] * boxes[i, a]
            densities[k] = density
            if not total > 0.0:
                break  # the kernel has shrunk and contains no box: this is no mode
            for a in range(4):
                shifted[a] /= total
            u = (shifted[0] - points[k, 0]) / points[k, 2]
            v = (shifted[1] - points[k, 1]) / points[k, 3]
            points[k] = shifted
            if u * u + v * v < tolerance * tolerance:
                break
    return FixedPoints(points, densities)


@pixel_kernel
def join_modes(points: ndarray, counts: ndarray, order: ndarray, distance: float) -> JoinedModes:
    """Assign fixed points that lie close to a denser one to its mode.

    Args:
        points: (S, 4), fixed points.
        counts: (S,), number of particles that climbed to each; points of 0 have no mode.
        order: (S,) indices, densest first.
        distance: Distance between the centres, in half sizes of the denser one.
    """
    size = len(points)
    owners = np.full(size, -1, dtype=np.int64)
    leaders = np.empty(size, dtype=np.int64)
    modes = 0
    for rank in range(size):
        i = order[rank]
        if not counts[i] > 0.0:
            continue
        for m in range(modes):
            leader = leaders[m]
            u = (points[i, 0] - points[leader, 0]) / points[leader, 2]
            v = (points[i, 1] - points[leader, 1]) / points[leader, 3]
            if u * u + v * v < distance * distance:
                owners[i] = m
                break
        if owners[i] < 0:
            owners[i] = modes
            leaders[modes] = i
            modes += 1
    return JoinedModes(owners, leaders[:modes].copy())
