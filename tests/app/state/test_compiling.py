"""The processes that compile the kernels: seen from the workbench, waited for, and ended."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from app.state.workbench import Workbench
from app.state.workers.compiling import WORDS, Compiling
from app.state.workers.jobs import Jobs
from tests.app.conftest import wait_until
from tracker.kernels import compilation
from tracker.runs import warm_up


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which no kernel was compiled."""
    monkeypatch.setattr(compilation, "is_compiled", lambda: False)


def instead(monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    """Another program in place of the one that compiles."""
    real = subprocess.Popen

    def start(line: list[str], **how: Any) -> Any:
        return real([sys.executable, "-c", code, line[-1]], **how)

    monkeypatch.setattr(warm_up.subprocess, "Popen", start)


SLOW = """
import pathlib, sys, time
def say(words):
    print(words, flush=True)
say("3 50")
say("20 50")
while sys.argv[-1] != "first" or not pathlib.Path(SEEN).exists():
    time.sleep(0.01)
say("ready")
time.sleep(300)
"""
"""Half of it is compiled when somebody has seen how far it is: when there is a file SEEN."""


@pytest.mark.full
def test_a_sequence_is_shown_at_once_and_run_when_its_loops_over_pixels_are_there(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch, data: Path, tmp_path: Path
) -> None:
    seen = tmp_path / "seen"
    instead(monkeypatch, SLOW.replace("SEEN", repr(str(seen))))
    said: list[str] = []
    bench = Workbench()
    waits: list[str] = []

    def note(change: str) -> None:
        now = bench.snapshot()
        if now.sequence is not None and now.run is None:
            waits.append(now.run_state.message)
            if waits[-1] == f"{WORDS}, 20 of 50":
                seen.touch()

    bench.subscribe(note)
    worker = Compiling(said.append)
    jobs = Jobs(bench, data=data, compiling=worker)
    jobs.open("crossing").result(30.0)
    assert said == [WORDS]
    assert bench.snapshot().run_state.done == 0, "it is seen before it can be run"
    wait_until(lambda: bench.snapshot().run_state.state == "done")
    jobs.close()
    assert len(worker._processes) == 2
    for process in worker._processes.values():
        assert process.wait(10.0) < 0, "what goes on for the other methods ends with the workbench"


def test_a_run_that_is_under_way_at_the_end_does_not_begin_to_compile(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    instead(monkeypatch, SLOW.replace("SEEN", repr(str(tmp_path / "seen"))))
    worker = Compiling()
    assert len(worker._processes) == 2
    worker.stop()
    for process in worker._processes.values():
        assert process.wait(10.0) != 0
    wait_until(lambda: not any("compiling" in each.name for each in threading.enumerate()))
    assert compilation._Elsewhere.compiles, "what runs as plain Python does so to its end"
    worker.close()
    assert not compilation._Elsewhere.compiles, "the next one compiles what it needs"


def test_where_everything_is_compiled_nothing_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr(compilation, "is_compiled", lambda: True)
    monkeypatch.setattr(warm_up.subprocess, "Popen", never)
    said: list[str] = []
    worker = Compiling(said.append)
    worker.wait(never, lambda: False)
    worker.close()
    assert said == []


@pytest.mark.parametrize("code", ["raise SystemExit(3)", "import os; os.abort()"])
def test_nobody_waits_for_a_process_that_failed(
    uncompiled: None,
    monkeypatch: pytest.MonkeyPatch,
    code: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    instead(monkeypatch, code)
    worker = Compiling()
    worker.wait(lambda done, total: None, lambda: False)
    wait_until(lambda: "compiling ended with status" in caplog.text)


def test_nobody_waits_for_the_other_process_where_the_first_one_failed(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    instead(
        monkeypatch, "import sys, time; time.sleep(300 if sys.argv[-1] != 'first' else 0); 1 / 0"
    )
    worker = Compiling()
    worker.wait(lambda done, total: None, lambda: False)
    assert any(process.poll() is None for process in worker._processes.values())
    worker.close()


def test_nobody_waits_where_no_process_can_be_started(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr(warm_up.subprocess, "Popen", refuse)
    Compiling().wait(lambda done, total: None, lambda: False)


def test_who_does_not_want_the_sequence_any_more_does_not_wait(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    instead(monkeypatch, "import time; time.sleep(300)")
    worker = Compiling()
    reported = threading.Event()
    worker.wait(lambda done, total: reported.set(), reported.is_set)
    assert all(process.poll() is None for process in worker._processes.values())
    worker.close()
