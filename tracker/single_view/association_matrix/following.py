"""Tracking of two people in one foreground component separately by their colours.

[CRM03] Comaniciu, Ramesh, Meer, "Kernel-based object tracking", IEEE TPAMI 25(5), 2003.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int, UInt16
from numpy import ndarray

from tracker.kernels.pictures.following import follow_colours

ITERATIONS = 20
"""Largest number of mean-shift iterations."""

TOLERANCE = 0.1
"""Length of a shift below which the mean shift ends, pixels."""


def object_histograms(
    bins: UInt16[ndarray, "h w"], owners: Int[ndarray, "h w"], count: int, size: int
) -> Float[ndarray, "N bins"]:
    """Compute the colour histogram of each object, with sum 1.

    Args:
        bins: The histogram bin of each pixel.
        owners: Object of each pixel, -1 for none.
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
    """Compute Bhattacharyya coefficients Σ_u sqrt(p(u) q(u)) of all pairs of histograms ([CRM03]).

    They are 1 for equal, 0 for disjoint histograms, each of which has the sum 1.
    """
    return np.asarray(np.sqrt(first) @ np.sqrt(second).T)


def follow(
    bins: UInt16[ndarray, "h w"],
    moving: Bool[ndarray, "h w"],
    box: Float[ndarray, " 4"],
    histogram: Float[ndarray, " bins"],
) -> Float[ndarray, " 2"]:
    """Track a colour histogram by mean shift over the moving pixels, [CRM03].

        y ← Σ_i w_i x_i / Σ_i w_i,  w_i = sqrt(q(u_i) / p_y(u_i))

    over the moving pixels x_i in the ellipse inscribed in the box at y, u_i being
    their bins; q is the target's histogram, p_y that of the moving pixels there
    under the Epanechnikov kernel.

    Args:
        bins: The histogram bin of each pixel.
        moving: Whether each pixel is in the foreground.
        box: Box of the target before, centre and half sizes, pixels.
        histogram: q, of the last step at which the target was alone.

    Returns:
        The centre, pixels; that of the box if no pixel has the target's colours.
    """
    centre: ndarray = follow_colours(
        bins, moving, np.asarray(box, dtype=float), histogram, ITERATIONS, TOLERANCE
    )
    return centre
