"""Measurement noise of boxes that a method finds in an image."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

_LEAST = 0.5
"""Least half size for which noise is computed, pixels."""


def box_sigmas(
    boxes: Float[ndarray, "N 4"],
    centre: float,
    size: float,
    *,
    pixels: float = 0.0,
    extents: float | Float[ndarray, " 2"] = 1.0,
    largest: float = np.inf,
) -> Float[ndarray, "N 4"]:
    """Compute the measurement noise of boxes, proportional to their size, plus some pixels.

    With half sizes h in pixels, of the width and the height,

        σ_centre = √((s_c h / e)² + σ_px²),  σ_size = s_h h

    Args:
        boxes: Centre and half sizes of N boxes, pixels.
        centre: s_c, a share of the half size, or metres where ``extents`` are given.
        size: s_h, a share of the half size.
        pixels: σ_px, pixels.
        extents: e, half width and half height of the target, metres; 1 for a share.
        largest: Half height, pixels, above which the noise of a box increases no further.
    """
    half_sizes = np.maximum(boxes[:, 2:], _LEAST)
    half_sizes = half_sizes * np.minimum(1.0, largest / half_sizes[:, 1:])
    centres = np.hypot(centre * half_sizes / extents, pixels)
    return np.concatenate([centres, size * half_sizes], axis=1)
