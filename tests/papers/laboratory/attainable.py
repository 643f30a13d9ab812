"""How much corrections of who is who can win: found with the truth, in the tracks themselves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.optimize import linear_sum_assignment

from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.fusion.trajectories import Trajectories
from tracker.geometry.assignment import pairs_within
from tracker.sequences.sequence import GroundTruth, Sequence


@dataclass(frozen=True, slots=True)
class Attainable:
    """IDF1 of tracks whose places stay as they are."""

    identities: float
    """Where every row has the id of its person: nothing that is said of who is who wins more."""
    best: tuple[float, ...]
    """Without a change, then after each of the best single ones."""


def attainable(
    sequence: Sequence, tracks: Trajectories, settings: EvaluationSettings, changes: int
) -> Attainable:
    """What can be won, and what single changes win that somebody chooses who knows the truth.

    A change is what one sentence says of one moment: two tracks are exchanged from there on, the
    one goes on as the other, or a track is two people's. Of all there are the one that wins most
    is made, then of those that are left; it moves nobody else.

    Args:
        sequence: With its truth.
        tracks: Of a run.
        settings: How they are scored.
        changes: How many are made.
    """
    assert sequence.ground_truth is not None
    truth, gate = sequence.ground_truth, settings.effective_gate

    def idf1(ids: Int[ndarray, " N"]) -> float:
        return float(evaluate_sequence(sequence, replace(tracks, ids=ids), settings)["idf1"] or 0.0)

    people = people_of(tracks, truth, gate)
    ids = np.asarray(tracks.ids, dtype=np.int64)
    own = np.where(people >= 0, ids.max(initial=0) + 1 + people, ids)
    met = _Meetings(tracks, truth, gate)
    curve = [idf1(ids)]
    for _ in range(changes):
        offered = list(_changes(tracks.frames, ids, people))
        if not offered:
            break
        worths = [met.right(one) for one in offered]
        if max(worths) <= met.right(ids):
            break
        ids = offered[int(np.argmax(worths))]
        curve.append(idf1(ids))
    return Attainable(idf1(own), tuple(curve))


def people_of(tracks: Trajectories, truth: GroundTruth, gate: float) -> Int[ndarray, " N"]:
    """The person of each row of tracks, one row each, -1 for none."""
    found = np.full(len(tracks), -1, dtype=np.int64)
    for step in np.unique(tracks.frames).tolist():
        own, theirs = tracks.at(step), truth.at(step)
        rows, columns = pairs_within(_apart(tracks, own, truth, theirs), gate)
        found[own.start + rows] = truth.ids[theirs][columns]
    return found


def _apart(
    tracks: Trajectories, own: slice, truth: GroundTruth, theirs: slice
) -> Float[ndarray, "A B"]:
    """Metres on the ground between each of the tracks' rows and each of the truth's."""
    way = tracks.positions[own, None, :2] - truth.positions[theirs, :2]
    return np.asarray(np.hypot(way[..., 0], way[..., 1]))


class _Meetings:
    """Rows of tracks and of people within the gate: what identity scores count."""

    def __init__(self, tracks: Trajectories, truth: GroundTruth, gate: float) -> None:
        rows, people = [], []
        for step in np.unique(tracks.frames).tolist():
            own, theirs = tracks.at(step), truth.at(step)
            one, other = np.nonzero(_apart(tracks, own, truth, theirs) <= gate)
            rows.append(own.start + one)
            people.append(truth.ids[theirs][other])
        self._rows = np.concatenate([np.zeros(0, dtype=np.int64), *rows])
        names = np.concatenate([np.zeros(0, dtype=np.int64), *people])
        self._names, self._people = np.unique(names, return_inverse=True)

    def right(self, ids: Int[ndarray, " N"]) -> float:
        """How many rows are right where each person has one id, and each id one person."""
        names, number = np.unique(ids, return_inverse=True)
        counts = np.zeros((len(self._names), len(names)))
        np.add.at(counts, (self._people, number[self._rows]), 1.0)
        return float(counts[linear_sum_assignment(counts, maximize=True)].sum())


def _changes(
    steps: Int[ndarray, " N"], ids: Int[ndarray, " N"], people: Int[ndarray, " N"]
) -> Iterator[Int[ndarray, " N"]]:
    """The ids after each change: where a person's track changes, and where a track's person."""
    free = int(ids.max(initial=0)) + 1
    for before, after in _consecutive(people, steps):
        if people[before] >= 0 and ids[before] != ids[after]:
            yield _goes_on(steps, ids, before, after, free)
    for before, after in _consecutive(ids, steps):
        if people[before] != people[after]:
            yield np.where((ids == ids[before]) & (steps >= steps[after]), free, ids)


def _consecutive(names: Int[ndarray, " N"], steps: Int[ndarray, " N"]) -> Iterator[tuple[int, int]]:
    """Each row and the next one of the same name."""
    order = np.lexsort((steps, names))
    for before, after in zip(order[:-1].tolist(), order[1:].tolist(), strict=True):
        if names[before] == names[after]:
            yield before, after


def _goes_on(
    steps: Int[ndarray, " N"], ids: Int[ndarray, " N"], before: int, after: int, free: int
) -> Int[ndarray, " N"]:
    """The track of one row goes on as that of the other; how it went on follows what came before
    the other, where the two do not overlap."""
    one, other = ids[before], ids[after]
    tail = (ids == one) & (steps > steps[before])
    head = (ids == other) & (steps < steps[after])
    new = np.where((ids == other) & ~head, one, ids)
    fits = head.any() and tail.any() and steps[tail].min() > steps[head].max()
    new[tail] = other if fits else free
    return new
