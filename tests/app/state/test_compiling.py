"""The processes that compile the kernels: seen from the workbench, waited for, and ended."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from app.state.compiling import Compiling
from app.state.jobs import Jobs
from app.state.workbench import Workbench
from tests.app.conftest import wait_until
from tracker.files.lock import locked
from tracker.kernels import compilation
from tracker.runs import warm_up
from tracker.runs.warm_up import COMPILING


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which no kernel was compiled."""
    monkeypatch.setattr(compilation, "is_compiled", lambda: False)
    monkeypatch.setattr(compilation, "are_pixels_compiled", lambda: False)


def instead(monkeypatch: pytest.MonkeyPatch, code: str) -> list[subprocess.Popen[str]]:
    """Another program in place of the one that compiles; its processes, once they are started."""
    real, started = subprocess.Popen, list[subprocess.Popen[str]]()

    def start(line: list[str], **how: Any) -> Any:
        started.append(real([sys.executable, "-c", code, line[-1]], **how))
        return started[-1]

    monkeypatch.setattr(warm_up.subprocess, "Popen", start)
    return started


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
    processes = instead(monkeypatch, SLOW.replace("SEEN", repr(str(seen))))
    said: list[str] = []
    bench = Workbench()
    waits: list[str] = []

    def note(change: str) -> None:
        now = bench.snapshot()
        if now.sequence is not None and now.run is None:
            waits.append(now.run_state.message)

    bench.subscribe(note)
    worker = Compiling(said.append)
    jobs = Jobs(bench, data=data, compiling=worker)
    jobs.open("crossing").result(30.0)
    wait_until(lambda: said == [COMPILING] and f"{COMPILING}, 20 of 50" in waits)
    assert bench.snapshot().run_state.done == 0, "it is seen before it can be run"
    seen.touch()
    wait_until(lambda: bench.snapshot().run_state.state == "done")
    jobs.close()
    assert len(processes) == 2
    for process in processes:
        assert process.wait(10.0) < 0, "what goes on for the other methods ends with the workbench"


def test_a_run_that_is_under_way_at_the_end_does_not_begin_to_compile(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    processes = instead(monkeypatch, SLOW.replace("SEEN", repr(str(tmp_path / "seen"))))
    worker = Compiling()
    wait_until(lambda: len(processes) == 2)
    worker.stop()
    for process in processes:
        assert process.wait(10.0) != 0
    wait_until(lambda: not any("compiling" in each.name for each in threading.enumerate()))
    assert compilation._Elsewhere.compiles, "what runs as plain Python does so to its end"
    worker.close()
    assert not compilation._Elsewhere.compiles, "the next one compiles what it needs"


def test_who_need_not_wait_is_not_told_of_compiling(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    processes = instead(monkeypatch, SLOW.replace("SEEN", repr(str(tmp_path / "seen"))))
    monkeypatch.setattr(compilation, "are_pixels_compiled", lambda: True)
    said: list[str] = []
    worker = Compiling(said.append)
    wait_until(lambda: worker.words == f"{COMPILING}, 20 of 50")
    worker.wait(said.append, lambda: False)
    worker.close()
    assert said == []
    assert worker.words == ""
    assert len(processes) == 2


def test_that_the_loops_over_pixels_are_there_is_remembered_by_the_next_command(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A command that ends before all kernels are compiled leaves the next one nothing to wait
    for."""
    seen = tmp_path / "seen"
    seen.touch()
    instead(monkeypatch, SLOW.replace("SEEN", repr(str(seen))))
    said: list[str] = []
    first = Compiling(said.append)
    first.wait(lambda words: None, lambda: False)
    first.close()
    said.clear()
    again = Compiling(said.append)
    again.wait(said.append, lambda: False)
    again.close()
    assert said == []


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
    assert worker.words == ""


@pytest.mark.parametrize("code", ["raise SystemExit(3)", "import os; os.abort()"])
def test_nobody_waits_for_a_process_that_failed(
    uncompiled: None,
    monkeypatch: pytest.MonkeyPatch,
    code: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    instead(monkeypatch, code)
    worker = Compiling()
    worker.wait(lambda words: None, lambda: False)
    wait_until(lambda: "compiling ended with status" in caplog.text)


def test_nobody_waits_for_the_other_process_where_the_first_one_failed(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes = instead(
        monkeypatch, "import sys, time; time.sleep(300 if sys.argv[-1] != 'first' else 0); 1 / 0"
    )
    worker = Compiling()
    worker.wait(lambda words: None, lambda: False)
    assert any(process.poll() is None for process in processes)
    worker.close()


def test_nobody_waits_where_no_process_can_be_started(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError("no more processes")

    monkeypatch.setattr(warm_up.subprocess, "Popen", refuse)
    Compiling().wait(lambda words: None, lambda: False)


def test_who_does_not_want_the_sequence_any_more_does_not_wait(
    uncompiled: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes = instead(monkeypatch, "import time; time.sleep(300)")
    worker = Compiling()
    reported = threading.Event()
    worker.wait(lambda words: reported.set(), reported.is_set)
    wait_until(lambda: len(processes) == 2)
    assert all(process.poll() is None for process in processes)
    worker.close()


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A machine on which no kernel was compiled, with a folder of its own for them."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return compilation.kernel_folder() / "compiling"


def test_one_of_a_machine_compiles_and_the_others_find_it_done(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes = instead(monkeypatch, "")
    ready, statuses = threading.Event(), list[int]()
    with locked(elsewhere):
        other = threading.Thread(
            target=lambda: statuses.append(warm_up.ensure_compiled(ready=ready.set))
        )
        other.start()
        assert ready.wait(30.0), "its first run goes on meanwhile"
        compilation.mark_compiled()
    other.join(30.0)
    assert (statuses, processes) == ([0], [])


def test_who_waits_for_another_that_was_ended_compiles_itself(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes = instead(monkeypatch, "")
    asked = threading.Event()
    with locked(elsewhere):
        other = threading.Thread(target=lambda: warm_up.ensure_compiled(ready=asked.set))
        other.start()
        assert asked.wait(30.0)
    other.join(30.0)
    assert len(processes) == 2
    assert compilation.is_compiled()
    with locked(elsewhere):
        assert warm_up.ensure_compiled(stopped=lambda: True) == 0


def test_who_is_stopped_while_it_waits_compiles_nothing(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes = instead(monkeypatch, "")
    with locked(elsewhere):
        assert warm_up.ensure_compiled(stopped=lambda: True) != 0
    assert processes == []


def test_who_waits_for_all_kernels_is_told_how_many_there_are_and_not_slowed(
    elsewhere: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lines: list[list[str]] = []
    processes = instead(monkeypatch, 'print("3 50", flush=True)')
    start = warm_up.subprocess.Popen
    monkeypatch.setattr(
        warm_up.subprocess, "Popen", lambda line, **how: lines.append(line) or start(line, **how)
    )
    said: list[str] = []
    assert warm_up.ensure_compiled(said.append) == 0
    assert len(processes) == 2
    assert said[0] == COMPILING
    assert f"{COMPILING}, 3 of 50" in said
    assert not any(warm_up.BACKGROUND in line for line in lines)


def test_who_waits_for_another_that_compiles_is_told_so(elsewhere: Path) -> None:
    said: list[str] = []
    with locked(elsewhere):
        asked = iter([False, True])
        warm_up.ensure_compiled(said.append, stopped=lambda: next(asked, True))
    assert said == [COMPILING, warm_up.WAITING]
