"""What colours say of a person by shape: how much likelier they are a person's than something's."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

PEAK_EVEN = 0.45
"""Distance to a template at which a peak at a shape is as often somebody's as something else's: a
peak is where colours are most alike, so those of plants, screens and walls are near as well."""

SHAPE_EVEN = 0.56
"""Likewise of the colours in a shape's own box, where no peak vouches for it."""

LARGEST = 2.0
"""Logarithm of the largest ratio with which a peak speaks for the shape at its place or against
it: of what colours tell beyond that, light and a side that no template shows take as much."""

UNLIKE = 1.0
"""Likewise against a shape of nobody's colours: strangers have none of the templates'."""


def colour_ratios(
    vouched: Bool[ndarray, "K N"],
    of_peaks: Float[ndarray, " N"],
    of_shapes: Float[ndarray, " K"],
    sigma: float,
) -> Float[ndarray, " K"]:
    """ln Λ of the colours of people by shape, to be added to that of the shape itself.

    With the distance D to the nearest template and the spread σ of the colour likelihood, of a
    shape that a peak vouches for and of another

        ln Λ = (D_p - D) / σ  within ±2,      ln Λ = (D_s - D) / σ  within -1 … 0.

    In rendered rooms the logarithm of how many such places are people's and how many something
    else's falls by about 1 / σ a unit, whatever the shape's odds: the two are told apart by
    different things, and their ratios multiply. Another shape near a person has that person's
    colours, so that they alone speak for nobody: only a peak does.

    Args:
        vouched: Which of N peaks vouches for which of K shapes.
        of_peaks: D of each peak.
        of_shapes: D of each shape's box.
        sigma: σ.
    """
    nearest = np.where(vouched, of_peaks, np.inf).min(axis=1, initial=np.inf)
    by_peak = np.clip((PEAK_EVEN - nearest) / sigma, -LARGEST, LARGEST)
    by_box = np.clip((SHAPE_EVEN - of_shapes) / sigma, -UNLIKE, 0.0)
    return np.asarray(np.where(vouched.any(axis=1), by_peak, by_box))
