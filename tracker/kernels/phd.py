"""The PHD update of a whole mixture by one set of measurements, and extraction, compiled.

:func:`tracker.filters.phd.extract_measured` has the equations and the source of the extraction.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.kalman import Expected, Measurements, kalman_pairs
from tracker.kernels.linear_algebra import Gaussians, merge_moments
from tracker.kernels.mixtures import heaviest_of_groups


class PairWeights(NamedTuple):
    """Weights of P pairs of a component and a measurement, for M measurements."""

    weights: ndarray
    """(P,), expected number of targets of each pair."""
    log_odds: ndarray
    """(P,), log(p_D w q(z) / κ(z)) of each pair: this component against clutter."""
    sums: ndarray
    """(M,), sum of the weights of each measurement's pairs."""


class UpdatedIntensity(NamedTuple):
    """An intensity after one measurement set: J components as missed, followed by P pairs."""

    weights: ndarray
    """(K,), expected numbers of targets, K = J + P."""
    means: ndarray
    """(K, d), states."""
    covariances: ndarray
    """(K, d, d), covariances."""
    parents: ndarray
    """(K,), the predicted component that each comes from."""
    measured: ndarray
    """(K,), the measurement that updated it, -1 for a miss."""
    log_odds: ndarray
    """(P,), log odds of the pairs against clutter."""
    sums: ndarray
    """(M,), sum of the weights of each measurement's pairs."""


@kernel
def phd_weights(log_terms: ndarray, measured: ndarray, log_clutter: ndarray) -> PairWeights:
    """Compute the weights of a PHD update in logarithms, so that far measurements do not underflow.

    Args:
        log_terms: (P,), log(p_D w q(z)) of each pair.
        measured: (P,), the measurement of each pair.
        log_clutter: (M,), log κ(z); minus infinity without clutter.
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
    return PairWeights(weights, odds, sums)


@kernel
def _vectors(values: ndarray, which: ndarray) -> ndarray:
    """Select rows of (J, d) by index; ``values[which]`` is slower, also to compile."""
    picked = np.empty((len(which), values.shape[1]))
    for k in range(len(which)):
        for a in range(values.shape[1]):
            picked[k, a] = values[which[k], a]
    return picked


@kernel
def _matrices(values: ndarray, which: ndarray) -> ndarray:
    """Select matrices of (J, n, d) by index, as :func:`_vectors` does rows."""
    picked = np.empty((len(which), values.shape[1], values.shape[2]))
    for k in range(len(which)):
        for a in range(values.shape[1]):
            for b in range(values.shape[2]):
                picked[k, a, b] = values[which[k], a, b]
    return picked


@kernel
def _picked(expected: Expected, which: ndarray, size: int) -> Expected:
    """Select the predictions of the components ``which``; J, the number of all, is ``size``."""
    nothing, of_all = which[:0], np.zeros(1, dtype=np.int64)
    there = which if len(expected.posture_values) else nothing
    return Expected(
        _vectors(expected.values, which),
        _matrices(expected.jacobians, which if len(expected.jacobians) == size else of_all),
        _matrices(expected.spreads, which if len(expected.spreads) else nothing),
        _vectors(expected.posture_values, there),
        _matrices(expected.posture_jacobians, there),
        _matrices(expected.posture_spreads, there),
        expected.posture_drift,
        expected.posture_share,
    )


@kernel
def phd_update(
    predicted: Gaussians,
    expected: Expected,
    measurements: Measurements,
    detection_probabilities: ndarray,
    clutter: ndarray,
    gate: float,
) -> UpdatedIntensity:
    """Compute the GM-PHD update: every component as missed, then one for every gated pair.

    The equations are those of :func:`tracker.filters.phd.update`.

    Args:
        predicted: J predicted components.
        expected: The measurement that each component predicts.
        measurements: M measurements with their noise.
        detection_probabilities: (J,), p_D of each component.
        clutter: (M,), κ(z) per unit of the measurement space.
        gate: Largest squared Mahalanobis distance of a pair.
    """
    weights, means, covariances = predicted.weights, predicted.means, predicted.covariances
    size, dimension = means.shape
    detectable = np.flatnonzero(detection_probabilities * weights > 0.0)
    found = kalman_pairs(
        _vectors(means, detectable),
        _matrices(covariances, detectable),
        _picked(expected, detectable, size),
        measurements,
        gate,
    )
    parent, measured = found.components, found.measured
    new_means, new_covariances = found.means, found.covariances
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
        log_terms[pair] = log_scales[parent[pair]] + found.log_likelihoods[pair]
        parent[pair] = detectable[parent[pair]]
    shares = phd_weights(log_terms, measured, log_clutter)

    all_weights = np.empty(size + pairs)
    all_means = np.empty((size + pairs, dimension))
    all_covariances = np.empty((size + pairs, dimension, dimension))
    parents = np.empty(size + pairs, dtype=np.int64)
    sources = np.empty(size + pairs, dtype=np.int64)
    # row by row: slices take longer, also to compile
    for k in range(size + pairs):
        pair = k - size
        if k < size:
            all_weights[k] = weights[k] * (1.0 - detection_probabilities[k])
            parents[k], sources[k] = k, -1
        else:
            all_weights[k] = shares.weights[pair]
            parents[k], sources[k] = parent[pair], measured[pair]
        for a in range(dimension):
            all_means[k, a] = means[k, a] if k < size else new_means[pair, a]
            for b in range(dimension):
                all_covariances[k, a, b] = (
                    covariances[k, a, b] if k < size else new_covariances[pair, a, b]
                )
    return UpdatedIntensity(
        all_weights,
        all_means,
        all_covariances,
        parents,
        sources,
        shares.log_odds,
        shares.sums,
    )


class AllocatedWeights(NamedTuple):
    """The weight that P pairs of a component and a measurement contribute to extracted targets."""

    weights: ndarray
    """(P,), the part of each pair's weight that counts for the target of its measurement; 0 where
    the measurement is not reported."""
    places: ndarray
    """(P,), index of the pair's measurement among the reported ones, -1 for none."""
    reported: int
    """Number of reported measurements."""


