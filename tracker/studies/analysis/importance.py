"""The importance of parameters: the share of the variance that each explains, with its uncertainty.

[HHL14] Hutter, Hoos, Leyton-Brown, "An efficient approach for assessing hyperparameter
importance", ICML 2014 (fANOVA), in Optuna's implementation.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tracker.studies.definition.definition import Varied
from tracker.studies.storage.records import Trial
from tracker.studies.workers.cluster import Crew

FEWEST = 12
"""Least number of complete trials for an estimate."""

REPEATS = 5
"""The number of bootstrap samples of the trials, whose spread is the uncertainty."""

TREES = 8
"""The number of trees of the forest."""

MOST_TRIALS = 200
"""Largest number of trials of a sample, since the time for the forest grows with it."""

GROWTH = 2.0
"""Factor by which the number of trials grows between two estimates; the time for the next estimate
is expected to grow by the same factor."""

SHARE = 0.005
"""Largest ratio of the time for estimates to the workers' time for runs before the end."""

NEARLY = 0.9
"""Share of the complete trials on which an estimate must be based so that it is not computed again
at the end."""

LAST_SECONDS = 60.0
"""Longest time that the end of a study waits for the estimate, seconds."""


def importance(
    varied: Sequence[Varied],
    rows: Sequence[tuple[Mapping[str, Any], Sequence[float]]],
    defaults: Mapping[str, Any],
) -> dict[str, Any]:
    """Estimate the share of the variance of the first objective that each parameter explains.

    The shares are those of fANOVA [HHL14], averaged over bootstrap samples of the trials.

    Args:
        varied: The varied parameters.
        rows: The values by key and the objectives of each complete trial.
        defaults: The value of each parameter, by key, for trials in which it had no effect.

    Returns:
        A mapping with ``trials``, the number of trials; ``shares``, the mean and the standard
        deviation of the share by key, the largest first; and ``seconds``, the duration of the
        computation.
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
    """Return Optuna's distribution of a varied parameter."""
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
    """Return the values of the varied parameters, clipped to their ranges, which may exclude a
    default."""
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


class ImportanceEstimator:
    """The estimates of importance in a running study, which a worker computes from time to time."""

    def __init__(self, varied: Sequence[Varied], defaults: Mapping[str, Any]) -> None:
        """Store the arguments of the estimates.

        Args:
            varied: The varied parameters.
            defaults: Their default values, by key.
        """
        self._varied, self._defaults = tuple(varied), dict(defaults)
        self._poll: Callable[[], Any | None] | None = None
        """The getter of the estimate that is being computed."""
        self._trials = 0
        """The number of trials of the last estimate."""
        self._spent = self._last_seconds = 0.0

    def update(
        self, complete: Sequence[Trial], crew: Crew, *, worked: float, last: bool = False
    ) -> dict[str, Any] | None:
        """Return the newest estimate, or None if there is no new one, and start the next one if
        due.

        Args:
            complete: The trials that ended with all their runs.
            crew: The workers, one of which computes the estimate.
            worked: The time that the workers have spent on runs, seconds.
            last: Whether there are no more trials; the function then waits for the last estimate.
        """
        found = self._found()
        until = time.monotonic() + LAST_SECONDS
        while True:  # at the end, an earlier estimate may still be computed
            self._ask(complete, crew, worked, last)
            if not last or self._poll is None or time.monotonic() >= until:
                return found
            time.sleep(0.02)
            found = self._found() or found

    def _ask(self, complete: Sequence[Trial], crew: Crew, worked: float, last: bool) -> None:
        """Start an estimate if none is being computed and one is due."""
        needed = self._trials / NEARLY if last else self._trials * GROWTH
        spared = last or self._spent + GROWTH * self._last_seconds <= SHARE * worked
        if self._poll is None and spared and len(complete) >= max(FEWEST, needed):
            self._trials = len(complete)
            rows = [(one.values, one.objectives) for one in complete if one.objectives]
            self._poll = crew.call(importance, self._varied, rows, self._defaults)

    def _found(self) -> dict[str, Any] | None:
        """Return the estimate that was being computed, if it has ended."""
        found = None if self._poll is None else self._poll()
        if found is not None:
            self._poll = None
            self._last_seconds = found.pop("seconds")
            self._spent += self._last_seconds
        return found
