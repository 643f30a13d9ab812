"""The Gaussian-mixture PHD recursion: update and extraction.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker import update_kernels
from tracker.gaussian_mixture import GaussianMixture


@dataclass(frozen=True, slots=True)
class PhdUpdate:
    """The intensity after one measurement set, and what fed it."""

    posterior: GaussianMixture
    """First the J predicted components as missed, then one for every gated pair."""
    parents: Int[ndarray, " K"]
    """The predicted component that each posterior component comes from."""
    measurements: Int[ndarray, " K"]
    """The measurement that updated it, -1 where it was missed."""
    log_odds: Float[ndarray, " P"]
    """log(p_D w' q(z) / κ(z)) of each gated pair: this component against clutter."""
    measurement_weights: Float[ndarray, " M"]
    """W_z: the expected number of targets (0 … 1) that each measurement came from."""


def update(
    predicted: GaussianMixture,
    measurements: Float[ndarray, "M m"],
    *,
    expected: Float[ndarray, "J m"],
    jacobians: Float[ndarray, "J m d"],
    noise: Float[ndarray, "N m m"],
    spread: Float[ndarray, "K m m"] | None = None,
    detection_probability: float | Float[ndarray, " J"],
    clutter_intensity: float | Float[ndarray, " M"],
    gate: float = np.inf,
) -> PhdUpdate:
    """Update an intensity by one set of measurements, eq. (28)–(33) of [VM06].

        v(x) = (1 - p_D) v'(x) + Σ_z Σ_j w_j(z) N(x; m_j(z), P_j)
        w_j(z) = p_D,j w'_j q_j(z) / (κ(z) + Σ_l p_D,l w'_l q_l(z))

    with q_j(z) = N(z; h(m_j), H P_j Hᵀ + R). This is recursion (10) of [ZW21];
    the pseudocode printed there leaves out the division by the sum and keeps the
    predicted covariance, which would let weights grow without bound: here both
    follow the recursion.

    Args:
        predicted: v', J components.
        measurements: z, one a row; none is allowed.
        expected: h(m_j) for each component; for a linear model H m_j.
        jacobians: H for each component.
        noise: R, one for all measurements (N = 1) or one each (N = M).
        spread: What each component adds to the noise, where h bends (K = J); nothing, if none
            (or K = 0).
        detection_probability: p_D, one for all or one a component. Where it is
            0 the component is left as it is.
        clutter_intensity: κ(z) per unit of the measurement space.
        gate: Squared Mahalanobis distance beyond which a pair is left out.

    Raises:
        numpy.linalg.LinAlgError: If H P Hᵀ + R is not positive definite.
    """
    size, count = predicted.size, len(measurements)
    weights, means, covariances, parents, sources, log_odds, sums = update_kernels.phd_update(
        predicted.weights,
        predicted.means,
        predicted.covariances,
        np.ascontiguousarray(expected, dtype=float),
        np.ascontiguousarray(jacobians, dtype=float),
        np.ascontiguousarray(measurements, dtype=float),
        np.ascontiguousarray(noise, dtype=float),
        np.zeros((0, *noise.shape[1:])) if spread is None else spread,
        _filled(detection_probability, size),
        _filled(clutter_intensity, count),
        gate,
    )
    posterior = GaussianMixture(weights, means, covariances, predicted.labels[parents])
    return PhdUpdate(posterior, parents, sources, log_odds, sums)


def _filled(value: float | Float[ndarray, " N"], count: int) -> Float[ndarray, " N"]:
    """One number for all as one each."""
    return value if isinstance(value, np.ndarray) else np.full(count, float(value))


def extract(mixture: GaussianMixture, threshold: float) -> Int[ndarray, " K"]:
    """Indices of the components heavier than ``threshold``, heaviest first ([ZW21] §2.4)."""
    above = np.flatnonzero(mixture.weights > threshold)
    return above[np.argsort(-mixture.weights[above], kind="stable")]
