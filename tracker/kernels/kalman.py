"""Gating, and the Kalman update of all components by all measurements in their gates, compiled.

Shapes: J components of a state of size d, M measurements of size m, P gated pairs. A pair is inside
its gate where (z − h)ᵀ S⁻¹ (z − h) ≤ gate, with S = H P Hᵀ + R.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel


class Measurements(NamedTuple):
    """M measurements of m components each."""

    values: ndarray
    """(M, m), pixels."""
    noises: ndarray
    """(1, m, m), one covariance for all, or (M, m, m), squared pixels."""


class GatedPairs(NamedTuple):
    """P pairs of a component and a measurement inside its gate."""

    components: ndarray
    """(P,), index of the component."""
    measured: ndarray
    """(P,), index of the measurement."""
    log_likelihoods: ndarray
    """(P,), log N(z; h, S)."""


@kernel
def _widest_axis(values: ndarray, reach: ndarray) -> int:
    """The axis along which values (N, d) are spread most, in units of the mean reach (J, d)."""
    best = 0
    most = -1.0
    for a in range(values.shape[1]):
        low = math.inf
        high = -math.inf
        total = 0.0
        for i in range(values.shape[0]):
            low = min(low, values[i, a])
            high = max(high, values[i, a])
        for i in range(reach.shape[0]):
            total += reach[i, a]
        width = (high - low) / max(total, 1e-300)
        if width > most:
            most = width
            best = a
    return best


@kernel
def factor_innovation(
    own: ndarray, j: int, noises: ndarray, n: int, lower: ndarray, place: int
) -> float:
    """Write the Cholesky factor of S = own + R to ``lower[place]``; returns log(1 / √det(2π S)).

    The diagonal of the factor has 1 / L_pp instead of L_pp, so that solving multiplies.

    Args:
        own: H P Hᵀ (J, m, m) of all components.
        j: Index of the component.
        noises: R (N, m, m), covariances of measurement noise.
        n: Index of the measurement noise.
        lower: (K, m, m), receives the factor.
        place: Index at which the factor is written.
    """
    order = own.shape[1]
    constant: float = -0.5 * order * math.log(2.0 * math.pi)
    product = 1.0
    for p in range(order):
        for q in range(p):
            total = own[j, p, q] + noises[n, p, q]
            for r in range(q):
                total -= lower[place, p, r] * lower[place, q, r]
            lower[place, p, q] = total * lower[place, q, q]
        total = own[j, p, p] + noises[n, p, p]
        for r in range(p):
            total -= lower[place, p, r] * lower[place, p, r]
        if not total > 0.0:
            raise np.linalg.LinAlgError("H P H' + R is not positive definite")
        lower[place, p, p] = 1.0 / math.sqrt(total)
        product *= lower[place, p, p]
    return constant + math.log(product)


@kernel
def gated_pairs(
    expected: ndarray, measurements: Measurements, own: ndarray, gate: float, lower: ndarray
) -> GatedPairs:
    """List the pairs inside their gates, measurement by measurement.

    A measurement within the gate of S lies within √(gate S_pp) along every axis p: only such
    measurements are compared, found by bisection along one axis. The result equals that of
    comparing all.

    Args:
        expected: (J, m), predicted measurement of each component.
        measurements: M measurements with their noise.
        own: (J, m, m), H P Hᵀ of each component, which is added to the noise.
        gate: Largest squared Mahalanobis distance of a pair.
        lower: (J, m, m) with one noise for all, else (1, m, m): receives the result of
            :func:`factor_innovation` for each component, or for the last one.
    """
    size, order = expected.shape
    count = len(measurements.values)
    if size == 0 or count == 0:
        nothing = np.empty(0, dtype=np.int64)
        return GatedPairs(nothing, nothing, np.empty(0))
    values, noises = measurements.values, measurements.noises
    shared = noises.shape[0] == 1
    reach = np.empty((size, order))
    for p in range(order):
        noise = noises[:, p, p].max()
        for j in range(size):
            if not own[j, p, p] + noise > 0.0:
                raise np.linalg.LinAlgError("H P H' + R is not positive definite")
            # a little more than the bound, so that rounding excludes no measurement
            reach[j, p] = math.sqrt(gate * (own[j, p, p] + noise)) * (1.0 + 1e-9)
    axis = _widest_axis(values, reach)
    by_axis = np.argsort(values[:, axis])
    ordered = np.empty(values.shape)
    coordinates = np.empty(count)
    for k in range(count):
        coordinates[k] = values[by_axis[k], axis]
        for p in range(order):
            ordered[k, p] = values[by_axis[k], p]

    capacity = 4 * (size + count)
    component = np.empty(capacity, dtype=np.int64)
    measured = np.empty(capacity, dtype=np.int64)
    likelihood = np.empty(capacity)
    hits = np.empty(count + 1, dtype=np.int64)
    solved = np.empty(order)
    constant = 0.0
    n = place = pairs = 0
    for j in range(size):
        first = np.searchsorted(coordinates, expected[j, axis] - reach[j, axis])
        last = np.searchsorted(coordinates, expected[j, axis] + reach[j, axis], "right")
        inside = 0
        for k in range(first, last):
            # without a branch, which would be unpredictable
            near = True
            for p in range(order):
                near &= abs(ordered[k, p] - expected[j, p]) <= reach[j, p]
            hits[inside] = k
            inside += int(near)
        if shared:
            place = j
            constant = factor_innovation(own, j, noises, n, lower, place)
        for hit in range(inside):
            k = hits[hit]
            z = by_axis[k]
            if not shared:
                n = z
                constant = factor_innovation(own, j, noises, n, lower, place)
            distance = 0.0
            for p in range(order):
                total = ordered[k, p] - expected[j, p]
                for r in range(p):
                    total -= lower[place, p, r] * solved[r]
                solved[p] = total * lower[place, p, p]
                distance += solved[p] * solved[p]
            if not distance <= gate or distance == math.inf:
                continue
            if pairs == capacity:
                component = np.concatenate((component, np.empty_like(component)))
                measured = np.concatenate((measured, np.empty_like(measured)))
                likelihood = np.concatenate((likelihood, np.empty_like(likelihood)))
                capacity *= 2
            component[pairs] = j
            measured[pairs] = z
            likelihood[pairs] = constant - 0.5 * distance
            pairs += 1
    found = GatedPairs(component[:pairs], measured[:pairs], likelihood[:pairs])
    return _by_measurement(found, count)


@kernel
def _by_measurement(pairs: GatedPairs, count: int) -> GatedPairs:
    """Sort pairs measurement by measurement, retaining their order within each."""
    component, measured, likelihood = pairs.components, pairs.measured, pairs.log_likelihoods
    place_of = np.zeros(count + 1, dtype=np.int64)
    for z in measured:
        place_of[z + 1] += 1
    for z in range(count):
        place_of[z + 1] += place_of[z]
    components, measurements = np.empty_like(component), np.empty_like(measured)
    likelihoods = np.empty_like(likelihood)
    for pair in range(len(measured)):
        place = place_of[measured[pair]]
        place_of[measured[pair]] += 1
        components[place] = component[pair]
        measurements[place] = measured[pair]
        likelihoods[place] = likelihood[pair]
    return GatedPairs(components, measurements, likelihoods)


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
        lower: Cholesky factors of S, of :func:`tracker.kernels.kalman.factor_innovation`.
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
