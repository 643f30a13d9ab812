"""What a trial is worth: its objectives over recordings and seeds, vetoes, and hopelessness."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tracker.studies.defined.objectives import HELD_OUT, VETO, Objective, front, mean_over
from tracker.studies.kept.records import JobRow, Trial
from tracker.studies.work.jobs import Outcome

FIRST_SHARE = 1.0 / 3.0
"""Of a trial's runs those that it is judged by before the others are begun."""

FEWEST = 10
"""Complete trials before one is given up."""

Place = tuple[str, int]
"""A recording and a seed."""


class Judge:
    """Knows the trials that ended, and judges the next ones by them."""

    def __init__(
        self,
        objectives: Sequence[Objective],
        ended: Sequence[Trial],
        outcome: Callable[[str], Outcome | None],
    ) -> None:
        """Take up what ended before.

        Args:
            objectives: Of the study.
            ended: Its trials so far.
            outcome: Finds the outcome of a run by its key.
        """
        self._objectives = tuple(objectives)
        self.complete: list[Trial] = []
        """Those that ended with all their runs."""
        self._runs: list[dict[Place, tuple[float, ...]]] = []
        self._overlaps: dict[Place, float] = {}
        for trial in ended:
            found = {row.key: outcome(row.key) for row in trial.jobs}
            self._add(trial, {key: one for key, one in found.items() if one is not None})

    def _add(self, trial: Trial, outcomes: Mapping[str, Outcome]) -> None:
        rows = [row for row in trial.jobs if row.key in outcomes]
        if trial.number == 0:
            for row in rows:
                overlap = outcomes[row.key].overlap
                if overlap is not None:
                    self._overlaps[row.recording, row.seed] = overlap
        if trial.state == "complete":
            self.complete.append(trial)
            self._runs.append(
                {(r.recording, r.seed): v for r in rows if (v := self._of(outcomes[r.key]))}
            )

    def _of(self, outcome: Outcome) -> tuple[float, ...] | None:
        found = [outcome.figures.get(one.key) for one in self._objectives]
        return tuple(float(v) for v in found if v is not None) if None not in found else None

    def first_runs(self, runs: int, prune: bool) -> int:
        """How many of a trial's runs are done before it is judged."""
        return max(1, round(runs * FIRST_SHARE)) if prune and runs > 1 else runs

    def is_hopeless(self, rows: Sequence[JobRow], outcomes: Mapping[str, Outcome]) -> bool:
        """Whether a trial is worse in every objective than half of the complete ones were.

        Compared are means over the same recordings and seeds.
        """
        if len(self.complete) < FEWEST:
            return False
        places = [(row.recording, row.seed) for row in rows]
        own = [self._of(outcomes[row.key]) for row in rows]
        if None in own:
            return True
        others = [
            np.mean([runs[place] for place in places], axis=0)
            for runs in self._runs
            if all(place in runs for place in places)
        ]
        if len(others) < FEWEST:
            return False
        middle = np.median(others, axis=0)
        here = np.mean([v for v in own if v is not None], axis=0)
        return not any(
            not one.better(float(middle[index]), float(here[index]))
            for index, one in enumerate(self._objectives)
        )

    def trial(
        self,
        number: int,
        values: dict[str, object],
        rows: tuple[JobRow, ...],
        outcomes: Mapping[str, Outcome],
        *,
        pruned: bool,
        words: str,
        failed: bool,
    ) -> Trial:
        """A trial that ended, and is among those that the next are judged by.

        Args:
            number: Its number.
            values: What was tried.
            rows: Its runs.
            outcomes: Theirs, by key.
            pruned: Whether there would have been more.
            words: Why it failed, or what it is.
            failed: Whether a run of it failed.
        """
        done = [(r, outcomes[r.key]) for r in rows if outcomes.get(r.key) is not None]
        done = [(row, outcome) for row, outcome in done if outcome.became == "done"]
        figures = {}
        measured = [(row, {**one.figures, HELD_OUT.key: one.overlap}) for row, one in done]
        for key in sorted({key for _, of_run in measured for key in of_run}):
            found = {
                (row.recording, row.seed): float(value)
                for row, of_run in measured
                if (value := of_run.get(key)) is not None
            }
            if found:
                figures[key] = mean_over(found)
        missing = [one for one in self._objectives if self._lacks(one, done)]
        if not failed and missing:
            failed = True
            words = f"{missing[0].name} is not defined: nobody is where it needs somebody"
        objectives = spreads = None
        if not failed:
            objectives = tuple(figures[one.key].value for one in self._objectives)
            spreads = tuple(figures[one.key].spread for one in self._objectives)
        if pruned and not failed:
            words = "given up after its first runs: worse than half of the others"
        vetoed = number != 0 and self._is_vetoed(done)
        trial = Trial(
            number,
            "failed" if failed else "pruned" if pruned else "complete",
            dict(values),
            objectives,
            spreads or (),
            {key: mean.value for key, mean in figures.items()},
            vetoed,
            words,
            sum(outcome.seconds for _, outcome in done),
            rows,
        )
        self._add(trial, {row.key: outcome for row, outcome in done})
        return trial

    def _lacks(self, one: Objective, done: Sequence[tuple[JobRow, Outcome]]) -> bool:
        return any(outcome.figures.get(one.key) is None for _, outcome in done)

    def _is_vetoed(self, done: Sequence[tuple[JobRow, Outcome]]) -> bool:
        """Whether people overlap clearly less with left-out cameras than the default's do."""
        for row, outcome in done:
            usual = self._overlaps.get((row.recording, row.seed))
            if usual is not None and (outcome.overlap or 0.0) < usual - VETO:
                return True
        return False

    def for_sampler(self, trial: Trial) -> tuple[float, ...]:
        """What the sampler is told: of a vetoed trial no more than nothing for its identity."""
        assert trial.objectives is not None
        return tuple(
            0.0 if trial.vetoed and one.of == "agreement" else value
            for one, value in zip(self._objectives, trial.objectives, strict=True)
        )


def best_of(trials: Sequence[Trial], objectives: Sequence[Objective]) -> Trial | None:
    """The trial that leads in the first objective, of as good ones in the next; None if none
    ended. Where nothing is better than the defaults, it is they."""
    good = usable(trials)
    if not good:
        return None

    def rank(trial: Trial) -> tuple[float, ...]:
        assert trial.objectives is not None
        signed = zip(objectives, trial.objectives, strict=True)
        return (*((-v if o.higher else v) for o, v in signed), trial.number)

    return min(good, key=rank)


def front_of(trials: Sequence[Trial], objectives: Sequence[Objective]) -> list[int]:
    """The trials that no other beats in all objectives."""
    return front(((one.number, one.objectives or ()) for one in usable(trials)), objectives)


def usable(trials: Sequence[Trial]) -> list[Trial]:
    """Those that may be taken: complete and not vetoed."""
    return [one for one in trials if one.state == "complete" and not one.vetoed and one.objectives]
