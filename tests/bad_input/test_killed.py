"""``kill -9`` at any instant of any write: what was confirmed is there, and nothing is spoilt.

``MULTIVIEW_PHD_KILLS=300`` kills more often, over all kinds of files together.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import time
from multiprocessing.context import ForkServerContext
from pathlib import Path
from random import Random

import pytest

from tests.bad_input import faults
from tests.bad_input.writes import KINDS, Kind

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there is no such signal")

KILLS = max(1, round(int(os.environ.get("MULTIVIEW_PHD_KILLS", "30")) / len(KINDS)))
"""Of each kind of file."""


def write_for_ever(name: str, folder: Path, first: int, confirmed: Path) -> None:
    """In a process of its own: one write after the other, each confirmed when it is done."""
    sys.stderr = open(os.devnull, "w")  # a kill leaves half sentences
    with confirmed.open("ab", buffering=0) as said:
        for number in range(first, first + 10**6):
            KINDS[name].write(folder, number)
            said.write(f"{number}\n".encode())


@pytest.fixture(scope="module")
def processes() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.bad_input.writes"])
    return context


@pytest.mark.full
@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.name)
def test_what_was_confirmed_survives_a_kill_at_any_instant(
    tmp_path: Path, kind: Kind, processes: ForkServerContext
) -> None:
    folder, confirmed = tmp_path / "files", tmp_path / "confirmed.txt"
    folder.mkdir()
    confirmed.touch()
    kind.make(folder)
    chance = Random(kind.name)
    newest = 0
    for kill in range(KILLS):
        writer = processes.Process(
            target=write_for_ever, args=(kind.name, folder, newest + 1, confirmed)
        )
        writer.start()
        told, deadline = confirmed.stat().st_size, time.monotonic() + 120.0
        while confirmed.stat().st_size == told and time.monotonic() < deadline:
            time.sleep(0.001)
            assert writer.is_alive(), f"it ended by itself with {writer.exitcode}"
        time.sleep(chance.uniform(0.0, 0.05))
        writer.kill()
        writer.join()
        writer.close()
        last = int(confirmed.read_text().split()[-1])
        newest = kind.newest(folder)
        assert last <= newest <= last + 1, f"kill {kill}: {last} was confirmed, {newest} is there"
    kind.write(folder, newest + 1)  # and it goes on
    assert kind.newest(folder) == newest + 1


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals and mounts")
def test_nothing_is_lost_and_trials_go_on_where_they_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "trials.jsonl"
    for trials in (1, 3):
        arguments = ["faults", str(file), "--trials", str(trials), "--seed", "7"]
        monkeypatch.setattr(sys, "argv", arguments)
        assert faults.main() == 0, file.read_text()
        told = [json.loads(line) for line in file.read_text().splitlines()]
        assert [one["trial"] for one in told] == list(range(trials))
