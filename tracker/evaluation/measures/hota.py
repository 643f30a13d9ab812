"""HOTA: detection and association in balance, averaged over localisation thresholds.

[LODTGLL21] Luiten, Ošep, Dendorfer, Torr, Geiger, Leal-Taixé, Leibe, "HOTA: a
higher order metric for evaluating multi-object tracking", IJCV 129, 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.evaluation.measures.matching import Comparison
from tracker.geometry.assignment import linear_sum_assignment

ALPHAS = np.arange(1, 20) * 0.05
"""The localisation thresholds α: the least similarity of a pair that counts, 0.05 … 0.95."""

_TINY = np.finfo(float).eps


@dataclass(frozen=True, slots=True, eq=False)
class Hota:
    """The scores at each α; the figures are their means."""

    detection: Float[ndarray, " A"]
    """DetA = TP / (TP + FN + FP)."""
    association: Float[ndarray, " A"]
    """AssA: mean over the pairs of TPA / (TPA + FNA + FPA); 0 without pairs."""
    localisation: Float[ndarray, " A"]
    """LocA: mean similarity of the pairs; 1 at an α without pairs."""

    @property
    def hota(self) -> Float[ndarray, " A"]:
        """√(DetA · AssA)."""
        return np.asarray(np.sqrt(self.detection * self.association))


def hota(comparison: Comparison) -> Hota | None:
    """Compute HOTA with the similarity 1 − distance / gate, which is 0 from the gate on.

    With a gate of 1 m, α = 0.05 requires a distance of at most 0.95 m, and α = 0.95 one of at most
    0.05 m. At each step people and estimates are paired so that the sum of similarity times
    alignment is largest; the alignment of a person and a track is the Jaccard index of their steps,
    weighted by similarity. A pair counts at every α up to its similarity [LODTGLL21].

    The result is None where there are neither people nor estimates; its scores are zeros (LocA 1)
    where there are only people or only estimates.
    """
    truth, tracks = comparison.truth, comparison.tracks
    people, estimates = len(truth), len(tracks)
    if not people and not estimates:
        return None
    similarities = [
        np.maximum(1.0 - distances / comparison.measure.gate, 0.0)
        for distances in comparison.distances
    ]
    present = np.bincount(truth.indices, minlength=len(truth.names))[:, None]
    reported = np.bincount(tracks.indices, minlength=len(tracks.names))
    aligned = np.zeros((len(truth.names), len(tracks.names)))
    for step, similarity in enumerate(similarities):
        if similarity.size:
            rivals = similarity.sum(axis=0) + similarity.sum(axis=1)[:, None] - similarity
            share = np.divide(
                similarity, rivals, out=np.zeros_like(similarity), where=rivals > _TINY
            )
            aligned[np.ix_(truth.indices[truth.at(step)], tracks.indices[tracks.at(step)])] += share
    alignment = aligned / np.maximum(present + reported - aligned, _TINY)

    people_of, tracks_of, similarity_of = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
    for step, similarity in enumerate(similarities):
        if similarity.size:
            persons = truth.indices[truth.at(step)]
            ids = tracks.indices[tracks.at(step)]
            score = alignment[np.ix_(persons, ids)] * similarity
            rows, columns = linear_sum_assignment(score, maximize=True)
            people_of.append(persons[rows])
            tracks_of.append(ids[columns])
            similarity_of.append(similarity[rows, columns])
    return _scores(
        np.concatenate(people_of),
        np.concatenate(tracks_of),
        np.concatenate(similarity_of),
        present,
        reported,
    )


def _scores(
    people_of: ndarray,
    tracks_of: ndarray,
    similarity_of: ndarray,
    present: ndarray,
    reported: ndarray,
) -> Hota:
    """Compute DetA, AssA and LocA at each α.

    Args:
        people_of: The index of the person of each of M pairs, over all steps.
        tracks_of: The index of the track of each pair.
        similarity_of: The similarity of each pair, 0 … 1.
        present: The number of steps of each of K people, as a column (K, 1).
        reported: The number of steps of each track.
    """
    people, estimates = int(present.sum()), int(reported.sum())
    detection, association, localisation = np.zeros(19), np.zeros(19), np.ones(19)
    shape = (len(present), len(reported))
    for a, alpha in enumerate(ALPHAS):
        counted = similarity_of >= alpha - _TINY
        pairs = int(counted.sum())
        detection[a] = pairs / (people + estimates - pairs)
        if pairs:
            flat = np.ravel_multi_index((people_of[counted], tracks_of[counted]), shape)
            together = np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)
            overlap = together / np.maximum(present + reported - together, 1)
            association[a] = float((together * overlap).sum()) / pairs
            localisation[a] = float(similarity_of[counted].mean())
    return Hota(detection, association, localisation)
