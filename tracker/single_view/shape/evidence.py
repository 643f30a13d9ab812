"""Likelihood ratio and measurement noise of people detected by shape, for the fusion.

[LBS93] Lerro, Bar-Shalom, "Interacting multiple model tracking with target amplitude feature",
IEEE TAES 29(2), 1993.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.parameters.groups.shapes import ShapesParams
from tracker.single_view.noise import box_sigmas


def log_ratios(
    log_odds: Float[ndarray, " N"], even: float, weight: float, largest: float
) -> Float[ndarray, " N"]:
    """Convert the log odds of people by shape to log likelihood ratios, min(a ln o/o_0, ln Λ_max).

    Args:
        log_odds: ln o of N people.
        even: ln o_0, at which Λ is 1.
        weight: a, the factor on the log odds.
        largest: ln Λ_max, the upper bound.
    """
    return np.asarray(np.minimum(weight * (log_odds - even), largest))


def shape_sigmas(
    boxes: Float[ndarray, "N 4"], half_extents: Float[ndarray, " 3"], parameters: ShapesParams
) -> Float[ndarray, "N 4"]:
    """Compute the measurement noise of people by shape, constant in metres, plus some pixels.

    Args:
        boxes: Centre and half sizes of N boxes, pixels.
        half_extents: Half width, depth and height of the target, metres.
        parameters: The standard deviations in metres, pixels and shares of the size.
    """
    p = parameters
    extents = np.array([(half_extents[0] + half_extents[1]) / 2.0, half_extents[2]])
    return box_sigmas(boxes, p.place_sigma, p.size_sigma, pixels=p.pixel_sigma, extents=extents)
