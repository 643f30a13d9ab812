"""The Kalman update of all components by all measurements in their gates, compiled.

Shapes: J components of a state of size d, M measurements of size m, P gated pairs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.gating import GatedPairs, Measurements, factor_innovation, gated_pairs


class Expected(NamedTuple):
    """The linearised predicted measurements of J components, of a target in one of two postures.

        g(z|x) = (1 − ε) N(z; h(x), R + Ω) + ε N(z; h'(x'), R + Ω'),  x' = x + N(0, D)

    The arrays of the other posture have no rows where there is none.
    """

    values: ndarray
    """h (J, m), the predicted measurement of each mean, pixels."""
    jacobians: ndarray
    """H (J, m, d), or (1, m, d), one for all, pixels per metre."""
    spreads: ndarray
    """Ω (J, m, m), noise that a component adds by nonlinearity, or (0, m, m) for none."""
    posture_values: ndarray
    """h' (J, m), or (0, m)."""
    posture_jacobians: ndarray
    """H' (J, m, d), or (0, m, d)."""
    posture_spreads: ndarray
    """Ω' (J, m, m), or (0, m, m)."""
    posture_drift: ndarray
    """D (d, d), covariance of the change of a state with the posture."""
    posture_share: float
    """ε, share of the measurements in the other posture, above 0 and below 1."""

    @staticmethod
    def of(values: ndarray, jacobians: ndarray, spreads: ndarray | None = None) -> Expected:
        """Make predictions of one posture, from arrays of any memory layout; None for no spread."""
        size, dimension = jacobians.shape[1:]
        return Expected(
            np.ascontiguousarray(values, dtype=float),
            np.ascontiguousarray(jacobians, dtype=float),
            np.empty((0, size, size)) if spreads is None else spreads,
            np.empty((0, size)),
            np.empty((0, size, dimension)),
            np.empty((0, size, size)),
            np.zeros((dimension, dimension)),
            0.0,
        )


class Pairs(NamedTuple):
    """P pairs, each a component updated by a measurement inside its gate."""

    components: ndarray
    """(P,), index of the component."""
    measured: ndarray
    """(P,), index of the measurement."""
    log_likelihoods: ndarray
    """(P,), log N(z; h, S)."""
    means: ndarray
    """(P, d), updated states."""
    covariances: ndarray
    """(P, d, d), updated covariances in Joseph form, which stay symmetric and positive definite."""


class _Innovations(NamedTuple):
    """The contributions of J components to the innovation covariances S."""

    cross: ndarray
    """P Hᵀ (J, d, m)."""
    own: ndarray
    """H P Hᵀ + Ω (J, m, m)."""
    factors: ndarray
    """(J, m, m), Cholesky factors of S, where all measurements have one noise; else (1, m, m),
    working memory."""


class _Spot(NamedTuple):
    """Indices of one updated covariance, and of what it is computed from."""

    component: int
    """Index of the component."""
    noise: int
    """Index of the measurement noise R."""
    factored: int
    """Index of the Cholesky factor of the innovation covariance S."""
    place: int
    """Index at which gain and covariance are stored."""


class _Filtered(NamedTuple):
    """Gains and covariances of all spots, and working memory for one of them."""

    gains: ndarray
    """K (N, d, m)."""
    covariances: ndarray
    """(I − K H) P (I − K H)ᵀ + K (R + Ω) Kᵀ (N, d, d)."""
    noise: ndarray
    """R + Ω (m, m); this and the next three are working memory."""
    factor: ndarray
    """I − K H (d, d)."""
    half: ndarray
    """(I − K H) P (d, d)."""
    noisy: ndarray
    """K (R + Ω) (d, m)."""


