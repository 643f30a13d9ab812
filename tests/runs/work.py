"""Pieces of work that other processes can import, and a program that spreads one of them."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from tracker.runs.processes import WorkerControl, map_in_processes


def double(item: int, control: WorkerControl) -> tuple[int, int]:
    """Twice the item, and the id of the process that computed it."""
    control.advance(10)
    return 2 * item, os.getpid()


def after_the_other(item: tuple[Path, bool], control: WorkerControl) -> bool:
    """The item that waits ends when the other has ended, and comes before it nevertheless."""
    folder, waits = item
    while waits and not (folder / "done").exists():
        time.sleep(0.01)
    (folder / "done").touch()
    return waits


def fail_at_two(item: int, control: WorkerControl) -> int:
    """A failure among the work."""
    if item == 2:
        raise ValueError("two is too much")
    return double(item, control)[0]


def until_cancelled(item: int, control: WorkerControl) -> int:
    """Go on until the work is cancelled."""
    control.advance(1)
    while not control.cancelled():
        time.sleep(0.01)
    return item


def note_and_wait(folder: str, control: WorkerControl) -> None:
    """Leave the id of this process in a folder, and go on until the work is cancelled."""
    (Path(folder) / f"{os.getpid()}.pid").touch()
    until_cancelled(0, control)


if __name__ == "__main__":
    from tests.runs import work  # not __main__, which another process does not find

    try:
        map_in_processes(work.note_and_wait, [sys.argv[1]] * 2, steps=2, processes=2)
    except KeyboardInterrupt:
        sys.exit(130)
