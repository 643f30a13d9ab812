"""Modes of a weighted sample of boxes, by mean shift.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels; distances are
in half sizes of the current box, so that the result does not depend on scale.

[CM02] Comaniciu, Meer, "Mean shift: a robust approach toward feature space analysis",
IEEE TPAMI 24(5), 2002.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.kernels.pictures import images

ITERATIONS = 30
"""Largest number of steps of a climb; most converge well before."""

TOLERANCE = 0.01
"""Length of a step in half sizes below which a climb ends: far below any peak's deviation."""


def starts(
    boxes: Float[ndarray, "S 4"], weights: Float[ndarray, " S"], most: int, *, spread: bool
) -> Int[ndarray, " K"]:
    """Select the indices of the heaviest samples as starts, at most ``most``.

    Args:
        boxes: Samples, pixels.
        weights: Weights, not negative; samples of weight 0 are never selected.
        most: Largest number of starts.
        spread: Whether a start is at least half a box away from heavier ones. Without,
            all starts may be at the one target that fits best.
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

    The kernel is Gaussian, with a bandwidth of ``bandwidth`` half sizes of the current
    box, in the centre and in the half sizes alike.

    Args:
        boxes: Samples x_i, pixels.
        weights: w_i, not negative.
        start_boxes: Boxes at which the climbs start; there may be none.
        bandwidth: Bandwidth in half sizes.
        merge_distance: Distance of centres, in half sizes, below which modes are merged to the
            denser one.

    Returns:
        The modes, densest first, and their densities. An empty sample has none, and neither has
        a start without any sample near it.
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