@kernel
def _innovations(covariances: ndarray, expected: Expected, noises: int) -> _Innovations:
    """Compute P Hᵀ and H P Hᵀ + Ω of every component, and leave the factors to the gating.

    Args:
        covariances: P (J, d, d).
        expected: The predictions, with H and Ω.
        noises: The number of covariances of the measurements' noise.
    """
    jacobians, spreads = expected.jacobians, expected.spreads
    size, dimension, order = len(covariances), covariances.shape[1], jacobians.shape[1]
    ph = np.empty((size, dimension, order))
    own = np.empty((size, order, order))
    for j in range(size):
        h = 0 if len(jacobians) == 1 else j
        for a in range(dimension):
            for p in range(order):
                total = 0.0
                for b in range(dimension):
                    total += covariances[j, a, b] * jacobians[h, p, b]
                ph[j, a, p] = total
        for p in range(order):
            for q in range(order):
                total = spreads[j, p, q] if len(spreads) else 0.0
                for a in range(dimension):
                    total += jacobians[h, p, a] * ph[j, a, q]
                own[j, p, q] = total
    return _Innovations(ph, own, np.empty((size if noises == 1 else 1, order, order)))


@kernel
def _filter(
    spot: _Spot,
    cross: ndarray,
    lower: ndarray,
    covariances: ndarray,
    expected: Expected,
    noises: ndarray,
    filtered: _Filtered,
) -> None:
    """Compute gain and covariance of one spot, in place.

    Args:
        spot: Component, noise and indices of the result.
        cross: P Hᵀ, as in :class:`_Innovations`.
        lower: Cholesky factors of S, of :func:`tracker.kernels.gating.factor_innovation`.
        covariances: P (J, d, d).
        expected: The predictions, with H and Ω.
        noises: R (N, m, m).
        filtered: Receives the result.
    """
    dimension, order = filtered.noisy.shape
    j, n, factored, place = spot.component, spot.noise, spot.factored, spot.place
    jacobians, spreads = expected.jacobians, expected.spreads
    gains, updated = filtered.gains, filtered.covariances
    noise, factor, half, noisy = filtered.noise, filtered.factor, filtered.half, filtered.noisy
    h = 0 if len(jacobians) == 1 else j
    for p in range(order):
        for q in range(order):
            noise[p, q] = noises[n, p, q]
            if len(spreads):
                noise[p, q] += spreads[j, p, q]
    # K = P Hᵀ S⁻¹, row by row through the factor
    for a in range(dimension):
        for p in range(order):
            total = cross[j, a, p]
            for r in range(p):
                total -= lower[factored, p, r] * gains[place, a, r]
            gains[place, a, p] = total * lower[factored, p, p]
        for p in range(order - 1, -1, -1):
            total = gains[place, a, p]
            for r in range(p + 1, order):
                total -= lower[factored, r, p] * gains[place, a, r]
            gains[place, a, p] = total * lower[factored, p, p]
    for a in range(dimension):
        for b in range(dimension):
            total = 1.0 if a == b else 0.0
            for p in range(order):
                total -= gains[place, a, p] * jacobians[h, p, b]
            factor[a, b] = total
        for p in range(order):
            total = 0.0
            for q in range(order):
                total += gains[place, a, q] * noise[q, p]
            noisy[a, p] = total
    for a in range(dimension):
        for b in range(dimension):
            total = 0.0
            for c in range(dimension):
                total += factor[a, c] * covariances[j, c, b]
            half[a, b] = total
    for a in range(dimension):
        for b in range(a + 1):
            total = 0.0
            for c in range(dimension):
                total += half[a, c] * factor[b, c]
            for p in range(order):
                total += noisy[a, p] * gains[place, b, p]
            updated[place, a, b] = total
            updated[place, b, a] = total


