"""Which values are tried next: by Optuna, whose storage is a file of the study.

[AYY19] Akiba, Sano, Yanase, Ohta, Koyama, "Optuna: a next-generation hyperparameter optimization
framework", KDD 2019. TPE: Bergstra, Bardenet, Bengio, Kégl, NeurIPS 2011; for several objectives
NSGA-II: Deb, Pratap, Agarwal, Meyarivan, IEEE TEVC 6(2), 2002.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tracker.parameters import RunParameters
from tracker.studies.defined import space
from tracker.studies.defined.definition import Definition, Varied
from tracker.studies.defined.objectives import Objective
from tracker.studies.errors import StudyError
from tracker.studies.kept import journal

STARTUP = 12
"""Trials drawn at random before TPE trusts what it has."""


def first_values(definition: Definition, defaults: dict[str, Any]) -> list[dict[str, Any]]:
    """What is tried before a sampler chooses: the defaults, and where somebody was."""
    first, start = [defaults], dict(definition.start or {})
    if start and start != {key: defaults[key] for key in start}:
        first.append({**defaults, **start})
    return first


class Sampler:
    """Asks Optuna for the values of each trial and tells it what became of them.

    A trial that was asked for and not told is there again when the file is opened anew: the same
    number with the same values.
    """

    def __init__(
        self,
        path: Path,
        definition: Definition,
        objectives: Sequence[Objective],
        bases: Sequence[RunParameters],
    ) -> None:
        """Open the file, or make it.

        Args:
            path: Optuna's journal.
            definition: Of the study.
            objectives: Whose values are told.
            bases: Of each recording what is not varied.

        Raises:
            StudyError: If the file cannot be read.
        """
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._optuna: Any = optuna
        self._definition, self._bases = definition, bases
        self._varied = {one.key: one for one in definition.varied}
        self._single = len(objectives) == 1
        self._journal: journal.Journal | None = None
        try:
            self._journal = journal.Journal(path)
            self._study: Any = optuna.create_study(
                storage=journal.storage(self._journal, minimized=self._minimized(objectives)),
                study_name=definition.name,
                directions=["maximize" if one.higher else "minimize" for one in objectives],
                sampler=self._sampler(),
                load_if_exists=True,
            )
            self._study.get_trials(deepcopy=False)  # here, where what fails is told
        except (ValueError, LookupError, TypeError, AttributeError, AssertionError,
                RecursionError) as error:  # fmt: skip
            self.close()
            raise StudyError(
                f"{path}: the record of what was tried cannot be read ({error}); the results are "
                "in results.sqlite3 beside it: start a new study with what they show"
            ) from None
        self._trials: dict[int, Any] = {}

    def close(self) -> None:
        """Close the file."""
        if self._journal is not None:
            self._journal.close()

    def _sampler(self) -> Any:
        samplers, seed = self._optuna.samplers, self._definition.seed
        search = self._definition.search
        if search == "auto":
            search = "tpe" if self._single else "nsga2"
        if search == "tpe":
            return samplers.TPESampler(
                multivariate=True, constant_liar=True, n_startup_trials=STARTUP, seed=seed
            )
        if search == "nsga2":
            size = max(8, min(50, self._definition.trials // 5))
            return samplers.NSGAIISampler(population_size=size, seed=seed)
        return samplers.RandomSampler(seed=seed)

    def _minimized(self, objectives: Sequence[Objective]) -> bool | None:
        """Of a search by TPE whether the smallest value is the best; None of other searches."""
        by_tpe = self._single and self._definition.search in ("auto", "tpe")
        return not objectives[0].higher if by_tpe else None

    @property
    def asked(self) -> int:
        """How many trials were asked for, ever."""
        return len(self._study.get_trials(deepcopy=False))

    def open_trials(self) -> list[int]:
        """Trials that were asked for and not told."""
        state = self._optuna.trial.TrialState
        found = self._study.get_trials(deepcopy=False, states=(state.RUNNING,))
        return [trial.number for trial in found]

    def again(self, number: int) -> dict[str, Any]:
        """The values of a trial that was asked for before."""
        trials = self._study.get_trials(deepcopy=False)
        identity = trials[number]._trial_id
        self._trials[number] = self._optuna.trial.Trial(self._study, identity)
        return self._drawn(number)

    def ask(self, values: Mapping[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Another trial: its number and values.

        Args:
            values: To be tried, where that is not the sampler's choice.
        """
        assert self._journal is not None
        with self._journal.together():
            if values is not None:
                fit = {k: v for k, v in values.items() if self._varied[k].contains(v)}
                self._study.enqueue_trial(fit)
            trial = self._study.ask()
            self._trials[trial.number] = trial
            return trial.number, self._drawn(trial.number)

    def _drawn(self, number: int) -> dict[str, Any]:
        trial = self._trials[number]

        def draw(one: Varied) -> Any:
            if one.choices:
                return trial.suggest_categorical(one.key, list(one.choices))
            assert one.low is not None
            assert one.high is not None
            if one.is_whole:
                return trial.suggest_int(one.key, int(one.low), int(one.high), log=one.log)
            return trial.suggest_float(one.key, one.low, one.high, log=one.log)

        return space.drawn(self._definition.varied, self._bases, draw)

    def tell(self, number: int, values: Sequence[float] | None, *, pruned: bool = False) -> None:
        """What became of a trial.

        Args:
            number: Of the trial.
            values: Of the objectives; None where it failed.
            pruned: Whether it was given up: then the values are of its first runs only.
        """
        trial, state = self._trials.pop(number), self._optuna.trial.TrialState
        assert self._journal is not None
        with self._journal.together():
            if values is None:
                self._study.tell(trial, state=state.FAIL)
            elif pruned:
                if self._single:
                    trial.report(float(values[0]), 0)
                self._study.tell(trial, state=state.PRUNED)
            else:
                self._study.tell(trial, [float(one) for one in values])

    def grid(self) -> list[dict[str, Any]]:
        """All trials of a grid.

        Raises:
            StudyError: If there are more than the study is to have.
        """
        most = self._definition.trials
        found = list(itertools.islice(space.grid(self._definition.varied, self._bases), most + 1))
        if len(found) > most:
            raise StudyError(
                f"search = grid: there are more combinations than the {most} trials; raise trials, "
                "take fewer steps, or another search"
            )
        return found
