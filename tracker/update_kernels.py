"""The Kalman update of all components by all measurements in their gates, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels import _kernel


class Alternative(NamedTuple):
    """What else a measurement of J components may be: that of a target in another posture."""

    expected: ndarray
    """(J, m), or (0, m) where there is no other posture; as the next two."""
    jacobians: ndarray
    """(J, m, d)."""
    spreads: ndarray
    """(J, m, m), what the posture adds to the noise."""
    drift: ndarray
    """(d, d), how far a state may have moved with the change of posture: a covariance."""
    share: float
    """Of the measurements, above 0 and below 1."""

    @staticmethod
    def none(size: int, dimension: int) -> Alternative:
        """There is no other posture."""
        return Alternative(
            np.zeros((0, size)),
            np.zeros((0, size, dimension)),
            np.zeros((0, size, size)),
            np.zeros((dimension, dimension)),
            0.0,
        )


@_kernel
def _widest_axis(values: ndarray, reach: ndarray) -> int:
    """The axis along which values (N, d) lie furthest apart, measured by the mean reach (J, d)."""
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


@_kernel
def _factor(own: ndarray, j: int, noises: ndarray, n: int, lower: ndarray, place: int) -> float:
    """Cholesky factor of S = own + R into ``lower[place]``; log of 1 / √det(2π S)."""
    order = own.shape[1]
    constant: float = -0.5 * order * math.log(2.0 * math.pi)
    for p in range(order):
        for q in range(p + 1):
            total = own[j, p, q] + noises[n, p, q]
            for r in range(q):
                total -= lower[place, p, r] * lower[place, q, r]
            if p == q:
                if not total > 0.0:
                    raise np.linalg.LinAlgError("H P H' + R is not positive definite")
                lower[place, p, p] = math.sqrt(total)
                constant -= math.log(lower[place, p, p])
            else:
                lower[place, p, q] = total / lower[place, q, q]
    return constant


@_kernel
def _gated_pairs(
    expected: ndarray,
    measurements: ndarray,
    noises: ndarray,
    own: ndarray,
    gate: float,
    lower: ndarray,
    constants: ndarray,
) -> tuple[ndarray, ndarray, ndarray]:
    """Component, measurement and log-likelihood of each pair inside its gate.

    What lies within the gate of S lies within √(gate S_pp) along every axis p: only such
    measurements are looked at, found by bisection along one axis. The result is that of
    looking at all.
    """
    size, order = expected.shape
    count = len(measurements)
    if size == 0 or count == 0:
        nothing = np.empty(0, dtype=np.int64)
        return nothing, nothing, np.empty(0)
    shared = noises.shape[0] == 1
    reach = np.empty((size, order))
    for p in range(order):
        noise = noises[:, p, p].max()
        for j in range(size):
            if not own[j, p, p] + noise > 0.0:
                raise np.linalg.LinAlgError("H P H' + R is not positive definite")
            # a little more than the bound, so that rounding excludes nothing
            reach[j, p] = math.sqrt(gate * (own[j, p, p] + noise)) * (1.0 + 1e-9)
    axis = _widest_axis(measurements, reach)
    by_axis = np.argsort(measurements[:, axis])
    coordinates = measurements[:, axis][by_axis]

    capacity = 4 * (size + count)
    component = np.empty(capacity, dtype=np.int64)
    measured = np.empty(capacity, dtype=np.int64)
    likelihood = np.empty(capacity)
    solved = np.empty(order)
    pairs = 0
    for j in range(size):
        if shared:
            constants[j] = _factor(own, j, noises, 0, lower, j)
        first = np.searchsorted(coordinates, expected[j, axis] - reach[j, axis])
        last = expected[j, axis] + reach[j, axis]
        for k in range(first, count):
            if coordinates[k] > last:
                break
            z = by_axis[k]
            near = True
            for p in range(order):
                if abs(measurements[z, p] - expected[j, p]) > reach[j, p]:
                    near = False
            if not near:
                continue
            place = j if shared else 0
            constant = constants[j] if shared else _factor(own, j, noises, z, lower, 0)
            distance = 0.0
            for p in range(order):
                total = measurements[z, p] - expected[j, p]
                for r in range(p):
                    total -= lower[place, p, r] * solved[r]
                solved[p] = total / lower[place, p, p]
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

    # measurement by measurement
    place_of = np.zeros(count + 1, dtype=np.int64)
    for pair in range(pairs):
        place_of[measured[pair] + 1] += 1
    for z in range(count):
        place_of[z + 1] += place_of[z]
    order_of = np.empty(pairs, dtype=np.int64)
    for pair in range(pairs):
        order_of[place_of[measured[pair]]] = pair
        place_of[measured[pair]] += 1
    return component[order_of], measured[order_of], likelihood[order_of]


@_kernel
def kalman_pairs(
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    gate: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """The Kalman update of every component by every measurement inside its gate.

    Args:
        means: (J, d).
        covariances: (J, d, d).
        expected: (J, m), the measurement each component predicts.
        jacobians: (J, m, d), its derivative H.
        measurements: (M, m).
        noises: (1, m, m) for all, or (M, m, m).
        spreads: (J, m, m), what a component adds to the noise, or (0, m, m) for nothing.
        gate: Squared Mahalanobis distance of the innovation; infinity for none.

    Returns:
        For each of the P pairs, measurement by measurement: component (P,),
        measurement (P,), log N(z; h, S) (P,), mean (P, d), covariance (P, d, d)
        in Joseph form, which stays symmetric and positive.

    Raises:
        numpy.linalg.LinAlgError: If the covariance of an innovation is not positive definite.
    """
    size, dimension = means.shape
    order = measurements.shape[1]
    shared = noises.shape[0] == 1
    spread = spreads.shape[0] > 0
    ph = np.empty((size, dimension, order))
    own = np.empty((size, order, order))
    for j in range(size):
        for a in range(dimension):
            for p in range(order):
                total = 0.0
                for b in range(dimension):
                    total += covariances[j, a, b] * jacobians[j, p, b]
                ph[j, a, p] = total
        for p in range(order):
            for q in range(order):
                total = spreads[j, p, q] if spread else 0.0
                for a in range(dimension):
                    total += jacobians[j, p, a] * ph[j, a, q]
                own[j, p, q] = total
    lower = np.empty((size if shared else 1, order, order))
    constants = np.empty(size)
    component, measured, likelihood = _gated_pairs(
        expected, measurements, noises, own, gate, lower, constants
    )

    pairs = len(component)
    new_means = np.empty((pairs, dimension))
    new_covariances = np.empty((pairs, dimension, dimension))
    gains = np.empty((size if shared else 1, dimension, order))
    updated = np.empty((size if shared else 1, dimension, dimension))
    has_gain = np.zeros(size, dtype=np.bool_)
    factor = np.empty((dimension, dimension))
    half = np.empty((dimension, dimension))
    noise = np.empty((order, order))
    solved = np.empty(order)
    for pair in range(pairs):
        j = component[pair]
        z = measured[pair]
        place = j if shared else 0
        if not (shared and has_gain[j]):
            has_gain[j] = True
            n = 0 if shared else z
            if not shared:
                _factor(own, j, noises, n, lower, 0)
            for p in range(order):
                for q in range(order):
                    noise[p, q] = noises[n, p, q] + (spreads[j, p, q] if spread else 0.0)
            # K = P Hᵀ S⁻¹, row by row through the factor
            for a in range(dimension):
                for p in range(order):
                    total = ph[j, a, p]
                    for r in range(p):
                        total -= lower[place, p, r] * solved[r]
                    solved[p] = total / lower[place, p, p]
                for p in range(order - 1, -1, -1):
                    total = solved[p]
                    for r in range(p + 1, order):
                        total -= lower[place, r, p] * gains[place, a, r]
                    gains[place, a, p] = total / lower[place, p, p]
            # P = (I - K H) P (I - K H)ᵀ + K R Kᵀ
            for a in range(dimension):
                for b in range(dimension):
                    total = 1.0 if a == b else 0.0
                    for p in range(order):
                        total -= gains[place, a, p] * jacobians[j, p, b]
                    factor[a, b] = total
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
                        for q in range(order):
                            total += gains[place, a, p] * noise[p, q] * gains[place, b, q]
                    updated[place, a, b] = total
                    updated[place, b, a] = total
        for a in range(dimension):
            total = means[j, a]
            for p in range(order):
                total += gains[place, a, p] * (measurements[z, p] - expected[j, p])
            new_means[pair, a] = total
            for b in range(dimension):
                new_covariances[pair, a, b] = updated[place, a, b]
    return component, measured, likelihood, new_means, new_covariances


@_kernel
def all_pairs(
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    gate: float,
    other_expected: ndarray,
    other_jacobians: ndarray,
    other_spreads: ndarray,
    other_drift: ndarray,
    other_share: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """:func:`kalman_pairs` of a measurement that is of one of two kinds.

        g(z|x) = (1 − ε) N(z; h(x), R + Ω) + ε N(z; h'(x'), R + Ω'),  x' = x + N(0, D)

    Args:
        means: As the further ones, of :func:`kalman_pairs`.
        other_expected: h' and, in the further ones, H', Ω', D and ε: :class:`Alternative`.

    Returns:
        The pairs of the first kind and then those of the other.
    """
    component, measured, likelihood, new_means, new_covariances = kalman_pairs(
        means, covariances, expected, jacobians, measurements, noises, spreads, gate
    )
    if len(other_expected) == 0:
        return component, measured, likelihood, new_means, new_covariances
    more = kalman_pairs(
        means,
        covariances + other_drift,
        other_expected,
        other_jacobians,
        measurements,
        noises,
        other_spreads,
        gate,
    )
    return (
        np.concatenate((component, more[0])),
        np.concatenate((measured, more[1])),
        np.concatenate((likelihood + math.log(1.0 - other_share), more[2] + math.log(other_share))),
        np.concatenate((new_means, more[3])),
        np.concatenate((new_covariances, more[4])),
    )
