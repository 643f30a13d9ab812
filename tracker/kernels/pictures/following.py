"""Mean shift over moving pixels towards a target's colour histogram, compiled.

[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel


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

    The equation is in :func:`tracker.single_view.association_matrix.following.follow`.

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
