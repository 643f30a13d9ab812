"""Gating: the pairs of components and measurements within the gates, compiled.

A pair is inside its gate where (z − h)ᵀ S⁻¹ (z − h) ≤ gate, with S = H P Hᵀ + R.
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
