"""Which measurements are reported as targets, compiled."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.kernels import _kernel


@_kernel
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
    starts = np.searchsorted(measured, np.arange(count + 1))
    surest = np.full(count, -np.inf)
    for pair in range(len(weights)):
        surest[measured[pair]] = max(surest[measured[pair]], log_odds[pair])
    reported = 0
    for z in np.argsort(-surest, kind="mergesort"):
        if sums[z] <= threshold:
            continue
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
