"""The GM-PHD recursion with NumPy alone: what the compiled kernels are held against.

Array code throughout, gated and merged through sorted coordinates, so that it can be
compared at a thousand targets, for its results and for its speed.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture


def predict(
    mixture: GaussianMixture, transition: ndarray, noise: ndarray, survival: float
) -> GaussianMixture:
    """w ← p_S w, m ← F m, P ← F P Fᵀ + Q."""
    return GaussianMixture(
        survival * mixture.weights,
        mixture.means @ transition.T,
        transition @ mixture.covariances @ transition.T + noise,
        mixture.labels,
    )


def windows(centres: ndarray, reach: ndarray, values: ndarray) -> tuple[ndarray, ndarray]:
    """Every pair of a centre and a value no further from it than its reach."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    first = np.searchsorted(ordered, centres - reach)
    count = np.searchsorted(ordered, centres + reach, side="right") - first
    centre = np.repeat(np.arange(len(centres)), count)
    offset = np.arange(len(centre)) - np.repeat(np.cumsum(count) - count, count)
    return centre, order[first[centre] + offset]


def update(
    predicted: GaussianMixture,
    measurements: ndarray,
    *,
    jacobian: ndarray,
    noise: ndarray,
    detection: float,
    clutter_intensity: float,
    gate: float,
) -> tuple[GaussianMixture, ndarray]:
    """Eq. (28)–(33) of [VM06] for z = H x: the missed, then the gated pairs; whose z each is."""
    transposed = predicted.covariances @ jacobian.T
    innovation_covariances = jacobian @ transposed + noise
    inverses = np.linalg.inv(innovation_covariances)
    expected = predicted.means @ jacobian.T
    reach = np.sqrt(gate * innovation_covariances[:, 0, 0])
    parent, measured = windows(expected[:, 0], reach, measurements[:, 0])
    innovation = measurements[measured] - expected[parent]
    near = innovation[:, 1] ** 2 <= gate * innovation_covariances[parent, 1, 1]
    parent, measured, innovation = parent[near], measured[near], innovation[near]
    distance = np.einsum("pa,pab,pb->p", innovation, inverses[parent], innovation)
    inside = np.flatnonzero(distance <= gate)
    inside = inside[np.lexsort((parent[inside], measured[inside]))]
    parent, measured, innovation = parent[inside], measured[inside], innovation[inside]
    scale = (
        detection * predicted.weights / np.sqrt(np.linalg.det(2.0 * np.pi * innovation_covariances))
    )
    terms = scale[parent] * np.exp(-0.5 * distance[inside])
    totals = clutter_intensity + np.bincount(measured, terms, len(measurements))
    gains = transposed @ inverses
    covariances = predicted.covariances - gains @ transposed.transpose(0, 2, 1)
    posterior = GaussianMixture(
        np.concatenate([(1.0 - detection) * predicted.weights, terms / totals[measured]]),
        np.concatenate(
            [
                predicted.means,
                predicted.means[parent] + np.einsum("pab,pb->pa", gains[parent], innovation),
            ]
        ),
        np.concatenate([predicted.covariances, covariances[parent]]),
        np.concatenate([predicted.labels, predicted.labels[parent]]),
    )
    return posterior, np.concatenate([np.full(predicted.size, -1), measured])


def absorbing(mixture: GaussianMixture, threshold: float) -> tuple[ndarray, ndarray]:
    """Every pair of a component and another that would absorb it, were it the leader.

    Looked for in the nine cells around a component, of a grid over the two axes on which
    the mixture is spread widest.
    """
    means, size, many = mixture.means, mixture.size, mixture.dimension > 1
    reach = np.sqrt(threshold * mixture.covariances.diagonal(axis1=1, axis2=2))
    axes = np.argsort(-np.ptp(means, axis=0) / (reach.mean(axis=0) + 1e-300))[:2]
    side = reach[:, axes].max(axis=0) + 1e-9
    cells = np.floor((means[:, axes] - means[:, axes].min(axis=0)) / side).astype(np.int64)
    rows = cells[:, 0]
    columns = cells[:, 1] if many else np.zeros(size, dtype=np.int64)
    width = columns.max() + 3
    order = np.argsort(rows * width + columns, kind="stable")
    keys = (rows * width + columns)[order]
    parts = []
    for row in (-1, 0, 1):
        middle = (rows + row) * width + columns
        first = np.searchsorted(keys, middle - 1)
        count = np.searchsorted(keys, middle + 1, side="right") - first
        one = np.repeat(np.arange(size), count)
        offset = np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
        other = order[first[one] + offset]
        for axis in axes:
            near = np.abs(means[other, axis] - means[one, axis]) <= reach[one, axis]
            one, other = one[near], other[near]
        parts.append((one, other))
    one, other = (np.concatenate(part) for part in zip(*parts, strict=True))
    offset = means[other] - means[one]
    precisions = np.linalg.inv(mixture.covariances)
    inside = np.einsum("na,nab,nb->n", offset, precisions[one], offset) <= threshold
    return one[inside], other[inside]


