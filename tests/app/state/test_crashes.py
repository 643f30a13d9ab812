"""After a native crash the draft that was computed with is put aside; after a kill it is not."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from queue import SimpleQueue

import pytest

from app.state.crashes import LAST, Crashes, Note
from app.state.jobs import Watchdog
from app.web.running import LEAST_BYTES, Budget, machine_memory
from tests.app.conftest import wait_until
from tracker.files.validated import write_json

START = """
import os, sys
from pathlib import Path
from app.state.crashes import Crashes
folder, draft, number = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
crashes = Crashes(folder)
crashes.watch()
with crashes.computing(Path(draft) if draft else None):
    os.kill(os.getpid(), number) if number else None
crashes.close()
"""


@pytest.fixture
def draft(tmp_path: Path) -> Path:
    path = tmp_path / "unsaved" / "draft.json"
    write_json(path, {"taught": 1})
    return path


def start(folder: Path, draft: Path | str, number: int) -> None:
    line = [sys.executable, "-c", START, folder, draft, str(number)]
    done = subprocess.run(line, stderr=subprocess.PIPE, check=False)
    assert done.returncode == -number, done.stderr


@pytest.mark.full
@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGABRT])
def test_the_draft_of_a_crash_is_put_aside(tmp_path: Path, draft: Path, number: int) -> None:
    folder = tmp_path / "starts"
    start(folder, draft, number)
    (told,) = Crashes(folder).tidy()
    assert "The program crashed" in told.words
    assert "draft.unreadable.json" in told.words
    assert not draft.exists()
    assert draft.with_suffix(".unreadable.json").is_file()
    assert "Fatal Python error" in (folder / LAST).read_text(encoding="utf-8")
    assert [path.name for path in folder.iterdir()] == [LAST]
    assert Crashes(folder).tidy() == []


@pytest.mark.full
def test_a_crash_with_what_is_saved_takes_no_draft(tmp_path: Path, draft: Path) -> None:
    start(tmp_path / "starts", "", signal.SIGSEGV)
    (told,) = Crashes(tmp_path / "starts").tidy()
    assert "changes" not in told.words
    assert draft.is_file()


@pytest.mark.full
@pytest.mark.parametrize("number", [0, signal.SIGKILL, signal.SIGTERM])
def test_an_end_or_a_kill_is_no_crash(tmp_path: Path, draft: Path, number: int) -> None:
    start(tmp_path / "starts", draft, number)
    assert Crashes(tmp_path / "starts").tidy() == []
    assert draft.is_file()
    assert not list((tmp_path / "starts").iterdir())


def test_notes_of_a_start_that_runs_are_left(tmp_path: Path) -> None:
    folder = tmp_path / "starts"
    folder.mkdir()
    (folder / "start-1.txt").write_text("of a process that is there")
    assert Crashes(folder).tidy() == []
    assert (folder / "start-1.txt").is_file()
    assert Crashes(None).tidy() == []


def test_silence_is_told_and_news_end_it() -> None:
    told: SimpleQueue[float] = SimpleQueue()
    with Watchdog(told.put, after=0.05, looks=0.01) as dog:
        assert told.get() >= 0.05
        before = time.monotonic()
        dog.heard()
        told.get()  # may have been measured before the news
        assert 0.05 <= told.get() <= time.monotonic() - before
    wait_until(lambda: all(thread.name != "watchdog" for thread in threading.enumerate()))


def test_a_budget_is_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Budget.of(8 << 30) == Budget(2 << 30, 4 << 30)
    assert Budget.of(0) == Budget(LEAST_BYTES // 4, LEAST_BYTES // 2)
    assert machine_memory() > LEAST_BYTES
    usual = Budget.of()
    monkeypatch.setattr("app.web.running.machine_memory", lambda: 512 << 20)
    small = Budget.of()
    assert small.pictures + small.columns <= 256 << 20
    assert small.pictures <= usual.pictures


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"place": 3}', '{"draft": ["a"]}', '{"good": -1}', '{"values": null}']
)
def test_a_spoilt_note_stops_no_start(tmp_path: Path, text: str) -> None:
    (tmp_path / "start-999999999.txt").write_text("Fatal Python error")
    (tmp_path / "start-999999999.json").write_text(text)
    (crash,) = Crashes(tmp_path).tidy()
    assert crash.note == Note()
