"""The Gaussian-mixture PHD recursion: update and extraction of estimates.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
[RCV10] B. Ristic, D. Clark, B.-N. Vo, "Improved SMC implementation of the PHD filter",
FUSION 2010: estimates gathered by measurement.
[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels import mixtures as mixture_kernels
from tracker.kernels import phd as phd_kernels
from tracker.kernels.kalman import Expected, Measurements

SPARE = 0.25
"""Expected number of targets by which the targets that a component explains may exceed its
predicted weight, or 1 where the weight is less: weights are uncertain. The tolerance is below the
half target from which one is reported."""


@dataclass(frozen=True, slots=True)
class PhdUpdate:
    """The intensity after one measurement set, and where its components come from."""

    posterior: GaussianMixture
    """The J predicted components as missed, followed by one component for every gated pair."""
    parents: Int[ndarray, " K"]
    """Index of the predicted component that each posterior component comes from."""
    measurements: Int[ndarray, " K"]
    """Index of the measurement that updated each component, -1 for a missed one."""
    log_odds: Float[ndarray, " P"]
    """log(p_D w' q(z) / κ(z)) of each gated pair: this component against clutter."""
    measurement_weights: Float[ndarray, " M"]
    """W_z = Σ_j w_j(z): the expected number of targets, 0 … 1, behind each measurement z."""


def update(
    predicted: GaussianMixture,
    measurements: Float[ndarray, "M m"],
    *,
    expected: Expected,
    noise: Float[ndarray, "N m m"],
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
        predicted: v', the predicted intensity of J components.
        measurements: z, a row for each; M may be 0.
        expected: h(m_j) of each component (H m_j of a linear model), H of each or one for all, and
            the noise Ω that each adds where h is nonlinear (unscented form).
        noise: R, one for all measurements (N = 1) or one for each (N = M).
        detection_probability: p_D, one for all or one for each component. Where it is
            0 the component does not change.
        clutter_intensity: κ(z) per unit of the measurement space.
        gate: Squared Mahalanobis distance beyond which a pair is left out.

    Raises:
        numpy.linalg.LinAlgError: If H P Hᵀ + R is not positive definite.
    """
    size, count = predicted.size, len(measurements)
    updated = phd_kernels.phd_update(
        predicted.gaussians,
        expected,
        Measurements(
            np.ascontiguousarray(measurements, dtype=float),
            np.ascontiguousarray(noise, dtype=float),
        ),
        _filled(detection_probability, size),
        _filled(clutter_intensity, count),
        gate,
    )
    posterior = GaussianMixture.of(updated, predicted.labels.take(updated.parents))
    return PhdUpdate(posterior, updated.parents, updated.measured, updated.log_odds, updated.sums)


def _filled(value: float | Float[ndarray, " N"], count: int) -> Float[ndarray, " N"]:
    """An array of ``count`` numbers, from one number for all or from one for each."""
    if isinstance(value, np.ndarray):
        return value
    filled = np.empty(count)  # faster than np.full, and this runs at every update
    filled.fill(value)
    return filled


def extract(mixture: GaussianMixture, threshold: float) -> Int[ndarray, " K"]:
    """The indices of the components heavier than ``threshold``, heaviest first ([ZW21] §2.4)."""
    above = (mixture.weights > threshold).nonzero()[0]
    return above.take(mixture_kernels.heaviest_first(mixture.weights.take(above)))


def extract_measured(
    predicted: GaussianMixture, updated: PhdUpdate, threshold: float = 0.5
) -> GaussianMixture:
    """Extract one target for each measurement that probably has one, after [RCV10].

    Where targets are many, the weight of one is spread over several components and none
    of them is heavy. So components are grouped by the measurement z that updated them:

        W_z = Σ_j w_j(z),   m_z = Σ_j w_j(z) m_j(z) / W_z

    is reported where W_z is above the threshold, beside heavy components that no
    measurement updated. Beyond [RCV10], the expected number of targets that a predicted component
    may explain is limited to max(w'_j, 1) and a tolerance (:data:`SPARE`). Measurements are
    processed by decreasing log odds of their likeliest pair, so a false alarm beside a target,
    to which the PHD filter also gives a weight near 1, is not reported too.

    Args:
        predicted: v', the predicted intensity before the update.
        updated: The update of v' by one measurement set, before any reduction.
        threshold: Expected number W_z of targets above which one is reported.

    Returns:
        The reported targets: first those of measurements, by decreasing log odds of the likeliest
        pair, then missed components above the threshold.
    """
    posterior = updated.posterior
    found = phd_kernels.report(
        predicted.weights,
        phd_kernels.UpdatedIntensity(
            posterior.weights,
            posterior.means,
            posterior.covariances,
            updated.parents,
            updated.measurements,
            updated.log_odds,
            updated.measurement_weights,
        ),
        threshold,
        SPARE,
    )
    return GaussianMixture.of(found, posterior.labels.take(found.heaviest))
