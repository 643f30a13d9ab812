"""The judgement of trials: means of objectives over recordings and seeds, vetoes, and pruning."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from tracker.studies.jobs import Outcome
from tracker.studies.objectives import HELD_OUT, VETO, Objective, front, mean_over
from tracker.studies.store import JobRow, Trial

FIRST_SHARE = 1.0 / 3.0
"""Share of a trial's runs that are computed before it may be pruned."""

FEWEST = 10
"""Least number of complete trials with which a trial is compared before it may be pruned."""

Place = tuple[str, int]
"""A recording and a seed."""


class Judge:
    """The judge of trials, which compares them with the trials that ended before."""

    def __init__(
        self,
        objectives: Sequence[Objective],
        ended: Sequence[Trial],
        outcome: Callable[[str], Outcome | None],
    ) -> None:
        """Take the trials that ended before into account.

        Args:
            objectives: The objectives of the study.
            ended: The trials of the study that have ended.
            outcome: A function that gets the key of a run and returns its outcome; None if it is
                not stored.
        """
        self._objectives = tuple(objectives)
        self.complete: list[Trial] = []
        """The trials that ended with all their runs."""
        self._runs: list[dict[Place, tuple[float, ...]]] = []
        self._overlaps: dict[Place, float] = {}
        for trial in ended:
            found = {row.key: outcome(row.key) for row in trial.jobs}
            self._add(trial, {key: one for key, one in found.items() if one is not None})

    def _add(self, trial: Trial, outcomes: Mapping[str, Outcome]) -> None:
        """Store the objectives of a complete trial, and the held-out overlaps of the defaults.

        Args:
            trial: A trial that ended.
            outcomes: The outcomes of its runs, by key.
        """
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
        """Return the objectives of a run; None if one of them is not defined."""
        found = [outcome.figures.get(one.key) for one in self._objectives]
        return tuple(float(v) for v in found if v is not None) if None not in found else None

    def first_runs(self, runs: int, prune: bool) -> int:
        """Return the number of a trial's runs that are computed first; then it may be pruned.

        Args:
            runs: The number of all runs of the trial.
            prune: Whether trials are pruned.
        """
        return max(1, round(runs * FIRST_SHARE)) if prune and runs > 1 else runs

    def is_hopeless(self, rows: Sequence[JobRow], outcomes: Mapping[str, Outcome]) -> bool:
        """Whether a trial is worse in every objective than the median of the complete trials.

        Means over the same recordings and seeds are compared. A trial with an undefined objective
        is hopeless, too.

        Args:
            rows: The runs of the trial that have ended.
            outcomes: Their outcomes, by key.
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
        return all(
            one.better(float(middle[index]), float(here[index]))
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
        """Return the record of a trial that ended, and compare the next trials with it, too.

        Args:
            number: The trial's number.
            values: The parameters that were tried, by key.
            rows: The trial's runs.
            outcomes: The outcomes of the runs, by key.
            pruned: Whether the trial was pruned, so that its further runs were left out.
            words: The reason of a failure, or a remark on the trial.
            failed: Whether a run failed.
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
        undefined = [one for one in self._objectives if self._lacks(one, done)]
        if not failed and undefined:
            failed = True
            words = f"{undefined[0].name} is not defined: nobody is where it needs somebody"
        objectives = spreads = None
        if not failed:
            objectives = tuple(figures[one.key].value for one in self._objectives)
            spreads = tuple(figures[one.key].spread for one in self._objectives)
        if pruned and not failed:
            words = "given up after its first runs: worse than half of the others"
        missing = 0.0 if number == 0 else self._missing_overlap(done)
        trial = Trial(
            number,
            "failed" if failed else "pruned" if pruned else "complete",
            dict(values),
            objectives,
            spreads or (),
            {key: mean.value for key, mean in figures.items()},
            missing > 0.0,
            words,
            sum(outcome.seconds for _, outcome in done),
            rows,
            missing_overlap=missing,
        )
        self._add(trial, {row.key: outcome for row, outcome in done})
        return trial

    def _lacks(self, one: Objective, done: Sequence[tuple[JobRow, Outcome]]) -> bool:
        """Whether an objective is not defined for one of the runs."""
        return any(outcome.figures.get(one.key) is None for _, outcome in done)

    def _missing_overlap(self, done: Sequence[tuple[JobRow, Outcome]]) -> float:
        """Return by how much more than :data:`VETO` the held-out overlap of a run is less than that
        of the defaults, at most over the runs; 0 if it is not."""
        pairs = [
            (self._overlaps.get((row.recording, row.seed)), outcome.overlap or 0.0)
            for row, outcome in done
        ]
        missing = [usual - VETO - here for usual, here in pairs if usual is not None]
        return max(0.0, *missing) if missing else 0.0


def best_of(trials: Sequence[Trial], objectives: Sequence[Objective]) -> Trial | None:
    """Return the trial that is best in the first objective, among equal ones in the next ones, and
    among equal ones the earliest; None if there is none. So if no trial is better than the
    defaults, it is the trial of the defaults."""
    good = usable(trials)
    if not good:
        return None

    def rank(trial: Trial) -> tuple[float, ...]:
        assert trial.objectives is not None
        signed = zip(objectives, trial.objectives, strict=True)
        return (*((-v if o.higher else v) for o, v in signed), trial.number)

    return min(good, key=rank)


def front_of(trials: Sequence[Trial], objectives: Sequence[Objective]) -> list[int]:
    """Return the numbers of the trials on the Pareto front."""
    return front(((one.number, one.objectives or ()) for one in usable(trials)), objectives)


def usable(trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials that are complete and not vetoed."""
    return [one for one in trials if one.state == "complete" and not one.vetoed and one.objectives]
