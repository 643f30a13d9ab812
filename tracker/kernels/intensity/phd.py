"""The PHD update of a whole mixture by one set of measurements, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import all_pairs


@kernel
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


@kernel
def _vectors(values: ndarray, which: ndarray) -> ndarray:
    """The rows ``which`` of (J, d): by brackets it takes several times as long, as to compile."""
    taken = np.empty((len(which), values.shape[1]))
    for k in range(len(which)):
        for a in range(values.shape[1]):
            taken[k, a] = values[which[k], a]
    return taken


@kernel
def _matrices(values: ndarray, which: ndarray) -> ndarray:
    """The matrices ``which`` of (J, n, d), likewise."""
    taken = np.empty((len(which), values.shape[1], values.shape[2]))
    for k in range(len(which)):
        for a in range(values.shape[1]):
            for b in range(values.shape[2]):
                taken[k, a, b] = values[which[k], a, b]
    return taken


@kernel
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
    other_expected: ndarray,
    other_jacobians: ndarray,
    other_spreads: ndarray,
    other_drift: ndarray,
    other_share: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray, ndarray, ndarray]:
    """The GM-PHD update: every component as missed, then one for every gated pair.

    Args:
        weights: (J,).
        means: (J, d).
        covariances: (J, d, d).
        expected: (J, m), as the further ones, of :func:`tracker.kernels.kalman.kalman_pairs`.
        detection_probabilities: (J,).
        clutter: (M,), κ(z).
        gate: Squared Mahalanobis distance.
        other_expected: As the further ones, of :func:`tracker.kernels.kalman.all_pairs`.

    Returns:
        (K,) weights, (K, d) means, (K, d, d) covariances, (K,) parent and (K,)
        measurement, -1 for a miss; (P,) log odds of the pairs against clutter; (M,) sums
        of the weights.
    """
    size, dimension = means.shape
    detectable = np.flatnonzero(detection_probabilities * weights > 0.0)
    nothing = detectable[:0]
    of_all = np.zeros(1, dtype=np.int64)
    there = detectable if len(other_expected) else nothing
    parent, measured, log_likelihood, new_means, new_covariances = all_pairs(
        _vectors(means, detectable),
        _matrices(covariances, detectable),
        _vectors(expected, detectable),
        _matrices(jacobians, detectable if len(jacobians) == size else of_all),
        measurements,
        noises,
        _matrices(spreads, detectable if len(spreads) else nothing),
        gate,
        _vectors(other_expected, there),
        _matrices(other_jacobians, there),
        _matrices(other_spreads, there),
        other_drift,
        other_share,
    )
    pairs = len(parent)
    log_clutter = np.empty(len(clutter))
    for z in range(len(clutter)):
        log_clutter[z] = math.log(clutter[z]) if clutter[z] > 0.0 else -math.inf
    log_scales = np.empty(len(detectable))
    for k in range(len(detectable)):
        j = detectable[k]
        log_scales[k] = math.log(detection_probabilities[j] * weights[j])
    log_terms = np.empty(pairs)
    for pair in range(pairs):
        log_terms[pair] = log_scales[parent[pair]] + log_likelihood[pair]
        parent[pair] = detectable[parent[pair]]
    pair_weights, log_odds, sums = phd_weights(log_terms, measured, log_clutter)

    all_weights = np.empty(size + pairs)
    all_means = np.empty((size + pairs, dimension))
    all_covariances = np.empty((size + pairs, dimension, dimension))
    parents = np.empty(size + pairs, dtype=np.int64)
    sources = np.empty(size + pairs, dtype=np.int64)
    # row by row: by slices it takes longer, as to compile
    for k in range(size + pairs):
        pair = k - size
        if k < size:
            all_weights[k] = weights[k] * (1.0 - detection_probabilities[k])
            parents[k], sources[k] = k, -1
        else:
            all_weights[k] = pair_weights[pair]
            parents[k], sources[k] = parent[pair], measured[pair]
        for a in range(dimension):
            all_means[k, a] = means[k, a] if k < size else new_means[pair, a]
            for b in range(dimension):
                all_covariances[k, a, b] = (
                    covariances[k, a, b] if k < size else new_covariances[pair, a, b]
                )
    return all_weights, all_means, all_covariances, parents, sources, log_odds, sums
