"""What people by shape tell the fusion: how well they are placed, and how likely each is one.

[LBS93] Lerro, Bar-Shalom, "Interacting multiple model tracking with target amplitude feature",
IEEE TAES 29(2), 1993.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.parameters.groups.shapes import ShapesParams


def log_ratios(
    log_odds: Float[ndarray, " N"], even: float, weight: float, largest: float
) -> Float[ndarray, " N"]:
    """ln Λ of people by shape, of their odds.

    Args:
        log_odds: ln o.
        even: ln o_0, at which Λ is 1.
        weight: a.
        largest: ln Λ_max.
    """
    return np.asarray(np.minimum(weight * (log_odds - even), largest))


def shape_sigmas(
    boxes: Float[ndarray, "N 4"], half_extents: Float[ndarray, " 3"], parameters: ShapesParams
) -> Float[ndarray, "N 4"]:
    """Measurement noise: the same in metres for who is near and far, and some pixels.

    Args:
        boxes: Centre and half sizes, pixels.
        half_extents: Of the target, metres.
        parameters: The noise.
    """
    p = parameters
    extents = np.array([(half_extents[0] + half_extents[1]) / 2.0, half_extents[2]])
    half_sizes = np.maximum(boxes[:, 2:], 0.5)
    centres = np.hypot(p.place_sigma * half_sizes / extents, p.pixel_sigma)
    return np.concatenate([centres, p.size_sigma * half_sizes], axis=1)
