"""A study on disk: a folder that whatever ends the program leaves whole.

``study.toml`` is its definition, ``journal.log`` what the sampler was asked, ``results.sqlite3``
every run that ended and every trial, ``status.json`` what it is doing. One process runs a study;
any number read it meanwhile.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tracker.files.atomic import filling
from tracker.files.folders import data_folder
from tracker.studies.defined.defining import read_definition
from tracker.studies.defined.definition import Definition
from tracker.studies.errors import StudyError
from tracker.studies.kept.reading import read_as
from tracker.studies.kept.records import TOLD, Status, ToldOutcome, Trial
from tracker.studies.kept.writer import RESULTS, STATUS, Writer
from tracker.studies.work.jobs import Outcome

FILE = "study.toml"
JOURNAL = "journal.log"
_LOCK = "running.lock"
STOP = "stop"


def studies_folder() -> Path:
    """``$MULTIVIEW_PHD_STUDIES``, else the platform's place for data."""
    own = os.environ.get("MULTIVIEW_PHD_STUDIES")
    if own:
        return Path(own).expanduser().absolute()
    return data_folder() / "studies"


def create(definition: Definition, folder: Path) -> Store:
    """Make a study's folder; the same one is opened where it is there already.

    Args:
        definition: Of the study.
        folder: Of all studies.

    Raises:
        StudyError: If there is another study of that name, or nothing can be written.
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
        with filling(place) as begun:
            (begun / FILE).write_text(definition.to_toml(), encoding="utf-8")
    except FileExistsError:
        return create(definition, folder)  # another process was first
    except OSError as error:
        raise StudyError(f"{place}: cannot be written ({error.strerror or error})") from None
    return Store(place)


def find(name: str | None, folder: Path) -> Store:
    """A study by its name or folder; the one that ran last where none is named.

    Raises:
        StudyError: If there is none.
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
    """All studies, the one that was at work last first."""
    if not folder.is_dir():
        return []
    found = [Store(path.parent) for path in folder.glob(f"*/{FILE}")]
    return sorted(found, key=lambda one: one.touched(), reverse=True)


class Store:
    """The folder of one study."""

    def __init__(self, folder: Path) -> None:
        """Nothing is read before it is needed."""
        self.folder = folder.absolute()

    @property
    def name(self) -> str:
        """Of the study."""
        return self.folder.name

    def definition(self) -> Definition:
        """What the study is.

        Raises:
            StudyError: If its file is not as it must be any more.
        """
        return read_definition(self.folder / FILE)

    def touched(self) -> float:
        """When anything was written, seconds since 1970."""
        times = [
            (self.folder / name).stat().st_mtime
            for name in (FILE, RESULTS, STATUS)
            if (self.folder / name).exists()
        ]
        return max(times, default=0.0)

    # reading

    def trials(self, after: float = 0.0) -> list[Trial]:
        """Trials that ended, by number.

        Args:
            after: Only those that ended later, seconds since 1970.

        Raises:
            StudyError: If one cannot be read any more, with the field.
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
        """One that ended.

        Raises:
            StudyError: If there is none of that number.
        """
        for one in self.trials():
            if one.number == number:
                return one
        raise StudyError(f"study {self.name}: no trial {number} has ended; `study show` lists them")

    def outcome(self, key: str) -> Outcome | None:
        """A run that ended."""
        with self._reading() as connection:
            if connection is None:
                return None
            row = connection.execute("SELECT outcome FROM jobs WHERE key = ?", (key,)).fetchone()
        if row is None:
            return None
        return Outcome(**read_as(ToldOutcome, row[0], f"{self.folder / RESULTS}, run {key}"))

    def told(self, name: str) -> Any:
        """Something that was written down beside the trials; None where it was not."""
        with self._reading() as connection:
            if connection is None:
                return None
            row = connection.execute("SELECT value FROM told WHERE name = ?", (name,)).fetchone()
        if row is None:
            return None
        return read_as(TOLD.get(name, object), row[0], f"{self.folder / RESULTS}, {name}")

    def status(self) -> Status:
        """What it is doing. Of a process that was killed the state is that it was stopped."""
        try:
            status = read_as(Status, (self.folder / STATUS).read_bytes(), STATUS)
        except (OSError, StudyError):  # it is told anew, and nothing else is in it
            return Status()
        if status.state == "running" and not self.is_running():
            words = "the program that ran it was ended; nothing that ended before is lost"
            status = Status(
                "stopped", words, status.done, status.trials, status.runs, status.seconds,
                all_runs=status.all_runs, all_seconds=status.all_seconds, written=status.written,
            )  # fmt: skip
        return status

    def is_running(self) -> bool:
        """Whether a process runs it."""
        path = self.folder / _LOCK
        if not path.exists():
            return False
        lock = sqlite3.connect(path, timeout=0.0, isolation_level=None)
        try:  # any number may read, but not beside the one that runs it
            lock.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError:
            return True
        finally:
            lock.close()
        return False

    # writing, by the process that runs it

    @contextmanager
    def running(self) -> Iterator[Writer]:
        """Be the one that runs it.

        Raises:
            StudyError: If another process does, or the folder cannot be written to.
        """
        with self._locked(1.0), Writer(self.folder) as writer:
            (self.folder / STOP).unlink(missing_ok=True)
            yield writer

    def ask_to_stop(self) -> None:
        """Have the process that runs it end at once, with everything kept."""
        (self.folder / STOP).touch()

    def asked_to_stop(self) -> bool:
        """Whether somebody did."""
        return (self.folder / STOP).exists()

    @contextmanager
    def _locked(self, seconds: float) -> Iterator[None]:
        """A lock that the system frees with the process, whatever ends it."""
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
