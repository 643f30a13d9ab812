"""The track-oriented Poisson multi-Bernoulli recursion: the update of the detected targets.

[W15] J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT,
JIPDA, and association-based MeMBer", IEEE Transactions on Aerospace and
Electronic Systems 51(3), 2015: TOMB/P.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker import association
from tracker.association import Marginals
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels.kalman import Alternative
from tracker.kernels.labelled import marginals as marginal_kernels


@dataclass(frozen=True, slots=True, eq=False)
class PmbUpdate:
    """The Bernoulli tracks after one measurement set, and the association that made them."""

    tracks: GaussianMixture
    """Weights are existence probabilities; one component a track, in the order given."""
    marginals: Marginals


def update(
    tracks: GaussianMixture,
    measurements: Float[ndarray, "M m"],
    *,
    expected: Float[ndarray, "n m"],
    jacobians: Float[ndarray, "n m d"],
    noise: Float[ndarray, "N m m"],
    spread: Float[ndarray, "K m m"] | None = None,
    detection_probability: Float[ndarray, " n"],
    unexplained_intensity: Float[ndarray, " M"],
    gate: float,
    other: Alternative | None = None,
) -> PmbUpdate:
    """Update every track by the measurements that may be its own ([W15] TOMB/P).

        w_i0 = 1 − r_i + r_i (1 − p_i),   w_ij = r_i p_i q_i(z_j)

    With the marginal association probabilities P, existence becomes
    r' = Σ_j P(i ← j) + P(i misses) r_i (1 − p_i) / w_i0, and the density is the
    mixture of the updated and the missed Gaussians, kept as one Gaussian of its
    mean and covariance.

    Args:
        tracks: n Bernoullis: existence as weight, Gaussian, label.
        measurements: z, one a row; none is allowed.
        expected: h(m_i).
        jacobians: H_i.
        noise: R, one for all measurements (N = 1) or one each (N = M).
        spread: What each track adds to the noise, where h bends (K = n); nothing, if none
            (or K = 0).
        detection_probability: p_i of each track.
        unexplained_intensity: ρ_j = κ(z_j) + e_j, clutter and newborns at each measurement.
        gate: Squared Mahalanobis distance beyond which a pair is left out.
        other: What else a measurement may be; nothing, if none.
    """
    existences, means, covariances, rows, unexplained = marginal_kernels.bernoulli_update(
        tracks.weights,
        tracks.means,
        tracks.covariances,
        np.ascontiguousarray(expected, dtype=float),
        np.ascontiguousarray(jacobians, dtype=float),
        np.ascontiguousarray(measurements, dtype=float),
        np.ascontiguousarray(noise, dtype=float),
        np.zeros((0, *noise.shape[1:])) if spread is None else spread,
        detection_probability,
        unexplained_intensity,
        gate,
        *(other or Alternative.none(noise.shape[1], tracks.dimension)),
        association.TOLERANCE,
        association.ITERATIONS,
    )
    return PmbUpdate(
        GaussianMixture(existences, means, covariances, tracks.labels),
        Marginals(rows[:, 1:], rows[:, 0], unexplained),
    )
