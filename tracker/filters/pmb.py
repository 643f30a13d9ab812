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

from tracker.filters import association
from tracker.filters.association import Marginals
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels import bernoulli as marginal_kernels
from tracker.kernels.kalman import Expected, Measurements


@dataclass(frozen=True, slots=True, eq=False)
class PmbUpdate:
    """The Bernoulli tracks after one measurement set, and the association probabilities."""

    tracks: GaussianMixture
    """One component for each track, in the order given; weights are existence probabilities."""
    marginals: Marginals
    """Association probabilities of the tracks and measurements."""


def update(
    tracks: GaussianMixture,
    measurements: Float[ndarray, "M m"],
    *,
    expected: Expected,
    noise: Float[ndarray, "N m m"],
    detection_probability: Float[ndarray, " n"],
    unexplained_intensity: Float[ndarray, " M"],
    gate: float,
    resemblance: Float[ndarray, "k M"] | None = None,
) -> PmbUpdate:
    """Update every track by the measurements in its gate ([W15] TOMB/P).

        w_i0 = 1 − r_i + r_i (1 − p_i),   w_ij = r_i p_i q_i(z_j)

    With the marginal association probabilities P, existence becomes
    r' = Σ_j P(i ← j) + P(i misses) r_i (1 − p_i) / w_i0, and the density is the
    mixture of the updated and the missed Gaussians, approximated by one Gaussian of its
    mean and covariance.

    Args:
        tracks: n Bernoulli components; the weight is the existence probability r_i.
        measurements: z, a row for each; M may be 0.
        expected: h(m_i), H_i, and the noise that each track adds where h is nonlinear.
        noise: R, one for all measurements (N = 1) or one for each (N = M).
        detection_probability: p_i, the detection probability of each track.
        unexplained_intensity: ρ_j = κ(z_j) + e_j, intensity of clutter and of new targets at
            each measurement.
        gate: Squared Mahalanobis distance beyond which a pair is left out.
        resemblance: Factor on w_ij of the first k tracks: the likelihood ratio of the
            measurement's appearance, of this track against any target; None for 1.
    """
    updated = marginal_kernels.bernoulli_update(
        tracks.gaussians,
        expected,
        Measurements(
            np.ascontiguousarray(measurements, dtype=float),
            np.ascontiguousarray(noise, dtype=float),
        ),
        detection_probability,
        unexplained_intensity,
        np.ones((0, len(measurements))) if resemblance is None else resemblance,
        gate,
        association.CONVERGENCE,
    )
    rows = updated.rows
    return PmbUpdate(
        GaussianMixture(updated.existences, updated.means, updated.covariances, tracks.labels),
        Marginals(rows[:, 1:], rows[:, 0], updated.unexplained),
    )