def groups(mixture: GaussianMixture, threshold: float) -> tuple[ndarray, ndarray]:
    """Who is absorbed by which leader, heaviest first, and the leaders."""
    absorbed, leader = absorbing(mixture, threshold)
    order = np.argsort(leader, kind="stable")
    theirs = absorbed[order].tolist()
    starts = np.searchsorted(leader[order], np.arange(mixture.size + 1)).tolist()
    group = [-1] * mixture.size
    leaders = []
    for one in np.argsort(-mixture.weights, kind="stable").tolist():
        if group[one] >= 0:
            continue
        group[one] = number = len(leaders)
        leaders.append(one)
        for other in theirs[starts[one] : starts[one + 1]]:
            if group[other] < 0:
                group[other] = number
    return np.array(group), np.array(leaders)


def merge(mixture: GaussianMixture, threshold: float) -> tuple[GaussianMixture, ndarray]:
    """Table II of [VM06], keeping the first two moments; and the leader of each group."""
    if mixture.size == 0:
        return mixture, np.zeros(0, dtype=np.int64)
    group, leaders = groups(mixture, threshold)
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], np.arange(len(leaders)))
    weights = np.add.reduceat(mixture.weights[order], starts)
    share = (mixture.weights / weights[group])[order, None]
    means = np.add.reduceat(share * mixture.means[order], starts)
    offset = mixture.means[order] - means[group[order]]
    spread = mixture.covariances[order] + offset[:, :, None] * offset[:, None, :]
    covariances = np.add.reduceat(share[:, :, None] * spread, starts)
    return GaussianMixture(weights, means, covariances, mixture.labels[leaders]), leaders


def reduce(
    mixture: GaussianMixture, pruning: float, merging: float, most: int
) -> tuple[GaussianMixture, ndarray]:
    """Prune, merge and cap, keeping the weight, heaviest first; and who led each."""
    kept = np.flatnonzero(mixture.weights >= pruning)
    merged, leaders = merge(mixture.take(kept), merging)
    heaviest = np.argsort(-merged.weights, kind="stable")[:most]
    part = merged.take(heaviest)
    weights = part.weights * (merged.weights.sum() / max(part.weights.sum(), 1e-300))
    reduced = GaussianMixture(weights, part.means, part.covariances, part.labels)
    return reduced, kept[leaders[heaviest]]


def extract_measured(
    posterior: GaussianMixture,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    predicted_weights: ndarray,
    threshold: float,
    spare: float,
) -> list[tuple[float, ndarray]]:
    """Each reported target's weight and mean; see :func:`tracker.filters.phd.extract_measured`."""
    pairs = np.flatnonzero(measured >= 0)
    parent, z = parents[pairs], measured[pairs]
    weights, means = posterior.weights[pairs], posterior.means[pairs]
    left = np.maximum(predicted_weights, 1.0) + spare
    found = []
    names = np.unique(z)
    surest = sorted(names.tolist(), key=lambda name: (-log_odds[z == name].max(), name))
    for name in surest:
        rows = np.flatnonzero(z == name)
        if weights[rows].sum() <= threshold:
            continue
        spent = np.minimum(weights[rows], left[parent[rows]])
        if spent.sum() > threshold:
            left[parent[rows]] -= spent
            found.append((float(spent.sum()), spent @ means[rows] / spent.sum()))
    missed = np.flatnonzero((measured < 0) & (posterior.weights > threshold))
    found += [(float(posterior.weights[i]), posterior.means[i]) for i in missed.tolist()]
    return found
