"""Appearance of tracklets as a likelihood: two-covariance PLDA, learnt from the recording.

[SW10] Brümmer, de Villiers, "The speaker partitioning problem", Odyssey 2010: the two-covariance
model.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.kernels import boxes as box_kernels
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.recording import CameraBoxes

WINDOW = 4.0
"""Duration of the parts of tracklets of which the model is learnt, seconds: whole tracklets are too
few."""

DIMENSIONS = 24
"""Number of principal components of the embeddings."""

_OWN = 0.7
"""Least association probability of a box by which people with templates are told apart."""

_FEWEST = 5
"""Least number of parts, and of pairs of each kind, from which anything is learnt."""

_CORRELATION = 0.3
"""Correlation of the boxes of one tracklet, by which n boxes tell as much as n / (1 + 0.3 (n − 1)).
"""

_DRIFT = 0.15
"""Variance of one person's appearance between tracklets, in that between persons."""

_MOST = 6.0
"""Bound of the log ratio of a pair."""


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """The mean embeddings of n tracklets in D dimensions, and how well they are known."""

    values: Float[ndarray, "n D"]
    counts: Float[ndarray, " n"]
    """Weighted number of boxes, 0 without any."""

    @property
    def variances(self) -> Float[ndarray, " n"]:
        """Variance of a mean in units of that of one box, 1/n*; 1 without a box."""
        counts = np.where(self.counts > 0.0, self.counts, 1.0)
        return np.asarray((1.0 + _CORRELATION * (counts - 1.0)) / counts)