@kernel
def _update(
    gated: GatedPairs,
    means: ndarray,
    covariances: ndarray,
    expected: Expected,
    measurements: Measurements,
    innovations: _Innovations,
    updated: Pairs,
    end: int,
) -> None:
    """Compute the gated pairs into the rows of ``updated`` before the row ``end``."""
    component, measured = gated.components, gated.measured
    noises, lower = measurements.noises, innovations.factors
    dimension, order = innovations.cross.shape[1:]
    count = len(component)
    first = end - count
    # with one noise for all, the pairs of a component share gain and covariance
    shared = len(noises) == 1
    known = np.zeros(len(means), dtype=np.bool_)
    known[component] = True
    filtered = np.flatnonzero(known) if shared else component
    places = len(means) if shared else count
    result = _Filtered(
        np.empty((places, dimension, order)),
        np.empty((places, dimension, dimension)),
        np.empty((order, order)),
        np.empty((dimension, dimension)),
        np.empty((dimension, dimension)),
        np.empty((dimension, order)),
    )
    for k in range(len(filtered)):
        j = filtered[k]
        spot = _Spot(j, 0, j, j) if shared else _Spot(j, measured[k], 0, k)
        if not shared:
            factor_innovation(innovations.own, j, noises, spot.noise, lower, 0)
        _filter(spot, innovations.cross, lower, covariances, expected, noises, result)
    gains, filtered_covariances = result.gains, result.covariances
    values, expected_values = measurements.values, expected.values
    log_likelihoods = gated.log_likelihoods
    components, numbers, likelihoods, new_means, new_covariances = updated
    for pair in range(count):
        j, z, row = component[pair], measured[pair], first + pair
        place = j if shared else pair
        components[row], numbers[row] = j, z
        likelihoods[row] = log_likelihoods[pair]
        for a in range(dimension):
            total = means[j, a]
            for p in range(order):
                total += gains[place, a, p] * (values[z, p] - expected_values[j, p])
            new_means[row, a] = total
            for b in range(dimension):
                new_covariances[row, a, b] = filtered_covariances[place, a, b]


@kernel
def _in_posture(expected: Expected) -> Expected:
    """The predictions of the other posture, as those of a single posture."""
    return Expected(
        expected.posture_values,
        expected.posture_jacobians,
        expected.posture_spreads,
        expected.posture_values[:0],
        expected.posture_jacobians[:0],
        expected.posture_spreads[:0],
        expected.posture_drift,
        expected.posture_share,
    )


@kernel
def _room_for(count: int, dimension: int) -> Pairs:
    """Arrays for the number of pairs, to be filled."""
    return Pairs(
        np.empty(count, dtype=np.int64),
        np.empty(count, dtype=np.int64),
        np.empty(count),
        np.empty((count, dimension)),
        np.empty((count, dimension, dimension)),
    )


@kernel
def kalman_pairs(
    means: ndarray,
    covariances: ndarray,
    expected: Expected,
    measurements: Measurements,
    gate: float,
) -> Pairs:
    """Compute the Kalman update of every component by every measurement inside its gate.

    Args:
        means: (J, d), states.
        covariances: (J, d, d), covariances.
        expected: The measurement that each component predicts, in one posture or two.
        measurements: M measurements with their noise.
        gate: Squared Mahalanobis distance of the innovation; infinity for no gate.

    Returns:
        The pairs, measurement by measurement, those of the first posture before those of the
        other; with two postures each likelihood has the share of its posture as a factor.

    Raises:
        numpy.linalg.LinAlgError: If the covariance of an innovation is not positive definite.
    """
    dimension, noises = means.shape[1], len(measurements.noises)
    own = _innovations(covariances, expected, noises)
    gated = gated_pairs(expected.values, measurements, own.own, gate, own.factors)
    count = len(gated.components)
    if len(expected.posture_values) == 0:
        found = _room_for(count, dimension)
        _update(gated, means, covariances, expected, measurements, own, found, count)
        return found
    other, drifted = _in_posture(expected), covariances + expected.posture_drift
    of_other = _innovations(drifted, other, noises)
    also = gated_pairs(other.values, measurements, of_other.own, gate, of_other.factors)
    both = count + len(also.components)
    found = _room_for(both, dimension)
    _update(gated, means, covariances, expected, measurements, own, found, count)
    _update(also, means, drifted, other, measurements, of_other, found, both)
    share = expected.posture_share
    found.log_likelihoods[:count] += math.log(1.0 - share)
    found.log_likelihoods[count:] += math.log(share)
    return found
