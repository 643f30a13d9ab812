"""The proposal at the end of a study: the best values, evaluated again on other seeds.

The maximum over many trials is biased upwards. So the best few trials, the defaults and the user's
own values are evaluated again on seeds that no trial had, and the best of these is proposed,
without changes that have no effect. On these seeds the proposal is never worse than the defaults.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tracker.studies.jobs import Job, Outcome
from tracker.studies.judging import Judge, usable
from tracker.studies.objectives import OBJECTIVES
from tracker.studies.recordings import Opened, Recordings
from tracker.studies.store import JobRow, Trial

CANDIDATES = 4
"""The number of best trials that are evaluated again."""

LEAST = 5e-4
"""Least difference of the first objective, in its unit, that counts as better."""

SEARCH_SHARE = 0.6
"""Share of a study's time for the search, if it makes a proposal; the rest is for the evaluation
again."""

SHOWN = ("score", "hota", "idf1", "mota", "identity")
"""The keys of the figures that are compared in a proposal. Speed is not among them: the first run
of a worker, as a rule that of the defaults, includes the start of the program, and stage 1 may be
read from the cache."""

Measure = Callable[[Sequence[Job]], Mapping[str, Outcome]]
"""A function that has workers do jobs, as far as the time allows, and returns the outcomes by
key."""


class Proposer:
    """The evaluation of candidates on other seeds, and the proposal of the best."""

    def __init__(
        self,
        recordings: Recordings,
        trials: Sequence[Trial],
        defaults: Mapping[str, Any],
        start: Mapping[str, Any],
        seeds: Sequence[int],
        measure: Measure,
    ) -> None:
        """Store the candidates and the function that evaluates them.

        Args:
            recordings: The recordings of the study.
            trials: The trials that ended.
            defaults: The default values of the varied parameters, by key.
            start: The user's own values of the varied parameters; empty if they are the defaults.
            seeds: Seeds that no trial had.
            measure: A function that has workers do jobs.
        """
        self._recordings, self._trials = recordings, trials
        self._defaults, self._start = dict(defaults), dict(start)
        self._measure = measure
        self._seeds = list(seeds)
        self._trial_seed = recordings.seeds[0]
        self._lead = recordings.objectives[0]
        self._judge = Judge(recordings.objectives, (), lambda key: None)

    def propose(self) -> dict[str, Any]:
        """Evaluate the candidates, and return the proposal as plain values for storage."""
        drawn = self._seeds_matter()
        if not drawn:
            self._seeds = [self._trial_seed]
        current = {**self._defaults, **self._start}
        lists: list[dict[str, Any]] = [{}] + ([current] if self._start else [])
        lists += [trial.values for trial in self._best_trials()]
        measured = self._measured(lists)
        default = measured[0]
        if default is None:
            return self._no_proposal("the time was over before anything was measured again", drawn)
        now = measured[1] if self._start else default
        if now is None:
            return self._no_proposal("the time was over before anything was measured again", drawn)
        good = [
            (values, trial)
            for values, trial in zip(lists, measured, strict=True)
            if trial is not None and trial.state == "complete" and not trial.vetoed
        ]
        values, best = max(good, key=lambda pair: self._value(pair[1]), default=({}, default))
        if not self._gain(best, now) >= LEAST:
            return self._no_proposal("nothing better was found", drawn, default, now)
        if best is not default and self._gain(best, default) < LEAST:
            values, best = {}, default  # the defaults are as good, and simpler
        values = {k: v for k, v in values.items() if v != self._defaults.get(k)}
        values, best, brought = self._without_ineffective(values, best)
        number = next((t.number for t in self._trials if t.values == values), None)
        return {
            "better": True,
            "words": self._words(best, now, default, drawn),
            "trial": number,
            "values": {**self._defaults, **values},
            "rows": [
                {
                    "key": key,
                    "default": self._defaults[key],
                    "before": current[key],
                    "after": values.get(key, self._defaults[key]),
                    "brought": brought.get(key),
                }
                for key in self._defaults
                if values.get(key, self._defaults[key]) != current[key] or key in values
            ],
            **self._facts(default, now, best),
        }

    def _no_proposal(
        self, words: str, drawn: bool, default: Trial | None = None, now: Trial | None = None
    ) -> dict[str, Any]:
        """Return a result that proposes no change.

        Args:
            words: The reason, in words.
            drawn: Whether runs with different seeds differ.
            default: The evaluation of the defaults, if there is one.
            now: The evaluation of the user's own values, if there is one.
        """
        return {
            "better": False,
            "words": words if drawn else f"{words} ({_DETERMINISTIC})",
            "trial": None,
            "values": {**self._defaults, **self._start},
            "rows": [],
            **self._facts(default, now, now),
        }

    def _facts(
        self, default: Trial | None, now: Trial | None, after: Trial | None
    ) -> dict[str, Any]:
        """Return the seeds, and the figures of the defaults, the user's values and the proposal."""

        def of(trial: Trial | None, key: str) -> float | None:
            return None if trial is None else trial.figures.get(key)

        return {
            "seeds": self._seeds,
            "figures": [
                {
                    "key": key,
                    "name": OBJECTIVES[key].name,
                    "default": of(default, key),
                    "before": of(now, key),
                    "after": of(after, key),
                }
                for key in SHOWN
                if any(of(one, key) is not None for one in (default, now, after))
            ],
        }

    def _words(self, best: Trial, now: Trial, default: Trial, drawn: bool) -> str:
        """Return the sentence that compares the proposal with the user's values and the
        defaults."""
        lead = self._lead
        here, there = self._value(best), self._value(now)
        sign = 1.0 if lead.higher else -1.0
        base = "the default" if not self._start else "where you were"
        words = (
            f"{lead.name} {lead.words(sign * here, None)}, {base} {lead.words(sign * there, None)}"
        )
        if self._start:
            words += f", the default {lead.words(sign * self._value(default), None)}"
        seeds = ", ".join(map(str, self._seeds))
        return f"{words}; " + (f"measured on the seeds {seeds}" if drawn else _DETERMINISTIC)

    def _seeds_matter(self) -> bool:
        """Whether runs with different seeds have different tracks."""
        one, other = self._jobs({}, [self._trial_seed]), self._jobs({}, self._seeds[:1])
        found = self._measure([job for _, job in (*one, *other)])
        pairs = zip(one, other, strict=True)
        return any(
            a.key not in found or b.key not in found or found[a.key].tracks != found[b.key].tracks
            for (_, a), (_, b) in pairs
        )

    def _best_trials(self) -> list[Trial]:
        """Return the best trials besides the defaults, the best first."""
        left = [one for one in usable(self._trials) if one.number != 0]
        return sorted(left, key=self._value, reverse=True)[:CANDIDATES]

    def _without_ineffective(
        self, values: dict[str, Any], best: Trial
    ) -> tuple[dict[str, Any], Trial, dict[str, float | None]]:
        """Remove the changes that have no effect.

        The effect of a change is the decrease of the first objective (its increase, if smaller
        values are better) without this change.

        Args:
            values: The values that differ from the defaults, by key.
            best: The evaluation of these values.

        Returns:
            The remaining values, their evaluation, and the effect of each of them by key; None for
            an effect that was not measured.
        """
        keys = list(values)
        lists = [{k: v for k, v in values.items() if k != key} for key in keys]
        measured = self._measured(lists)
        brought = {
            key: None if one is None else self._gain(best, one)
            for key, one in zip(keys, measured, strict=True)
        }
        idle = [key for key, gain in brought.items() if gain is not None and gain < LEAST / 4.0]
        if idle:
            fewer = {k: v for k, v in values.items() if k not in idle}
            (again,) = self._measured([fewer])
            if (
                again is not None
                and again.state == "complete"
                and not again.vetoed
                and self._gain(again, best) > -LEAST / 4.0
            ):
                return fewer, again, {k: v for k, v in brought.items() if k in fewer}
        return values, best, brought

    def _measured(self, lists: Sequence[Mapping[str, Any]]) -> list[Trial | None]:
        """Evaluate each set of values on the other seeds; None if the time was over before.

        In the first call the first set is empty and stands for the defaults, whose held-out overlap
        decides on the vetoes of all others.
        """
        rows = [self._jobs(values, self._seeds) for values in lists]
        found = self._measure([job for some in rows for _, job in some])
        result: list[Trial | None] = []
        for values, some in zip(lists, rows, strict=True):
            if not all(row.key in found for row, _ in some):
                result.append(None)
                continue
            failed = next((found[r.key] for r, _ in some if found[r.key].became != "done"), None)
            result.append(
                self._judge.trial(
                    0 if not values else 1,
                    dict(values),
                    tuple(row for row, _ in some),
                    found,
                    pruned=False,
                    words="" if failed is None else failed.words,
                    failed=failed is not None,
                )
            )
        return result

    def _jobs(self, values: Mapping[str, Any], seeds: Sequence[int]) -> list[tuple[JobRow, Job]]:
        """Return the runs of values on all recordings with given seeds."""
        every: Sequence[Opened] = self._recordings.every
        jobs = [(one, self._recordings.job(one, values, seed)) for seed in seeds for one in every]
        return [(JobRow(job.key, one.place, job.seed), job) for one, job in jobs]

    def _value(self, trial: Trial) -> float:
        """Return the first objective of a trial, with a sign such that larger values are better."""
        if trial.objectives is None:
            return float("-inf")
        return trial.objectives[0] if self._lead.higher else -trial.objectives[0]

    def _gain(self, one: Trial, other: Trial) -> float:
        """Return by how much a trial is better than another in the first objective."""
        return self._value(one) - self._value(other)


_DETERMINISTIC = "nothing is drawn at random here, so that another seed measures the same again"
