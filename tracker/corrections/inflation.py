"""Covariance inflation, where the place of a correction contradicts the estimate from boxes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray


def inflation(
    offset: Float[ndarray, " 3"], covariance: Float[ndarray, "3 3"], sigma: float
) -> Float[ndarray, "3 3"]:
    """Compute the covariance that is added to an estimate that contradicts a given place.

    The place of a correction is trusted more than the estimate. With the innovation ν from the
    estimate, of covariance P, to the place, of standard deviation σ, the covariance is inflated
    along ν until the two are one standard deviation apart, and not at all where they are nearer:

        a = νᵀ (P + σ² I)⁻¹ ν,   W = max(1 − 1 / a, 0) ν νᵀ   ⟹   νᵀ (P + W + σ² I)⁻¹ ν = min(a, 1)

    The Kalman update with P + W is within σ of the place: the residual is σ² (P + W + σ² I)⁻¹ ν,
    of length σ √min(a, 1) at most. It is the covariance matching of adaptive
    filters (Mehra, "Approaches to adaptive filtering", IEEE Transactions on Automatic Control
    17(5), 1972) for one innovation, as for an unmodelled manoeuvre.

    Args:
        offset: ν, from the estimate to the place, metres.
        covariance: P, covariance of the estimated position, square metres.
        sigma: σ, standard deviation of the place along every axis, metres.

    Returns:
        W, square metres; zero where the estimate does not contradict the place.
    """
    square = float(offset @ np.linalg.solve(covariance + sigma**2 * np.eye(3), offset))
    return np.asarray((1.0 - 1.0 / max(square, 1.0)) * np.outer(offset, offset))
