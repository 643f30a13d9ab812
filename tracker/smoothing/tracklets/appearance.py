"""Appearance of tracklets as a likelihood: probabilistic linear discriminant analysis (PLDA).

[PE07] Prince, Elder, "Probabilistic linear discriminant analysis for inferences about identity",
ICCV 2007.
[BV10] Brümmer, de Villiers, "The speaker partitioning problem", Odyssey 2010: the two-covariance
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

_WINDOW = 4.0
"""Duration of the parts of tracklets from which the model is learnt, seconds: whole tracklets are
too few."""

_DIMENSIONS = 24
"""Largest number of principal components of the embeddings."""

_FEWEST = 5
"""Least number of parts, and of pairs of each kind, from which anything is learnt."""

_CORRELATION = 0.3
"""Correlation of the boxes of one tracklet: n boxes have the information of n / (1 + 0.3 (n − 1))
independent ones. From 0.1 to 0.7 the IDF1 of five of the six pairs of cameras of ``cmc2-looks``
changes by at most 0.0005; that of the sixth is higher by 0.026 at 0.1."""

_DRIFT = 0.15
"""Variance of one person's appearance between tracklets, as a share of that between persons. From
0.05 to 0.45 the IDF1 of each pair of cameras of ``cmc2-looks`` changes by at most 0.0002."""

_ROUNDING = 1e-6
"""Least variance within a tracklet: that of unit vectors in half precision, 2⁻¹⁰ squared."""

_MOST = 6.0
"""Bound of the log ratio of a pair: however many boxes there are, the model is an approximation."""


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """The mean embeddings of n tracklets in D dimensions, and the number of boxes of each."""

    values: Float[ndarray, "n D"]
    """Mean embedding of each tracklet, 0 without a box."""
    counts: Float[ndarray, " n"]
    """Weighted number of boxes; 0 without any."""

    @property
    def variances(self) -> Float[ndarray, " n"]:
        """Variance of each mean in units of that of one box; 1 without a box."""
        counts = np.where(self.counts > 0.0, self.counts, 1.0)
        return np.asarray((1.0 + _CORRELATION * (counts - 1.0)) / counts)

    def take(self, chosen: ndarray) -> Means:
        """Select the means of some tracklets, by mask or index."""
        return Means(self.values[chosen], self.counts[chosen])


class AppearanceModel:
    """The log likelihood ratio of two tracklets being of one person, learnt from the recording.

    The model is PLDA [PE07] in the two-covariance form [BV10]. The mean of each camera is
    subtracted from its embeddings, which are mapped to coordinates in which those of one tracklet
    within some seconds have the covariance I, and the means of persons the distribution N(0, B)
    with a diagonal B. A tracklet is represented by the weighted mean of all its boxes, and a pair
    has the ratio of :func:`log_ratio_of` times β, clipped to ±6. β, at most 1, is the slope of a
    logistic regression between halves of one tracklet and tracklets that exist at the same time.
    Where a recording has too few of these, nothing is learnt and every ratio is 0.
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
        self._between, self._slope = np.zeros(0), 0.0
        self._means = Means(np.zeros((count, 0)), np.zeros(count))
        vectors, weights, rows = _weighted_embeddings(links, cameras, embeddings)
        owners, steps = tracklets.owners[rows], tracklets.steps[rows]
        windows = steps // max(round(_WINDOW / step_time), 1)
        parts = np.unique(owners * (windows.max(initial=0) + 1) + windows, return_inverse=True)[1]
        learnt = learn_covariances(vectors, weights, parts)
        if learnt is None:
            return
        projection, self._between = learnt
        vectors = vectors @ projection
        self._means = _means(vectors, weights, owners, count)
        late = steps > ((tracklets.firsts + tracklets.lasts) / 2.0)[owners]
        first, second = (
            _means(vectors[half], weights[half], owners[half], count) for half in (~late, late)
        )
        both = (first.counts > 0.0) & (second.counts > 0.0)
        same = log_ratio_of(self._between, first.take(both), second.take(both))
        i, j = _overlapping_pairs(tracklets)
        seen = (self._means.counts[i] > 0.0) & (self._means.counts[j] > 0.0)
        one, two = self._means.take(i[seen]), self._means.take(j[seen])
        other = log_ratio_of(self._between, one, two)
        if min(len(same), len(other)) >= _FEWEST:
            self._slope = logistic_slope(same, other)

    def log_ratio(
        self, earlier: Int[ndarray, " P"], later: Int[ndarray, " P"]
    ) -> tuple[Float[ndarray, " P"], Bool[ndarray, " P"]]:
        """Compute the log likelihood ratio of pairs of tracklets.

        Args:
            earlier: Index of the first of each of P pairs.
            later: Index of the second.

        Returns:
            The log ratio, 0 where either has no embedding or nothing was learnt, and whether both
            have embeddings and something was learnt.
        """
        one, two = self._means.take(earlier), self._means.take(later)
        known = (one.counts > 0.0) & (two.counts > 0.0) & (self._slope > 0.0)
        ratio = np.clip(self._slope * log_ratio_of(self._between, one, two), -_MOST, _MOST)
        return np.where(known, ratio, 0.0), known


