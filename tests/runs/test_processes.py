"""Work spread over processes: order, progress, failures, and every way to end it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.runs import work
from tracker.runs.pipeline import Cancelled
from tracker.runs.processes import available_cores, map_in_processes

pytestmark = pytest.mark.full

PATIENCE = 60.0
"""Seconds after which what was waited for counts as not happening."""


@pytest.mark.parametrize("processes", [1, 2])
def test_progress_grows_to_the_whole(processes: int) -> None:
    reported: list[tuple[int, int]] = []
    answers = map_in_processes(
        work.double,
        [1, 2, 3, 4],
        steps=40,
        processes=processes,
        on_progress=lambda *report: reported.append(report),
    )
    assert [twice for twice, _ in answers] == [2, 4, 6, 8]
    assert (os.getpid() in {process for _, process in answers}) == (processes == 1)
    assert (reported[0], reported[-1]) == ((0, 40), (40, 40))
    assert reported == sorted(reported)


def test_answers_keep_the_order_of_the_items_whichever_ends_first(tmp_path: Path) -> None:
    items = [(tmp_path, True), (tmp_path, False)]
    assert map_in_processes(work.after_the_other, items, steps=0, processes=2) == [True, False]


@pytest.mark.parametrize("processes", [1, 2])
def test_nothing_to_do(processes: int) -> None:
    assert map_in_processes(work.double, [], steps=0, processes=processes) == []


@pytest.mark.parametrize("processes", [1, 2])
def test_a_failure_ends_all(processes: int) -> None:
    with pytest.raises(ValueError, match="two is too much"):
        map_in_processes(work.fail_at_two, [1, 2, 3, 4], steps=4, processes=processes)


def test_cancelling_ends_work_that_goes_on() -> None:
    progress: list[int] = []
    with pytest.raises(Cancelled):
        map_in_processes(
            work.until_cancelled,
            [1, 2],
            steps=9,
            processes=2,
            on_progress=lambda done, total: progress.append(done),
            cancelled=lambda: max(progress) >= 2,
        )


def test_an_interrupt_ends_work_that_goes_on() -> None:
    def interrupt(done: int, total: int) -> None:
        if done >= 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        map_in_processes(work.until_cancelled, [1, 2], steps=9, processes=2, on_progress=interrupt)


@pytest.fixture
def endless(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A program while two processes work for it."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.runs.work", str(tmp_path)],
        cwd=Path(__file__).parents[2],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + PATIENCE
    while len(workers(tmp_path)) < 2:
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
    deadline = time.monotonic() + PATIENCE
    while any(runs(pid) for pid in pids):
        assert time.monotonic() < deadline, "a process is left"
        time.sleep(0.05)


def runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    try:  # a process that has ended but that nobody has waited for counts as ended
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return not Path("/proc/self").exists()


def test_ctrl_c_leaves_no_processes(endless: subprocess.Popen[str], tmp_path: Path) -> None:
    pids = workers(tmp_path)
    os.killpg(endless.pid, signal.SIGINT)  # as a terminal does: to all of them
    _, err = endless.communicate(timeout=PATIENCE)
    assert (endless.returncode, err) == (130, "")
    wait_for_end(pids)


def test_processes_end_with_a_parent_that_is_killed(
    endless: subprocess.Popen[str], tmp_path: Path
) -> None:
    pids = workers(tmp_path)
    endless.kill()
    endless.communicate(timeout=PATIENCE)
    wait_for_end(pids)


def test_this_process_may_use_at_least_one_core_and_no_more_than_there_are() -> None:
    assert 1 <= available_cores() <= (os.cpu_count() or 1)
