"""The library's file, which stores recordings, runs and their tracks.

Several processes may read and write it at once. Every change is one transaction of SQLite in WAL
mode: if a process ends at any time, all earlier changes are in the file, and a run is stored with
its tracks or not at all.
"""

from __future__ import annotations

import json
import os
import sqlite3
import threading
import time
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from tracker.library import KEEP, columns, schema
from tracker.library.errors import LibraryError, NoSuchRun, explained
from tracker.library.records import (
    HEADLINES,
    KeptRun,
    NewRecording,
    NewRun,
    Recording,
    Result,
    inserted,
    selected,
)
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values

WAIT_SECONDS = 5.0
"""Longest wait for the transaction of another process, seconds."""

CHECKED_BYTES = 64 << 20
"""Size of the file, bytes, up to which it is checked before the first write, so that a damaged file
is not changed: some 360 runs of 500 steps and 10 people, checked in 32 ms."""

UNDO_SECONDS = 24 * 3600.0
"""Time for which a deleted run can be restored, seconds, unless :meth:`Library.collect` removes it
before."""

OSPA = "ospa over time"
"""The key of the curve of OSPA among a run's stored figures."""

_RUNS = f"SELECT {selected(KeptRun, 'runs')} FROM runs JOIN recordings ON recordings.id = recording"
_UNMARKED = "star = 0 AND name = '' AND note = '' AND tags = '[]'"
"""The condition of SQL for runs that a user has not marked."""


