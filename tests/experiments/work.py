"""Pieces of work that other processes find, and a command line with an experiment of them."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from tracker import experiments
from tracker.experiments import Context, Experiment, Result
from tracker.experiments.laboratory.pool import Desk, spread


def double(item: int, desk: Desk) -> tuple[int, int]:
    """Twice the item, and whose work it was; later items are done sooner."""
    time.sleep(0.02 * (6 - item))
    desk.advance(10)
    return 2 * item, os.getpid()


def fail_at_two(item: int, desk: Desk) -> int:
    """A failure among the work."""
    if item == 2:
        raise ValueError("two is too much")
    return double(item, desk)[0]


def until_cancelled(item: int, desk: Desk) -> int:
    """Goes on until it is told to stop."""
    desk.advance(1)
    while not desk.cancelled():
        time.sleep(0.01)
    return item


def note_and_wait(folder: str, desk: Desk) -> None:
    """Says which process it is, and goes on until it is told to stop."""
    (Path(folder) / f"{os.getpid()}.pid").touch()
    until_cancelled(0, desk)


def endless(context: Context) -> Result:
    """An experiment without an end."""
    folder = os.environ["WORK_FOLDER"]
    spread(note_and_wait, [folder, folder], context, words="waiting", steps=2)
    raise AssertionError("it ended")


if __name__ == "__main__":
    from app.command import main as cli
    from tests.experiments import work  # not __main__, which another process does not find

    experiments.EXPERIMENTS["endless"] = Experiment("endless", "It never ends.", work.endless)
    sys.exit(cli.main())
