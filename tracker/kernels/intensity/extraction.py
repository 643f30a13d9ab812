"""Which measurements are reported as targets, compiled."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels.compilation import kernel
from tracker.kernels.intensity.mixture import heaviest_of_groups
from tracker.kernels.linear_algebra import merge_moments


@kernel
def pay_for_measurements(
    left: ndarray,
    weights: ndarray,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    sums: ndarray,
    threshold: float,
) -> tuple[ndarray, ndarray, int]:
    """Which measurements the components can pay for, the surest first.

    Args:
        left: (J,), what each component has to spend; it is used up.
        weights: (P,), of each pair of a component and a measurement.
        parents: (P,), the component.
        measured: (P,), the measurement, ascending.
        log_odds: (P,), against clutter.
        sums: (M,), of the weights of each measurement.
        threshold: What a measurement costs at least.

    Returns:
        What each pair spends (P,), the place of its measurement among the reported ones
        (P,), -1 for none, and their number.
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
    return spent, group, reported


@kernel
def report(
    predicted: ndarray,
    weights: ndarray,
    means: ndarray,
    covariances: ndarray,
    parents: ndarray,
    sources: ndarray,
    log_odds: ndarray,
    sums: ndarray,
    threshold: float,
    spare: float,
) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """The targets that an update reports: :func:`tracker.filters.phd.extract_measured`.

    Args:
        predicted: (J,) weights.
        weights: (K,), as the further ones, of :func:`tracker.kernels.intensity.phd.phd_update`.
        threshold: Expected number of targets.
        spare: What a component may spend beyond its weight, or beyond one target.

    Returns:
        (T,) weights, (T, d) means, (T, d, d) covariances, and (T,) the heaviest of the
        components that each was made of.
    """
    size = len(predicted)
    spent, group, count = pay_for_measurements(
        np.maximum(predicted, 1.0) + spare,
        weights[size:],
        parents[size:],
        sources[size:],
        log_odds,
        sums,
        threshold,
    )
    found = merge_moments(spent, means[size:], covariances[size:], group, count)
    heaviest = size + heaviest_of_groups(spent, group, count)
    missed = np.flatnonzero(weights[:size] > threshold)
    if len(missed) == 0:
        return found[0], found[1], found[2], heaviest
    return (
        np.concatenate((found[0], weights[missed])),
        np.concatenate((found[1], means[missed])),
        np.concatenate((found[2], covariances[missed])),
        np.concatenate((heaviest, missed)),
    )