def log_ratio_of(between: Float[ndarray, " D"], one: Means, other: Means) -> Float[ndarray, " P"]:
    """Compute the log likelihood ratio of one person against two for P pairs of means.

    With the variance v = 0.15 B + 1/n* of a mean y, of a person's change of appearance and of the
    n* independent boxes that it is worth, the ratio is

        Σ_d log N([y_i, y_j]; 0, [[B + v_i, B], [B, B + v_j]])
                / N(y_i; 0, B + v_i) N(y_j; 0, B + v_j)

    Args:
        between: B, the variances between persons, in units of that within tracklets.
        one: Mean embeddings of the first of each pair.
        other: Mean embeddings of the second.
    """
    total = np.zeros(len(one.counts))
    variances = one.variances, other.variances
    # dimension by dimension: of many pairs all dimensions at once need much memory
    for d, shared in enumerate(between.tolist()):
        first, second = ((1.0 + _DRIFT) * shared + variance for variance in variances)
        x, y = one.values[:, d], other.values[:, d]
        determinant = first * second - shared**2
        total -= 0.5 * np.log(determinant / (first * second))
        total -= 0.5 * (x**2 * second + y**2 * first - 2.0 * shared * x * y) / determinant
        total += 0.5 * (x**2 / first + y**2 / second)
    return total


def learn_covariances(
    vectors: Float[ndarray, "K A"], weights: Float[ndarray, " K"], parts: Int[ndarray, " K"]
) -> tuple[Float[ndarray, "A D"], Float[ndarray, " D"]] | None:
    """Estimate the covariances within and between the parts of tracklets.

    Args:
        vectors: Embeddings of K boxes, less the mean.
        weights: Weight of each, 0 … 1.
        parts: Index of the part of a tracklet that each belongs to.

    Returns:
        The projection to coordinates in which the covariance within parts is I and that between
        them diagonal, and its diagonal B > 0; None if too few parts have more than one box, or if
        these do not differ.
    """
    several = np.bincount(parts, weights) > 1.0
    if several.sum() < _FEWEST:
        return None
    _, axes = np.linalg.eigh((vectors * weights[:, None]).T @ vectors)
    projection = axes[:, : -1 - min(_DIMENSIONS, several.sum() - 1) : -1]
    means = _means(vectors @ projection, weights, parts, len(several))
    residuals = vectors @ projection - means.values[parts]
    used = np.where(several[parts], weights, 0.0)
    within = (residuals * used[:, None]).T @ residuals / (means.counts[several] - 1.0).sum()
    sizes, axes = np.linalg.eigh(within)
    sizes = np.maximum(sizes, max(1e-3 * sizes.max(), _ROUNDING))
    projection = projection @ (axes / np.sqrt(sizes))
    means = _means(vectors @ projection, weights, parts, len(several)).take(several)
    sizes, axes = np.linalg.eigh(means.values.T @ means.values / len(means.counts))
    between = sizes - means.variances.mean()
    good = between > 0.0
    return (projection @ axes[:, good], between[good]) if good.any() else None


def logistic_slope(same: Float[ndarray, " S"], other: Float[ndarray, " O"]) -> float:
    """Calibrate log ratios by logistic regression without an offset; both kinds count alike.

    Args:
        same: Log ratios of S pairs of one person.
        other: Log ratios of O pairs of two persons.

    Returns:
        The factor of the log ratios, 0 … 1: a model that is too sure of itself is corrected, one
        that is too cautious is not.
    """
    margins = np.concatenate([same, -other])
    shares = np.repeat([1.0 / len(same), 1.0 / len(other)], [len(same), len(other)])

    def derivative(slope: float) -> float:
        """The derivative of the log likelihood, which decreases with the slope."""
        wrong = 1.0 / (1.0 + np.exp(np.clip(slope * margins, -500.0, 500.0)))
        return float((shares * margins * wrong).sum())

    low, high = 0.0, 1.0
    if derivative(high) >= 0.0:
        return high
    for _ in range(30):
        middle = (low + high) / 2.0
        low, high = (middle, high) if derivative(middle) > 0.0 else (low, middle)
    return low


def _weighted_embeddings(
    links: Links, cameras: Many[CameraBoxes], embeddings: Many[Float[ndarray, "B A"]]
) -> tuple[Float[ndarray, "K A"], Float[ndarray, " K"], Int[ndarray, " K"]]:
    """The embeddings of links less each camera's mean, their weights and their rows.

    The weight is the association probability times (1 − o)², o being the largest share of the box
    that another box covers.
    """
    vectors, weights, rows = [], [], []
    for c, camera in enumerate(cameras):
        own = links.take(links.cameras == c)
        own = own.take(np.asarray(embeddings[c].any(axis=1))[own.boxes])
        covered = box_kernels.covered(camera.boxes, camera.starts)[own.boxes]
        values = np.asarray(embeddings[c], dtype=float)[own.boxes]
        weight = own.shares * (1.0 - covered) ** 2
        total = weight.sum()
        vectors.append(values - weight @ values / (total if total > 0.0 else 1.0))
        weights.append(weight)
        rows.append(own.rows)
    return np.concatenate(vectors), np.concatenate(weights), np.concatenate(rows)


def _means(
    vectors: Float[ndarray, "K D"],
    weights: Float[ndarray, " K"],
    of: Int[ndarray, " K"],
    count: int,
) -> Means:
    """The weighted mean of the vectors of each of ``count`` tracklets; 0 where there are none."""
    counts = np.bincount(of, weights, count)
    values = np.zeros((count, vectors.shape[1]))
    np.add.at(values, of, weights[:, None] * vectors)
    return Means(values / np.where(counts > 0.0, counts, 1.0)[:, None], counts)


def _overlapping_pairs(tracklets: Paths) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The pairs of tracklets that overlap in time, and so are of two people."""
    i, j = np.triu_indices(len(tracklets.labels), 1)
    lasts = tracklets.lasts
    overlap = np.minimum(lasts[i], lasts[j]) > np.maximum(tracklets.firsts[i], tracklets.firsts[j])
    return i[overlap], j[overlap]