class Library:
    """An open library file. It is thread-safe, and closed by :meth:`close` or at the end of
    ``with``."""

    def __init__(
        self, path: Path, *, read_only: bool = False, wait_seconds: float = WAIT_SECONDS
    ) -> None:
        """Open the file, or create it if there is none; a file of an older version is migrated.

        Args:
            path: The library's file.
            read_only: Whether the file is only read: it is not created, migrated or changed.
            wait_seconds: Longest wait for the transaction of another process, seconds.

        Raises:
            LibraryError: If the library cannot be opened; the message says why, and what to do.
        """
        self.path = path
        self.read_only = read_only
        self._lock = threading.RLock()
        with explained(path):
            self._connection = self._connect(wait_seconds)
            try:
                self._prepare()
            except BaseException:
                self._connection.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._connection.close()

    # reading

    def recordings(self) -> list[Recording]:
        """Return all recordings, the one that was opened last first."""
        with self._reading() as connection:
            columns_of = selected(Recording, "recordings")
            found = connection.execute(f"SELECT {columns_of} FROM recordings ORDER BY opened DESC")
            return [Recording(*row) for row in found]

    def recording(self, number: int) -> Recording:
        """Return the recording with a number.

        Raises:
            LibraryError: If there is no such recording.
        """
        found = next((one for one in self.recordings() if one.id == number), None)
        if found is None:
            raise LibraryError(f"there is no recording {number}; read the list again")
        return found

    def thumbnail(self, recording: int) -> bytes | None:
        """Return the JPEG thumbnail of a recording; None if it has none or does not exist."""
        with self._reading() as connection:
            found = connection.execute(
                "SELECT thumbnail FROM recordings WHERE id = ?", (recording,)
            ).fetchone()
            return None if found is None or found[0] is None else bytes(found[0])

    def runs(self, recording: int | None = None) -> list[KeptRun]:
        """Return the runs of one recording or of all recordings, the one that was computed last
        first, without deleted ones."""
        where, values = ("recording = ?", (recording,)) if recording is not None else ("1", ())
        return self._runs(f"{where} ORDER BY latest DESC", *values)

    def run(self, number: int) -> KeptRun:
        """Return the run with a number.

        Raises:
            LibraryError: If there is no such run, or it was deleted.
        """
        found = self._runs("runs.id = ?", number)
        if not found:
            raise NoSuchRun(
                f"{self.path}: there is no run {number}; `multiview-phd runs` lists them"
            )
        return found[0]

    def find(self, text: str) -> KeptRun:
        """Return a run by its number, or by its name.

        Raises:
            LibraryError: If no run, or more than one run, has this number or name.
        """
        if text.isdecimal():
            return self.run(int(text))
        named = [run for run in self.runs() if run.name == text]
        if len(named) != 1:
            found = "none" if not named else f"several ({', '.join(str(r.id) for r in named)})"
            raise LibraryError(
                f"{self.path}: expected one run called {text!r}, found {found}; "
                "`multiview-phd runs` lists numbers and names"
            )
        return named[0]

    def with_key(self, key: str) -> KeptRun | None:
        """Return the run with a key (see :attr:`KeptRun.key`); None if it is not stored."""
        return next(iter(self._runs("key = ? ORDER BY runs.id DESC", key)), None)

    def result(self, number: int) -> Result:
        """Return a run with its parameters, figures and tracks.

        Raises:
            LibraryError: If there is no such run, or its tracks are damaged.
        """
        with self._reading() as connection:
            run = self.run(number)
            row = connection.execute(
                "SELECT place, parameters, figures, columns, corrections FROM runs "
                "JOIN results ON run = runs.id JOIN recordings ON recordings.id = recording "
                "WHERE runs.id = ?",
                (number,),
            ).fetchone()
            if row is None:
                raise LibraryError(f"{self.path}: the tracks of run {number} are not there")
            values, figures = _inflated(row[1]), _inflated(row[2])
            parameters, unknown = parameters_of(values)
            corrections = () if row[4] is None else tuple(_inflated(row[4])["corrections"])
            ospa = tuple(figures.pop(OSPA, ()))
            return Result(
                run, row[0], parameters, unknown, values, figures, columns.unpack(row[3]), ospa,
                corrections,
            )  # fmt: skip

    def _runs(self, where: str, *values: object) -> list[KeptRun]:
        """Return the runs that fulfil a condition of SQL and are not deleted."""
        with self._reading() as connection:
            found = connection.execute(f"{_RUNS} WHERE deleted IS NULL AND {where}", values)
            return [KeptRun(*row) for row in found]

    def size(self) -> int:
        """Return the size of the file and of its write-ahead log, bytes."""
        beside = (self.path, self.path.with_name(self.path.name + "-wal"))
        return sum(part.stat().st_size for part in beside if part.exists())

    # writing

    def open_recording(self, new: NewRecording) -> int:
        """Insert a recording, or update it and the time when it was opened, and return its
        number."""
        with self._writing() as connection:
            return self._recording(connection, new)

    def keep(self, recording: NewRecording, new: NewRun, budget: int = KEEP) -> int:
        """Store a run, and delete the oldest unmarked runs beyond the budget.

        A run is unmarked if it has no star, name, note or tag. If a run with the same key is
        stored, it keeps its number and the date of its first computation, and its tracks and
        figures are replaced; if it was deleted, it is restored.

        Args:
            recording: The run's recording.
            new: The run.
            budget: Largest number of unmarked runs that are kept, including this one.

        Returns:
            The run's number.
        """
        figures = {**new.figures, OSPA: list(new.ospa)} if new.ospa else new.figures
        made = _deflated({"corrections": new.corrections}) if new.corrections else None
        packed = (_deflated(new.parameters), _deflated(figures), columns.pack(new.kept), made)
        with self._writing() as connection:
            place = self._recording(connection, recording)
            known = connection.execute(
                "SELECT id FROM runs WHERE key = ? AND recording = ? ORDER BY id DESC",
                (new.key, place),
            ).fetchone()
            number = known[0] if known else self._insert(connection, place, new)
            connection.execute(
                "UPDATE runs SET latest = ?, taught = ?, deleted = NULL WHERE id = ?",
                (new.began, inserted(new)["taught"], number),
            )
            if new.figures or not known:  # other settings of the evaluation give other figures
                self._list_figures(connection, number, new.figures)
            connection.execute(
                "INSERT OR REPLACE INTO results (run, parameters, figures, columns, corrections) "
                "VALUES (?, ?, ?, ?, ?)",
                (number, *packed),
            )
            connection.execute(
                # this run is kept even if the clock was set back
                f"DELETE FROM runs WHERE id IN (SELECT id FROM runs WHERE {_UNMARKED} "
                "AND deleted IS NULL ORDER BY id = ? DESC, latest DESC LIMIT -1 OFFSET ?)",
                (number, max(budget, 1)),
            )
            connection.execute("DELETE FROM runs WHERE deleted < ?", (time.time() - UNDO_SECONDS,))
            return int(number)

    def score(
        self, number: int, figures: dict[str, float | int | None], ospa: Sequence[float]
    ) -> None:
        """Replace the figures of a run by those computed from its stored tracks.

        Args:
            number: The run's number.
            figures: The new figures by key; other figures of the run are kept.
            ospa: OSPA over time, in the form of :attr:`Result.ospa`.

        Raises:
            LibraryError: If there is no such run.
        """
        with self._writing() as connection:
            known = self.result(number).figures
            stored = _deflated({**known, **figures, OSPA: list(ospa)})
            connection.execute("UPDATE results SET figures = ? WHERE run = ?", (stored, number))
            self._list_figures(connection, number, figures)

    def move(self, recording: int, place: str) -> None:
        """Change the name or folder from which a recording is opened (see :attr:`Recording.place`).

        Raises:
            LibraryError: If there is no such recording, or another one has that place.
        """
        with self._writing() as connection:
            other = connection.execute(
                "SELECT name FROM recordings WHERE place = ? AND id <> ?", (place, recording)
            ).fetchone()
            if other is not None:
                raise LibraryError(f"{self.path}: {place} is recording {other[0]} already")
            changed = connection.execute(
                "UPDATE recordings SET place = ? WHERE id = ?", (place, recording)
            )
            if not changed.rowcount:
                raise LibraryError(f"{self.path}: there is no recording {recording}")

    def rename(self, number: int, name: str) -> None:
        """Set the name of a run; an empty one removes the name."""
        self._set(number, "name", " ".join(name.split()))

    def star(self, number: int, on: bool = True) -> None:
        """Star a run, so that it is kept independently of the budget, or remove the star."""
        self._set(number, "star", int(on))

    def note(self, number: int, text: str) -> None:
        """Set the note of a run."""
        self._set(number, "note", text.strip())

    def tag(self, number: int, tags: Sequence[str]) -> None:
        """Replace the tags of a run."""
        self._set(number, "tags", json.dumps(sorted(set(tags)), ensure_ascii=False))

    def delete(self, numbers: Sequence[int]) -> int:
        """Delete runs; they can be restored for :data:`UNDO_SECONDS`.

        Returns:
            The size of their tracks, bytes.
        """
        with self._writing() as connection:
            size = 0
            for number in numbers:
                self.run(number)
                size += connection.execute(
                    "SELECT coalesce(sum(length(columns)), 0) FROM results WHERE run = ?", (number,)
                ).fetchone()[0]
                connection.execute(
                    "UPDATE runs SET deleted = ? WHERE id = ?", (time.time(), number)
                )
            return size

    def restore(self, numbers: Sequence[int]) -> None:
        """Restore deleted runs.

        Raises:
            LibraryError: If a run does not exist any more.
        """
        with self._writing() as connection:
            for number in numbers:
                done = connection.execute("UPDATE runs SET deleted = NULL WHERE id = ?", (number,))
                if not done.rowcount:
                    raise LibraryError(f"{self.path}: run {number} cannot be taken back any more")

    def collect(self, budget: int = KEEP) -> tuple[int, int]:
        """Free the space of deleted runs and of unmarked ones beyond the budget.

        Returns:
            The number of runs that were removed, and the decrease of the file's size in bytes.
        """
        before = self.size()
        with self._writing() as connection:
            gone = connection.execute("DELETE FROM runs WHERE deleted IS NOT NULL").rowcount
            gone += connection.execute(
                f"DELETE FROM runs WHERE id IN (SELECT id FROM runs WHERE {_UNMARKED} "
                "ORDER BY latest DESC LIMIT -1 OFFSET ?)",
                (max(budget, 0),),
            ).rowcount
        with self._lock, explained(self.path):
            self._connection.execute("VACUUM")
            self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        return gone, max(0, before - self.size())

    # inside

    def _connect(self, wait_seconds: float) -> sqlite3.Connection:
        """Open the file by SQLite, and create its folder unless it is only read."""
        if not self.read_only:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        mode = "ro" if self.read_only else "rwc"
        return sqlite3.connect(
            f"{self.path.absolute().as_uri()}?mode={mode}",
            uri=True,
            timeout=wait_seconds,
            isolation_level=None,
            check_same_thread=False,
        )

    def _prepare(self) -> None:
        """Set the options of the connection, and check and migrate the file unless it is only
        read."""
        connection = self._connection
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        connection.execute("PRAGMA foreign_keys = ON")
        version = schema.version_of(connection, self.path)
        if self.read_only:
            if version != schema.VERSION:
                raise LibraryError(
                    f"{self.path}: the library is of version {version}, and reading alone cannot "
                    f"bring it to {schema.VERSION}; open it once by `multiview-phd runs`"
                )
            return
        if self.path.stat().st_size <= CHECKED_BYTES:
            (word,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if word != "ok":
                raise sqlite3.DatabaseError(" ".join(word.split()))
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        if version < schema.VERSION:
            schema.migrate(connection, self.path)

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with self._lock, explained(self.path):
            yield self._connection

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """Yield the connection within one transaction."""
        with self._lock, explained(self.path):
            if self.read_only:
                raise LibraryError(f"{self.path}: the library is open for reading alone")
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise

    def _recording(self, connection: sqlite3.Connection, new: NewRecording) -> int:
        """Insert or update a recording, and return its number."""
        values = inserted(new) | {"opened": time.time()}
        renewed = ", ".join(f"{name} = excluded.{name}" for name in values if name != "thumbnail")
        (number,) = connection.execute(
            f"{_insertion('recordings', values)} ON CONFLICT (place) DO UPDATE SET {renewed}, "
            "thumbnail = coalesce(excluded.thumbnail, thumbnail) RETURNING id",
            values,
        ).fetchone()
        return int(number)

    def _list_figures(
        self,
        connection: sqlite3.Connection,
        number: int,
        figures: dict[str, float | int | None],
    ) -> None:
        """Copy the figures of a finished run to the list of runs."""
        columns = ", ".join(f"{name} = ?" for name in HEADLINES)
        values = [figures.get(name) for name in HEADLINES]
        connection.execute(f"UPDATE runs SET {columns}, final = 1 WHERE id = ?", (*values, number))

    def _insert(self, connection: sqlite3.Connection, recording: int, new: NewRun) -> int:
        """Insert a run into the list of runs, and return its number."""
        values = inserted(new) | {"recording": recording, "corrected": len(new.corrections)}
        done = connection.execute(_insertion("runs", values), values)
        assert done.lastrowid is not None
        return done.lastrowid

    def _set(self, number: int, column: str, value: str | int) -> None:
        """Set one column of a run."""
        with self._writing() as connection:
            self.run(number)
            connection.execute(f"UPDATE runs SET {column} = ? WHERE id = ?", (value, number))


def _insertion(table: str, values: dict[str, Any]) -> str:
    """Return the statement that inserts values by the names of their columns."""
    return f"INSERT INTO {table} ({', '.join(values)}) VALUES (:{', :'.join(values)})"


def _deflated(value: dict[str, Any]) -> bytes:
    """Return values as JSON that is compressed by zlib."""
    return zlib.compress(json.dumps(value, ensure_ascii=False).encode())


def _inflated(data: bytes) -> dict[str, Any]:
    """Return the values of :func:`_deflated`."""
    try:
        return dict(json.loads(zlib.decompress(data)))
    except zlib.error as error:
        raise ValueError(str(error)) from None


def parameters_of(values: dict[str, Any]) -> tuple[RunParameters, tuple[str, ...]]:
    """Return parameters from stored values, and the keys that this version does not accept."""
    try:
        return RunParameters.model_validate(values), ()
    except ValueError:
        pass
    accepted, unknown = RunParameters(), []
    for group, value in values.items():
        pairs = (
            {f"{group}.{name}": one for name, one in value.items()}
            if isinstance(value, dict)
            else {group: value}
        )
        for key, one in pairs.items():
            try:
                accepted = with_values(accepted, {key: one})
            except ValueError:
                unknown.append(key)
    return accepted, tuple(unknown)


def open_library(path: Path, *, wait_seconds: float = WAIT_SECONDS) -> Library:
    """Open a library for writing, or for reading alone if its file is write-protected.

    Raises:
        LibraryError: If the library cannot be opened.
    """
    read_only = path.exists() and not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK))
    return Library(path, read_only=read_only, wait_seconds=wait_seconds)
