"""Identity precision, recall and F1: each person has one track over the whole sequence.

[RSZCT16] Ristani, Solera, Zou, Cucchiara, Tomasi, "Performance measures and a data
set for multi-target, multi-camera tracking", ECCV workshops 2016.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from tracker.evaluation.figures import GATED, Definition
from tracker.evaluation.matching import Comparison
from tracker.geometry.assignment import linear_sum_assignment

RSZCT16 = "Ristani et al., ECCV workshops 2016"


@dataclass(frozen=True, slots=True, eq=False)
class Identity:
    """The best one-to-one assignment of tracks to people, and its counts.

    A people-step is one person at one step.
    """

    true_positives: int
    """IDTP: the number of people-steps at which the person's own track is within the gate."""
    false_positives: int
    """IDFP: the number of the other estimates."""
    false_negatives: int
    """IDFN: the number of the other people-steps."""
    track_of: Int[ndarray, " K"]
    """Index, in the tracks' names, of the track that is assigned to each person; −1 for none."""

    @property
    def precision(self) -> float | None:
        """IDP = IDTP / estimates; None without estimates."""
        estimates = self.true_positives + self.false_positives
        return self.true_positives / estimates if estimates else None

    @property
    def recall(self) -> float | None:
        """IDR = IDTP / people-steps; None without people."""
        people = self.true_positives + self.false_negatives
        return self.true_positives / people if people else None

    @property
    def f1(self) -> float | None:
        """IDF1 = 2 IDTP / (estimates + people-steps); None without both."""
        both = 2 * self.true_positives + self.false_positives + self.false_negatives
        return 2 * self.true_positives / both if both else None


IDENTITY: tuple[Definition[Identity], ...] = (
    Definition("idf1", "IDF1", "Identity", "", "higher", 3, GATED,
        "Share of positions that carry the right identity, when each person gets the one "
        "track that fits best: 2 IDTP / (estimates + true positions).",
        lambda i: i.f1, RSZCT16, True),
    Definition("idp", "IDP", "Identity", "", "higher", 3, GATED,
        "Identity precision: share of the estimates that carry the right identity.",
        lambda i: i.precision, RSZCT16),
    Definition("idr", "IDR", "Identity", "", "higher", 3, GATED,
        "Identity recall: share of the true positions found under the right identity.",
        lambda i: i.recall, RSZCT16),
)  # fmt: skip


def identity(comparison: Comparison) -> Identity:
    """Assign each person at most one track so that IDTP is largest.

    IDTP of an assignment is the number of steps at which a person and the assigned track both
    exist and lie within the gate of each other; the largest IDTP also has the fewest IDFP
    and IDFN together.
    """
    truth, tracks = comparison.truth, comparison.tracks
    together = np.zeros((len(truth.names), len(tracks.names)), dtype=np.int64)
    for who, which, distances in comparison.by_step():
        rows, columns = np.nonzero(distances <= comparison.measure.gate)
        together[who[rows], which[columns]] += 1
    people, own = linear_sum_assignment(together, maximize=True)
    right = together[people, own]
    track_of = np.full(len(truth.names), -1)
    track_of[people[right > 0]] = own[right > 0]
    hits = int(right.sum())
    return Identity(hits, len(tracks) - hits, len(truth) - hits, track_of)
