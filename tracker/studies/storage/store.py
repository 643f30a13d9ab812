"""The folder of a study, which stays consistent if its process ends at any time.

``study.toml`` is the definition, ``journal.log`` the sampler's journal, ``results.sqlite3`` has
every run and trial that ended, ``status.json`` the current status. One process runs a study;
any number of processes may read it meanwhile.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tracker.files.atomic import new_folder
from tracker.files.folders import data_folder
from tracker.studies.definition.definition import Definition
from tracker.studies.definition.parsing import read_definition
from tracker.studies.errors import StudyError
from tracker.studies.storage.reading import read_as
from tracker.studies.storage.records import STORED, Status, StoredOutcome, Trial
from tracker.studies.storage.writer import RESULTS, STATUS, Writer
from tracker.studies.workers.jobs import Outcome

FILE = "study.toml"
"""The name of the file with the definition."""

JOURNAL = "journal.log"
"""The name of the sampler's journal."""

_LOCK = "running.lock"
"""The name of the file that the process running the study locks."""

STOP = "stop"
"""The name of the file whose existence requests the process to stop."""


def studies_folder() -> Path:
    """Return ``$MULTIVIEW_PHD_STUDIES``, else ``studies`` in the platform's folder for data."""
    own = os.environ.get("MULTIVIEW_PHD_STUDIES")
    if own:
        return Path(own).expanduser().absolute()
    return data_folder() / "studies"


def create(definition: Definition, folder: Path) -> Store:
    """Create the folder of a study, or open it if it exists with the same definition.

    Args:
        definition: The study's definition.
        folder: The folder of all studies.

    Raises:
        StudyError: If there is a different study of that name, or the folder cannot be written to.
    """
    place = folder / definition.name
    if place.exists():
        store = Store(place)
        if store.definition() != definition:
            raise StudyError(
                f'there is another study "{definition.name}" in {folder}; give this one another '
                f"name, or delete {place}"
            )
        return store
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with new_folder(place) as begun:
            (begun / FILE).write_text(definition.to_toml(), encoding="utf-8")
    except FileExistsError:
        return create(definition, folder)  # another process was first
    except OSError as error:
        raise StudyError(f"{place}: cannot be written ({error.strerror or error})") from None
    return Store(place)


def find(name: str | None, folder: Path) -> Store:
    """Return a study by its name or folder, or the one that was last active.

    Args:
        name: The name or the folder of the study; None for the one that was last active.
        folder: The folder of all studies.

    Raises:
        StudyError: If there is no such study.
    """
    if name is not None and (Path(name) / FILE).is_file():
        return Store(Path(name))
    every = stores(folder)
    found = [one for one in every if name is None or one.name == name]
    if not found:
        known = ", ".join(one.name for one in every) or "none is there"
        wanted = "a study" if name is None else f'the study "{name}"'
        raise StudyError(f"{folder}: expected {wanted}, found {known}; `study run` starts one")
    return found[0]


def stores(folder: Path) -> list[Store]:
    """Return all studies, the one that was last active first."""
    if not folder.is_dir():
        return []
    found = [Store(path.parent) for path in folder.glob(f"*/{FILE}")]
    return sorted(found, key=lambda one: one.touched(), reverse=True)


