"""The importance of parameters: the share of the variance that each explains, with its uncertainty.

[HHL14] Hutter, Hoos, Leyton-Brown, "An efficient approach for assessing hyperparameter
importance", ICML 2014 (fANOVA), in Optuna's implementation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

from tracker.studies.sampling import distribution
from tracker.studies.space import Varied
from tracker.studies.store import Trial

FEWEST = 12
"""Least number of complete trials for an estimate."""

REPEATS = 5
"""The number of bootstrap samples of the trials, whose spread is the uncertainty."""

TREES = 8
"""The number of trees of the forest."""

MOST_TRIALS = 200
"""Largest number of trials of a sample, since the time for the forest grows with it."""

GROWTH = 2.0
"""Factor by which the number of trials grows between two estimates."""


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
        A mapping with ``trials``, the number of trials, and ``shares``, the mean and the standard
        deviation of the share by key, the largest first.
    """
    import warnings

    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    distributions = {one.key: distribution(one) for one in varied}
    whole = [({**defaults, **values}, reached[0]) for values, reached in rows]
    usable = [
        ({one.key: one.nearest(values[one.key]) for one in varied}, lead) for values, lead in whole
    ]
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
    }


class ImportanceEstimator:
    """The estimates of importance in a running study, which a thread computes beside the runs."""

    def __init__(
        self, varied: Sequence[Varied], defaults: Mapping[str, Any], trials: int = 0
    ) -> None:
        """Store the arguments of the estimates.

        Args:
            varied: The varied parameters.
            defaults: Their default values, by key.
            trials: The number of trials of the last estimate; 0 if there is none.
        """
        self._varied, self._defaults = tuple(varied), dict(defaults)
        self._trials = trials
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="importance")
        self._pending: Future[dict[str, Any]] | None = None

    def update(self, complete: Sequence[Trial], *, last: bool = False) -> dict[str, Any] | None:
        """Return a new estimate, or None if there is none, and start the next one if due: whenever
        the number of trials has grown by :data:`GROWTH`.

        Args:
            complete: The trials that ended with all their runs.
            last: Whether there are no more trials; the estimate is then computed from all.
        """
        found = None
        if self._pending is not None and (last or self._pending.done()):
            found, self._pending = self._pending.result(), None
        due = self._trials + 1 if last else GROWTH * self._trials
        if self._pending is None and len(complete) >= max(FEWEST, due):
            self._trials = len(complete)
            rows = [(one.values, one.objectives) for one in complete if one.objectives]
            self._pending = self._thread.submit(importance, self._varied, rows, self._defaults)
            if last:
                return self.update(complete, last=True)
        return found

    def close(self) -> None:
        """End the thread."""
        self._thread.shutdown(cancel_futures=True)
