"""What people look like, gathered from the recording itself, and whether two pieces look alike."""

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
"""Association probability of a box that tells what its person looks like."""

_ENOUGH = 0.2
"""Seconds of boxes in one camera that make a model; at least :data:`_FEWEST` boxes."""

_FEWEST = 3

_APART = 0.25
"""Seconds from the middle of a piece at which its halves begin that are compared."""

_DOUBT = 0.02
"""Probability that looks tell nothing of who it is."""

_LATER = 0.1
"""How much further apart the same person's looks are later than within one piece."""

_NARROWEST = 0.1
"""Of the spread of distances, whatever few of them say."""

_SAME, _OTHER = (0.15, 0.15), (0.8, 0.15)
"""Median and spread of the distances where a recording has too few of its own."""

_COMPARED = 5
"""Distances of each kind from which the recording's own are taken."""

_AT_ONCE = 2048
"""Pairs whose looks are in memory together: of a long recording there are millions."""


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """The looks of n pieces in each of C cameras."""

    vectors: Float[ndarray, "n C A"]
    """Of unit length, less what all have in common; 0 where there is none."""
    known: Bool[ndarray, "n C"]

    def distances(self, one: ndarray, other: ndarray) -> Float[ndarray, "P C"]:
        """(1 − cos) / 2 of pairs in each camera: 0 for the same looks, 1 for opposite ones."""
        cosines = np.empty((len(one), self.vectors.shape[1]))
        for first in range(0, len(one), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            cosines[some] = np.einsum(
                "pca,pca->pc", self.vectors[one[some]], self.vectors[other[some]]
            )
        return np.asarray((1.0 - cosines) / 2.0)


class Appearance:
    """Whether two pieces look like one person: a likelihood ratio calibrated on the recording.

    Every piece gathers in each camera the mean of the unit vectors of boxes that nobody else
    overlaps. What all have in common in a camera is taken off, and two pieces are compared
    in the cameras that know both, by the angle between what is left. How far apart one
    person's looks are is read off the halves of pieces, how far two persons' off pieces that
    live at the same time; both as Gaussians of median and spread. The log likelihood ratio of
    each camera counts with a doubt, so that none decides alone against all others.
    """

    def __init__(
        self,
        pieces: Paths,
        links: Links,
        cameras: Many[CameraBoxes],
        looks: Many[Float[ndarray, "B A"]],
        step_time: float,
    ) -> None:
        """Gather.

        Args:
            pieces: Whose looks.
            links: Whose box each is.
            cameras: The boxes.
            looks: A unit vector for each box of each camera, 0 where there is none.
            step_time: Seconds.
        """
        fewest = max(_FEWEST, round(_ENOUGH / step_time))
        seen = [np.asarray(vectors.any(axis=1)) for vectors in looks]
        own = links.take(clean(links, cameras, seen))
        steps, owners = pieces.steps[own.rows], pieces.owners[own.rows]
        middle = ((pieces.firsts + pieces.lasts) / 2.0)[owners]
        apart = _APART / step_time
        size = (len(pieces.labels), len(cameras))
        whole = _gather(own, owners, looks, size, fewest)
        early = steps < middle - apart
        late = steps > middle + apart
        first = _gather(own.take(early), owners[early], looks, size, fewest)
        second = _gather(own.take(late), owners[late], looks, size, fewest)
        common = whole.vectors.sum(axis=0) / np.maximum(whole.known.sum(axis=0), 1)[:, None]
        self._models = _less(whole, common)
        halves = Models(
            np.concatenate([_less(first, common).vectors, _less(second, common).vectors]),
            np.concatenate([first.known, second.known]),
        )
        one = np.arange(size[0])
        both = first.known & second.known
        same = halves.distances(one, one + size[0])[both]
        i, j = _together(pieces)
        other = self._models.distances(i, j)[whole.known[i] & whole.known[j]]
        middle_same, spread_same = _median(same, _SAME)
        self._same = middle_same + _LATER / 2.0, float(np.hypot(spread_same, _LATER))
        self._other = _median(other, _OTHER)

    def log_ratio(
        self, earlier: Int[ndarray, " P"], later: Int[ndarray, " P"]
    ) -> tuple[Float[ndarray, " P"], Bool[ndarray, " P"]]:
        """log of how much likelier the looks of two pieces are one person's than two persons'.

        Returns:
            The log ratio, 0 where no camera knows both, and whether any does.
        """
        known = self._models.known[earlier] & self._models.known[later]
        (low, narrow), (high, wide) = self._same, self._other
        if not high > low:  # here all look alike
            return np.zeros(len(earlier)), np.zeros(len(earlier), dtype=bool)
        # beyond the two medians a distance says no more than at them
        distances = np.clip(self._models.distances(earlier, later), low, high)
        one = np.exp(-0.5 * ((distances - low) / narrow) ** 2) / narrow
        two = np.exp(-0.5 * ((distances - high) / wide) ** 2) / wide
        ratio = np.log(
            ((1.0 - _DOUBT) * one + _DOUBT * two) / (_DOUBT * one + (1.0 - _DOUBT) * two)
        )
        return np.asarray((ratio * known).sum(axis=1)), known.any(axis=1)


def clean(
    links: Links, cameras: Many[CameraBoxes], seen: Many[Bool[ndarray, " B"]] | None = None
) -> Bool[ndarray, " L"]:
    """Links of boxes that are surely somebody's and touch no other box; of each camera only those
    of which there is something to see, where that is told."""
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
    looks: Many[Float[ndarray, "B A"]],
    size: tuple[int, int],
    fewest: int,
) -> Models:
    """The mean looks of each piece and camera, of unit length."""
    vectors = np.zeros((*size, looks[0].shape[1]))
    counts = np.zeros(size, dtype=np.int64)
    for c in range(size[1]):
        own = links.cameras == c
        rows = owners[own]
        order = np.argsort(rows, kind="stable")
        sorted_rows = rows[order]
        begins = np.flatnonzero(np.diff(sorted_rows, prepend=-1))
        if len(begins):
            vectors[sorted_rows[begins], c] = np.add.reduceat(
                looks[c][links.boxes[own][order]].astype(float), begins
            )
        counts[:, c] = np.bincount(rows, minlength=size[0])
    known = counts >= fewest
    return Models(_unit(vectors) * known[..., None], known)


def _less(models: Models, common: Float[ndarray, "C A"]) -> Models:
    """Without what all have in common."""
    return Models(_unit(models.vectors - common) * models.known[..., None], models.known)


def _unit(vectors: ndarray) -> ndarray:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-9))


def _together(pieces: Paths) -> tuple[Int[ndarray, " P"], Int[ndarray, " P"]]:
    """The pairs of pieces that live at the same time: two people."""
    i, j = np.triu_indices(len(pieces.labels), 1)
    lasts = pieces.lasts
    overlap = np.minimum(lasts[i], lasts[j]) > np.maximum(pieces.firsts[i], pieces.firsts[j])
    return i[overlap], j[overlap]


def _median(values: ndarray, otherwise: tuple[float, float]) -> tuple[float, float]:
    """Median and robust spread."""
    if len(values) < _COMPARED:
        return otherwise
    middle = float(np.median(values))
    return middle, max(1.4826 * float(np.median(np.abs(values - middle))), _NARROWEST)
