"""The importance of parameters: shares of the variance that they explain, and their uncertainty.

[HHL14] Hutter, Hoos, Leyton-Brown, "An efficient approach for assessing hyperparameter
importance", ICML 2014 (fANOVA), in Optuna's implementation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tracker.studies.defined.definition import Varied
from tracker.studies.kept.records import Trial
from tracker.studies.work.cluster import Crew

FEWEST = 12
"""Least number of complete trials for an estimate."""

REPEATS = 5
"""The number of bootstrap samples of the trials, whose spread is the uncertainty."""

TREES = 8
"""The number of trees of the forest."""

MOST_TRIALS = 200
"""Most trials of a sample, since the time for the forest grows with their number."""

GROWTH = 2.0
"""The estimate is computed again when the number of trials has grown by this factor."""

SHARE = 0.005
"""Largest share of the workers' time that is spent on estimates before the end."""

NEARLY = 0.9
"""At the end the estimate is not computed again if it is based on this share of the trials."""

LAST_SECONDS = 60.0
"""Longest time that the end of a study waits for the estimate, seconds."""


def importance(
    varied: Sequence[Varied],
    rows: Sequence[tuple[Mapping[str, Any], Sequence[float]]],
    defaults: Mapping[str, Any],
) -> dict[str, Any]:
    """Estimate the share of the variance of the first objective that each parameter explains.

    Args:
        varied: The varied parameters.
        rows: The values and the objectives of each complete trial.
        defaults: The value of each parameter for trials in which it had no effect.

    Returns:
        A mapping with ``trials``, the number of trials; ``shares``, the mean and standard deviation
        by key, largest first; and ``seconds``, the time of the computation.
    """
    import warnings

    begin = time.perf_counter()
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    distributions = {one.key: _distribution(one) for one in varied}
    usable = [(_inside(varied, {**defaults, **values}), reached[0]) for values, reached in rows]
    rng = np.random.default_rng(0)
    found: dict[str, list[float]] = {one.key: [] for one in varied}
    for _ in range(REPEATS):
        drawn = rng.integers(len(usable), size=min(len(usable), MOST_TRIALS))
        study = optuna.create_study()
        study.add_trials(
            [
                optuna.trial.create_trial(
                    params=usable[i][0], distributions=distributions, value=float(usable[i][1])
                )
                for i in drawn.tolist()
            ]
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a parameter may not vary within a sample
            evaluator = optuna.importance.FanovaImportanceEvaluator(
                n_trees=TREES, seed=int(rng.integers(2**31))
            )
            try:
                shares = evaluator.evaluate(study)
            except (ValueError, RuntimeError):  # all objectives are equal
                shares = {}
        for key, each in found.items():
            each.append(float(shares.get(key, 0.0)))
    means = {
        key: [float(np.mean(each)), float(np.std(each, ddof=1))] for key, each in found.items()
    }
    return {
        "trials": len(rows),
        "shares": dict(sorted(means.items(), key=lambda pair: -pair[1][0])),
        "seconds": time.perf_counter() - begin,
    }


def _distribution(one: Varied) -> Any:
    from optuna.distributions import (
        CategoricalDistribution,
        FloatDistribution,
        IntDistribution,
    )

    if one.choices:
        return CategoricalDistribution(list(one.choices))
    assert one.low is not None
    assert one.high is not None
    if one.is_whole:
        return IntDistribution(int(one.low), int(one.high), log=one.log)
    return FloatDistribution(one.low, one.high, log=one.log)


def _inside(varied: Sequence[Varied], values: Mapping[str, Any]) -> dict[str, Any]:
    """Clip the values to the varied ranges, which may exclude a default."""
    found = {}
    for one in varied:
        here = values[one.key]
        if one.choices:
            found[one.key] = here if here in one.choices else one.choices[0]
        else:
            assert one.low is not None
            assert one.high is not None
            found[one.key] = min(max(here, one.low), one.high)
    return found


class Weighing:
    """Has the importance estimated by a worker of a running study, when it is worth the time."""

    def __init__(self, varied: Sequence[Varied], defaults: Mapping[str, Any]) -> None:
        """Store the arguments of the estimates.

        Args:
            varied: The varied parameters.
            defaults: Their default values, by key.
        """
        self._varied, self._defaults = tuple(varied), dict(defaults)
        self._asked: Callable[[], Any | None] | None = None
        self._weighed = 0
        self._spent = self._took = 0.0

    def news(
        self, complete: Sequence[Trial], crew: Crew, *, worked: float, last: bool = False
    ) -> dict[str, Any] | None:
        """Return a new estimate if one has been computed, and have the next one computed if due.

        Args:
            complete: The trials that ended with all their runs.
            crew: The workers, one of which computes the estimate.
            worked: The time that the workers spent on runs so far, seconds.
            last: Whether there are no more trials, so that the estimate is waited for.
        """
        found = self._found()
        until = time.monotonic() + LAST_SECONDS
        while True:  # at the end, an earlier estimate may still be computed
            self._ask(complete, crew, worked, last)
            if not last or self._asked is None or time.monotonic() >= until:
                return found
            time.sleep(0.02)
            found = self._found() or found

    def _ask(self, complete: Sequence[Trial], crew: Crew, worked: float, last: bool) -> None:
        needed = self._weighed / NEARLY if last else self._weighed * GROWTH
        spared = last or self._spent + GROWTH * self._took <= SHARE * worked
        if self._asked is None and spared and len(complete) >= max(FEWEST, needed):
            self._weighed = len(complete)
            rows = [(one.values, one.objectives) for one in complete if one.objectives]
            self._asked = crew.call(importance, self._varied, rows, self._defaults)

    def _found(self) -> dict[str, Any] | None:
        found = None if self._asked is None else self._asked()
        if found is not None:
            self._asked = None
            self._took = found.pop("seconds")
            self._spent += self._took
        return found
