"""CLEAR MOT: accuracy and precision, misses, false positives, identity switches.

[BS08] Bernardin, Stiefelhagen, "Evaluating multiple object tracking performance:
the CLEAR MOT metrics", EURASIP Journal on Image and Video Processing, 2008.
[LHN09] Li, Huang, Nevatia, "Learning to associate: HybridBoosted multi-target
tracker for crowded scene", CVPR 2009 (mostly tracked and mostly lost).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.evaluation.figures import GATED, Definition, mean
from tracker.evaluation.matching import Comparison, Matches, assign, gather

BS08 = "Bernardin, Stiefelhagen, EURASIP JIVP 2008 (CLEAR MOT)"
LHN09 = "Li, Huang, Nevatia, CVPR 2009"

CONTINUATION = 1000.0
"""The bonus on the score of a pair of the step before, as in TrackEval: far above the score of a
pair, which is at most 1."""

MOSTLY_TRACKED, MOSTLY_LOST = 0.8, 0.2
"""Shares of a person's steps with a pair, above and below which the person is mostly tracked and
mostly lost [LHN09]."""

PersonStatus = Literal["mostly tracked", "partly tracked", "mostly lost"]


@dataclass(frozen=True, slots=True, eq=False)
class Clear:
    """The CLEAR MOT counts of the whole sequence, by step, and by person."""

    matches: Matches
    """The pairs of all steps; a pair of the step before remains one while it is within the gate."""
    distances: Float[ndarray, " M"]
    """The distance of each pair, in the unit of the distance."""
    switch: Bool[ndarray, " M"]
    """Whether the person of each pair had another id when last paired."""
    misses: Int[ndarray, " S"]
    """The number of people without a pair at each step."""
    false_positives: Int[ndarray, " S"]
    """The number of estimates without a pair at each step."""
    id_switches: Int[ndarray, " S"]
    """The number of identity switches at each step."""
    present: Int[ndarray, " K"]
    """The number of steps at which each person is present."""
    tracked: Int[ndarray, " K"]
    """The number of steps at which each person is paired."""
    fragmentations: Int[ndarray, " K"]
    """The number of times that each person is paired again after a gap."""
    switches: Int[ndarray, " K"]
    """The number of identity switches of each person."""

    @property
    def mota(self) -> float | None:
        """1 − (misses + false positives + switches) / people-steps; None without people."""
        people = int(self.present.sum())
        wrong = self.misses.sum() + self.false_positives.sum() + self.id_switches.sum()
        return 1.0 - float(wrong) / people if people else None

    @property
    def motp(self) -> float | None:
        """Mean distance of the pairs, in the unit of the distance; None without pairs."""
        return mean(self.distances)

    @property
    def statuses(self) -> list[PersonStatus]:
        """How much of the steps of each person are tracked."""
        shares = (self.tracked / np.maximum(self.present, 1)).tolist()
        return [
            "mostly tracked"
            if share > MOSTLY_TRACKED
            else "mostly lost"
            if share < MOSTLY_LOST
            else "partly tracked"
            for share in shares
        ]


CLEAR: tuple[Definition[Clear], ...] = (
    Definition("mota", "MOTA", "CLEAR", "", "higher", 3, GATED,
        "1 − (misses + false positives + identity switches) / true positions.",
        lambda c: c.mota, BS08, True),
    Definition("motp", "MOTP", "CLEAR", "{d}", "lower", 3, GATED,
        "Mean distance of the pairs of person and estimate, pairs being kept over time.",
        lambda c: c.motp, BS08),
    Definition("misses", "Missed", "CLEAR", "", "lower", 0, GATED,
        "True positions without an estimate, over all steps.",
        lambda c: int(c.misses.sum()), BS08, True),
    Definition("false_positives", "False", "CLEAR", "", "lower", 0, GATED,
        "Estimates without a person, over all steps.",
        lambda c: int(c.false_positives.sum()), BS08, True),
    Definition("id_switches", "Identity switches", "CLEAR", "", "lower", 0, GATED,
        "How often a person is paired with another id than when last paired.",
        lambda c: int(c.id_switches.sum()), BS08, True),
    Definition("fragmentations", "Fragmentations", "CLEAR", "", "lower", 0, GATED,
        "How often a person's pairing is taken up again after a gap, absence included.",
        lambda c: int(c.fragmentations.sum()), LHN09),
    Definition("mostly_tracked", "Mostly tracked", "CLEAR", "people", "higher", 0, GATED,
        "People paired at more than 80 % of their steps.",
        lambda c: c.statuses.count("mostly tracked"), LHN09),
    Definition("partly_tracked", "Partly tracked", "CLEAR", "people", "none", 0, GATED,
        "People paired at 20 to 80 % of their steps.",
        lambda c: c.statuses.count("partly tracked"), LHN09),
    Definition("mostly_lost", "Mostly lost", "CLEAR", "people", "lower", 0, GATED,
        "People paired at less than 20 % of their steps.",
        lambda c: c.statuses.count("mostly lost"), LHN09),
)  # fmt: skip


def clear(comparison: Comparison) -> Clear:
    """Pair people and estimates step after step, preferring pairs of the step before, and count.

    The pairs of a step are those of the matching protocol, but a person and an
    estimate that were a pair at the step before remain one while they are within the gate.
    A switch is counted when a person is paired with another id than at the last pair, however long
    ago; a person who is paired with the same id again after a gap has no switch.
    The counts equal TrackEval's: a person who leaves and comes back counts as fragmented too,
    and steps without any people or without any estimates are skipped, so that they cause no
    fragmentation.

    Without people, MOTA is None and every estimate a false positive. Without
    estimates, MOTA is 0, every person is mostly lost and MOTP is None.
    """
    truth, tracks, steps = comparison.truth, comparison.tracks, comparison.steps
    people = len(truth.names)
    last = np.full(people, -1)  # track of each person when last paired
    before = np.full(people, -1)  # track of each person at the step before
    fragments = np.zeros(people, dtype=np.int64)
    pairs, switch = [], [np.zeros(0, dtype=bool)]
    for who, which, distances in comparison.by_step():
        bonus = CONTINUATION * (before[who, None] == which)
        rows, columns = assign(distances, comparison.measure.gate, bonus)
        pairs.append((rows, columns))
        if not distances.size:
            continue
        matched, found = who[rows], which[columns]
        switch.append((last[matched] >= 0) & (last[matched] != found))
        fragments[matched] += before[matched] < 0
        last[matched] = found
        before[:] = -1
        before[matched] = found
    matches, switched = gather(comparison, pairs), np.concatenate(switch)
    frames, persons = truth.frames[matches.truth_rows], truth.indices[matches.truth_rows]
    paired_at = np.bincount(frames, minlength=steps)
    return Clear(
        matches=matches,
        distances=comparison.apart(matches),
        switch=switched,
        misses=truth.counts - paired_at,
        false_positives=tracks.counts - paired_at,
        id_switches=np.bincount(frames[switched], minlength=steps),
        present=np.bincount(truth.indices, minlength=people),
        tracked=np.bincount(persons, minlength=people),
        fragmentations=np.maximum(fragments - 1, 0),
        switches=np.bincount(persons[switched], minlength=people),
    )
