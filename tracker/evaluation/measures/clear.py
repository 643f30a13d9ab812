"""CLEAR MOT: accuracy and precision, misses, false positives, identity switches.

[BS08] Bernardin, Stiefelhagen, "Evaluating multiple object tracking performance:
the CLEAR MOT metrics", EURASIP Journal on Image and Video Processing, 2008.
[LHN09] Li, Huang, Nevatia, "Learning to associate: HybridBoosted multi-target
tracker for crowded scene", CVPR 2009 (mostly tracked and mostly lost).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int
from numpy import ndarray

from tracker.evaluation.measures.matching import Comparison, Matches, gather
from tracker.geometry.assignment import linear_sum_assignment

CONTINUATION = 1000.0
"""The bonus on the score of a pair of the step before, as in TrackEval: far above the score of a
pair, which is at most 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Clear:
    """The CLEAR MOT counts of the whole sequence, by step, and by person."""

    matches: Matches
    """The pairs of all steps; a pair of the step before remains one while it is within the gate."""
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
    motp: float | None
    """Mean distance of the pairs, in the unit of the distance; None without pairs."""

    @property
    def mota(self) -> float | None:
        """1 − (misses + false positives + switches) / people-steps; None without people."""
        people = int(self.present.sum())
        wrong = self.misses.sum() + self.false_positives.sum() + self.id_switches.sum()
        return 1.0 - float(wrong) / people if people else None

    @property
    def _share(self) -> ndarray:
        return np.asarray(self.tracked / np.maximum(self.present, 1))

    @property
    def mostly_tracked(self) -> int:
        """The number of people paired at more than 80 % of their steps."""
        return int((self._share > 0.8).sum())

    @property
    def mostly_lost(self) -> int:
        """The number of people paired at less than 20 % of their steps."""
        return int((self._share < 0.2).sum())

    @property
    def partly_tracked(self) -> int:
        """The number of the other people."""
        return len(self.present) - self.mostly_tracked - self.mostly_lost


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
    truth, tracks, gate = comparison.truth, comparison.tracks, comparison.measure.gate
    people = len(truth.names)
    last = np.full(people, -1)  # track of each person when last paired
    before = np.full(people, -1)  # track of each person at the step before
    fragments = np.zeros(people, dtype=np.int64)
    pairs, switch = [], [np.zeros(0, dtype=bool)]
    none = np.zeros(0, dtype=np.int64)
    for step, distances in enumerate(comparison.distances):
        if not distances.size:
            pairs.append((none, none))
            continue
        who = truth.indices[truth.at(step)]
        which = tracks.indices[tracks.at(step)]
        score = CONTINUATION * (before[who, None] == which) + 1.0 - distances / (2.0 * gate)
        score[distances > gate] = 0.0
        rows, columns = linear_sum_assignment(score, maximize=True)
        paired = score[rows, columns] > 0.0
        rows, columns = rows[paired], columns[paired]
        pairs.append((rows, columns))
        matched, found = who[rows], which[columns]
        switch.append((last[matched] >= 0) & (last[matched] != found))
        fragments[matched] += before[matched] < 0
        last[matched] = found
        before[:] = -1
        before[matched] = found
    matches = gather(comparison, pairs)
    switched = np.concatenate(switch)
    steps = truth.frames[matches.truth_rows]
    persons = truth.indices[matches.truth_rows]
    paired_at = np.bincount(steps, minlength=comparison.steps)
    apart = comparison.measure.between(
        truth.positions[matches.truth_rows], tracks.positions[matches.track_rows]
    )
    return Clear(
        matches=matches,
        switch=switched,
        misses=truth.counts - paired_at,
        false_positives=tracks.counts - paired_at,
        id_switches=np.bincount(steps[switched], minlength=comparison.steps),
        present=np.bincount(truth.indices, minlength=people),
        tracked=np.bincount(persons, minlength=people),
        fragmentations=np.maximum(fragments - 1, 0),
        switches=np.bincount(persons[switched], minlength=people),
        motp=float(apart.mean()) if len(apart) else None,
    )
