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
from tracker.kernels.gating import Measurements
from tracker.kernels.intensity import extraction, phd
from tracker.kernels.intensity import mixture as mixture_kernels
from tracker.kernels.kalman import Expected

SPARE = 0.25
"""How much more than one target, or than its weight, a component may stand for: weights are
uncertain, but less than half a target cannot be reported."""


@dataclass(frozen=True, slots=True)
class PhdUpdate:
    """The intensity after one measurement set, and from which pairs it was made."""

    posterior: GaussianMixture
    """First the J predicted components as missed, then one for every gated pair."""
    parents: Int[ndarray, " K"]
    """The predicted component that each posterior component comes from."""
    measurements: Int[ndarray, " K"]
    """The measurement that updated it, -1 where it was missed."""
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
        predicted: v', J components.
        measurements: z, one a row; none is allowed.
        expected: h(m_j) for each component, for a linear model H m_j; H for each or one for
            all; and what each adds to the noise where h is nonlinear (Ω of the unscented form).
        noise: R, one for all measurements (N = 1) or one each (N = M).
        detection_probability: p_D, one for all or one a component. Where it is
            0 the component is left as it is.
        clutter_intensity: κ(z) per unit of the measurement space.
        gate: Squared Mahalanobis distance beyond which a pair is left out.

    Raises:
        numpy.linalg.LinAlgError: If H P Hᵀ + R is not positive definite.
    """
    size, count = predicted.size, len(measurements)
    updated = phd.phd_update(
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
    """One number for all as one each."""
    if isinstance(value, np.ndarray):
        return value
    filled = np.empty(count)  # cheaper than np.full, and done at every update
    filled.fill(value)
    return filled


def extract(mixture: GaussianMixture, threshold: float) -> Int[ndarray, " K"]:
    """Indices of the components heavier than ``threshold``, heaviest first ([ZW21] §2.4)."""
    above = (mixture.weights > threshold).nonzero()[0]
    return above.take(mixture_kernels.heaviest_first(mixture.weights.take(above)))


def extract_measured(
    predicted: GaussianMixture, updated: PhdUpdate, threshold: float = 0.5
) -> GaussianMixture:
    """One target for each measurement that most likely had one, after [RCV10].

    Where targets are many, the weight of one is spread over several components and none
    of them is heavy. So components are gathered by the measurement z that made them:

        W_z = Σ_j w_j(z),   m_z = Σ_j w_j(z) m_j(z) / W_z

    is reported where W_z is above the threshold, beside heavy components that no
    measurement updated. Beyond [RCV10], a predicted component pays for what it explains:
    it stands for w'_j targets, or for one where that is less, and a little more
    (:data:`SPARE`). The surest measurement is served first, so a false alarm beside a
    target, which the PHD filter gives a weight near 1 as well, is not reported too.

    Args:
        predicted: v', as it was updated.
        updated: By one measurement set, not reduced yet.
        threshold: Expected number of targets.

    Returns:
        The reported targets: first those of measurements, the surest first.
    """
    posterior = updated.posterior
    found = extraction.report(
        predicted.weights,
        phd.UpdatedIntensity(
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
