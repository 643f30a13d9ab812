"""What parameters would change: computed on demand, kept, and given up when somebody works."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from app.state import sensitivity as module
from app.state.sensitivity import Curve, Sensitivity, shares, values_to_try
from app.state.workbench import Workbench
from tracker.evaluation import evaluate_sequence
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import ParameterError, value_of, with_values
from tracker.runs import pipeline
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence

P_D, T_E = "fusion.detection_probability", "fusion.extraction_threshold"


@pytest.fixture
def bench(crossing: Path) -> Workbench:
    workbench = Workbench()
    sequence = read_sequence(crossing)
    workbench.open(sequence, "key", FrameReader(sequence), pipeline.default_parameters(sequence))
    return workbench


@pytest.fixture
def curves(bench: Workbench) -> Iterator[Sensitivity]:
    made = Sensitivity(bench)
    yield made
    made.close()


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_the_values_tried_are_few_allowed_and_hold_the_one_now() -> None:
    tried = {key: (p, values_to_try(p, p.default)) for key, p in PARAMETERS.items()}
    assert not [
        f"{key}: {values}"
        for key, (p, values) in tried.items()
        if p.default not in values or not 2 <= len(set(values)) == len(values) <= 7
    ]
    for key, (_, values) in tried.items():
        for value in values:
            with_values(RunParameters(), {key: value})


@pytest.mark.full
def test_a_curve_is_what_runs_of_these_values_reach(bench: Workbench, curves: Sensitivity) -> None:
    curves.ask([T_E])
    until(lambda: not curves.under_way)
    curve = curves.curves()[T_E]
    assert curve.whole
    assert curve.measure == "MOTA"
    now = bench.snapshot()
    assert now.sequence is not None
    assert curve.values == values_to_try(PARAMETERS[T_E], value_of(now.parameters, T_E))
    last = with_values(now.parameters, {T_E: curve.values[-1]})
    run = pipeline.compute(now.sequence, last)
    figures = evaluate_sequence(now.sequence, run.tracks).figures
    mota = next(figure.value for figure in figures if figure.definition.key == "mota")
    assert curve.scores[-1] == pytest.approx(mota)


def test_a_curve_holds_whatever_its_parameter_is_and_is_not_computed_twice(
    bench: Workbench, curves: Sensitivity, monkeypatch: pytest.MonkeyPatch
) -> None:
    curves.ask([T_E])
    until(lambda: not curves.under_way)
    bench.set_parameters({T_E: curves.curves()[T_E].values[0]}, "test")
    assert curves.curves()[T_E].whole
    monkeypatch.setattr(module.pipeline, "compute", lambda *_, **__: pytest.fail("computed again"))
    curves.ask([T_E])
    until(lambda: not curves.under_way)
    bench.set_parameters({P_D: 0.5}, "test")
    assert T_E not in curves.curves(), "of other parameters nothing is known"


@pytest.mark.parametrize("work", [
    lambda bench: bench.set_parameters({P_D: 0.5}, "test"),
    lambda bench: bench.seek(7),
])  # fmt: skip
def test_whoever_works_ends_it(
    bench: Workbench, curves: Sensitivity, monkeypatch: pytest.MonkeyPatch, work: Any
) -> None:
    begun: list[bool] = []
    ended: list[bool] = []

    def compute(*_: Any, cancelled: Callable[[], bool], **__: Any) -> None:
        begun.append(True)
        until(cancelled)
        ended.append(True)
        raise pipeline.Cancelled

    monkeypatch.setattr(module.pipeline, "compute", compute)
    curves.ask([P_D, T_E])
    until(lambda: bool(begun))
    assert curves.under_way == [P_D, T_E]
    work(bench)
    until(lambda: bool(ended) and not curves.under_way)
    assert curves.curves() == {}


def test_what_is_no_parameter_is_refused(curves: Sensitivity) -> None:
    with pytest.raises(ParameterError):
        curves.ask(["fusion.nothing"])


def test_pages_are_told_how_far_it_is_and_that_it_ended(
    bench: Workbench, curves: Sensitivity
) -> None:
    curves.ask([T_E])
    task = bench.snapshot().tasks["effects"]
    tried = len(values_to_try(PARAMETERS[T_E], PARAMETERS[T_E].default))
    assert (task.of, task.total) == (bench.snapshot().sequence_key, tried)
    until(lambda: bench.snapshot().tasks["effects"].state == "done")
    assert bench.snapshot().tasks["effects"].done == tried


def test_shares_of_the_variance_are_those_of_the_curves_that_are_whole() -> None:
    steep = Curve(P_D, "MOTA", (0.2, 0.5, 0.8), (0.9, 0.6, 0.9), whole=True)
    flat = Curve(T_E, "MOTA", (0.2, 0.5, 0.8), (0.9, None, 0.8), whole=True)
    part = Curve("fusion.memory", "MOTA", (0.0, 3.0), (0.1, 0.9), whole=False)
    # variances 0.02 and 0.0025
    assert shares({P_D: steep, T_E: flat, "fusion.memory": part}) == {
        P_D: pytest.approx(8 / 9),
        T_E: pytest.approx(1 / 9),
    }
    assert shares({P_D: steep, "fusion.memory": part}) == {}, "there is nothing to compare with"
    level = Curve(T_E, "MOTA", (0.2, 0.5), (0.9, 0.9), whole=True)
    assert shares({P_D: level, T_E: level}) == {P_D: 0.0, T_E: 0.0}