class Store:
    """The folder of one study."""

    def __init__(self, folder: Path) -> None:
        """Store the path; files are read when they are needed."""
        self.folder = folder.absolute()

    @property
    def name(self) -> str:
        """The name of the study."""
        return self.folder.name

    def definition(self) -> Definition:
        """Read the study's definition.

        Raises:
            StudyError: If the file of the definition is not valid.
        """
        return read_definition(self.folder / FILE)

    def touched(self) -> float:
        """Return the time when a file of the study last changed, seconds since 1970."""
        times = [
            (self.folder / name).stat().st_mtime
            for name in (FILE, RESULTS, STATUS)
            if (self.folder / name).exists()
        ]
        return max(times, default=0.0)

    # reading

    def trials(self, after: float = 0.0) -> list[Trial]:
        """Return the trials that ended, by number.

        Args:
            after: Only trials that ended after this time are returned, seconds since 1970.

        Raises:
            StudyError: If the record of a trial is not valid; the message names the field.
        """
        with self._reading() as connection:
            if connection is None:
                return []
            rows = connection.execute(
                "SELECT number, told FROM trials WHERE ended > ? ORDER BY number", (after,)
            ).fetchall()
        return [
            read_as(Trial, text, f"{self.folder / RESULTS}, trial {number}")
            for number, text in rows
        ]

    def trial(self, number: int) -> Trial:
        """Return a trial that ended, by its number.

        Raises:
            StudyError: If there is no such trial.
        """
        for one in self.trials():
            if one.number == number:
                return one
        raise StudyError(f"study {self.name}: no trial {number} has ended; `study show` lists them")

    def outcome(self, key: str) -> Outcome | None:
        """Return the outcome of a run by the key of its job; None if it is not stored."""
        with self._reading() as connection:
            if connection is None:
                return None
            row = connection.execute("SELECT outcome FROM jobs WHERE key = ?", (key,)).fetchone()
        if row is None:
            return None
        return Outcome(**read_as(StoredOutcome, row[0], f"{self.folder / RESULTS}, run {key}"))

    def fact(self, name: str) -> Any:
        """Return a fact that is stored beside the trials; None if it is not stored."""
        with self._reading() as connection:
            if connection is None:
                return None
            row = connection.execute("SELECT value FROM told WHERE name = ?", (name,)).fetchone()
        if row is None:
            return None
        return read_as(STORED.get(name, object), row[0], f"{self.folder / RESULTS}, {name}")

    def status(self) -> Status:
        """Return the status that was last written; its state is ``stopped`` if the process was
        killed."""
        try:
            status = read_as(Status, (self.folder / STATUS).read_bytes(), STATUS)
        except (OSError, StudyError):  # the status is written again soon
            return Status()
        if status.state == "running" and not self.is_running():
            words = "the program that ran it was ended; nothing that ended before is lost"
            status = Status(
                "stopped", words, status.done, status.trials, status.runs, status.seconds,
                all_runs=status.all_runs, all_seconds=status.all_seconds, written=status.written,
            )  # fmt: skip
        return status

    def is_running(self) -> bool:
        """Whether a process runs the study."""
        path = self.folder / _LOCK
        if not path.exists():
            return False
        lock = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        try:  # reading fails while the running process holds its exclusive lock
            lock.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError:
            return True
        finally:
            lock.close()
        return False

    # writing, by the process that runs it

    @contextmanager
    def running(self) -> Iterator[Writer]:
        """Hold the study's lock, and yield the writer of its results.

        Raises:
            StudyError: If another process runs the study, or the folder cannot be written to.
        """
        with self._locked(1.0), Writer(self.folder) as writer:
            (self.folder / STOP).unlink(missing_ok=True)
            yield writer

    def ask_to_stop(self) -> None:
        """Request the process that runs the study to stop; its results remain stored."""
        (self.folder / STOP).touch()

    def asked_to_stop(self) -> bool:
        """Whether the process that runs the study was requested to stop."""
        return (self.folder / STOP).exists()

    @contextmanager
    def _locked(self, seconds: float) -> Iterator[None]:
        """Hold the lock of the study, which the system releases when the process ends.

        Args:
            seconds: Longest wait for the lock, seconds.
        """
        try:
            lock = sqlite3.connect(self.folder / _LOCK, timeout=seconds, isolation_level=None)
        except sqlite3.Error as error:
            raise StudyError(f"{self.folder}: cannot be written to ({error})") from None
        try:
            try:
                lock.execute("PRAGMA journal_mode = MEMORY")
                lock.execute("BEGIN EXCLUSIVE")
            except sqlite3.OperationalError as error:
                raise StudyError(
                    f'the study "{self.name}" is run by another process ({error}); stop that one, '
                    "or give this one another name"
                ) from None
            yield
        finally:
            lock.close()

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection | None]:
        """Yield a connection to the file of results; None if there are no results yet."""
        path = self.folder / RESULTS
        if not path.exists():
            yield None
            return
        try:
            connection = sqlite3.connect(path, timeout=5.0, isolation_level=None)
            try:
                there = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
                yield connection if there else None
            finally:
                connection.close()
        except sqlite3.Error as error:
            raise StudyError(f"{path}: cannot be read ({error})") from None
