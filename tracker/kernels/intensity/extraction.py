"""Which measurements are reported as targets, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.intensity.mixture import heaviest_of_groups
from tracker.kernels.intensity.phd import UpdatedIntensity
from tracker.kernels.linear_algebra import merge_moments


class Payments(NamedTuple):
    """What P pairs of a component and a measurement spend on it."""

    spent: ndarray
    """(P,)."""
    places: ndarray
    """(P,), the place of the pair's measurement among the reported ones, -1 for none."""
    reported: int
    """How many measurements."""


class Reported(NamedTuple):
    """The T targets that an update reports."""

    weights: ndarray
    """(T,)."""
    means: ndarray
    """(T, d)."""
    covariances: ndarray
    """(T, d, d)."""
    heaviest: ndarray
    """(T,), the heaviest of the components that each was made of."""


@kernel
def pay_for_measurements(
    left: ndarray,
    weights: ndarray,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    sums: ndarray,
    threshold: float,
) -> Payments:
    """Which measurements the components can pay for, the surest first.

    Args:
        left: (J,), what each component has to spend; it is used up.
        weights: (P,), of each pair of a component and a measurement.
        parents: (P,), the component.
        measured: (P,), the measurement, ascending.
        log_odds: (P,), against clutter.
        sums: (M,), of the weights of each measurement.
        threshold: What a measurement costs at least.
    """
    count = len(sums)
    spent = np.zeros(len(weights))
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
            spent[pair] = min(weights[pair], left[parents[pair]])
            left[parents[pair]] -= spent[pair]
            group[pair] = reported
        reported += 1
    return Payments(spent, group, reported)


@kernel
def report(
    predicted: ndarray, updated: UpdatedIntensity, threshold: float, spare: float
) -> Reported:
    """The targets that an update reports: :func:`tracker.filters.phd.extract_measured`.

    Args:
        predicted: (J,) weights.
        updated: By one measurement set, not reduced yet.
        threshold: Expected number of targets.
        spare: What a component may spend beyond its weight, or beyond one target.
    """
    size = len(predicted)
    weights, means, covariances = updated.weights, updated.means, updated.covariances
    paid = pay_for_measurements(
        np.maximum(predicted, 1.0) + spare,
        weights[size:],
        updated.parents[size:],
        updated.measured[size:],
        updated.log_odds,
        updated.sums,
        threshold,
    )
    found = merge_moments(paid.spent, means[size:], covariances[size:], paid.places, paid.reported)
    heaviest = size + heaviest_of_groups(paid.spent, paid.places, paid.reported)
    missed = np.flatnonzero(weights[:size] > threshold)
    if len(missed) == 0:
        return Reported(found.weights, found.means, found.covariances, heaviest)
    return Reported(
        np.concatenate((found.weights, weights[missed])),
        np.concatenate((found.means, means[missed])),
        np.concatenate((found.covariances, covariances[missed])),
        np.concatenate((heaviest, missed)),
    )
