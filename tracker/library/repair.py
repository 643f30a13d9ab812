"""The check of a library, and the repair of a damaged one from all rows that can be read."""

from __future__ import annotations

import json
import shutil
import sqlite3
import time
import zlib
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tracker.library import columns, schema
from tracker.library.errors import LibraryError, explained

_MOST_COMPLAINTS = 20
"""Largest number of problems that are reported."""


@dataclass(frozen=True, slots=True)
class Checked:
    """The result of checking a library."""

    complaints: tuple[str, ...]
    """The problems, a sentence for each; empty if there is no damage."""
    runs: int
    """The number of runs that can be read with their tracks."""


def check(path: Path) -> Checked:
    """Check the whole file and the tracks of every run, without writing anything.

    Raises:
        LibraryError: If the file is not a library, is of a newer version, or cannot be opened.
    """
    if not path.is_file():
        raise LibraryError(f"{path}: there is no library; it is made when a run is kept")
    complaints: list[str] = []
    with (
        explained(path),
        closing(_reader(path)) as connection,
        closing(sqlite3.connect(":memory:", isolation_level=None)) as memory,
    ):
        version = schema.version_of(connection, path)
        complaints += [
            " ".join(word.split())
            for (word,) in connection.execute(f"PRAGMA integrity_check({_MOST_COMPLAINTS})")
            if word != "ok"
        ]
        schema.migrate(memory, path, schema.MIGRATIONS[: max(1, version)])
        lost = [
            f"row {row} of {table} {why}" for table, row, why in _copy_readable(connection, memory)
        ]
        # rows that cannot be found at all are reported by the integrity check alone
        complaints += lost
        (good,) = memory.execute("SELECT count(*) FROM runs").fetchone()
    return Checked(tuple(complaints[:_MOST_COMPLAINTS]), good)


def repair(path: Path) -> tuple[Path, int, int]:
    """Copy the file, and replace it by a new one with all rows that can be read.

    Returns:
        The path of the copy, the number of runs in the new file, and the number of rows that could
        not be read.

    Raises:
        LibraryError: If the file cannot be read; it is then unchanged.
    """
    aside = path.with_name(f"{path.stem}-damaged-{time.strftime('%Y%m%d-%H%M%S')}{path.suffix}")
    made = path.with_name(f".{path.name}.repaired")
    beside = [path.with_name(path.name + end) for end in ("-wal", "-shm")]
    with explained(path):
        for source in (path, *beside):
            if source.exists():
                shutil.copy2(source, aside.with_name(aside.name + source.name[len(path.name) :]))
        made.unlink(missing_ok=True)
        try:
            with closing(_reader(path)) as old, closing(sqlite3.connect(made)) as new:
                new.isolation_level = None
                version = schema.version_of(old, path)
                schema.migrate(new, made, schema.MIGRATIONS[: max(1, version)])
                new.execute("BEGIN")
                lost = len(_copy_readable(old, new, with_tracks=True))
                new.execute("COMMIT")
                schema.migrate(new, made)
                (saved,) = new.execute("SELECT count(*) FROM runs").fetchone()
            for source in beside:
                source.unlink(missing_ok=True)
            made.replace(path)
        finally:
            made.unlink(missing_ok=True)
    return aside, int(saved), lost


def _reader(path: Path) -> sqlite3.Connection:
    """Open a library for reading; invalid UTF-8 in texts is replaced."""
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=5.0)
    connection.text_factory = lambda data: data.decode("utf-8", errors="replace")
    return connection


def _copy_readable(
    old: sqlite3.Connection, new: sqlite3.Connection, *, with_tracks: bool = False
) -> list[tuple[str, int, str]]:
    """Copy all rows that can be read: runs with their tracks, and their recordings.

    Args:
        old: The damaged library.
        new: An empty library of the same version.
        with_tracks: Whether the tracks are copied too, rather than only decoded as a check.

    Returns:
        The table, the row number and the reason of each row that was not copied.
    """
    lost: list[tuple[str, int, str]] = []
    tracked: set[int] = set()
    for table in ("results", "recordings", "runs"):
        names = [row[1] for row in new.execute(f"PRAGMA table_info({table})")]
        listed, marks = ", ".join(names), ", ".join("?" * len(names))
        for number in _numbers(old, table):
            try:
                row = old.execute(
                    f"SELECT {listed} FROM {table} WHERE rowid = ?", (number,)
                ).fetchone()
                if row is None:
                    raise ValueError("is not where the table says")
                if table == "results":
                    columns.unpack(row[3])
                    json.loads(zlib.decompress(row[1])), json.loads(zlib.decompress(row[2]))
                    tracked.add(number)
                    if not with_tracks:
                        continue
                if table == "runs" and number not in tracked:
                    raise ValueError("has no tracks that can be read")
                if table == "runs":
                    new.execute(_LOST_RECORDING, {"id": row[1]})
                new.execute(f"INSERT INTO {table} ({listed}) VALUES ({marks})", row)
            except (sqlite3.Error, zlib.error, ValueError, TypeError, OverflowError) as error:
                lost.append((table, number, " ".join(str(error).split())))
    new.execute("DELETE FROM results WHERE run NOT IN (SELECT id FROM runs)")
    return lost


_LOST_RECORDING = """
INSERT OR IGNORE INTO recordings
VALUES (:id, 'lost-' || :id, 'a recording that was lost', 'folder', '', 0, 0, 25.0, 0, 0, NULL,
        NULL, 0.0)
"""
"""The statement that inserts a substitute for a recording whose row cannot be read, so that its
runs can be kept."""


def _numbers(old: sqlite3.Connection, table: str) -> list[int]:
    """Return the row numbers that can be reached from the first or the last row of a table."""
    found: set[int] = set()
    for order in ("ASC", "DESC"):
        try:
            for (number,) in old.execute(f"SELECT rowid FROM {table} ORDER BY rowid {order}"):
                found.add(number)
        except sqlite3.Error:
            continue
    return sorted(found)
