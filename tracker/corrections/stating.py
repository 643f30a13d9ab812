"""Where somebody is by what a person said of the place, against what all else says of it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def doubted(
    offset: Float[ndarray, " 3"], covariance: Float[ndarray, "3 3"], sigma: float
) -> Float[ndarray, "3 3"]:
    """By how much more than it says itself all else may err, where it contradicts a stated place.

    Who says where somebody is has seen that the rest is wrong there. With ν the way from what the
    rest says, of covariance P, to the place, of standard deviation σ, the rest is widened along ν
    until the two are one standard deviation apart, and not at all where they are no farther:

        a = νᵀ (P + σ² I)⁻¹ ν,   W = max(1 − 1 / a, 0) ν νᵀ   ⟹   νᵀ (P + W + σ² I)⁻¹ ν = min(a, 1)

    Whoever weighs the place against P + W comes to within σ of it: what is left of ν is
    σ² (P + W + σ² I)⁻¹ ν, of length σ √min(a, 1) at most. It is the covariance matching of adaptive
    filters (Mehra, "Approaches to adaptive filtering", IEEE Transactions on Automatic Control
    17(5), 1972) for one innovation, as for a manoeuvre that the motion model did not foresee.

    Args:
        offset: ν, metres.
        covariance: P, square metres.
        sigma: σ, metres.

    Returns:
        W, square metres; zero where the rest does not contradict the place.
    """
    square = float(offset @ np.linalg.solve(covariance + sigma**2 * np.eye(3), offset))
    return np.asarray((1.0 - 1.0 / max(square, 1.0)) * np.outer(offset, offset))
