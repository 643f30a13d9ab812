"""The search is made of the trials of the study, and goes on from them wherever it was ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import optuna
import pytest

from tests.studies.small import definition
from tracker.parameters.catalogue import RunParameters
from tracker.studies.definition import StudyDefinition
from tracker.studies.objectives import OBJECTIVES
from tracker.studies.sampling import BEST, LAST, Sampler
from tracker.studies.store import Trial

P, RATE = "fusion.detection_probability", "fusion.clutter_rate"
Score = Callable[[dict[str, Any]], tuple[float, ...]]


@pytest.fixture
def made(tmp_path: Path) -> StudyDefinition:
    return definition(tmp_path, trials=400, search="auto")


def sampler(made: StudyDefinition, keys: tuple[str, ...], *state: Any) -> Sampler:
    return Sampler(made, [OBJECTIVES[key] for key in keys], [RunParameters()], *state)


def ended(number: int, values: dict[str, Any], *objectives: float, **fields: Any) -> Trial:
    state = fields.pop("state", "complete")
    return Trial(number, state, values, objectives or None, (), {}, False, "", 1.0, (), **fields)


def go_on(
    search: Sampler, trials: int, score: Score, violation: Callable[[float], float] | None = None
) -> list[Trial]:
    """Trials of a search, one after another."""
    found = []
    for _ in range(trials):
        number, values = search.ask()
        missing = 0.0 if violation is None else violation(values[P])
        trial = ended(number, values, *score(values), missing_overlap=missing)
        found.append(replace(trial, vetoed=missing > 0.0))
        search.tell(found[-1])
    return found


def near(values: dict[str, Any]) -> tuple[float, ...]:
    return (-abs(values[P] - 0.7), -abs(values[RATE] - 1.0))


def test_numbers_that_are_neither_ended_nor_under_way_come_next(made: StudyDefinition) -> None:
    values = {P: 0.7, RATE: 1.0}
    search = sampler(made, ("score",), [ended(k, values, 0.5) for k in (1, 2, 5)], {3: values})
    assert search.left == 396
    assert [search.ask()[0] for _ in range(4)] == [0, 4, 6, 7]
    search.tell(ended(3, values, 0.5))
    assert search.left == 392


def test_a_grid_is_gone_on_with_where_it_was(tmp_path: Path) -> None:
    grid = definition(tmp_path, search="grid", trials=40)
    whole = sampler(grid, ("score",))
    values = dict(whole.ask() for _ in range(whole.trials))
    known = [ended(k, values[k], 0.5) for k in (0, 2, 3)]
    rest = sampler(grid, ("score",), known, {1: values[1]})
    assert dict(rest.ask() for _ in range(rest.left)) == {
        k: v for k, v in values.items() if k not in (0, 1, 2, 3)
    }


@pytest.mark.parametrize("search", ["random", "tpe", "nsga2"])
def test_a_search_that_goes_on_does_not_draw_the_same_again(
    made: StudyDefinition, search: str
) -> None:
    made = made.model_copy(update={"search": search})
    first = sampler(made, ("score",))
    trials = go_on(first, 8, lambda values: (values[P],))
    again = go_on(sampler(made, ("score",), trials), 6, lambda values: (values[P],))
    drawn = [one.values[P] for one in (*trials, *again)]
    assert len(set(drawn)) == len(drawn)


def test_the_same_trials_lead_to_the_same_values(made: StudyDefinition) -> None:
    trials = go_on(sampler(made, ("score",)), 30, lambda values: near(values)[:1])
    running = {30: {P: 0.65, RATE: 2.0}}
    one, other = (sampler(made, ("score",), trials, running) for _ in range(2))
    assert [one.ask() for _ in range(3)] == [other.ask() for _ in range(3)]


@pytest.mark.parametrize("keys", [("score",), ("score", "speed")])
def test_what_was_learnt_is_used_after_a_restart(
    made: StudyDefinition, keys: tuple[str, ...]
) -> None:
    """The search goes on near the best p_D, where a sixth of uniform draws lies."""

    def score(values: dict[str, Any]) -> tuple[float, ...]:
        return near(values)[: len(keys)]

    few = made.model_copy(update={"trials": 60})
    trials = go_on(sampler(few, keys), 108, score)
    after = go_on(sampler(few, keys, trials), 36, score)
    assert sum(abs(one.values[P] - 0.7) < 0.03 for one in after) > 12


@pytest.mark.parametrize("keys", [("identity",), ("identity", "speed")])
def test_vetoed_trials_are_infeasible_however_good_they_are(
    made: StudyDefinition, keys: tuple[str, ...]
) -> None:
    """Also those of a study of before, which stored no more than the veto."""

    def score(values: dict[str, Any]) -> tuple[float, ...]:
        return (1.0 - values[P], 1.0)[: len(keys)]

    def violation(p: float) -> float:
        return max(0.0, 0.8 - p)

    few = made.model_copy(update={"trials": 60})
    trials = go_on(sampler(few, keys), 60, score, violation)
    assert sum(one.vetoed for one in trials) > 0
    assert sum(one.vetoed for one in trials[40:]) < 10
    assert sum(not one.vetoed and one.values[P] < 0.85 for one in trials[40:]) > 5
    old = [replace(one, missing_overlap=0.0) for one in trials]
    again = go_on(sampler(made, keys, old), 20, score, violation)
    assert sum(one.vetoed for one in again) < 10


@pytest.mark.full
def test_a_long_search_uses_the_best_and_the_last_trials(
    made: StudyDefinition, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[list[Any]] = []
    add = optuna.study.Study.add_trials

    def adding(self: optuna.study.Study, trials: Any) -> None:
        used.append([one for one in trials if one.state.is_finished()])
        add(self, trials)

    monkeypatch.setattr(optuna.study.Study, "add_trials", adding)
    trials = [
        ended(k, {P: 0.6 + 0.3 * ((k * 577) % 2000) / 2000, RATE: 1.0}, ((k * 577) % 2000) / 2000)
        for k in range(2000)
    ]
    search = sampler(made.model_copy(update={"trials": 5000}), ("score",), trials)
    assert len(used[-1]) == BEST + LAST
    reached = {one.value for one in used[-1]}
    early = sorted((one.objectives or (0.0,))[0] for one in trials[:-LAST])
    assert set(early[-BEST:]) <= reached
    assert {(one.objectives or (0.0,))[0] for one in trials[-LAST:]} <= reached
    number, values = search.ask()
    assert number == 2000
    for k in range(2001, 2260):
        other, tried = search.ask()
        assert other == k
        search.tell(ended(k, tried, 0.5))
    assert len(used) == 2
    assert max(len(some) for some in used) == BEST + LAST
    search.tell(ended(number, values, 0.5))


def test_failed_and_pruned_trials_are_taken_into_account(made: StudyDefinition) -> None:
    search = sampler(made, ("score",))
    for state, objectives in (("failed", ()), ("pruned", (0.3,)), ("complete", (0.4,))):
        number, values = search.ask()
        search.tell(ended(number, values, *objectives, state=state))
    trials = [
        ended(0, {P: 0.95, RATE: 3.0}, state="failed"),
        ended(1, {P: 0.9, RATE: 2.0}, 0.3, state="pruned"),
    ]
    assert sampler(made, ("score",), trials).ask()[0] == 2
    assert (
        sampler(made, ("score", "speed"), [replace(trials[1], objectives=(0.3, 9.0))]).left == 399
    )