class Reported(NamedTuple):
    """The T targets extracted from an update."""

    weights: ndarray
    """(T,), expected number of targets."""
    means: ndarray
    """(T, d), states."""
    covariances: ndarray
    """(T, d, d), covariances."""
    heaviest: ndarray
    """(T,), index of the heaviest component of each."""


@kernel
def allocate_weights(
    left: ndarray,
    weights: ndarray,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    sums: ndarray,
    threshold: float,
) -> AllocatedWeights:
    """Determine the measurements that components can explain, by decreasing log odds of their
    pairs.

    A component explains no more targets than its own expected number: what it contributes to one
    measurement is subtracted from what it can contribute to the next.

    Args:
        left: (J,), expected number of targets that each component may still explain; reduced in
            place.
        weights: (P,), weight of each pair of a component and a measurement.
        parents: (P,), the component of each pair.
        measured: (P,), the measurement of each pair, ascending.
        log_odds: (P,), log odds of each pair against clutter.
        sums: (M,), sum of the weights of each measurement.
        threshold: Expected number of targets from which a measurement is reported.
    """
    count = len(sums)
    shares = np.zeros(len(weights))
    group = np.full(len(weights), -1, dtype=np.int64)
    starts = np.zeros(count + 1, dtype=np.int64)
    surest = np.full(count, -np.inf)
    for pair in range(len(weights)):
        starts[measured[pair] + 1] += 1
        surest[measured[pair]] = max(surest[measured[pair]], log_odds[pair])
    for z in range(count):
        starts[z + 1] += starts[z]
    worth = np.flatnonzero(sums > threshold)
    reported = 0
    for z in worth[np.argsort(-surest[worth], kind="mergesort")]:
        total = 0.0
        for pair in range(starts[z], starts[z + 1]):
            total += min(weights[pair], left[parents[pair]])
        if total <= threshold:
            continue
        for pair in range(starts[z], starts[z + 1]):
            shares[pair] = min(weights[pair], left[parents[pair]])
            left[parents[pair]] -= shares[pair]
            group[pair] = reported
        reported += 1
    return AllocatedWeights(shares, group, reported)


@kernel
def report(
    predicted: ndarray, updated: UpdatedIntensity, threshold: float, spare: float
) -> Reported:
    """Extract the targets of an update, as :func:`tracker.filters.phd.extract_measured`.

    Args:
        predicted: (J,) weights of the predicted components.
        updated: The update by one measurement set, before any reduction.
        threshold: Expected number of targets from which one is reported.
        spare: Expected number of targets by which the targets that a component explains may exceed
            its weight, or 1 where the weight is less.
    """
    size = len(predicted)
    weights, means, covariances = updated.weights, updated.means, updated.covariances
    allocated = allocate_weights(
        np.maximum(predicted, 1.0) + spare,
        weights[size:],
        updated.parents[size:],
        updated.measured[size:],
        updated.log_odds,
        updated.sums,
        threshold,
    )
    found = merge_moments(
        allocated.weights, means[size:], covariances[size:], allocated.places, allocated.reported
    )
    heaviest = size + heaviest_of_groups(allocated.weights, allocated.places, allocated.reported)
    missed = np.flatnonzero(weights[:size] > threshold)
    if len(missed) == 0:
        return Reported(found.weights, found.means, found.covariances, heaviest)
    return Reported(
        np.concatenate((found.weights, weights[missed])),
        np.concatenate((found.means, means[missed])),
        np.concatenate((found.covariances, covariances[missed])),
        np.concatenate((heaviest, missed)),
    )
