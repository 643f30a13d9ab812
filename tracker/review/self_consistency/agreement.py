"""How far two runs hold the same people for the same, and where they do not.

[RT16] Ristani, Solera, Zou, Cucchiara, Tomasi, "Performance measures and a data set for
multi-target, multi-camera tracking", ECCV workshops 2016: IDF1.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation.measures.clear import clear
from tracker.evaluation.measures.identity import identity
from tracker.evaluation.measures.matching import Comparison, Measure, Tracks, prepare
from tracker.evaluation.settings import EvaluationSettings
from tracker.sequences.sequence import GroundTruth

_BRIEF = 0.4
"""Seconds: who is found a little earlier or later is no other person."""

_TOGETHER = 1.0
"""Seconds between two differences that are one moment."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A stretch in which another run does not hold a person for who he is here."""

    first: int
    last: int
    person: int
    """His id here."""
    other: int | None
    """The id here of who he is there; None where he is nobody, or somebody unknown here."""
    missing: bool
    """Whether nobody is there at all."""


@dataclass(frozen=True, slots=True)
class ReviewItem:
    """A moment at which runs disagree."""

    step: int
    """The first."""
    ids: tuple[int, ...]
    """Of the people whom it is about, here."""
    looks: tuple[str, ...]
    """Which runs see it otherwise."""
    why: str
    """In a few words."""


def compared(
    here: Tracks, there: Tracks, steps: int, half_extents: Float[ndarray, " 3"]
) -> Comparison:
    """Two runs by the protocol by which a run is compared with the truth."""
    settings = EvaluationSettings()
    measure = Measure(settings.distance, settings.effective_gate, half_extents)
    everybody = np.ones(len(here.frames), dtype=bool)
    return prepare(
        GroundTruth(here.frames, here.ids, here.positions, everybody), there, measure, steps=steps
    )


def agreement(comparison: Comparison) -> float:
    """IDF1 of one run by the other ([RT16]), which is the same both ways; 1 where neither has
    anybody."""
    found = identity(comparison).f1
    return 1.0 if found is None else found


def differences(comparison: Comparison, step_time: float) -> list[Difference]:
    """The stretches, longer than a moment, in which a person is another one there, or nobody."""
    truth, tracks = comparison.truth, comparison.tracks
    partner = identity(comparison).track_of
    of_track = np.full(len(tracks.names), -1)
    of_track[partner[partner >= 0]] = np.flatnonzero(partner >= 0)
    matches = clear(comparison).matches
    # -1: nobody is there; -2: somebody who is nobody here
    is_who = np.full(len(truth), -1)
    found = of_track[tracks.indices[matches.track_rows]]
    is_who[matches.truth_rows] = np.where(found >= 0, found, -2)
    result = []
    for person in range(len(truth.names)):
        rows = np.flatnonzero(truth.indices == person)
        result += _stretches(
            truth.frames[rows], is_who[rows], person, truth.names, max(_BRIEF / step_time, 1.0)
        )
    return result


def _stretches(
    frames: Int[ndarray, " K"],
    is_who: Int[ndarray, " K"],
    person: int,
    names: Int[ndarray, " n"],
    brief: float,
) -> list[Difference]:
    """Of one person."""
    change = np.flatnonzero((np.diff(is_who) != 0) | (np.diff(frames) > brief)) + 1
    found = []
    for rows in np.split(np.arange(len(frames)), change):
        who = int(is_who[rows[0]])
        first, last = int(frames[rows[0]]), int(frames[rows[-1]])
        if who == person or last - first < brief:
            continue
        other = int(names[who]) if who >= 0 else None
        found.append(Difference(first, last, int(names[person]), other, who == -1))
    return found


def doubts(found: Items[tuple[str, Items[Difference]]], step_time: float) -> tuple[ReviewItem, ...]:
    """The moments of all differences: those that most runs see otherwise first; of as many, who
    somebody is before whether he is there, and the longer before the shorter.

    Args:
        found: Of each other run its name and its differences.
        step_time: Seconds.
    """
    moments: list[list[tuple[str, Difference]]] = []
    every = [(name, one) for name, some in found for one in some]
    for name, one in sorted(every, key=lambda each: (each[1].person, each[1].first)):
        last = moments[-1] if moments else None
        near = last is not None and (
            last[-1][1].person == one.person
            and last[-1][1].missing == one.missing
            and one.first - last[0][1].first <= _TOGETHER / step_time
        )
        if near and last is not None:
            last.append((name, one))
        else:
            moments.append([(name, one)])

    def rank(moment: list[tuple[str, Difference]]) -> tuple[int, bool, int]:
        longest = max(one.last - one.first for _, one in moment)
        return -len({name for name, _ in moment}), moment[0][1].missing, -longest

    return tuple(_doubt(moment) for moment in sorted(moments, key=rank))


def _doubt(moment: list[tuple[str, Difference]]) -> ReviewItem:
    first = moment[0][1]
    names = tuple(dict.fromkeys(name for name, _ in moment))
    others = sorted({one.other for _, one in moment if one.other is not None})
    if first.missing:
        why = f"{first.person} is not there"
    elif others:
        why = f"{first.person} is taken for {' or '.join(map(str, others))}"
    else:
        why = f"{first.person} is somebody else"
    return ReviewItem(first.first, (first.person, *others), names, f"{why} {', '.join(names)}")
