"""Work spread over processes: order, progress, failures, and every way to end it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.experiments import work
from tracker.experiments import Context
from tracker.experiments.laboratory.pool import cores, spread
from tracker.pipeline import Cancelled

pytestmark = pytest.mark.full


@pytest.mark.parametrize("processes", [1, 2])
def test_answers_come_in_the_order_of_the_items(processes: int) -> None:
    told: list[tuple[str, int, int]] = []
    context = Context(processes=processes, told=lambda *news: told.append(news))
    answers = spread(work.double, [1, 2, 3, 4], context, words="doubling", steps=40)
    assert [twice for twice, _ in answers] == [2, 4, 6, 8]
    assert (os.getpid() in {process for _, process in answers}) == (processes == 1)
    assert told[0] == ("doubling", 0, 40)
    assert told[-1] == ("doubling", 40, 40)
    done = [news[1] for news in told]
    assert done == sorted(done)


@pytest.mark.parametrize("processes", [1, 2])
def test_nothing_to_do(processes: int) -> None:
    assert spread(work.double, [], Context(processes=processes), words="", steps=0) == []


@pytest.mark.parametrize("processes", [1, 2])
def test_a_failure_ends_all(processes: int) -> None:
    with pytest.raises(ValueError, match="two is too much"):
        spread(work.fail_at_two, [1, 2, 3, 4], Context(processes=processes), words="", steps=4)


def test_cancelled() -> None:
    progress: list[int] = []
    context = Context(
        processes=2,
        told=lambda words, done, total: progress.append(done),
        cancelled=lambda: max(progress) >= 2,
    )
    with pytest.raises(Cancelled):
        spread(work.until_cancelled, [1, 2], context, words="", steps=9)


def test_an_interrupt_ends_the_processes_too() -> None:
    def interrupt(words: str, done: int, total: int) -> None:
        if done >= 2:
            raise KeyboardInterrupt

    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        spread(
            work.until_cancelled, [1, 2], Context(processes=2, told=interrupt), words="", steps=9
        )
    assert time.monotonic() - begin < 30.0


@pytest.fixture
def endless(tmp_path: Path) -> Any:
    """The command line while two processes work for it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.experiments.work", "experiment", "endless",
         "--output", str(tmp_path / "out")],
        env={**os.environ, "WORK_FOLDER": str(tmp_path)},
        cwd=Path(__file__).parents[2],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60.0
    while len(list(tmp_path.glob("*.pid"))) < 2:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    yield process
    if process.poll() is None:
        process.kill()
    process.communicate()


def workers(folder: Path) -> list[int]:
    return [int(path.stem) for path in folder.glob("*.pid")]


def wait_for_end(pids: list[int]) -> None:
    deadline = time.monotonic() + 15.0
    while any(runs(pid) for pid in pids):
        assert time.monotonic() < deadline, "a process is left"
        time.sleep(0.05)


def runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    try:  # one that has ended but that nobody asked for counts as ended
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return not Path("/proc/self").exists()


def test_ctrl_c_leaves_neither_files_nor_processes(
    endless: subprocess.Popen[str], tmp_path: Path
) -> None:
    pids = workers(tmp_path)
    os.killpg(endless.pid, signal.SIGINT)  # as a terminal does: to all of them
    _, err = endless.communicate(timeout=30)
    assert endless.returncode == 130
    assert err.strip().splitlines()[-1] == "multiview-phd: interrupted; nothing was written"
    assert "Traceback" not in err
    assert not (tmp_path / "out").exists()
    wait_for_end(pids)


def test_processes_end_with_a_parent_that_is_killed(
    endless: subprocess.Popen[str], tmp_path: Path
) -> None:
    pids = workers(tmp_path)
    endless.kill()
    endless.communicate(timeout=30)
    wait_for_end(pids)


def test_cores() -> None:
    assert 1 <= cores() <= (os.cpu_count() or 1)
