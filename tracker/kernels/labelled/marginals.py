"""Who made which measurement, compiled: belief propagation, and the updates that rest on it."""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import all_pairs
from tracker.kernels.linear_algebra import group_labels, merge_moments


@kernel
def belief_propagation(
    missed: ndarray, detected: ndarray, unexplained: ndarray, tolerance: float, iterations: int
) -> tuple[ndarray, ndarray]:
    """Messages between targets and measurements until they settle.

    Args:
        missed: (n,) weight of each target's miss.
        detected: (n, M) weight of each pair, 0 outside the gate.
        unexplained: (M,) weight of each measurement being nobody's.
        tolerance: Largest change of a message at which to stop.
        iterations: At most this many.

    Returns:
        (n, 1 + M) probabilities of a miss and of each measurement for every target, and
        (M,) the probability that no target made the measurement.
    """
    targets, count = detected.shape
    # only pairs inside a gate exchange messages: row by row, whose measurement and weight
    rows = np.zeros((targets, 1 + count))
    starts = np.zeros(targets + 1, dtype=np.int64)
    for i in range(targets):
        starts[i + 1] = starts[i]
        for j in range(count):
            if detected[i, j] > 0.0:
                starts[i + 1] += 1
    measured = np.empty(starts[targets], dtype=np.int64)
    weights = np.empty(starts[targets])
    to_target = np.empty(starts[targets])
    to_measurement = np.empty(starts[targets])
    pair = 0
    for i in range(targets):
        for j in range(count):
            if detected[i, j] > 0.0:
                measured[pair] = j
                weights[pair] = detected[i, j]
                to_target[pair] = 1.0 / unexplained[j]
                pair += 1
    totals = unexplained.copy()
    for _ in range(iterations):
        totals[:] = unexplained
        for i in range(targets):
            total = missed[i]
            for pair in range(starts[i], starts[i + 1]):
                total += weights[pair] * to_target[pair]
            for pair in range(starts[i], starts[i + 1]):
                rest = max(total - weights[pair] * to_target[pair], 1e-300)
                to_measurement[pair] = weights[pair] / rest
                totals[measured[pair]] += to_measurement[pair]
        change = 0.0
        for pair in range(len(measured)):
            j = measured[pair]
            new = 1.0 / max(totals[j] - to_measurement[pair], 1e-300)
            change = max(change, abs(new - to_target[pair]) * unexplained[j])
            to_target[pair] = new
        if change < tolerance:
            break
    for i in range(targets):
        total = missed[i]
        for pair in range(starts[i], starts[i + 1]):
            total += weights[pair] * to_target[pair]
        total = max(total, 1e-300)
        rows[i, 0] = missed[i] / total
        for pair in range(starts[i], starts[i + 1]):
            rows[i, 1 + measured[pair]] = weights[pair] * to_target[pair] / total
    return rows, unexplained / totals


@kernel
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
    other_expected: ndarray,
    other_jacobians: ndarray,
    other_spreads: ndarray,
    other_drift: ndarray,
    other_share: float,
    tolerance: float,
    iterations: int,
) -> tuple[ndarray, ndarray, ndarray, ndarray, ndarray]:
    """The update of Bernoulli tracks by one measurement set, of which each gets its share.

    Args:
        existences: (n,).
        means: (n, d), as the further ones, of :func:`tracker.kernels.kalman.kalman_pairs`.
        detection_probabilities: (n,).
        unexplained: (M,), intensity of clutter and newcomers at each measurement, > 0.
        gate: Squared Mahalanobis distance.
        other_expected: As the further ones, of :func:`tracker.kernels.kalman.all_pairs`.
        tolerance: As ``iterations``, of :func:`belief_propagation`.

    Returns:
        (n,) existences, (n, d) means, (n, d, d) covariances; (n, 1 + M) probabilities of
        a miss and of each measurement; (M,) the probability that no track made it.
    """
    size, dimension = means.shape
    count = len(measurements)
    track, measured, log_likelihood, pair_means, pair_covariances = all_pairs(
        means,
        covariances,
        expected,
        jacobians,
        measurements,
        noises,
        spreads,
        gate,
        other_expected,
        other_jacobians,
        other_spreads,
        other_drift,
        other_share,
    )
    pairs = len(track)
    missed = np.empty(size)
    survived = np.empty(size)
    for i in range(size):
        survived[i] = existences[i] * (1.0 - detection_probabilities[i])
        missed[i] = 1.0 - existences[i] + survived[i]
    detected = np.zeros((size, count))
    terms = np.empty(pairs)
    for pair in range(pairs):
        i = track[pair]
        terms[pair] = existences[i] * detection_probabilities[i] * math.exp(log_likelihood[pair])
        detected[i, measured[pair]] += terms[pair]
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
        i, z = track[pair], measured[pair]
        weights[size + pair] = rows[i, 1 + z] * terms[pair] / max(detected[i, z], 1e-300)
        group[size + pair] = track[pair]
    parts[size:], spread[size:] = pair_means, pair_covariances
    new_existences, new_means, new_covariances = merge_moments(weights, parts, spread, group, size)
    for i in range(size):
        new_existences[i] = min(new_existences[i], 1.0)
    return new_existences, new_means, new_covariances, rows, columns


@kernel
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
        tolerance: As ``iterations``, of :func:`belief_propagation`.

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
