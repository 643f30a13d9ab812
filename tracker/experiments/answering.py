"""A person who knows the truth and answers what the queue asks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tracker import pipeline
from tracker.corrections import Correction, Place
from tracker.doubts import Doubt, queue
from tracker.doubts.doubt import said, unsaid
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.parameters import RunParameters
from tracker.pipeline import Run
from tracker.runs.stage_cache import StageCache
from tracker.sequences.sequence import GroundTruth, Sequence
from tracker.trajectories import Trajectories
from tracker.without_truth.others import Given, Look, looked


class Truthful:
    """Says what is true of a doubtful place, as somebody would who looks at the pictures."""

    def __init__(self, truth: GroundTruth, gate: float) -> None:
        """Know the truth.

        Args:
            truth: Of the recording.
            gate: Metres within which a track is a person's.
        """
        self._truth, self._gate = truth, gate

    def who(self, place: Place) -> int | None:
        """Who is at a place; None for nobody."""
        own = self._truth.at(place.step)
        if own.start == own.stop:
            return None
        apart = np.hypot(*(self._truth.positions[own, :2] - [place.x, place.y]).T)
        best = int(np.argmin(apart))
        return int(self._truth.ids[own][best]) if apart[best] <= self._gate else None

    def holds(self, one: Correction) -> bool:
        """Whether something is true."""
        if one.kind == "nobody":
            return 2 * sum(self.who(place) is None for place in one.places) > len(one.places)
        who = {place: self.who(place) for place in one.places}
        if None in who.values():
            return False
        return all(who[a] == who[b] for a, b in one.pairs) and all(
            who[a] != who[b] for a, b in one.apart
        )

    def wrong(self, doubt: Doubt) -> bool:
        """Whether the run is wrong there."""
        now = doubt.alternatives[0].corrections
        return not (now and all(self.holds(one) for one in now))

    def answer(self, doubt: Doubt) -> tuple[Correction, ...]:
        """What is true of a doubtful place; nothing where that cannot be said.

        Where none of the alternatives is true, two who are not the same are parted.
        """
        for one in doubt.alternatives:
            if one.corrections and all(self.holds(told) for told in one.corrections):
                return said(one.corrections)
        for told in doubt.alternatives[0].corrections:
            for a, b in told.pairs:
                who = self.who(a), self.who(b)
                if None not in who and who[0] != who[1]:
                    return said(unsaid("different", (a, b)))
        return ()


@dataclass(frozen=True, slots=True)
class Answered:
    """Where a session stands after some answers."""

    answers: int
    idf1: float
    run: Run
    doubt: Doubt | None = None
    """What was asked last."""
    wrong: bool = False
    """Whether the run was wrong there."""
    skipped: bool = False


def session(
    sequence: Sequence,
    parameters: RunParameters,
    settings: EvaluationSettings,
    answers: int,
    *,
    backwards: bool = True,
) -> Iterator[Answered]:
    """Answer the first of the queue again and again.

    Args:
        sequence: With its truth.
        parameters: Of all runs.
        settings: How a run is scored.
        answers: How many are given.
        backwards: Whether the recording was seen backwards in time too, once, before.
    """
    assert sequence.ground_truth is not None
    person = Truthful(sequence.ground_truth, settings.effective_gate)
    cache = StageCache()
    run = pipeline.compute(sequence, parameters, cache=cache)
    other: Trajectories | None = None
    if backwards:
        given = Given(sequence, parameters, run.seed, tuple(run.views))
        other = looked(given, Look(backwards=True))
    told: tuple[Correction, ...] = ()
    skipped: set[str] = set()
    yield Answered(0, _idf1(run, settings), run)
    for count in range(1, answers + 1):
        doubts = [one for one in queue(run, other).doubts if one.id not in skipped]
        if not doubts:
            return
        doubt = doubts[0]
        wrong, more = person.wrong(doubt), person.answer(doubt)
        skipped.add(doubt.id)
        if more:
            told = (*told, *more)
            run = pipeline.compute(sequence, parameters, corrections=told, cache=cache)
        yield Answered(count, _idf1(run, settings), run, doubt, wrong, not more)


def _idf1(run: Run, settings: EvaluationSettings) -> float:
    return float(evaluate_sequence(run.sequence, run.tracks, settings)["idf1"] or 0.0)
