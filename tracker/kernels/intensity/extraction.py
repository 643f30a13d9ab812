"""Extraction of targets by measurement from a PHD update, compiled.

:func:`tracker.filters.phd.extract_measured` has the equations and the source.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.intensity.mixture import heaviest_of_groups
from tracker.kernels.intensity.phd import UpdatedIntensity
from tracker.kernels.linear_algebra import merge_moments


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
