"""The Kalman update of every component by every measurement, and the PHD update, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels import _kernel


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
    count, order = measurements.shape
    shared = noises.shape[0] == 1
    spread = spreads.shape[0] > 0
    ph = np.empty((size, dimension, order))
    own = np.empty((size, order, order))
    lower = np.empty((size, order, order))
    constants = np.empty(size)
    gains = np.empty((size, dimension, order))
    updated = np.empty((size, dimension, dimension))
    has_factor = np.zeros(size, dtype=np.bool_)
    has_gain = np.zeros(size, dtype=np.bool_)

    component = np.empty(size * count, dtype=np.int64)
    measured = np.empty(size * count, dtype=np.int64)
    likelihood = np.empty(size * count)
    new_means = np.empty((size * count, dimension))
    new_covariances = np.empty((size * count, dimension, dimension))

    factor = np.empty((dimension, dimension))
    half = np.empty((dimension, dimension))
    noise = np.empty((order, order))
    offset = np.empty(order)
    solved = np.empty(order)
    pairs = 0
    for z in range(count):
        for j in range(size):
            for p in range(order):
                for q in range(order):
                    noise[p, q] = noises[0 if shared else z, p, q]
                    if spread:
                        noise[p, q] += spreads[j, p, q]
            if z == 0:
                for a in range(dimension):
                    for p in range(order):
                        total = 0.0
                        for b in range(dimension):
                            total += covariances[j, a, b] * jacobians[j, p, b]
                        ph[j, a, p] = total
                # H P Hᵀ, the state's share of the innovation's covariance
                for p in range(order):
                    for q in range(p + 1):
                        total = 0.0
                        for a in range(dimension):
                            total += jacobians[j, p, a] * ph[j, a, q]
                        own[j, p, q] = total
            near = True
            for p in range(order):
                offset[p] = measurements[z, p] - expected[j, p]
                # no number of a measurement alone may be beyond the gate
                if offset[p] * offset[p] > gate * (noise[p, p] + own[j, p, p]):
                    near = False
            if not near:
                continue
            if not shared or not has_factor[j]:
                has_factor[j] = True
                # the Cholesky factor of S = H P Hᵀ + R
                for p in range(order):
                    for q in range(p + 1):
                        total = noise[p, q] + own[j, p, q]
                        for r in range(q):
                            total -= lower[j, p, r] * lower[j, q, r]
                        if p == q:
                            if not total > 0.0:
                                raise np.linalg.LinAlgError("H P H' + R is not positive definite")
                            lower[j, p, p] = math.sqrt(total)
                        else:
                            lower[j, p, q] = total / lower[j, q, q]
                constant = -0.5 * order * math.log(2.0 * math.pi)
                for p in range(order):
                    constant -= math.log(lower[j, p, p])
                constants[j] = constant
            distance = 0.0
            for p in range(order):
                total = offset[p]
                for r in range(p):
                    total -= lower[j, p, r] * solved[r]
                solved[p] = total / lower[j, p, p]
                distance += solved[p] * solved[p]
            if not distance <= gate or distance == math.inf:
                continue
            if not (shared and has_gain[j]):
                has_gain[j] = True
                # K = P Hᵀ S⁻¹, row by row through the factor
                for a in range(dimension):
                    for p in range(order):
                        total = ph[j, a, p]
                        for r in range(p):
                            total -= lower[j, p, r] * solved[r]
                        solved[p] = total / lower[j, p, p]
                    for p in range(order - 1, -1, -1):
                        total = solved[p]
                        for r in range(p + 1, order):
                            total -= lower[j, r, p] * gains[j, a, r]
                        gains[j, a, p] = total / lower[j, p, p]
                # P = (I - K H) P (I - K H)ᵀ + K R Kᵀ
                for a in range(dimension):
                    for b in range(dimension):
                        total = 1.0 if a == b else 0.0
                        for p in range(order):
                            total -= gains[j, a, p] * jacobians[j, p, b]
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
                                total += gains[j, a, p] * noise[p, q] * gains[j, b, q]
                        updated[j, a, b] = total
                        updated[j, b, a] = total
            component[pairs] = j
            measured[pairs] = z
            likelihood[pairs] = constants[j] - 0.5 * distance
            for a in range(dimension):
                total = means[j, a]
                for p in range(order):
                    total += gains[j, a, p] * offset[p]
                new_means[pairs, a] = total
                for b in range(dimension):
                    new_covariances[pairs, a, b] = updated[j, a, b]
            pairs += 1
    return (
        component[:pairs],
        measured[:pairs],
        likelihood[:pairs],
        new_means[:pairs],
        new_covariances[:pairs],
    )


@_kernel
def phd_weights(
    log_terms: ndarray, measured: ndarray, log_clutter: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Weights of a PHD update, in logarithms: a far measurement still goes to its nearest.

    Args:
        log_terms: (P,), log(p_D w q(z)) of each pair.
        measured: (P,), its measurement.
        log_clutter: (M,), log κ(z); minus infinity without clutter.

    Returns:
        (P,) weights; (P,) log odds against clutter; (M,) sums of the weights.
    """
    count = len(log_clutter)
    largest = np.empty(count)
    for z in range(count):
        largest[z] = max(log_clutter[z], -1e300)
    for pair in range(len(log_terms)):
        z = measured[pair]
        largest[z] = max(largest[z], log_terms[pair])
    totals = np.empty(count)
    for z in range(count):
        totals[z] = math.exp(log_clutter[z] - largest[z])
    weights = np.empty(len(log_terms))
    odds = np.empty(len(log_terms))
    for pair in range(len(log_terms)):
        z = measured[pair]
        weights[pair] = math.exp(log_terms[pair] - largest[z])
        totals[z] += weights[pair]
        odds[pair] = log_terms[pair] - log_clutter[z]
    sums = np.zeros(count)
    for pair in range(len(log_terms)):
        z = measured[pair]
        weights[pair] /= totals[z]
        sums[z] += weights[pair]
    return weights, odds, sums


