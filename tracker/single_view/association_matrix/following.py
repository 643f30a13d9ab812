"""Two who are one piece of foreground, followed apart by their colours.

[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Float, Int, UInt16
from numpy import ndarray

from tracker.kernels.compilation import pixel_kernel

ITERATIONS = 20
TOLERANCE = 0.1
"""Pixels: a shift shorter than this is the last one."""


def object_histograms(
    bins: UInt16[ndarray, "h w"], owners: Int[ndarray, "h w"], count: int, size: int
) -> Float[ndarray, "N bins"]:
    """The colours of the pixels of each object, each summing to 1.

    Args:
        bins: The histogram bin of each pixel.
        owners: The object that each pixel is of, -1 for none.
        count: Number of objects.
        size: Number of bins.
    """
    inside = owners >= 0
    pairs = owners[inside].astype(np.int64) * size + bins[inside]
    counted = np.bincount(pairs, minlength=count * size).reshape(count, size)
    totals = np.maximum(counted.sum(axis=1, keepdims=True), 1)
    return np.asarray(counted / totals)


def coefficients(
    first: Float[ndarray, "I bins"], second: Float[ndarray, "J bins"]
) -> Float[ndarray, "I J"]:
    """Bhattacharyya coefficients Σ_u sqrt(p(u) q(u)): 1 for equal, 0 for disjoint ones."""
    return np.asarray(np.sqrt(first) @ np.sqrt(second).T)


def follow(
    bins: UInt16[ndarray, "h w"],
    moving: Bool[ndarray, "h w"],
    box: Float[ndarray, " 4"],
    histogram: Float[ndarray, " bins"],
) -> Float[ndarray, " 2"]:
    """Where the colours went: mean shift over the moving pixels, [CRM03].

        y ← Σ_i w_i x_i / Σ_i w_i,  w_i = sqrt(q(u_i) / p_y(u_i))

    over the moving pixels x_i in the ellipse inscribed in the box at y, u_i being
    their bins; q is the target's histogram, p_y that of the moving pixels there
    under the Epanechnikov kernel.

    Args:
        bins: The histogram bin of each pixel.
        moving: The pixels that count.
        box: Where the target was, centre and half sizes, pixels.
        histogram: q, of the time when it was alone.

    Returns:
        The centre; where it was if there is nothing of it.
    """
    centre: ndarray = _follow(
        bins, moving, np.asarray(box, dtype=float), histogram, ITERATIONS, TOLERANCE
    )
    return centre


@pixel_kernel
def _follow(
    bins: ndarray,
    moving: ndarray,
    box: ndarray,
    histogram: ndarray,
    iterations: int,
    tolerance: float,
) -> ndarray:
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
