"""Gradient boosting of trees, brought into the form that the kernel reads."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.single_view.shape.finder import Trees

ROUNDS, RATE, MOST = 200, 0.2, 160_000
GIVEN_UP = 0.002
"""Share of the people found that each tree of the cascade may lose."""
_FOUND, _SLACK = -1.0, 0.1
_EVERYTHING = 255


def fit(means: ndarray, people: ndarray) -> Trees:
    """Trees for windows of which some show people.

    Args:
        means: (N, features) uint8.
        people: (N,) bool.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier

    model = HistGradientBoostingClassifier(
        max_iter=ROUNDS, learning_rate=RATE, max_leaf_nodes=8, max_depth=3, min_samples_leaf=60,
        l2_regularization=5.0, max_features=0.2, early_stopping=False, random_state=0,
        max_bins=64,
    )  # fmt: skip
    if len(means) > MOST:
        some = np.random.default_rng(0).choice(len(means), MOST, replace=False)
        means, people = means[some], people[some]
    model.fit(means, people)
    grown = [predictors[0].nodes for predictors in model._predictors]
    features = np.zeros((len(grown), 7), dtype=np.int32)
    thresholds = np.full((len(grown), 7), _EVERYTHING, dtype=np.int32)
    leaves = np.zeros((len(grown), 8), dtype=np.float32)
    for tree, nodes in enumerate(grown):
        _put(nodes, 0, 0, features[tree], thresholds[tree], leaves[tree])
    leaves[0] += float(np.ravel(model._baseline_prediction)[0])
    sums = running_sums(means[people], features, thresholds, leaves)
    kept = sums[:, sums[-1] > _FOUND]
    least = np.quantile(kept, GIVEN_UP, axis=1) - _SLACK
    return Trees(features, thresholds, leaves, least.astype(np.float32))


def _put(
    nodes: ndarray, source: int, place: int, features: ndarray, thresholds: ndarray, leaves: ndarray
) -> None:
    """One node and all below it, as a tree of full depth: where it ended, both ways are one."""
    node = nodes[source]
    if place >= len(features):
        leaves[place - len(features)] = node["value"]
        return
    ways = (source, source)
    if not node["is_leaf"]:
        features[place] = node["feature_idx"]
        thresholds[place] = int(np.floor(node["num_threshold"]))
        ways = (int(node["left"]), int(node["right"]))
    for way, next_place in zip(ways, (2 * place + 1, 2 * place + 2), strict=True):
        _put(nodes, way, next_place, features, thresholds, leaves)


def running_sums(
    means: ndarray, features: ndarray, thresholds: ndarray, leaves: ndarray
) -> ndarray:
    """What the trees up to each add up to, (T, N)."""
    values, rows = [], np.arange(len(means))
    for feature, threshold, leaf in zip(features, thresholds, leaves, strict=True):
        node = np.zeros(len(means), dtype=np.int64)
        for _ in range(3):
            left = means[rows, feature[node]] <= threshold[node]
            node = 2 * node + np.where(left, 1, 2)
        values.append(leaf[node - 7])
    return np.cumsum(values, axis=0)
