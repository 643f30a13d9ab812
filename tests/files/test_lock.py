"""A lock has one holder, among threads and processes, and none once its process has ended."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tracker.files.lock import is_locked, locked

HOLDER = """
import sys, time, pathlib
from tracker.files.lock import locked
with locked(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(300)
"""


def test_one_holder_at_a_time(tmp_path: Path) -> None:
    inside, most = 0, list[int]()
    guard = threading.Lock()

    def enter() -> None:
        nonlocal inside
        for _ in range(20):
            with locked(tmp_path / "file") as held:
                assert held
                with guard:
                    inside += 1
                    most.append(inside)
                with guard:
                    inside -= 1

    threads = [threading.Thread(target=enter) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1] * 80


def test_who_gives_up_is_told_and_holds_nothing(tmp_path: Path) -> None:
    attempts: list[bool] = []

    def wait() -> bool:
        attempts.append(is_locked(tmp_path / "file"))
        return len(attempts) < 3

    with locked(tmp_path / "file"), locked(tmp_path / "file", wait=wait) as held:
        assert not held
    assert attempts == [True] * 3
    with locked(tmp_path / "file", wait=lambda: False) as held:
        assert held


def test_asking_makes_no_file_and_takes_no_lock(tmp_path: Path) -> None:
    assert not is_locked(tmp_path / "none" / "file")
    assert list(tmp_path.iterdir()) == []
    with locked(tmp_path / "file"):
        assert is_locked(tmp_path / "file")
    assert not is_locked(tmp_path / "file")


@pytest.mark.skipif(sys.platform == "win32", reason="it has no such signal")
def test_a_killed_process_holds_nothing(tmp_path: Path) -> None:
    line = [sys.executable, "-c", HOLDER, str(tmp_path / "file")]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert is_locked(tmp_path / "file")
        process.kill()
        process.wait()
        with locked(tmp_path / "file", wait=lambda: False) as held:
            assert held
