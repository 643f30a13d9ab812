"""The writing of a study's results while it runs."""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tracker.files.atomic import replacing
from tracker.studies.errors import StudyError
from tracker.studies.storage.reading import read_as
from tracker.studies.storage.records import Status, StoredOutcome, Trial
from tracker.studies.workers.jobs import Outcome

RESULTS = "results.sqlite3"
"""The name of the file of results."""

STATUS = "status.json"
"""The name of the file with the status."""

_TABLES = (
    """
    CREATE TABLE IF NOT EXISTS jobs (
        key TEXT PRIMARY KEY,     -- of recording, values, seed and code
        outcome TEXT NOT NULL,    -- JSON
        ended REAL NOT NULL       -- seconds since 1970
    ) STRICT
    """,
    """
    CREATE TABLE IF NOT EXISTS trials (
        number INTEGER PRIMARY KEY,
        state TEXT NOT NULL,
        told TEXT NOT NULL,       -- JSON
        ended REAL NOT NULL
    ) STRICT
    """,
    "CREATE TABLE IF NOT EXISTS told (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
)


class Writer:
    """The writer of a study's results; each is stored completely or not at all."""

    def __init__(self, folder: Path) -> None:
        """Open the file of results, or create it.

        Raises:
            StudyError: If the file cannot be written to.
        """
        self._path = folder / RESULTS
        self._status = folder / STATUS
        with self._explained():
            self._connection = sqlite3.connect(self._path, timeout=10.0, isolation_level=None)
            self._connection.execute("PRAGMA journal_mode = WAL")
            self._connection.execute("PRAGMA synchronous = NORMAL")
            self._connection.execute("BEGIN IMMEDIATE")  # so that a reader sees all tables or none
            for table in _TABLES:
                self._connection.execute(table)
            self._connection.execute("COMMIT")
            rows = self._connection.execute("SELECT key, outcome FROM jobs").fetchall()
            found = self._connection.execute("SELECT max(ended) FROM trials").fetchone()
        self._ended = float(found[0] or 0.0)
        self._outcomes = {key: text for key, text in rows}

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    @property
    def runs(self) -> int:
        """The number of stored runs."""
        return len(self._outcomes)

    def outcome(self, key: str) -> Outcome | None:
        """Return the stored outcome of a run by the key of its job; None if there is none."""
        text = self._outcomes.get(key)
        return (
            None
            if text is None
            else Outcome(**read_as(StoredOutcome, text, f"{self._path}, run {key}"))
        )

    def keep(self, outcome: Outcome) -> None:
        """Store the outcome of a run, unless it is stored already."""
        text = json.dumps(outcome.to_json(), ensure_ascii=False)
        with self._explained():
            self._connection.execute(
                "INSERT OR IGNORE INTO jobs VALUES (?, ?, ?)", (outcome.key, text, time.time())
            )
        self._outcomes.setdefault(outcome.key, text)

    def end(self, trial: Trial) -> None:
        """Store a trial that ended."""
        # times increase even if the clock is set back, since readers ask for trials after a time
        self._ended = max(time.time(), self._ended + 1e-5)
        row = {**trial.to_json(), "ended": self._ended}
        with self._explained():
            self._connection.execute(
                "INSERT OR REPLACE INTO trials VALUES (?, ?, ?, ?)",
                (trial.number, trial.state, json.dumps(row, ensure_ascii=False), row["ended"]),
            )

    def put_fact(self, name: str, value: Any) -> None:
        """Store a fact beside the trials, under a name (see
        :data:`~tracker.studies.storage.records.STORED`)."""
        with self._explained():
            self._connection.execute(
                "INSERT OR REPLACE INTO told VALUES (?, ?)",
                (name, json.dumps(value, ensure_ascii=False)),
            )

    def write_status(self, status: Status) -> None:
        """Write the status for other processes.

        Raises:
            StudyError: If the status cannot be written.
        """
        try:
            with replacing(self._status, transient=True) as begun:
                begun.write_text(json.dumps(asdict(status)), encoding="utf-8")
        except OSError as error:
            raise StudyError(
                f"{error}; free some space and go on by `multiview-phd study resume`: every run "
                "that ended is kept"
            ) from None

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Store all outcomes and trials of the block in one transaction.

        The transaction is also committed if the block raises an exception.
        """
        with self._explained():
            self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
        finally:
            with self._explained():
                if self._connection.in_transaction:  # a full disk has ended it already
                    self._connection.execute("COMMIT")

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Replace an exception of SQLite by an error that says what the user can do."""
        try:
            yield
        except sqlite3.Error as error:
            words = " ".join(str(error).split())
            if "full" in words:
                words = "there is no space left"
            raise StudyError(
                f"{self._path}: cannot be written ({words}); mend that and go on by "
                "`multiview-phd study resume`: every run that ended is kept"
            ) from None
