"""The choice of the next trial's values by Optuna, in memory, from the trials of the study.

[AYY19] Akiba, Sano, Yanase, Ohta, Koyama, "Optuna: a next-generation hyperparameter optimization
framework", KDD 2019. TPE: Bergstra, Bardenet, Bengio, Kégl, NeurIPS 2011; for several objectives
NSGA-II: Deb, Pratap, Agarwal, Meyarivan, IEEE TEVC 6(2), 2002.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tracker.parameters.catalogue import RunParameters
from tracker.studies import space
from tracker.studies.definition import StudyDefinition
from tracker.studies.errors import StudyError
from tracker.studies.objectives import VETO, Objective
from tracker.studies.space import Varied
from tracker.studies.store import Trial

STARTUP = 12
"""The number of random trials before TPE is used."""

BEST = 100
LAST = 400
"""The numbers of best and of last trials that TPE uses in a long search, so that the time for a new
trial does not grow with the number of trials. TPE compares at most 25 good trials with all others,
among which old ones have little weight; the good ones are still the best of all trials."""

REBUILD = 250
"""The number of trials that end before the search is rebuilt from the best and the last ones."""


def first_values(definition: StudyDefinition, defaults: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the values of the first trials: the defaults, and the defaults with the user's own
    values if these differ."""
    first, start = [defaults], dict(definition.start or {})
    if start and start != {key: defaults[key] for key in start}:
        first.append({**defaults, **start})
    return first


def distribution(one: Varied) -> Any:
    """Return Optuna's distribution of a varied parameter."""
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    if one.choices:
        return CategoricalDistribution(list(one.choices))
    low, high = one.limits
    if one.is_whole:
        return IntDistribution(int(low), int(high), log=one.log)
    return FloatDistribution(low, high, log=one.log)


