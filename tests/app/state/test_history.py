"""The list of runs: a row a settled state, not a row a movement of a slider."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.state import history
from app.state.history import History
from app.state.workbench import Workbench
from tracker.runs import pipeline
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence

P_D, P_S = "fusion.detection_probability", "fusion.survival_probability"


@pytest.fixture
def bench(crossing: Path) -> Workbench:
    workbench = Workbench()
    sequence = read_sequence(crossing)
    workbench.open(sequence, "key", FrameReader(sequence), pipeline.default_parameters(sequence))
    return workbench


def compute(bench: Workbench, number: int) -> None:
    """A run of the parameters as they are, done at once."""
    bench.run_begins(f"run{number}")
    bench.run_ends(f"run{number}", "done")


def test_a_drag_is_one_row_and_two_changes_are_two(
    bench: Workbench, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(history.time, "monotonic", lambda: now)
    listed = History(bench)
    compute(bench, 0)
    for number, value in enumerate((0.9, 0.8, 0.7, 0.65), start=1):
        now += 0.3
        bench.set_parameters({P_D: value}, "viser")
        compute(bench, number)
    rows = [(run.number, run.parameters.fusion.detection_probability) for run in listed.runs]
    assert rows[0] == (2, 0.65)
    assert [number for number, _ in rows] == [2, 1]
    now += 0.3  # another slider is another change, however soon
    bench.set_parameters({P_S: 0.9}, "viser")
    compute(bench, 10)
    now += 60.0  # and so is the same one later
    bench.set_parameters({P_S: 0.8}, "viser")
    compute(bench, 11)
    assert [run.number for run in listed.runs] == [4, 3, 2, 1]
    listed.close()
