"""The GM-PHD recursion with NumPy alone: what the compiled kernels are held against.

Array code throughout, gated and merged through sorted coordinates, so that it can be
compared at a thousand targets, for its results and for its speed.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.gaussian_mixture import GaussianMixture


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


def groups(mixture: GaussianMixture, threshold: float) -> tuple[ndarray, ndarray]:
    """Who is absorbed by which leader, heaviest first, and the leaders."""
    axis = int(np.argmax(np.ptp(mixture.means, axis=0)))
    order = np.argsort(mixture.means[:, axis], kind="stable")
    means, precisions = mixture.means[order], np.linalg.inv(mixture.covariances[order])
    reach = np.sqrt(threshold * mixture.covariances[:, axis, axis].max())
    first = np.searchsorted(means[:, axis], means[:, axis] - reach).tolist()
    last = np.searchsorted(means[:, axis], means[:, axis] + reach, side="right").tolist()
    widest = np.sqrt(threshold * mixture.covariances.diagonal(axis1=1, axis2=2).max(axis=0))
    group = np.full(mixture.size, -1)
    leaders = []
    by_weight = np.argsort(-mixture.weights[order], kind="stable")
    # equal weights: the earlier of the mixture leads
    by_weight = by_weight[np.lexsort((order[by_weight], -mixture.weights[order][by_weight]))]
    for leader in by_weight.tolist():
        if group[leader] >= 0:
            continue
        part = slice(first[leader], last[leader])
        offset = means[part] - means[leader]
        near = np.flatnonzero((group[part] < 0) & (np.abs(offset) <= widest).all(axis=1))
        offset = offset[near]
        near += part.start
        distance = np.einsum("na,nab,nb->n", offset, precisions[near], offset)
        group[near[distance <= threshold]] = len(leaders)
        leaders.append(leader)
    found = np.empty(mixture.size, dtype=np.int64)
    found[order] = group
    return found, order[leaders]


def merge(mixture: GaussianMixture, threshold: float) -> tuple[GaussianMixture, ndarray]:
    """Table II of [VM06], keeping the first two moments; and the leader of each group."""
    group, leaders = groups(mixture, threshold)
    weights = np.bincount(group, mixture.weights)
    share = mixture.weights / weights[group]
    means = np.zeros((len(leaders), mixture.dimension))
    np.add.at(means, group, share[:, None] * mixture.means)
    offset = mixture.means - means[group]
    spread = mixture.covariances + offset[:, :, None] * offset[:, None, :]
    covariances = np.zeros((len(leaders), mixture.dimension, mixture.dimension))
    np.add.at(covariances, group, share[:, None, None] * spread)
    return GaussianMixture(weights, means, covariances, mixture.labels[leaders]), leaders


def reduce(
    mixture: GaussianMixture, pruning: float, merging: float, most: int
) -> tuple[GaussianMixture, ndarray]:
    """Prune, merge and cap, heaviest first; and who led each."""
    kept = np.flatnonzero(mixture.weights >= pruning)
    merged, leaders = merge(mixture.take(kept), merging)
    heaviest = np.argsort(-merged.weights, kind="stable")[:most]
    return merged.take(heaviest), kept[leaders[heaviest]]


def extract_measured(
    posterior: GaussianMixture,
    parents: ndarray,
    measured: ndarray,
    log_odds: ndarray,
    predicted_weights: ndarray,
    threshold: float,
    spare: float,
) -> list[tuple[float, ndarray]]:
    """Each reported target's weight and mean; see :func:`tracker.phd.extract_measured`."""
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