class AppearanceModel:
    """The log likelihood ratio of two tracklets having the same person, learnt from the recording.

    The two-covariance model [SW10]: embeddings, less the camera's mean, in the coordinates of their
    principal components in which those of one tracklet within some seconds have the covariance I,
    and those of different people N(0, B) with a diagonal B. The mean y of a tracklet over all its
    boxes, which count the less the more of them another box covers, has the variance
    v = 0.15 B + 1/n* for a person's own appearance, and

        log ratio = α Σ_d log N([y_i, y_j]; 0, [[B + v_i, B], [B, B + v_j]])
                            / N(y_i; 0, B + v_i) N(y_j; 0, B + v_j)

    with α by logistic regression between the halves of tracklets and tracklets that exist at the
    same time. Where a recording has too few of these, nothing is learnt and every ratio is 0.
    """

    def __init__(
        self,
        tracklets: Paths,
        links: Links,
        cameras: Many[CameraBoxes],
        embeddings: Many[Float[ndarray, "B A"]],
        step_time: float,
    ) -> None:
        """Learn the model, and compute the mean embeddings of all tracklets.

        Args:
            tracklets: The n tracklets.
            links: Association probabilities of their rows and boxes.
            cameras: The boxes of each camera.
            embeddings: A unit vector for each box of each camera, 0 where there is none.
            step_time: Time between two steps, seconds.
        """
        count = len(tracklets.labels)
        self._between, self._weight = np.zeros(0), 0.0
        self._means = Means(np.zeros((count, 0)), np.zeros(count))
        looks, weights, rows = _collect(links, cameras, embeddings)
        owners, steps = tracklets.owners[rows], tracklets.steps[rows]
        width = max(round(WINDOW / step_time), 1)
        parts = np.unique(
            owners * (int(steps.max(initial=0)) // width + 1) + steps // width, return_inverse=True
        )[1]
        learnt = _learn(looks, weights, parts)
        if learnt is None:
            return
        into, self._between = learnt
        looks = looks @ into
        self._means = _mean(looks, weights, owners, count)
        late = steps > ((tracklets.firsts + tracklets.lasts) / 2.0)[owners]
        halves = [_mean(looks[own], weights[own], owners[own], count) for own in (~late, late)]
        both = np.flatnonzero((halves[0].counts > 0.0) & (halves[1].counts > 0.0))
        same = self._ratio(*halves, both, both)
        i, j = _together(tracklets)
        seen = (self._means.counts[i] > 0.0) & (self._means.counts[j] > 0.0)
        other = self._ratio(self._means, self._means, i[seen], j[seen])
        if min(len(same), len(other)) >= _FEWEST:
            self._weight = _logistic(same, other)

    def log_ratio(
        self, earlier: Int[ndarray, " P"], later: Int[ndarray, " P"]
    ) -> tuple[Float[ndarray, " P"], Bool[ndarray, " P"]]:
        """The log likelihood ratio of pairs of tracklets being of one person against two.

        Args:
            earlier: Index of the first tracklet of each pair.
            later: Index of the second.

        Returns:
            The log ratio, 0 where nothing is known of either, and whether both are known.
        """
        counts = self._means.counts
        known = (counts[earlier] > 0.0) & (counts[later] > 0.0) & (self._weight > 0.0)
        ratio = self._weight * self._ratio(self._means, self._means, earlier, later)
        return np.where(known, np.clip(ratio, -_MOST, _MOST), 0.0), known

    def _ratio(
        self, one: Means, other: Means, i: Int[ndarray, " P"], j: Int[ndarray, " P"]
    ) -> Float[ndarray, " P"]:
        """The log ratio of pairs of means, with α = 1."""
        total = np.zeros(len(i))
        precision = [one.variances[i], other.variances[j]]
        for d, between in enumerate(self._between.tolist()):
            first, second = ((1.0 + _DRIFT) * between + variance for variance in precision)
            x, y = one.values[i, d], other.values[j, d]
            rest = first * second - between**2  # the determinant
            total -= 0.5 * np.log(rest / (first * second))
            total -= 0.5 * (x**2 * second + y**2 * first - 2.0 * between * x * y) / rest
            total += 0.5 * (x**2 / first + y**2 / second)
        return total


def _collect(
    links: Links, cameras: Many[CameraBoxes], embeddings: Many[Float[ndarray, "B A"]]
) -> tuple[Float[ndarray, "K A"], Float[ndarray, " K"], Int[ndarray, " K"]]:
    """The embeddings of links less each camera's mean, their weights a (1 − o)² and their rows."""
    looks, weights, rows = [], [], []
    for c, camera in enumerate(cameras):
        own = links.take(links.cameras == c)
        own = own.take(np.asarray(embeddings[c].any(axis=1))[own.boxes])
        covered = box_kernels.covered(camera.boxes, camera.starts)[own.boxes]
        found = np.asarray(embeddings[c], dtype=float)[own.boxes]
        weight = own.shares * (1.0 - covered) ** 2
        total = weight.sum()
        looks.append(found - (weight @ found) / (total if total > 0.0 else 1.0))
        weights.append(weight)
        rows.append(own.rows)
    return np.concatenate(looks), np.concatenate(weights), np.concatenate(rows)


def _learn(
    looks: Float[ndarray, "K A"], weights: Float[ndarray, " K"], parts: Int[ndarray, " K"]
) -> tuple[Float[ndarray, "A D"], Float[ndarray, " D"]] | None:
    """The map to the model's coordinates, and B in these; None where there are too few parts.

    Args:
        looks: Embeddings, less the mean.
        weights: Their weights.
        parts: The part of a tracklet that each belongs to.
    """
    several = np.bincount(parts, weights) > 1.0
    if several.sum() <= _FEWEST:
        return None
    _, axes = np.linalg.eigh((looks * weights[:, None]).T @ looks)
    into = axes[:, : -1 - min(DIMENSIONS, several.sum() - 1) : -1]
    found = _mean(looks @ into, weights, parts, len(several))
    apart = looks @ into - found.values[parts]
    freedom = (found.counts[several] - 1.0).sum()
    chosen = np.where(several[parts], weights, 0.0)
    within = (apart * chosen[:, None]).T @ apart / freedom
    sizes, axes = np.linalg.eigh(within)
    into = into @ (axes / np.sqrt(np.maximum(sizes, 1e-3 * sizes.max())))
    found = _mean(looks @ into, weights, parts, len(several))
    means = found.values[several]
    sizes, axes = np.linalg.eigh(means.T @ means / len(means))
    between = sizes - found.variances[several].mean()
    good = between > 0.0
    return into @ axes[:, good], between[good]


def _mean(
    looks: Float[ndarray, "K D"], weights: Float[ndarray, " K"], of: Int[ndarray, " K"], count: int
) -> Means:
    """The weighted mean of embeddings for each of some tracklets."""
    counts = np.bincount(of, weights, count)
    values = np.zeros((count, looks.shape[1]))
    np.add.at(values, of, weights[:, None] * looks)
    return Means(values / np.where(counts > 0.0, counts, 1.0)[:, None], counts)


def _logistic(same: Float[ndarray, " S"], other: Float[ndarray, " O"]) -> float:
    """α by logistic regression of both kinds, which count alike, between 0 and 1."""
    ratios = np.concatenate([same, other])
    signs = np.repeat([1.0, -1.0], [len(same), len(other)])
    shares = np.repeat([1.0 / len(same), 1.0 / len(other)], [len(same), len(other)])

    def slope(weight: float) -> float:
        """The derivative of the log likelihood, which decreases with the weight."""
        wrong = 1.0 / (1.0 + np.exp(np.clip(weight * ratios * signs, -500.0, 500.0)))
        return float((shares * signs * ratios * wrong).sum())

    low, high = 0.0, 1.0
    if slope(high) >= 0.0:
        return high
    for _ in range(30):
        middle = (low + high) / 2.0
        low, high = (middle, high) if slope(middle) > 0.0 else (low, middle)
    return low


def clean(links: Links, cameras: Many[CameraBoxes]) -> Bool[ndarray, " L"]:
    """Select the links of boxes with a clear association that overlap no other box.

    Args:
        links: L associations of rows and boxes.
        cameras: The boxes of each camera.
    """
    found = links.shares > _OWN
    for c, camera in enumerate(cameras):
        own = links.cameras == c
        found[own] &= box_kernels.alone(camera.boxes, camera.starts)[links.boxes[own]]
    return np.asarray(found)


def _together(tracklets: Paths) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The pairs of tracklets that overlap in time, and so are of two people."""
    i, j = np.triu_indices(len(tracklets.labels), 1)
    lasts = tracklets.lasts
    overlap = np.minimum(lasts[i], lasts[j]) > np.maximum(tracklets.firsts[i], tracklets.firsts[j])
    return i[overlap], j[overlap]
