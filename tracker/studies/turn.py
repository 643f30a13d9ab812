"""The lock of a machine's cores: one study at a time runs on a machine, and the others wait."""

from __future__ import annotations

import contextlib
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tracker.studies.storage.store import studies_folder

_LOCK, _WHOSE = "turn.lock", "turn.txt"
"""The names of the lock's file, and of the file with the name of the study that holds the lock."""

SECONDS_BETWEEN = 0.5
"""Interval at which a waiting study tries to get the lock, seconds."""


@contextmanager
def turn(name: str, waits: Callable[[str], bool], folder: Path | None = None) -> Iterator[bool]:
    """Hold the lock of this machine's cores; the system releases it when the process ends.

    Args:
        name: The name of the study.
        waits: A callback that gets a sentence on the reason of the wait at each attempt, and
            returns False to end the wait.
        folder: The folder of the lock; None for the folder of all studies.

    Yields:
        Whether the lock is held; False if ``waits`` ended the wait. If the folder is not writable,
        studies do not wait for each other.
    """
    place = folder or studies_folder()
    lock: sqlite3.Connection | None = None
    with contextlib.suppress(OSError, sqlite3.Error):
        place.mkdir(parents=True, exist_ok=True)
        lock = sqlite3.connect(place / _LOCK, timeout=0.0, isolation_level=None)
    if lock is None:
        yield True
        return
    try:
        while not _take(lock):
            if not waits(f"waits for its turn: {_whose(place)} has this machine's cores"):
                yield False
                return
            time.sleep(SECONDS_BETWEEN)
        with contextlib.suppress(OSError):
            (place / _WHOSE).write_text(name, encoding="utf-8")
        yield True
    finally:
        lock.close()


def _take(lock: sqlite3.Connection) -> bool:
    """Try to get the lock; False if another process holds it."""
    try:
        lock.execute("PRAGMA journal_mode = MEMORY")
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            return False
    return True  # on a file system without locks studies do not wait


def _whose(place: Path) -> str:
    """Return which study holds the lock, in words."""
    try:
        return f'the study "{(place / _WHOSE).read_text(encoding="utf-8")}"'
    except OSError:
        return "another study"
