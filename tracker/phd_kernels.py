"""The PHD update of a whole mixture by one set of measurements, compiled."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels import _kernel
from tracker.update_kernels import all_pairs_behind


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
        expected: (J, m), as the further ones, of :func:`tracker.update_kernels.kalman_pairs`.
        detection_probabilities: (J,).
        clutter: (M,), κ(z).
        gate: Squared Mahalanobis distance.
        other_expected: As the further ones, of :func:`tracker.update_kernels.all_pairs`.

    Returns:
        (K,) weights, (K, d) means, (K, d, d) covariances, (K,) parent and (K,)
        measurement, -1 for a miss; (P,) log odds of the pairs against clutter; (M,) sums
        of the weights.
    """
    size = len(means)
    detectable = np.flatnonzero(detection_probabilities * weights > 0.0)
    seen, spread_out, foreseen, slopes, spread = means, covariances, expected, jacobians, spreads
    if len(detectable) < size:  # else nothing need be moved
        seen, spread_out = means[detectable], covariances[detectable]
        foreseen = expected[detectable]
        slopes = jacobians[detectable] if len(jacobians) > 1 else jacobians
        spread = spreads[detectable] if len(spreads) else spreads
    there = detectable if len(other_expected) else detectable[:0]
    parent, measured, log_likelihood, all_means, all_covariances = all_pairs_behind(
        size,
        seen,
        spread_out,
        foreseen,
        slopes,
        measurements,
        noises,
        spread,
        gate,
        other_expected[there],
        other_jacobians[there],
        other_spreads[there],
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
    parents = np.empty(size + pairs, dtype=np.int64)
    sources = np.empty(size + pairs, dtype=np.int64)
    all_weights[:size] = weights * (1.0 - detection_probabilities)
    all_means[:size], all_covariances[:size] = means, covariances
    parents[:size], sources[:size] = np.arange(size), -1
    all_weights[size:] = pair_weights
    parents[size:], sources[size:] = parent, measured
    return all_weights, all_means, all_covariances, parents, sources, log_odds, sums
