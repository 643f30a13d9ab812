"""One study at a time on one machine: each takes all its cores, so others wait for their turn."""

from __future__ import annotations

import contextlib
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from tracker.studies.kept.store import studies_folder

_LOCK, _WHOSE = "turn.lock", "turn.txt"

SECONDS_BETWEEN = 0.5
"""How often who waits looks again."""


@contextmanager
def turn(name: str, waits: Callable[[str], bool], folder: Path | None = None) -> Iterator[bool]:
    """Be the one study that has this machine's cores; the system ends the turn with the process.

    Args:
        name: Of the study.
        waits: Told what it waits for, as often as it looks; False where it should wait no more.
        folder: Where it is noted whose turn it is; None for that of all studies.

    Yields:
        Whether it is this study's turn; False where it was to wait no more. Where the folder cannot
        be written to nobody waits.
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
    try:
        lock.execute("PRAGMA journal_mode = MEMORY")
        lock.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError as error:
        if "locked" in str(error):
            return False
    return True  # a disk that cannot lock keeps nobody waiting


def _whose(place: Path) -> str:
    try:
        return f'the study "{(place / _WHOSE).read_text(encoding="utf-8")}"'
    except OSError:
        return "another study"
