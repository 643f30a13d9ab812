"""Whole updates of targets by the boxes of one camera, compiled: no interpreter in between.

Each is a composition of the kernels of :mod:`tracker.kernels`; the tests hold them
against the formulas, pair by pair.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels import (
    _kernel,
    belief_propagation,
    kalman_pairs,
    merge_moments,
    phd_weights,
)


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
        expected: (J, m), as the further ones, of :func:`tracker.kernels.kalman_pairs`.
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


@_kernel
def bernoulli_update(
    existences: ndarray,
    means: ndarray,
    covariances: ndarray,
    expected: ndarray,
    jacobians: ndarray,
    measurements: ndarray,
    noises: ndarray,
    spreads: ndarray,
    detection_probabilities: ndarray,
    unexplained: ndarray,
    gate: float,
    tolerance: float,
    iterations: int,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """The update of Bernoulli tracks by one measurement set, of which each gets its share.

    Args:
        existences: (n,).
        means: (n, d), as the further ones, of :func:`tracker.kernels.kalman_pairs`.
        detection_probabilities: (n,).
        unexplained: (M,), intensity of clutter and newcomers at each measurement, > 0.
        gate: Squared Mahalanobis distance.
        tolerance: As ``iterations``, of :func:`tracker.kernels.belief_propagation`.

    Returns:
        (n,) existences, (n, d) means, (n, d, d) covariances; (n, 1 + M) probabilities of
        a miss and of each measurement; (M,) the probability that no track made it.
    """
    size, dimension = means.shape
    count = len(measurements)
    track, measured, log_likelihood, pair_means, pair_covariances = kalman_pairs(
        means, covariances, expected, jacobians, measurements, noises, spreads, gate
    )
    pairs = len(track)
    missed = np.empty(size)
    survived = np.empty(size)
    for i in range(size):
        survived[i] = existences[i] * (1.0 - detection_probabilities[i])
        missed[i] = 1.0 - existences[i] + survived[i]
    detected = np.zeros((size, count))
    for pair in range(pairs):
        i = track[pair]
        detected[i, measured[pair]] = (
            existences[i] * detection_probabilities[i] * math.exp(log_likelihood[pair])
        )
    rows, columns = belief_propagation(missed, detected, unexplained, tolerance, iterations)

    weights = np.empty(size + pairs)
    parts = np.empty((size + pairs, dimension))
    spread = np.empty((size + pairs, dimension, dimension))
    group = np.empty(size + pairs, dtype=np.int64)
    for i in range(size):
        # a faint share of the missed hypothesis stays, so that no track is without any
        weights[i] = max(rows[i, 0] * survived[i] / max(missed[i], 1e-300), 1e-12)
        group[i] = i
    parts[:size], spread[:size] = means, covariances
    for pair in range(pairs):
        weights[size + pair] = rows[track[pair], 1 + measured[pair]]
        group[size + pair] = track[pair]
    parts[size:], spread[size:] = pair_means, pair_covariances
    new_existences, new_means, new_covariances = merge_moments(weights, parts, spread, group, size)
    for i in range(size):
        new_existences[i] = min(new_existences[i], 1.0)
    return new_existences, new_means, new_covariances, rows, columns


@_kernel
def group_labels(labels: ndarray) -> tuple[ndarray, ndarray]:
    """The distinct labels, ascending, and for each of (J,) labels its place among them."""
    order = np.argsort(labels, kind="mergesort")
    distinct = np.empty(len(labels), dtype=np.int64)
    place = np.empty(len(labels), dtype=np.int64)
    count = 0
    for j in order:
        if count == 0 or labels[j] != distinct[count - 1]:
            distinct[count] = labels[j]
            count += 1
        place[j] = count - 1
    return distinct[:count].copy(), place


@_kernel
def share_boxes(
    weights: ndarray,
    labels: ndarray,
    detection_probabilities: ndarray,
    first_birth: int,
    last_birth: int,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    boxes: int,
    largest_odds: float,
    tolerance: float,
    iterations: int,
) -> tuple[ndarray, ndarray, ndarray]:
    """New weights of a PHD update whose labels stand for one person each.

    Args:
        weights: (J,) before this camera.
        labels: (J,).
        detection_probabilities: (J,).
        first_birth: Labels from here up to ``last_birth``, exclusive, stay Poisson.
        parents: (P,), the component of each pair.
        measured: (P,), its box.
        log_odds: (P,), log(p_D w q(z) / κ) of each.
        boxes: M.
        largest_odds: Logarithm of what counts as certain.
        tolerance: As ``iterations``, of :func:`tracker.kernels.belief_propagation`.

    Returns:
        (J,) factors on the weights of the missed; (P,) weights of the pairs; (P,) whether a
        pair is a person's, not a birth's.
    """
    distinct, place = group_labels(labels)
    count = len(distinct)
    person = (distinct < first_birth) | (distinct >= last_birth)
    held, there = np.zeros(count), np.zeros(count)
    for j in range(len(labels)):
        held[place[j]] += weights[j]
        there[place[j]] += weights[j] * detection_probabilities[j]
    # merging may have left a little more than one person
    scale = 1.0 / np.maximum(held, 1.0)
    missed = np.maximum(1.0 - there * scale, 1e-9)
    pairs = len(parents)
    odds, owner = np.empty(pairs), np.empty(pairs, dtype=np.int64)
    table = np.zeros((count, boxes))
    nobody = np.ones(boxes)  # clutter or a newcomer, in units of κ
    for pair in range(pairs):
        owner[pair] = place[parents[pair]]
        odds[pair] = math.exp(min(log_odds[pair], largest_odds)) * scale[owner[pair]]
        if person[owner[pair]]:
            table[owner[pair], measured[pair]] += odds[pair]
        else:
            nobody[measured[pair]] += odds[pair]
    people = np.flatnonzero(person)
    rows, columns = belief_propagation(missed[people], table[people], nobody, tolerance, iterations)
    row = np.full(count, -1, dtype=np.int64)
    factors = scale.copy()
    for i in range(len(people)):
        row[people[i]] = i
        factors[people[i]] *= rows[i, 0] / missed[people[i]]
    shares = np.empty(pairs)
    for pair in range(pairs):
        who, z = owner[pair], measured[pair]
        # the share of this pair in what its label, or the newcomers, got of the box
        if person[who]:
            shares[pair] = odds[pair] * rows[row[who], 1 + z] / max(table[who, z], 1e-300)
        else:
            shares[pair] = odds[pair] * columns[z] / nobody[z]
    return factors[place], shares, person[owner]
