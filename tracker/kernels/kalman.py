"""The Kalman update of all components by all measurements in their gates, compiled.

Shapes: J components of a state of size d, M measurements of size m, P gated pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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
def _innovations(
    covariances: ndarray, expected: Expected, axes: Sequence[int], rows: Sequence[int]
) -> _Innovations:
    """Compute P Hᵀ and H P Hᵀ + Ω of every component.

    Args:
        covariances: P (J, d, d).
        expected: The predictions, with H and Ω.
        axes: Axes of the state: a range, or a tuple of as many for unrolled loops.
        rows: Components of the measurement, likewise.
    """
    jacobians, spreads = expected.jacobians, expected.spreads
    size = len(covariances)
    ph = np.empty((size, len(axes), len(rows)))
    own = np.empty((size, len(rows), len(rows)))
    for j in range(size):
        h = 0 if len(jacobians) == 1 else j
        for a in range(len(axes)):
            for p in range(len(rows)):
                total = 0.0
                for b in range(len(axes)):
                    total += covariances[j, a, b] * jacobians[h, p, b]
                ph[j, a, p] = total
        for p in range(len(rows)):
            for q in range(len(rows)):
                total = spreads[j, p, q] if len(spreads) else 0.0
                for a in range(len(axes)):
                    total += jacobians[h, p, a] * ph[j, a, q]
                own[j, p, q] = total
    return _Innovations(ph, own)


@kernel
def _filter(
    spot: _Spot,
    cross: ndarray,
    lower: ndarray,
    covariances: ndarray,
    expected: Expected,
    noises: ndarray,
    filtered: _Filtered,
    axes_and_rows: tuple[Sequence[int], Sequence[int]],
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
        axes_and_rows: Axes and rows, as in :func:`_innovations`.
    """
    axes, rows = axes_and_rows
    j, n, factored, place = spot.component, spot.noise, spot.factored, spot.place
    jacobians, spreads = expected.jacobians, expected.spreads
    gains, updated = filtered.gains, filtered.covariances
    noise, factor, half, noisy = filtered.noise, filtered.factor, filtered.half, filtered.noisy
    h = 0 if len(jacobians) == 1 else j
    for p in range(len(rows)):
        for q in range(len(rows)):
            noise[p, q] = noises[n, p, q]
            if len(spreads):
                noise[p, q] += spreads[j, p, q]
    # K = P Hᵀ S⁻¹, row by row through the factor
    for a in range(len(axes)):
        for p in range(len(rows)):
            total = cross[j, a, p]
            for r in range(p):
                total -= lower[factored, p, r] * gains[place, a, r]
            gains[place, a, p] = total * lower[factored, p, p]
        for p in range(len(rows) - 1, -1, -1):
            total = gains[place, a, p]
            for r in range(p + 1, len(rows)):
                total -= lower[factored, r, p] * gains[place, a, r]
            gains[place, a, p] = total * lower[factored, p, p]
    for a in range(len(axes)):
        for b in range(len(axes)):
            total = 1.0 if a == b else 0.0
            for p in range(len(rows)):
                total -= gains[place, a, p] * jacobians[h, p, b]
            factor[a, b] = total
        for p in range(len(rows)):
            total = 0.0
            for q in range(len(rows)):
                total += gains[place, a, q] * noise[q, p]
            noisy[a, p] = total
    for a in range(len(axes)):
        for b in range(len(axes)):
            total = 0.0
            for c in range(len(axes)):
                total += factor[a, c] * covariances[j, c, b]
            half[a, b] = total
    for a in range(len(axes)):
        for b in range(a + 1):
            total = 0.0
            for c in range(len(axes)):
                total += half[a, c] * factor[b, c]
            for p in range(len(rows)):
                total += noisy[a, p] * gains[place, b, p]
            updated[place, a, b] = total
            updated[place, b, a] = total


@kernel
def _updated(
    pairs: GatedPairs,
    means: ndarray,
    covariances: ndarray,
    expected: Expected,
    measurements: Measurements,
    innovations: _Innovations,
    lower: ndarray,
    axes_and_rows: tuple[Sequence[int], Sequence[int]],
) -> Pairs:
    """Compute means and covariances of the gated pairs."""
    axes, rows = axes_and_rows
    component, measured = pairs.components, pairs.measured
    noises = measurements.noises
    count = len(component)
    dimension, order = len(axes), len(rows)
    new_means = np.empty((count, dimension))
    new_covariances = np.empty((count, dimension, dimension))
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
            factor_innovation(innovations.own, j, noises, spot.noise, lower, 0, rows)
        _filter(
            spot, innovations.cross, lower, covariances, expected, noises, result, axes_and_rows
        )
    gains, updated = result.gains, result.covariances
    for pair in range(count):
        j, z = component[pair], measured[pair]
        place = j if shared else pair
        for a in range(len(axes)):
            total = means[j, a]
            for p in range(len(rows)):
                total += gains[place, a, p] * (measurements.values[z, p] - expected.values[j, p])
            new_means[pair, a] = total
            for b in range(len(axes)):
                new_covariances[pair, a, b] = updated[place, a, b]
    return Pairs(component, measured, pairs.log_likelihoods, new_means, new_covariances)


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
        expected: The measurement that each component predicts.
        measurements: M measurements with their noise.
        gate: Squared Mahalanobis distance of the innovation; infinity for no gate.

    Returns:
        The pairs, measurement by measurement.

    Raises:
        numpy.linalg.LinAlgError: If the covariance of an innovation is not positive definite.
    """
    dimension, order = means.shape[1], measurements.values.shape[1]
    lower = np.empty((len(means) if len(measurements.noises) == 1 else 1, order, order))
    # positions and velocities in common sizes are so frequent that their loops are unrolled
    if dimension == 4 and order == 2:
        axes, rows = (0, 1, 2, 3), (0, 1)
        innovations = _innovations(covariances, expected, axes, rows)
        pairs = gated_pairs(expected.values, measurements, innovations.own, gate, lower)
        return _updated(
            pairs, means, covariances, expected, measurements, innovations, lower, (axes, rows)
        )
    whole = (range(dimension), range(order))
    innovations = _innovations(covariances, expected, whole[0], whole[1])
    pairs = gated_pairs(expected.values, measurements, innovations.own, gate, lower)
    return _updated(pairs, means, covariances, expected, measurements, innovations, lower, whole)


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
def all_pairs(
    means: ndarray,
    covariances: ndarray,
    expected: Expected,
    measurements: Measurements,
    gate: float,
) -> Pairs:
    """Compute the Kalman update as :func:`kalman_pairs`, of a target in one of two postures.

    Args:
        means: (J, d), states; the other arguments are those of :func:`kalman_pairs`.

    Returns:
        The pairs of the first posture, followed by those of the other.
    """
    first = kalman_pairs(means, covariances, expected, measurements, gate)
    if len(expected.posture_values) == 0:
        return first
    more = kalman_pairs(
        means, covariances + expected.posture_drift, _in_posture(expected), measurements, gate
    )
    share = expected.posture_share
    return Pairs(
        np.concatenate((first.components, more.components)),
        np.concatenate((first.measured, more.measured)),
        np.concatenate(
            (
                first.log_likelihoods + math.log(1.0 - share),
                more.log_likelihoods + math.log(share),
            )
        ),
        np.concatenate((first.means, more.means)),
        np.concatenate((first.covariances, more.covariances)),
    )
