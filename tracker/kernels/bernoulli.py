"""Updates with association marginals: each target makes at most one box, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.association import Convergence, belief_propagation
from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import Expected, Measurements, kalman_pairs
from tracker.kernels.linear_algebra import Gaussians, group_labels, merge_moments


class UpdatedBernoullis(NamedTuple):
    """n Bernoulli tracks after one measurement set."""

    existences: ndarray
    """(n,), existence probabilities."""
    means: ndarray
    """(n, d), states."""
    covariances: ndarray
    """(n, d, d), covariances."""
    rows: ndarray
    """(n, 1 + M), probabilities of a miss and of each measurement."""
    unexplained: ndarray
    """(M,), probability that no track made the measurement."""


class LabelledWeights(NamedTuple):
    """J components of tracks before the update by a camera."""

    weights: ndarray
    """(J,), expected numbers of targets."""
    labels: ndarray
    """(J,), labels of the tracks."""
    detection_probabilities: ndarray
    """(J,), p_D of each component."""


class PairOdds(NamedTuple):
    """P pairs of a component and a box."""

    parents: ndarray
    """(P,), index of the component."""
    measured: ndarray
    """(P,), index of the box."""
    log_odds: ndarray
    """(P,), log(p_D w q(z) / κ)."""
    boxes: int
    """M, the number of boxes."""


class SharedBoxes(NamedTuple):
    """Weights of a PHD update in which a label stands for one target."""

    factors: ndarray
    """(J,), factors on the weights of the missed components."""
    shares: ndarray
    """(P,), weights of the pairs."""
    of_people: ndarray
    """(P,), whether a pair is of a track, not of a birth."""


@kernel
def bernoulli_update(
    tracks: Gaussians,
    expected: Expected,
    measurements: Measurements,
    detection_probabilities: ndarray,
    unexplained: ndarray,
    resemblance: ndarray,
    gate: float,
    convergence: Convergence,
) -> UpdatedBernoullis:
    """Update Bernoulli tracks by one measurement set, with association marginals.

    Args:
        tracks: n tracks; weights are existence probabilities.
        expected: The measurement that each track predicts.
        measurements: M measurements with their noise.
        detection_probabilities: (n,), p_D of each track.
        unexplained: (M,), intensity of clutter and new targets at each measurement, > 0.
        resemblance: (k, M) with k up to n, likelihood ratio of each measurement's appearance for
            the first k tracks, of the track against any target; 1 for the other tracks.
        gate: Squared Mahalanobis distance of the gate.
        convergence: Convergence criterion of the belief propagation.
    """
    existences, means, covariances = tracks.weights, tracks.means, tracks.covariances
    size, dimension = means.shape
    count = len(measurements.values)
    found = kalman_pairs(means, covariances, expected, measurements, gate)
    track, measured = found.components, found.measured
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
        terms[pair] = (
            existences[i] * detection_probabilities[i] * math.exp(found.log_likelihoods[pair])
        )
        if i < len(resemblance):
            terms[pair] *= resemblance[i, measured[pair]]
        detected[i, measured[pair]] += terms[pair]
    marginals = belief_propagation(missed, detected, unexplained, convergence)
    rows = marginals.rows

    weights = np.empty(size + pairs)
    parts = np.empty((size + pairs, dimension))
    spread = np.empty((size + pairs, dimension, dimension))
    group = np.empty(size + pairs, dtype=np.int64)
    for i in range(size):
        # the missed hypothesis retains a tiny share, so that every track has a hypothesis
        weights[i] = max(rows[i, 0] * survived[i] / max(missed[i], 1e-300), 1e-12)
        group[i] = i
    parts[:size], spread[:size] = means, covariances
    for pair in range(pairs):
        i, z = track[pair], measured[pair]
        weights[size + pair] = rows[i, 1 + z] * terms[pair] / max(detected[i, z], 1e-300)
        group[size + pair] = track[pair]
    parts[size:], spread[size:] = found.means, found.covariances
    merged = merge_moments(weights, parts, spread, group, size)
    for i in range(size):
        merged.weights[i] = min(merged.weights[i], 1.0)
    return UpdatedBernoullis(
        merged.weights, merged.means, merged.covariances, rows, marginals.unexplained
    )


@kernel
def share_boxes(
    people: LabelledWeights,
    first_birth: int,
    last_birth: int,
    odds_of_pairs: PairOdds,
    largest_odds: float,
    convergence: Convergence,
) -> SharedBoxes:
    """Compute weights of a PHD update in which a label stands for one target.

    Args:
        people: J components.
        first_birth: First label of this step's births, which stay Poisson.
        last_birth: Label after the last of the births.
        odds_of_pairs: Log odds of each pair against clutter.
        largest_odds: Log odds at which they are clipped.
        convergence: Convergence criterion of the belief propagation.
    """
    weights, labels = people.weights, people.labels
    parents, measured = odds_of_pairs.parents, odds_of_pairs.measured
    boxes = odds_of_pairs.boxes
    grouped = group_labels(labels)
    distinct, place = grouped.labels, grouped.places
    count = len(distinct)
    person = (distinct < first_birth) | (distinct >= last_birth)
    held, there = np.zeros(count), np.zeros(count)
    for j in range(len(labels)):
        held[place[j]] += weights[j]
        there[place[j]] += weights[j] * people.detection_probabilities[j]
    # merging may result in a weight a little above 1
    scale = 1.0 / np.maximum(held, 1.0)
    missed = np.maximum(1.0 - there * scale, 1e-9)
    pairs = len(parents)
    odds, owner = np.empty(pairs), np.empty(pairs, dtype=np.int64)
    table = np.zeros((count, boxes))
    unassigned = np.ones(boxes)  # clutter or a newcomer, in units of κ
    for pair in range(pairs):
        owner[pair] = place[parents[pair]]
        odds[pair] = math.exp(min(odds_of_pairs.log_odds[pair], largest_odds)) * scale[owner[pair]]
        if person[owner[pair]]:
            table[owner[pair], measured[pair]] += odds[pair]
        else:
            unassigned[measured[pair]] += odds[pair]
    persons = np.flatnonzero(person)
    marginals = belief_propagation(missed[persons], table[persons], unassigned, convergence)
    rows, columns = marginals.rows, marginals.unexplained
    row = np.full(count, -1, dtype=np.int64)
    factors = scale.copy()
    for i in range(len(persons)):
        row[persons[i]] = i
        factors[persons[i]] *= rows[i, 0] / missed[persons[i]]
    shares = np.empty(pairs)
    for pair in range(pairs):
        who, z = owner[pair], measured[pair]
        # the share of this pair in the marginal of its label, or of the births, for the box
        if person[who]:
            shares[pair] = odds[pair] * rows[row[who], 1 + z] / max(table[who, z], 1e-300)
        else:
            shares[pair] = odds[pair] * columns[z] / unassigned[z]
    return SharedBoxes(factors[place], shares, person[owner])