@_kernel
def phd_update(
    weights: ndarray,
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    detection_probabilities: ndarray,
    clutter: ndarray,
    gate: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray]:
    """The GM-PHD update: every component as missed, then one for every gated pair.

    Args:
        weights: (J,).
        means: (J, d).
        covariances: (J, d, d).
        expected: (J, m), as the further ones, of :func:`kalman_pairs`.
        detection_probabilities: (J,).
        clutter: (M,), κ(z).
        gate: Squared Mahalanobis distance.

    Returns:
        (K,) weights, (K, d) means, (K, d, d) covariances, (K,) parent and (K,)
        measurement, -1 for a miss; (P,) log odds of the pairs against clutter; (M,) sums
        of the weights.
    """
    size, dimension = means.shape
    detectable = np.flatnonzero(detection_probabilities * weights > 0.0)
    spread = spreads[detectable] if len(spreads) else spreads
    parent, measured, log_likelihood, new_means, new_covariances = kalman_pairs(
        means[detectable],
        covariances[detectable],
        expected[detectable],
        jacobians[detectable],
        measurements,
        noises,
        spread,
        gate,
    )
    pairs = len(parent)
    log_clutter = np.empty(len(clutter))
    for z in range(len(clutter)):
        log_clutter[z] = math.log(clutter[z]) if clutter[z] > 0.0 else -math.inf
    log_terms = np.empty(pairs)
    for pair in range(pairs):
        j = detectable[parent[pair]]
        parent[pair] = j
        log_terms[pair] = math.log(detection_probabilities[j] * weights[j]) + log_likelihood[pair]
    pair_weights, log_odds, sums = phd_weights(log_terms, measured, log_clutter)

    all_weights = np.empty(size + pairs)
    all_means = np.empty((size + pairs, dimension))
    all_covariances = np.empty((size + pairs, dimension, dimension))
    parents = np.empty(size + pairs, dtype=np.int64)
    sources = np.empty(size + pairs, dtype=np.int64)
    all_weights[:size] = weights * (1.0 - detection_probabilities)
    all_means[:size], all_covariances[:size] = means, covariances
    parents[:size], sources[:size] = np.arange(size), -1
    all_weights[size:] = pair_weights
    all_means[size:], all_covariances[size:] = new_means, new_covariances
    parents[size:], sources[size:] = parent, measured
    return all_weights, all_means, all_covariances, parents, sources, log_odds, sums
