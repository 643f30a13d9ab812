"""The agreement of two runs on identities, and the moments at which they disagree.

[RT16] Ristani, Solera, Zou, Cucchiara, Tomasi, "Performance measures and a data set for
multi-target, multi-camera tracking", ECCV workshops 2016: IDF1.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.evaluation.clear import clear
from tracker.evaluation.identity import identity
from tracker.evaluation.matching import Comparison, GatedDistance, prepare
from tracker.evaluation.settings import EvaluationSettings
from tracker.sequences.sequence import GroundTruth, LabelledPositions

_BRIEF = 0.4
"""Length up to which a difference is ignored, seconds, since tracks may begin a little earlier or
later. Halved or doubled, there are 60 or 47 differences instead of 51 in four random crowds."""

_TOGETHER = 1.0
"""Largest time between the beginnings of differences that count as one moment, seconds. Halved
or doubled, they make 51 or 44 moments instead of 48."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A part of a track during which the other run has another identity, or no track."""

    first: int
    """The first step of the part."""
    last: int
    """The last step of the part, included."""
    person: int
    """The id of the track in this run."""
    other: int | None
    """The id in this run of the identity in the other run; None if this identity has no track in
    this run, or if the other run has no track during the part."""
    missing: bool
    """Whether the other run has no track during the part."""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A moment at which other runs disagree with this one."""

    step: int
    """The first step of the moment."""
    ids: tuple[int, ...]
    """The ids of the tracks concerned, in this run."""
    variants: tuple[str, ...]
    """The names of the runs that disagree."""
    why: str
    """The disagreement, in a few words."""


def compare_runs(
    here: LabelledPositions,
    there: LabelledPositions,
    steps: int,
    half_extents: Float[ndarray, " 3"],
) -> Comparison:
    """Compare two runs by the protocol of the evaluation, the first in the place of the truth.

    Args:
        here: The tracks of this run.
        there: The tracks of the other run.
        steps: The number of steps.
        half_extents: Half width, depth and height of a target, metres.
    """
    settings = EvaluationSettings()
    measure = GatedDistance(settings.distance, settings.effective_gate, half_extents)
    valid = np.ones(len(here.frames), dtype=bool)
    return prepare(
        GroundTruth(here.frames, here.ids, here.positions, valid), there, measure, steps=steps
    )


def agreement(comparison: Comparison) -> float:
    """Return IDF1 ([RT16]) of one run with the other in the place of the truth, which is symmetric
    in the two runs; 1 if neither has tracks."""
    found = identity(comparison).f1
    return 1.0 if found is None else found


def differences(comparison: Comparison, step_time: float) -> list[Difference]:
    """Return the parts of tracks, longer than :data:`_BRIEF`, on which the two runs differ.

    Identities of the two runs are matched as for IDF1, rows as for CLEAR MOT.

    Args:
        comparison: The comparison, as returned by :func:`compare_runs`.
        step_time: Duration of a step, seconds.
    """
    truth, tracks = comparison.truth, comparison.tracks
    partner = identity(comparison).track_of
    of_track = np.full(len(tracks.names), -1)
    of_track[partner[partner >= 0]] = np.flatnonzero(partner >= 0)
    matches = clear(comparison).matches
    # −1: the other run has no track; −2: its track has no partner in this run
    identities = np.full(len(truth), -1)
    found = of_track[tracks.indices[matches.track_rows]]
    identities[matches.truth_rows] = np.where(found >= 0, found, -2)
    result = []
    for person in range(len(truth.names)):
        rows = np.flatnonzero(truth.indices == person)
        result += _differences_of_track(
            truth.frames[rows], identities[rows], person, truth.names, max(_BRIEF / step_time, 1.0)
        )
    return result


def _differences_of_track(
    frames: Int[ndarray, " K"],
    identities: Int[ndarray, " K"],
    person: int,
    names: Int[ndarray, " n"],
    brief: float,
) -> list[Difference]:
    """Return the differences of one track.

    Args:
        frames: The K steps of the track.
        identities: The index of the identity in the other run at each step; −1 if the other run has
            no track, −2 if the identity of its track has no track in this run.
        person: The index of the track.
        names: The ids of all tracks, by index.
        brief: The number of steps up to which a difference is ignored.
    """
    change = np.flatnonzero((np.diff(identities) != 0) | (np.diff(frames) > brief)) + 1
    found = []
    for rows in np.split(np.arange(len(frames)), change):
        who = int(identities[rows[0]])
        first, last = int(frames[rows[0]]), int(frames[rows[-1]])
        if who == person or last - first < brief:
            continue
        other = int(names[who]) if who >= 0 else None
        found.append(Difference(first, last, int(names[person]), other, who == -1))
    return found


def disagreements(
    found: Many[tuple[str, Many[Difference]]], step_time: float
) -> tuple[Disagreement, ...]:
    """Group the differences of several runs into moments, the most important first.

    Moments at which more runs disagree come first; among those with the same number of runs, other
    identities come before missing tracks, and longer differences before shorter ones.

    Args:
        found: The name and the differences of each other run.
        step_time: Duration of a step, seconds.
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

    return tuple(_disagreement(moment) for moment in sorted(moments, key=rank))


def _disagreement(moment: list[tuple[str, Difference]]) -> Disagreement:
    """Return the disagreement of all differences of one moment."""
    first = moment[0][1]
    names = tuple(dict.fromkeys(name for name, _ in moment))
    others = sorted({one.other for _, one in moment if one.other is not None})
    if first.missing:
        why = f"{first.person} is not there"
    elif others:
        why = f"{first.person} is taken for {' or '.join(map(str, others))}"
    else:
        why = f"{first.person} is somebody else"
    return Disagreement(first.first, (first.person, *others), names, f"{why} {', '.join(names)}")
