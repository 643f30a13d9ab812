"""The library's file: written by many processes at once, read while others write.

Every change is one transaction of SQLite in WAL mode: whatever ends a process, the file holds
what was written before, and a run with its tracks or neither.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from tracker.library import schema
from tracker.library.errors import LibraryError, told

WAIT_SECONDS = 5.0
"""How long another program's writing is waited for."""

CHECKED_BYTES = 64 << 20
"""A file up to this size is looked through before the first write, so that a damaged one is
never written to."""


class LibraryFile:
    """One open file and its transactions. Thread-safe; close it, or use ``with``."""

    def __init__(
        self, path: Path, *, read_only: bool = False, wait_seconds: float = WAIT_SECONDS
    ) -> None:
        """Open it, or make it where there is none; an older one is brought to today's form.

        Args:
            path: Its file.
            read_only: Nothing is made or changed.
            wait_seconds: How long another program's writing is waited for.

        Raises:
            LibraryError: In one sentence.
        """
        self.path = path
        self.read_only = read_only
        self._lock = threading.RLock()
        with told(path):
            self._connection = self._connect(wait_seconds)
            try:
                self._prepare()
            except BaseException:
                self._connection.close()
                raise

    def _connect(self, wait_seconds: float) -> sqlite3.Connection:
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._connection.close()

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with self._lock, told(self.path):
            yield self._connection

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """One transaction: wholly or not at all."""
        with self._lock, told(self.path):
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
