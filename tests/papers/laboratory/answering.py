"""A person who knows the truth and answers what the queue asks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tests.papers.laboratory.attainable import people_of
from tracker.corrections import Correction, Place
from tracker.corrections.kinds import leeway
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.review.queue import ReviewItem, queue
from tracker.review.queue.item import TrackRows, confirm
from tracker.review.self_consistency.estimate import Common, Variant, track_variant
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.runs.stage_cache import StageCache
from tracker.sequences.sequence import GroundTruth, Sequence


class Truthful:
    """Says what is true of a doubtful place, as somebody would who looks at the pictures."""

    def __init__(
        self, truth: GroundTruth, gate: float, tracks: Trajectories, step_time: float
    ) -> None:
        """Know the truth, and look at the tracks.

        Args:
            truth: Of the recording.
            gate: Metres within which a track is a person's.
            tracks: That are shown: at each step each is one person's at most.
            step_time: Seconds.
        """
        self._truth, self._gate, self._tracks = truth, gate, tracks
        self._lanes = TrackRows(tracks)
        self._moment = leeway(step_time) + 1
        self._people = people_of(tracks, truth, gate)

    def who(self, place: Place) -> int | None:
        """Whose the track at a place is, mostly, in the second before and after; None for nobody's.

        Whose box it is at the very step a film of the moment tells, and no single picture: of two
        people side by side the nearer one is now the one and now the other.
        """
        own = self._tracks.at(place.step)
        if own.start == own.stop:
            return None
        apart = np.hypot(*(self._tracks.positions[own, :2] - [place.x, place.y]).T)
        best = int(np.argmin(apart))
        if apart[best] > self._gate:
            return None
        rows = self._lanes.rows[int(self._tracks.ids[own.start + best])]
        steps = self._tracks.frames[rows]
        around = rows[np.abs(steps - place.step) < self._moment]
        names, counts = np.unique(self._people[around], return_counts=True)
        here = int(self._people[own.start + best])
        most = names[counts == counts.max()]
        person = here if here in most else int(most[0])
        return person if person >= 0 else None

    def untracked(self, place: Place) -> bool:
        """Whether somebody is at a place whom no track has."""
        theirs = self._truth.at(place.step)
        apart = np.hypot(*(self._truth.positions[theirs, :2] - [place.x, place.y]).T)
        missing = ~np.isin(self._truth.ids[theirs], self._people[self._tracks.at(place.step)])
        return bool((missing & (apart <= self._gate)).any())

    def _at_an_end(self, place: Place, *, before: bool) -> bool:
        """Whether whom a track has at a place was not there a moment before, or is not after."""
        step = place.step + (-self._moment if before else self._moment)
        person = self.who(place)
        return person is not None and person not in self._truth.ids[self._truth.at(step)]

    def holds(self, one: Correction) -> bool:
        """Whether something is true."""
        if one.kind == "nobody":
            empty = sum(
                self.who(place) is None and not self.untracked(place) for place in one.places
            )
            return 2 * empty > len(one.places)
        if one.kind == "here":
            return self.untracked(one.places[0])
        if one.kind in ("came", "left"):
            return self._at_an_end(one.places[0], before=one.kind == "came")
        who = {place: self.who(place) for place in one.places}
        same = [who[a] is not None and who[a] == who[b] for a, b in one.constraints.must_link]
        # somebody and nobody are not one person either
        apart = [who[a] != who[b] for a, b in one.constraints.cannot_link]
        return all(same) and all(apart)

    def wrong(self, doubt: ReviewItem) -> bool:
        """Whether the run is wrong there."""
        now = doubt.alternatives[0].corrections
        return not (now and all(self.holds(one) for one in now))

    def answer(self, doubt: ReviewItem) -> tuple[Correction, ...]:
        """What is true of a doubtful place, of what is offered the one that says most; nothing
        where that cannot be said."""
        true = [
            one.corrections
            for one in doubt.alternatives
            if one.corrections and all(self.holds(told) for told in one.corrections)
        ]
        if not true:
            return ()
        as_it_is = doubt.alternatives[0].corrections
        return confirm(
            as_it_is
            if as_it_is in true
            else max(true, key=lambda told: sum(len(one.constraints.must_link) for one in told))
        )


@dataclass(frozen=True, slots=True)
class Answered:
    """Where a session stands after some answers."""

    answers: int
    idf1: float
    run: Run
    doubt: ReviewItem | None = None
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
    cache = StageCache()
    run = pipeline.compute(sequence, parameters, cache=cache)
    other: Trajectories | None = None
    if backwards:
        given = Common(sequence, parameters, run.seed, run.views)
        other = track_variant(given, Variant(backwards=True))
    told: tuple[Correction, ...] = ()
    skipped: set[str] = set()
    yield Answered(0, _idf1(run, settings), run)
    for count in range(1, answers + 1):
        doubts = [one for one in queue(run, other).items if one.id not in skipped]
        if not doubts:
            return
        doubt = doubts[0]
        person = Truthful(
            sequence.ground_truth, settings.effective_gate, run.tracks, sequence.step_time
        )
        wrong, more = person.wrong(doubt), person.answer(doubt)
        skipped.add(doubt.id)
        if more:
            told = (*told, *more)
            run = pipeline.compute(sequence, parameters, corrections=told, cache=cache)
        yield Answered(count, _idf1(run, settings), run, doubt, wrong, not more)


def _idf1(run: Run, settings: EvaluationSettings) -> float:
    return float(evaluate_sequence(run.sequence, run.tracks, settings)["idf1"] or 0.0)
