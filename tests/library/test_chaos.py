"""Processes that write, star and delete, killed at any moment: the file stays whole."""

from __future__ import annotations

import os
import random
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.library.runs import filled
from tracker.library import repair
from tracker.library.store import Library

WRITERS = 4

WRITER = """
import random, sys
from pathlib import Path
from tests.library.runs import RECORDING, run, tracks
from tracker.library.store import Library

path, name = Path(sys.argv[1]), sys.argv[2]
rng = random.Random(name)
kept = tracks(60, 4)
library = Library(path, wait_seconds=60.0)
for number in range(10**9):
    chosen = library.keep(RECORDING, run(number, kept=kept, key=f"{name}-{number}"), budget=10**9)
    sys.stdout.write(f"{chosen}\\n")  # from now on it is kept, whatever happens
    sys.stdout.flush()
    library.star(chosen, rng.random() < 0.5)
    if rng.random() < 0.2:
        sys.stdout.write(f"-{chosen}\\n")
        sys.stdout.flush()
        library.delete([chosen])
"""


def start(path: Path, name: str, log: Path) -> subprocess.Popen[str]:
    with log.open("a") as said:
        return subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path), name], stdout=said, stderr=said, text=True
        )


def kill_many_times(tmp_path: Path, kills: int) -> None:
    path, log = tmp_path / "library.sqlite3", tmp_path / "said.txt"
    filled(path, 1).close()
    rng = random.Random(0)
    writers = [start(path, f"w{k}", log) for k in range(WRITERS)]
    deadline = time.monotonic() + 60.0
    while log.stat().st_size < 40:
        assert time.monotonic() < deadline, log.read_text()
        time.sleep(0.05)
    try:
        for kill in range(kills):
            time.sleep(rng.uniform(0.0, 0.15))
            victim = rng.randrange(WRITERS)
            os.kill(writers[victim].pid, signal.SIGKILL)
            writers[victim].wait()
            writers[victim] = start(path, f"w{victim}-{kill}", log)
    finally:
        for writer in writers:
            writer.kill()
            writer.wait()
    lines = log.read_text().split()
    assert all(line.lstrip("-").isdecimal() for line in lines), log.read_text()[-2000:]
    said = {int(line) for line in lines}
    deleted = {-number for number in said if number < 0}
    kept = {number for number in said if number > 0} - deleted
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    connection.close()
    checked = repair.check(path)
    assert checked.complaints == ()
    with Library(path) as library:
        there = {run.id for run in library.runs()}
        assert kept <= there, "a finished run was lost"
        for number in sorted(there)[:: max(1, len(there) // 50)]:
            assert len(library.result(number).kept.tracks) in (240, 120)
    # where others work too many are killed before they have written
    assert len(kept) > kills / 10


@pytest.mark.full
def test_killed_while_they_write(tmp_path: Path) -> None:
    kill_many_times(tmp_path, 12)


@pytest.mark.long
def test_killed_200_times_while_they_write(tmp_path: Path) -> None:
    kill_many_times(tmp_path, 200)
