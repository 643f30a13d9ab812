"""Appearance models of tracklets, learnt from the recording, and their likelihood ratio."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.kernels import boxes as box_kernels
from tracker.smoothing.paths import Links, Paths
from tracker.smoothing.recording import CameraBoxes

_OWN = 0.7
"""Least association probability of a box that contributes to an appearance model."""

_ENOUGH = 0.2
"""Seconds of boxes in one camera that a model needs, at least :data:`_FEWEST` boxes."""

_FEWEST = 3
"""Least number of boxes of a model."""

_APART = 0.25
"""Seconds between the middle of a tracklet and each of its halves that are compared."""

_OUTLIERS = 0.02
"""Probability that the appearance is uninformative."""

_LATER = 0.1
"""Additional distance of one person's embeddings between tracklets, against within one."""

_NARROWEST = 0.1
"""Least standard deviation of the distances."""

_SAME, _OTHER = (0.15, 0.15), (0.8, 0.15)
"""Median and standard deviation of the distances where a recording has too few."""

_COMPARED = 5
"""Least number of distances of each kind for using those of the recording."""

_AT_ONCE = 2048
"""Number of pairs that are compared at once, which bounds the memory for long recordings."""


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """The mean embeddings of n tracklets in each of C cameras."""

    vectors: Float[ndarray, "n C A"]
    """Unit vectors, after the mean over all tracklets is subtracted; 0 where there is none."""
    known: Bool[ndarray, "n C"]
    """Whether a tracklet has an embedding in a camera."""

    def distances(self, one: ndarray, other: ndarray) -> Float[ndarray, "P C"]:
        """The distance (1 − cos) / 2 of pairs in each camera: 0 if equal, 1 if opposite."""
        cosines = np.empty((len(one), self.vectors.shape[1]))
        for first in range(0, len(one), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            cosines[some] = np.einsum(
                "pca,pca->pc", self.vectors[one[some]], self.vectors[other[some]]
            )
        return np.asarray((1.0 - cosines) / 2.0)


class Appearance:
    """A likelihood ratio of two tracklets having the same person, calibrated on the recording.

    The embedding of a tracklet in a camera is the mean of the unit vectors of its boxes that no
    other box overlaps, less the mean over all tracklets. Two tracklets are compared by the angle
    between their embeddings, in the cameras that have both. The distribution of one person's
    distances is estimated from the two halves of tracklets, that of two persons' from tracklets
    that exist at the same time; both are Gaussians of median and robust spread. Each camera's
    likelihood ratio includes a probability of being uninformative, so that no camera outweighs
    all others.
    """

    def __init__(
        self,
        tracklets: Paths,
        links: Links,
        cameras: Many[CameraBoxes],
        embeddings: Many[Float[ndarray, "B A"]],
        step_time: float,
    ) -> None:
        """Compute the embeddings of all tracklets, and the distributions of their distances.

        Args:
            tracklets: The n tracklets.
            links: Association probabilities of their rows and boxes.
            cameras: The boxes of each camera.
            embeddings: A unit vector for each box of each camera, 0 where there is none.
            step_time: Time between two steps, seconds.
        """
        fewest = max(_FEWEST, round(_ENOUGH / step_time))
        seen = [np.asarray(vectors.any(axis=1)) for vectors in embeddings]
        own = links.take(clean(links, cameras, seen))
        steps, owners = tracklets.steps[own.rows], tracklets.owners[own.rows]
        middle = ((tracklets.firsts + tracklets.lasts) / 2.0)[owners]
        apart = _APART / step_time
        size = (len(tracklets.labels), len(cameras))
        whole = _gather(own, owners, embeddings, size, fewest)
        early = steps < middle - apart
        late = steps > middle + apart
        first = _gather(own.take(early), owners[early], embeddings, size, fewest)
        second = _gather(own.take(late), owners[late], embeddings, size, fewest)
        common = whole.vectors.sum(axis=0) / np.maximum(whole.known.sum(axis=0), 1)[:, None]
        self._models = _less(whole, common)
        halves = Models(
            np.concatenate([_less(first, common).vectors, _less(second, common).vectors]),
            np.concatenate([first.known, second.known]),
        )
        one = np.arange(size[0])
        both = first.known & second.known
        same = halves.distances(one, one + size[0])[both]
        i, j = _together(tracklets)
        other = self._models.distances(i, j)[whole.known[i] & whole.known[j]]
        middle_same, spread_same = _median(same, _SAME)
        self._same = middle_same + _LATER / 2.0, float(np.hypot(spread_same, _LATER))
        self._other = _median(other, _OTHER)

    def log_ratio(
        self, earlier: Int[ndarray, " P"], later: Int[ndarray, " P"]
    ) -> tuple[Float[ndarray, " P"], Bool[ndarray, " P"]]:
        """The log likelihood ratio of pairs of tracklets being of one person against two.

        Args:
            earlier: Index of the first tracklet of each pair.
            later: Index of the second.

        Returns:
            The log ratio, 0 where no camera has both, and whether any camera has both.
        """
        known = self._models.known[earlier] & self._models.known[later]
        (low, narrow), (high, wide) = self._same, self._other
        if not high > low:  # appearance does not distinguish people here
            return np.zeros(len(earlier)), np.zeros(len(earlier), dtype=bool)
        # beyond the two medians a distance has the likelihood ratio of the median
        distances = np.clip(self._models.distances(earlier, later), low, high)
        one = np.exp(-0.5 * ((distances - low) / narrow) ** 2) / narrow
        two = np.exp(-0.5 * ((distances - high) / wide) ** 2) / wide
        ratio = np.log(
            ((1.0 - _OUTLIERS) * one + _OUTLIERS * two)
            / (_OUTLIERS * one + (1.0 - _OUTLIERS) * two)
        )
        return np.asarray((ratio * known).sum(axis=1)), known.any(axis=1)


def clean(
    links: Links, cameras: Many[CameraBoxes], seen: Many[Bool[ndarray, " B"]] | None = None
) -> Bool[ndarray, " L"]:
    """Select the links of boxes with a clear association that overlap no other box.

    Args:
        links: L associations of rows and boxes.
        cameras: The boxes of each camera.
        seen: Whether each box of each camera has an embedding; None for all.
    """
    found = links.shares > _OWN
    for c, camera in enumerate(cameras):
        good = box_kernels.alone(camera.boxes, camera.starts)
        if seen is not None:
            good &= seen[c]
        own = links.cameras == c
        found[own] &= good[links.boxes[own]]
    return np.asarray(found)


def _gather(
    links: Links,
    owners: Int[ndarray, " L"],
    embeddings: Many[Float[ndarray, "B A"]],
    size: tuple[int, int],
    fewest: int,
) -> Models:
    """Compute the mean embedding of each tracklet and camera, of unit length.

    Args:
        links: L associations of rows and boxes.
        owners: Tracklet of each association.
        embeddings: A unit vector for each box of each camera.
        size: Number of tracklets and of cameras.
        fewest: Least number of boxes of an embedding.
    """
    vectors = np.zeros((*size, embeddings[0].shape[1]))
    counts = np.zeros(size, dtype=np.int64)
    for c in range(size[1]):
        own = links.cameras == c
        rows = owners[own]
        order = np.argsort(rows, kind="stable")
        sorted_rows = rows[order]
        begins = np.flatnonzero(np.diff(sorted_rows, prepend=-1))
        if len(begins):
            vectors[sorted_rows[begins], c] = np.add.reduceat(
                embeddings[c][links.boxes[own][order]].astype(float), begins
            )
        counts[:, c] = np.bincount(rows, minlength=size[0])
    known = counts >= fewest
    return Models(_unit(vectors) * known[..., None], known)


def _less(models: Models, common: Float[ndarray, "C A"]) -> Models:
    """Subtract the mean over all tracklets from each embedding, and normalise."""
    return Models(_unit(models.vectors - common) * models.known[..., None], models.known)


def _unit(vectors: ndarray) -> ndarray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-9))


def _together(tracklets: Paths) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The pairs of tracklets that overlap in time, and so are of two people."""
    i, j = np.triu_indices(len(tracklets.labels), 1)
    lasts = tracklets.lasts
    overlap = np.minimum(lasts[i], lasts[j]) > np.maximum(tracklets.firsts[i], tracklets.firsts[j])
    return i[overlap], j[overlap]


def _median(values: ndarray, otherwise: tuple[float, float]) -> tuple[float, float]:
    """The median and the standard deviation estimated from absolute deviations."""
    if len(values) < _COMPARED:
        return otherwise
    middle = float(np.median(values))
    return middle, max(1.4826 * float(np.median(np.abs(values - middle))), _NARROWEST)
