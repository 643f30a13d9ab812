"""Which parameters matter: shares of the variance, and how sure they are.

[HHL14] Hutter, Hoos, Leyton-Brown, "An efficient approach for assessing hyperparameter
importance", ICML 2014 (fANOVA), as Optuna has it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tracker.studies.defined.definition import Varied

FEWEST = 12
"""Complete trials below which nothing is told."""

REPEATS = 5
"""Times that it is found out from trials drawn with replacement: their spread is told."""

TREES = 8

MOST_TRIALS = 200
"""More are drawn from at random: the forest takes time with their number."""


def importance(
    varied: Sequence[Varied],
    rows: Sequence[tuple[Mapping[str, Any], Sequence[float]]],
    defaults: Mapping[str, Any],
) -> dict[str, Any]:
    """Share of the variance of the first objective that each parameter explains by itself.

    Args:
        varied: What is varied.
        rows: Values and objectives of each complete trial.
        defaults: Of a parameter where a trial did not need it.

    Returns:
        ``trials``, ``shares``: by key a mean and its standard deviation, largest first, and
        ``seconds``: what it took.
    """
    import warnings

    begin = time.perf_counter()
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    distributions = {one.key: _distribution(one) for one in varied}
    usable = [(_inside(varied, {**defaults, **values}), told[0]) for values, told in rows]
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
            warnings.simplefilter("ignore")  # of a parameter that no draw varies
            evaluator = optuna.importance.FanovaImportanceEvaluator(
                n_trees=TREES, seed=int(rng.integers(2**31))
            )
            try:
                shares = evaluator.evaluate(study)
            except (ValueError, RuntimeError):  # all values are the same
                shares = {}
        for key, each in found.items():
            each.append(float(shares.get(key, 0.0)))
    told = {key: [float(np.mean(each)), float(np.std(each, ddof=1))] for key, each in found.items()}
    return {
        "trials": len(rows),
        "shares": dict(sorted(told.items(), key=lambda pair: -pair[1][0])),
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
    """The values, a default that lies outside its range at the range's end."""
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