class Sampler:
    """The search of a study: it chooses the values of each trial, given those that ended.

    What was tried is in the study's own table alone. The search by Optuna is made from it, and made
    anew from the best and the last trials from time to time.
    """

    def __init__(
        self,
        definition: StudyDefinition,
        objectives: Sequence[Objective],
        bases: Sequence[RunParameters],
        ended: Sequence[Trial] = (),
        running: Mapping[int, Mapping[str, Any]] | None = None,
    ) -> None:
        """Rebuild the search from the trials that ended and those under way.

        Args:
            definition: The study's definition.
            objectives: The objectives whose values are reported.
            bases: The parameters on each recording with the fixed values of the study.
            ended: The trials that ended.
            running: The values by key of each trial under way, by its number.

        Raises:
            StudyError: If a grid has more combinations than the study has trials.
        """
        self._definition, self._bases = definition, bases
        self._objectives = tuple(objectives)
        self._varied = {one.key: one for one in definition.varied}
        self.defaults = space.defaults_of(definition.varied, bases[0])
        """The default values of the varied parameters, by key."""
        given = first_values(definition, self.defaults)
        self.fixed = len(given)
        """The number of trials whose values are the defaults or the user's own."""
        if definition.search == "grid":
            given += self._grid()
        self._given = given
        self.trials = definition.trials if definition.search != "grid" else len(given)
        """The number of trials that the study has."""
        self._search = definition.search
        if self._search == "auto":
            self._search = "tpe" if len(self._objectives) == 1 else "nsga2"
        self._constrained = any(one.of == "agreement" for one in objectives)
        self._next = 0
        self._ended = list(ended)
        self._running = {number: dict(values) for number, values in (running or {}).items()}
        self._known = {trial.number for trial in ended} | set(self._running)
        self._rebuild()

    @property
    def left(self) -> int:
        """The number of trials that have not begun."""
        return self.trials - len(self._known)

    @property
    def has_begun(self) -> bool:
        """Whether the trial of the defaults has begun."""
        return 0 in self._known

    def ask(self) -> tuple[int, dict[str, Any]]:
        """Choose the values of the next trial, and return its number and the values by key."""
        number = next(k for k in itertools.count(self._next) if k not in self._known)
        self._next = number
        given = self._given[number] if number < len(self._given) else None
        values = self._begin(number, given)
        if given is not None and number < self.fixed:
            values = given if number == 0 else values | given
        self._known.add(number)
        self._running[number] = values
        return number, values

    def tell(self, trial: Trial) -> None:
        """Report a trial that ended.

        One with :attr:`~tracker.studies.store.Trial.missing_overlap` is infeasible, whatever its
        objectives are.
        """
        from optuna.trial import TrialState

        self._ended.append(trial)
        del self._running[trial.number]
        if self._search != "nsga2" and len(self._ended) - self._built >= REBUILD:
            self._rebuild()
            return
        # what began is replaced by what ended, since a rebuilt search has no handle to tell it by
        self._study.tell(self._open.pop(trial.number), state=TrialState.FAIL)
        self._study.add_trial(self._ended_trial(trial))

    def _rebuild(self) -> None:
        """Make Optuna's study from the trials that ended and those under way."""
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._built = len(self._ended)
        self._generations = itertools.count()
        self._study = optuna.create_study(
            directions=["maximize" if one.higher else "minimize" for one in self._objectives],
            sampler=self._sampler(),
        )
        ended = [self._ended_trial(trial) for trial in self._remembered()]
        running = [
            self._trial(optuna.trial.TrialState.RUNNING, values)
            for values in self._running.values()
        ]
        self._study.add_trials([*ended, *running])
        self._open = {number: len(ended) + k for k, number in enumerate(self._running)}

    def _sampler(self) -> Any:
        """Return Optuna's sampler; one that goes on draws other numbers than from the beginning."""
        from optuna import samplers

        seed = self._definition.seed
        if self._known:
            seed = int(np.random.SeedSequence([seed, len(self._known)]).generate_state(1)[0])
        if self._search == "tpe":
            return samplers.TPESampler(
                multivariate=True, constant_liar=True, n_startup_trials=STARTUP, seed=seed
            )
        if self._search == "nsga2":
            return samplers.NSGAIISampler(population_size=self._population, seed=seed)
        return samplers.RandomSampler(seed=seed)

    @property
    def _population(self) -> int:
        """The number of trials of a generation of NSGA-II."""
        return max(8, min(50, self._definition.trials // 5))

    def _remembered(self) -> list[Trial]:
        """Return the trials that the search uses, by number: for TPE the best and the last ones."""
        if self._search in ("random", "grid"):
            return []
        if self._search == "nsga2" or len(self._ended) <= BEST + LAST:
            return sorted(self._ended, key=lambda one: one.number)
        early = [one for one in self._ended[:-LAST] if one.state == "complete"]
        sign = -1.0 if self._objectives[0].higher else 1.0
        best = heapq.nsmallest(
            BEST, early, key=lambda one: (_violation(one), sign * (one.objectives or (0.0,))[0])
        )
        return sorted([*best, *self._ended[-LAST:]], key=lambda one: one.number)

    def _ended_trial(self, trial: Trial) -> Any:
        """Return a trial that ended as Optuna's."""
        reached: dict[str, Any] = {}
        if trial.objectives is not None and trial.state == "complete":
            reached["values"] = list(trial.objectives)
            generation = next(self._generations) // self._population
            reached["system_attrs"] = {"NSGAIISampler:generation": generation}
        elif trial.objectives is not None and len(trial.objectives) == 1:
            reached["intermediate_values"] = {0: trial.objectives[0]}
        if self._constrained and trial.objectives is not None:
            reached["constraints"] = {"missing overlap": _violation(trial)}
        return self._trial(_state_of(trial), trial.values, **reached)

    def _trial(self, state: Any, tried: Mapping[str, Any], **reached: Any) -> Any:
        """Return a trial of Optuna's with a state and values by key.

        Args:
            state: Optuna's state.
            tried: The values by key.
            reached: Further arguments of Optuna's function.
        """
        from optuna.trial import create_trial

        chosen = {key: one for key, one in self._varied.items() if key in tried}
        return create_trial(
            state=state,
            params={key: one.nearest(tried[key]) for key, one in chosen.items()},
            distributions={key: distribution(one) for key, one in chosen.items()},
            **reached,
        )

    def _begin(self, number: int, given: Mapping[str, Any] | None) -> dict[str, Any]:
        """Begin a trial of Optuna's study, and return its values by key.

        Args:
            number: The number of the trial.
            given: Values that the trial has, as far as the ranges allow; None if they are chosen.
        """
        if given is not None:
            near = {k: self._varied[k].nearest(v) for k, v in given.items() if k in self._varied}
            self._study.enqueue_trial(near)
        trial = self._study.ask()
        self._open[number] = trial.number

        def draw(one: Varied) -> Any:
            if one.choices:
                return trial.suggest_categorical(one.key, list(one.choices))
            low, high = one.limits
            if one.is_whole:
                return trial.suggest_int(one.key, int(low), int(high), log=one.log)
            return trial.suggest_float(one.key, low, high, log=one.log)

        return space.drawn(self._definition.varied, self._bases, draw)

    def _grid(self) -> list[dict[str, Any]]:
        """Return the values of all trials of a grid."""
        most = self._definition.trials
        found = list(itertools.islice(space.grid(self._definition.varied, self._bases), most + 1))
        if len(found) > most:
            raise StudyError(
                f"search = grid: there are more combinations than the {most} trials; raise trials, "
                "take fewer steps, or another search"
            )
        return found


def _state_of(trial: Trial) -> Any:
    """Return Optuna's state of a trial that ended."""
    from optuna.trial import TrialState

    if trial.objectives is None:
        return TrialState.FAIL
    return TrialState.COMPLETE if trial.state == "complete" else TrialState.PRUNED


def _violation(trial: Trial) -> float:
    """Return by how much a trial violates the constraint on the held-out overlap; 0 if it does
    not. Earlier versions stored only that a trial is vetoed."""
    return trial.missing_overlap or (VETO if trial.vetoed else 0.0)
