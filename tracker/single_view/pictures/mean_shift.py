"""Modes of a weighted sample of boxes, by mean shift.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels; distances are
measured in half sizes of the box one stands at, so that nothing depends on scale.

[CM02] Comaniciu, Meer, "Mean shift: a robust approach toward feature space analysis",
IEEE TPAMI 24(5), 2002.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.kernels.pictures import images

ITERATIONS = 30
"""Steps after which a climb ends; most converge well before."""

TOLERANCE = 0.01
"""A climb ends when a step is shorter than this many half sizes: far below any peak's deviation."""


def starts(
    boxes: Float[ndarray, "S 4"], weights: Float[ndarray, " S"], most: int, *, spread: bool
) -> Int[ndarray, " K"]:
    """Indices of the samples to climb from: the heaviest, at most ``most``.

    Args:
        boxes: Samples.
        weights: Not negative; samples of weight 0 are never taken.
        most: At most so many.
        spread: Whether a start keeps half a box's distance from heavier ones. Without,
            all starts may sit on the one target that fits best.
    """
    order = np.argsort(-weights, kind="stable")
    if not spread:
        chosen = order[:most]
        return chosen[weights[chosen] > 0.0]
    indices: ndarray = images.spread_starts(boxes, weights, order, most)
    return indices


def modes(
    boxes: Float[ndarray, "S 4"],
    weights: Float[ndarray, " S"],
    start_boxes: Float[ndarray, "K 4"],
    *,
    bandwidth: float,
    merge_distance: float,
) -> tuple[Float[ndarray, "M 4"], Float[ndarray, " M"]]:
    """Climb from each start to a mode of the density Σ_i w_i k(x - x_i), [CM02].

    The kernel is Gaussian, its width ``bandwidth`` half sizes of the box where the
    climb stands, in the centre and in the half sizes alike.

    Args:
        boxes: Samples x_i.
        weights: w_i, not negative.
        start_boxes: Where to begin; none is allowed.
        bandwidth: In half sizes.
        merge_distance: Modes whose centres are closer than this, in half sizes, are one:
            the denser stays.

    Returns:
        The modes, densest first, and their densities. None for an empty sample, and
        none from a start that no sample is near to.
    """
    climbed = images.mean_shift(
        np.ascontiguousarray(boxes, dtype=float),
        np.ascontiguousarray(weights, dtype=float),
        np.ascontiguousarray(start_boxes, dtype=float),
        bandwidth,
        ITERATIONS,
        TOLERANCE,
    )
    found, densities = climbed.boxes, climbed.densities
    order = np.argsort(-densities, kind="stable")
    kept = images.keep_apart(found, densities, order, merge_distance)
    return found.take(kept, 0), densities.take(kept)
