"""Appearance of tracklets as a likelihood, and log odds of the people with templates.

The likelihood is that of probabilistic linear discriminant analysis (PLDA).

[PE07] Prince, Elder, "Probabilistic linear discriminant analysis for inferences about identity",
ICCV 2007.
[BV10] Brümmer, de Villiers, "The speaker partitioning problem", Odyssey 2010: the two-covariance
model.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.kernels import boxes as box_kernels
from tracker.parameters.groups.fusion import FusionParams
from tracker.single_view.protocol import ViewResult
from tracker.smoothing.paths import CameraBoxes, Links, Paths
from tracker.smoothing.smoother import Smoother
from tracker.steps import Steps
from tracker.steps.table import Table

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
class Means(Table):
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


_AS_THE_FILTER = FusionParams()
"""The filter's default parameters, by which colours are weighted whatever the filter is set to."""

_OWN = 0.7
"""Association probability above which the colours of a box count."""


@dataclass(frozen=True, slots=True, eq=False)
class Appearances:
    """The appearance of the boxes of all steps, camera by camera; None where none is known."""

    embeddings: Many[Float[ndarray, "B A"]] | None = None
    """A unit vector for each box, 0 where it has none."""
    likenesses: Many[Float[ndarray, "B G"]] | None = None
    """Probability of each of G people with templates for each box, 1/G each where it is unknown."""

    @staticmethod
    def of(views: Steps[tuple[ViewResult, ...]]) -> Appearances:
        """Collect the appearance of boxes from the results of stage 1 for each step."""
        return Appearances(_embeddings(views), _likenesses(views))


def _embeddings(views: Steps[tuple[ViewResult, ...]]) -> list[Float[ndarray, "B A"]] | None:
    """The embeddings of each camera's boxes; None where there are none, or of several sizes."""
    cameras = range(views.width or 0)
    shapes = {shape for c in cameras for shape in views.shapes("embeddings", c)}
    sizes = {size for (size,) in shapes if size}
    if len(sizes) != 1:
        return None
    size = sizes.pop()
    return [
        np.concatenate(
            [
                own if own.shape[1] else np.zeros((count, size))
                for own, count in _with_counts(views, "embeddings", c)
            ]
        )
        for c in cameras
    ]


def _likenesses(views: Steps[tuple[ViewResult, ...]]) -> list[Float[ndarray, "B G"]] | None:
    """The likelihoods of each camera's boxes for G people; None for fewer than two people."""
    cameras = range(views.width or 0)
    shapes = {shape for c in cameras for shape in views.shapes("likenesses", c)}
    people = max((size for (size,) in shapes), default=0)
    if people < 2:  # colours do not discriminate one person alone
        return None
    return [
        np.concatenate(
            [
                own if own.shape[1] == people else np.full((count, people), 1.0 / people)
                for own, count in _with_counts(views, "likenesses", c)
            ]
        )
        for c in cameras
    ]


def _with_counts(
    views: Steps[tuple[ViewResult, ...]], name: str, camera: int
) -> Iterator[tuple[ndarray, int]]:
    """The arrays of a field at each step, and the number of boxes."""
    counts = views.column("boxes", camera).counts.tolist()
    return zip(views.values(name, camera), counts, strict=True)


def template_log_odds(
    tracklets: Paths, links: Links, smoother: Smoother, seen: Appearances, weight: float
) -> Float[ndarray, "n G"]:
    """Compute the log likelihood of each tracklet's colours under each of G people with templates.

        u_g = α Δt/τ Σ_z a(z) log (ε + (1 − ε) G p_g(z)),   less the largest

    over the boxes z of the tracklet that no other box touches, with association probability a. The
    filter's re-identification has the same evidence step by step, also when two people have just
    been one blob; here it is summed over whole tracklets. p_g is the relative likelihood among the
    templates: a person without a template resembles one of them too, but consistently the same.

    Args:
        tracklets: The n tracklets.
        links: Association probabilities of their rows and boxes.
        smoother: The boxes and the time of a step, Δt.
        seen: p_g of each box.
        weight: α, the weight of the appearance.

    Returns:
        Log likelihoods less the largest of each tracklet, at most 0; of shape (n, 1) where no
        box has likelihoods.
    """
    if seen.likenesses is None:
        return np.zeros((len(tracklets.labels), 1))
    own = links.take(_clear(links, smoother.cameras))
    owners = tracklets.owners[own.rows]
    people = seen.likenesses[0].shape[1]
    scores = np.zeros((len(tracklets.labels), people))
    outliers = _AS_THE_FILTER.recognition_outlier_probability
    fresh = weight * min(smoother.model.step_time / _AS_THE_FILTER.recognition_interval, 1.0)
    for c, likeness in enumerate(seen.likenesses):
        of_camera = own.cameras == c
        odds = np.log(outliers + (1.0 - outliers) * people * likeness[own.boxes[of_camera]])
        share = fresh * own.shares[of_camera]
        np.add.at(scores, owners[of_camera], share[:, None] * odds)
    return np.asarray(scores - scores.max(axis=1, keepdims=True))


def _clear(links: Links, cameras: Many[CameraBoxes]) -> Bool[ndarray, " L"]:
    """Select the links of boxes with a clear association that overlap no other box."""
    result = links.shares > _OWN
    for c, camera in enumerate(cameras):
        own = links.cameras == c
        result[own] &= box_kernels.alone(camera.boxes, camera.starts)[links.boxes[own]]
    return np.asarray(result)


def sum_by_chain(scores: Float[ndarray, "n G"], chains: Many[Many[int]]) -> Float[ndarray, "m G"]:
    """Sum the log likelihoods over the tracklets of each chain, less the largest of each chain.

    Args:
        scores: Log likelihood of each of n tracklets under each of G people.
        chains: The tracklets of each of m chains.
    """
    whole = np.array([scores[list(chain)].sum(axis=0) for chain in chains]).reshape(
        -1, scores.shape[1]
    )
    return np.asarray(whole - whole.max(axis=1, keepdims=True))
