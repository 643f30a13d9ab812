"""HOTA: detection and association in balance, averaged over localisation thresholds.

[LODTGLL21] Luiten, Ošep, Dendorfer, Torr, Geiger, Leal-Taixé, Leibe, "HOTA: a
higher order metric for evaluating multi-object tracking", IJCV 129, 2021.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.evaluation.figures import GATED, Definition, mean
from tracker.evaluation.matching import Comparison
from tracker.geometry.assignment import linear_sum_assignment

LODTGLL21 = "Luiten et al., IJCV 129, 2021"

ALPHAS = np.arange(1, 20) * 0.05
"""The localisation thresholds α: the least similarity of a pair that counts, 0.05 … 0.95
[LODTGLL21]."""

_TINY = np.finfo(float).eps
"""Guards divisions by zero and the comparison with α against rounding, as in TrackEval."""


@dataclass(frozen=True, slots=True, eq=False)
class Hota:
    """The scores at each α; the figures are their means."""

    detection: Float[ndarray, " A"]
    """DetA = TP / (TP + FN + FP)."""
    association: Float[ndarray, " A"]
    """AssA: mean over the pairs of TPA / (TPA + FNA + FPA); 0 without pairs."""
    localisation: Float[ndarray, " A"]
    """LocA: mean similarity of the pairs; 1 at an α without pairs."""
    within_gate: bool
    """Whether any person and estimate lie within the gate; LocA has no meaning otherwise."""

    @property
    def hota(self) -> Float[ndarray, " A"]:
        """√(DetA · AssA)."""
        return np.asarray(np.sqrt(self.detection * self.association))


HOTA: tuple[Definition[Hota | None], ...] = (
    Definition("hota", "HOTA", "HOTA", "", "higher", 3, GATED,
        "√(DetA · AssA), mean over α = 0.05 … 0.95; similarity = 1 − distance / gate.",
        lambda h: mean(h.hota) if h else None, LODTGLL21, True),
    Definition("deta", "DetA", "HOTA", "", "higher", 3, GATED,
        "Detection: TP / (TP + missed + false), mean over α.",
        lambda h: mean(h.detection) if h else None, LODTGLL21),
    Definition("assa", "AssA", "HOTA", "", "higher", 3, GATED,
        "Association: how much of its person's and its track's life each pair's two ids share, "
        "mean over the pairs and α.",
        lambda h: mean(h.association) if h else None, LODTGLL21),
    Definition("loca", "LocA", "HOTA", "", "higher", 3, GATED,
        "Localisation: mean similarity of the pairs, mean over α.",
        lambda h: mean(h.localisation) if h and h.within_gate else None, LODTGLL21),
)  # fmt: skip


def hota(comparison: Comparison) -> Hota | None:
    """Compute HOTA with the similarity 1 − distance / gate, which is 0 from the gate on.

    With a gate of 1 m, α = 0.05 requires a distance of at most 0.95 m, and α = 0.95 one of at most
    0.05 m. At each step people and estimates are paired so that the sum of similarity times
    alignment is largest; the alignment of a person and a track is the Jaccard index of their steps,
    weighted by similarity. A pair counts at every α up to its similarity [LODTGLL21].

    The result is None where there are neither people nor estimates; its scores are zeros (LocA 1)
    where there are only people or only estimates.
    """
    truth, tracks, gate = comparison.truth, comparison.tracks, comparison.measure.gate
    people, estimates = len(truth), len(tracks)
    if not people and not estimates:
        return None
    steps = [
        (who, which, np.maximum(1.0 - distances / gate, 0.0))
        for who, which, distances in comparison.by_step()
        if distances.size
    ]
    present = np.bincount(truth.indices, minlength=len(truth.names))[:, None]
    reported = np.bincount(tracks.indices, minlength=len(tracks.names))
    aligned = np.zeros((len(truth.names), len(tracks.names)))
    for who, which, similarity in steps:
        rivals = similarity.sum(axis=0) + similarity.sum(axis=1)[:, None] - similarity
        aligned[np.ix_(who, which)] += np.divide(
            similarity, rivals, out=np.zeros_like(similarity), where=similarity > 0.0
        )
    alignment = aligned / np.maximum(present + reported - aligned, _TINY)

    person_of, track_of, similarity_of = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
    for who, which, similarity in steps:
        score = alignment[np.ix_(who, which)] * similarity
        rows, columns = linear_sum_assignment(score, maximize=True)
        person_of.append(who[rows])
        track_of.append(which[columns])
        similarity_of.append(similarity[rows, columns])
    similarities = np.concatenate(similarity_of)
    pair = (np.concatenate(person_of), np.concatenate(track_of))

    detection, association, localisation = np.zeros((3, len(ALPHAS)))
    localisation += 1.0
    for a, alpha in enumerate(ALPHAS):
        counted = similarities >= alpha - _TINY
        pairs = int(counted.sum())
        detection[a] = pairs / (people + estimates - pairs)
        if pairs:
            together = np.zeros(aligned.shape, dtype=np.int64)
            np.add.at(together, (pair[0][counted], pair[1][counted]), 1)
            overlap = together / np.maximum(present + reported - together, 1)
            association[a] = float((together * overlap).sum()) / pairs
            localisation[a] = float(similarities[counted].mean())
    within_gate = any(bool((distances <= gate).any()) for distances in comparison.distances)
    return Hota(detection, association, localisation, within_gate)
