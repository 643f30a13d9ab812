"""A study on disk: a folder that whatever ends the program leaves whole.

``study.toml`` is its definition, ``journal.log`` what the sampler was asked, ``results.sqlite3``
every run that ended and every trial, ``status.json`` what it is doing. One process runs a study;
any number read it meanwhile.
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import platformdirs

from tracker.placing import filling, replacing
from tracker.studies.definition import Definition, read_definition
from tracker.studies.errors import StudyError
from tracker.studies.work.jobs import Outcome

FILE = "study.toml"
JOURNAL = "journal.log"
RESULTS = "results.sqlite3"
STATUS = "status.json"
_LOCK = "running.lock"
STOP = "stop"

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

TrialState = Literal["complete", "pruned", "failed"]


@dataclass(frozen=True, slots=True)
class JobRow:
    """One run of a trial."""

    key: str
    recording: str
    seed: int


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial that ended."""

    number: int
    state: TrialState
    values: dict[str, Any]
    """What was tried, by key."""
    objectives: tuple[float, ...] | None
    """Over recordings and seeds; None where it failed. Of a pruned one over its first runs."""
    spreads: tuple[float | None, ...]
    """Of each objective over the seeds."""
    figures: dict[str, float]
    """All other figures, over recordings and seeds."""
    vetoed: bool
    """Whether its people overlap too little with the cameras that were left out."""
    words: str
    """Why it failed or was given up, or what it is."""
    seconds: float
    """Of its runs on the workers' clocks."""
    jobs: tuple[JobRow, ...]
    ended: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Status:
    """What a study is doing, as whoever runs it has said last."""

    state: Literal["new", "running", "stopped", "done", "failed"] = "new"
    words: str = ""
    """What it waits for, or why it ended."""
    done: int = 0
    """Trials that ended."""
    trials: int = 0
    runs: int = 0
    """Runs that ended in this start, those that were not needed again left out."""
    seconds: float = 0.0
    """Since this start."""
    seconds_left: float | None = None
    busy: float | None = None
    """Share of the workers' time, since all were there, in which they worked."""
    workers: list[dict[str, Any]] = field(default_factory=list)
    process: int = 0
    written: float = 0.0
    """Seconds since 1970."""


def studies_folder() -> Path:
    """``$MULTIVIEW_PHD_STUDIES``, else the platform's place for data."""
    own = os.environ.get("MULTIVIEW_PHD_STUDIES")
    if own:
        return Path(own).expanduser().absolute()
    return platformdirs.user_data_path("multiview-phd", appauthor=False) / "studies"


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
        """
        with self._reading() as connection:
            if connection is None:
                return []
            rows = connection.execute(
                "SELECT told FROM trials WHERE ended > ? ORDER BY number", (after,)
            ).fetchall()
        return [_trial(json.loads(text)) for (text,) in rows]

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
        return None if row is None else Outcome(**json.loads(row[0]))

    def told(self, name: str) -> Any:
        """Something that was written down beside the trials; None where it was not."""
        with self._reading() as connection:
            if connection is None:
                return None
            row = connection.execute("SELECT value FROM told WHERE name = ?", (name,)).fetchone()
        return None if row is None else json.loads(row[0])

    def status(self) -> Status:
        """What it is doing. Of a process that was killed the state is that it was stopped."""
        try:
            status = Status(**json.loads((self.folder / STATUS).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return Status()
        if status.state == "running" and not self.is_running():
            words = "the program that ran it was ended; nothing that ended before is lost"
            status = Status(
                "stopped", words, status.done, status.trials, status.runs, status.seconds,
                written=status.written,
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


class Writer:
    """Results as they come in: each wholly or not at all."""

    def __init__(self, folder: Path) -> None:
        """Open the results, or make them.

        Raises:
            StudyError: If they cannot be written to.
        """
        self._path = folder / RESULTS
        self._status = folder / STATUS
        with self._told():
            self._connection = sqlite3.connect(self._path, timeout=10.0, isolation_level=None)
            self._connection.execute("PRAGMA journal_mode = WAL")
            self._connection.execute("PRAGMA synchronous = NORMAL")
            for table in _TABLES:
                self._connection.execute(table)
            rows = self._connection.execute("SELECT key, outcome FROM jobs").fetchall()
        self._outcomes = {key: text for key, text in rows}

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    @property
    def runs(self) -> int:
        """How many are kept."""
        return len(self._outcomes)

    def outcome(self, key: str) -> Outcome | None:
        """A run that ended before."""
        text = self._outcomes.get(key)
        return None if text is None else Outcome(**json.loads(text))

    def keep(self, outcome: Outcome) -> None:
        """Write down a run that ended; one that is there stays as it is."""
        text = json.dumps(outcome.to_json(), ensure_ascii=False)
        with self._told():
            self._connection.execute(
                "INSERT OR IGNORE INTO jobs VALUES (?, ?, ?)", (outcome.key, text, time.time())
            )
        self._outcomes.setdefault(outcome.key, text)

    def end(self, trial: Trial) -> None:
        """Write down a trial that ended."""
        told = {**trial.to_json(), "ended": time.time()}
        with self._told():
            self._connection.execute(
                "INSERT OR REPLACE INTO trials VALUES (?, ?, ?, ?)",
                (trial.number, trial.state, json.dumps(told, ensure_ascii=False), told["ended"]),
            )

    def tell(self, name: str, value: Any) -> None:
        """Write down something beside the trials."""
        with self._told():
            self._connection.execute(
                "INSERT OR REPLACE INTO told VALUES (?, ?)",
                (name, json.dumps(value, ensure_ascii=False)),
            )

    def say(self, status: Status) -> None:
        """Write down what is being done, for whoever looks; the results are elsewhere."""
        try:
            with replacing(self._status) as begun:
                begun.write_text(json.dumps(asdict(status)), encoding="utf-8")
        except OSError as error:
            raise StudyError(
                f"{error}; free some space and go on by `multiview-phd study resume`: every run "
                "that ended is kept"
            ) from None

    @contextmanager
    def _told(self) -> Iterator[None]:
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


def _trial(told: dict[str, Any]) -> Trial:
    objectives: Sequence[float] | None = told["objectives"]
    return Trial(
        **{
            **told,
            "objectives": None if objectives is None else tuple(objectives),
            "spreads": tuple(told["spreads"]),
            "jobs": tuple(JobRow(**one) for one in told["jobs"]),
        }
    )
