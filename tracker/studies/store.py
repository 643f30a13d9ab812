"""The folder of a study, which stays consistent if its process ends at any time.

``study.toml`` is the definition, ``results.sqlite3`` has every run that ended and every trial, also
those under way, ``status.json`` the current status. One process runs a study; any number of
processes may read it meanwhile.
"""

from __future__ import annotations

import json
import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, ConfigDict, Field
from typing_extensions import TypedDict

from tracker.files.atomic import new_folder, replacing
from tracker.files.folders import data_folder
from tracker.files.lock import is_locked, locked
from tracker.files.validated import InvalidJson, parse_json
from tracker.parameters.values import with_current_keys
from tracker.studies.definition import StudyDefinition, read_definition
from tracker.studies.errors import StudyError
from tracker.studies.jobs import Outcome

T = TypeVar("T")

FILE = "study.toml"
"""The name of the file with the definition, which the process that runs the study locks."""

RESULTS = "results.sqlite3"
"""The name of the file of results."""

STATUS = "status.json"
"""The name of the file with the status."""

STOP = "stop"
"""The name of the file whose existence requests the process to stop."""

HOLDER = "turn.txt"
"""The name of the file in the folder of all studies that is locked by the study which has this
machine's cores, and that has its name."""

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
        told TEXT NOT NULL,       -- JSON: the trial, or the values of one that is running
        ended REAL NOT NULL       -- seconds since 1970; 0 while the trial is running
    ) STRICT
    """,
    "CREATE TABLE IF NOT EXISTS told (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
)

TrialState = Literal["complete", "pruned", "failed"]
"""The state of a trial that ended: with all runs, after its first runs, or because a run failed."""


@dataclass(frozen=True, slots=True)
class JobRow:
    """One run of a trial."""

    key: str
    """The key of the run's job."""
    recording: str
    """The name or folder of the recording."""
    seed: int
    """The seed of the run."""


@dataclass(frozen=True, slots=True)
class Trial:
    """A trial that ended."""

    number: int
    """The number of the trial; 0 is that of the defaults."""
    state: TrialState
    """How the trial ended."""
    values: Annotated[dict[str, Any], AfterValidator(with_current_keys)]
    """The varied parameters, by key."""
    objectives: tuple[float, ...] | None
    """The mean of each objective over recordings and seeds, or over the first runs if the trial was
    pruned; None if it failed."""
    spreads: tuple[float | None, ...]
    """The standard deviation of each objective over the seeds; None for a single seed."""
    figures: dict[str, float]
    """The means of all figures over recordings and seeds, by key."""
    vetoed: bool
    """Whether the held-out overlap is clearly less than that of the defaults (see
    :data:`~tracker.studies.objectives.VETO`)."""
    words: str
    """The reason of a failure or pruning, or a remark on the trial."""
    seconds: float
    """The duration of all runs of the trial on the workers' clocks, seconds."""
    jobs: tuple[JobRow, ...]
    """The runs of the trial."""
    ended: float = 0.0
    """The time when the trial ended, seconds since 1970."""
    missing_overlap: float = 0.0
    """By how much the held-out overlap is less than allowed, intersection over union, at most over
    the runs; 0 if the trial is not vetoed, or was by a version that did not store it."""

    def to_json(self) -> dict[str, Any]:
        """Return all fields as plain values."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Status:
    """The status of a study, which its process writes at intervals.

    A session is the time from one start of the study to its next end or interruption.
    """

    state: Literal["new", "running", "stopped", "done", "failed"] = "new"
    """The state of the study."""
    words: str = ""
    """What the study waits for, or why it ended."""
    done: int = 0
    """The number of trials that ended."""
    trials: int = 0
    """The number of trials that the study has."""
    runs: int = 0
    """The number of runs computed in this session."""
    seconds: float = 0.0
    """The duration of this session, seconds."""
    seconds_left: float | None = None
    """The estimated time to the end, seconds; None if it is not known."""
    busy: float | None = None
    """The share of the workers' time in which they worked, 0 … 1, since the first run of the
    session ended; None before there are enough runs."""
    workers: list[dict[str, Any]] = field(default_factory=list)
    """The activity of each worker, as plain values."""
    all_runs: int = 0
    """The number of runs computed in all sessions together."""
    all_seconds: float = 0.0
    """The duration of all sessions together, seconds."""
    process: int = 0
    """The id of the process that runs the study."""
    written: float = 0.0
    """The time when the status was written, seconds since 1970."""


class _Importance(TypedDict):
    trials: int
    shares: dict[str, tuple[float, float]]


class _Objective(TypedDict):
    key: str


class _Recording(TypedDict):
    __pydantic_config__ = ConfigDict(extra="allow")  # type: ignore[misc]  # how pydantic asks it

    place: str
    content: str


STORED: dict[str, Any] = {
    "spent": float,
    "code": str,
    "recordings": list[_Recording],
    "objectives": Annotated[list[_Objective], Field(min_length=1)],
    "importance": _Importance,
    "tuned": dict[str, Any],
}
"""The types of the facts that are stored beside the trials, by name."""


def read_as(kind: type[T], text: str | bytes, where: str) -> T:
    """Parse JSON that a study stored into a value of a type.

    Args:
        kind: A dataclass, or any other type that pydantic validates.
        text: The JSON text.
        where: The file and the place in it, for messages.

    Raises:
        StudyError: If the text is not valid; the message names the field, and states what was
            expected and found.
    """
    try:
        return parse_json(kind, text)
    except InvalidJson as error:
        at = f", {error.field}" if error.field else ""
        raise StudyError(
            f"{where}{at}: {error.problem}; what the study wrote "
            "was changed since: take the file from a copy, or start a study of another name"
        ) from None


def studies_folder() -> Path:
    """Return ``$MULTIVIEW_PHD_STUDIES``, else ``studies`` in the platform's folder for data."""
    own = os.environ.get("MULTIVIEW_PHD_STUDIES")
    if own:
        return Path(own).expanduser().absolute()
    return data_folder() / "studies"


def create(definition: StudyDefinition, folder: Path) -> Store:
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
        # what is stored no longer names what no longer exists, of which the notes speak
        if store.definition().to_json() != definition.to_json():
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


def free_name(words: str, folder: Path) -> str:
    """Return a valid name of a study that is not in use in a folder.

    Args:
        words: The words that the name begins with; characters that no name has become dashes.
        folder: The folder of all studies.
    """
    plain = "".join(c if c.isalpha() or c.isdecimal() or c in " .+-_" else "-" for c in words)
    plain = plain[:50].strip(" .+-_") or "study"
    return next(name for n in count(1) if not (folder / (name := f"{plain} {n}")).exists())


@contextmanager
def turn(name: str, waits: Callable[[str], bool], folder: Path | None = None) -> Iterator[bool]:
    """Hold the lock of this machine's cores, so that one study at a time runs on them.

    Args:
        name: The name of the study.
        waits: A callback that gets a sentence on the reason of the wait at each attempt, and
            returns False to end the wait.
        folder: The folder of the lock; None for the folder of all studies.

    Yields:
        Whether the lock is held; False if ``waits`` ended the wait. If the folder is not writable,
        studies do not wait for each other.
    """
    file = (folder or studies_folder()) / HOLDER

    def wait() -> bool:
        try:
            holder = f'the study "{file.read_text(encoding="utf-8")}"'
        except OSError:
            holder = "another study"
        return waits(f"waits for its turn: {holder} has this machine's cores")

    with ExitStack() as held:
        mine = True
        try:
            mine = held.enter_context(locked(file, wait=wait))
            if mine:
                file.write_text(name, encoding="utf-8")
        except OSError:
            pass
        yield mine


class Store:
    """The folder of one study."""

    def __init__(self, folder: Path) -> None:
        """Store the path; files are read when they are needed."""
        self.folder = folder.absolute()
        self._results = self.folder / RESULTS

    @property
    def name(self) -> str:
        """The name of the study."""
        return self.folder.name

    def definition(self) -> StudyDefinition:
        """Read the study's definition.

        Raises:
            StudyError: If the file of the definition is not valid.
        """
        return read_definition(self.folder / FILE)

    def touched(self) -> float:
        """Return the time when a file of the study last changed, seconds since 1970."""
        files = [self.folder / name for name in (FILE, RESULTS, STATUS)]
        return max((file.stat().st_mtime for file in files if file.exists()), default=0.0)

    def trials(self, after: float = 0.0) -> list[Trial]:
        """Return the trials that ended, by number.

        Args:
            after: Only trials that ended after this time are returned, seconds since 1970.

        Raises:
            StudyError: If the record of a trial is not valid; the message names the field.
        """
        rows = self._rows(
            "SELECT number, told FROM trials WHERE ended > ? ORDER BY number", max(after, 0.0)
        )
        return [read_as(Trial, text, f"{self._results}, trial {number}") for number, text in rows]

    def running_trials(self) -> dict[int, dict[str, Any]]:
        """Return the values by key of each trial under way, by its number.

        Raises:
            StudyError: If the record of a trial is not valid.
        """
        rows = self._rows(
            "SELECT number, told FROM trials WHERE state = ? ORDER BY number", "running"
        )
        return {
            number: with_current_keys(
                read_as(dict[str, Any], text, f"{self._results}, trial {number}")
            )
            for number, text in rows
        }

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
        for (text,) in self._rows("SELECT outcome FROM jobs WHERE key = ?", key):
            return read_as(Outcome, text, f"{self._results}, run {key}")
        return None

    def fact(self, name: str) -> Any:
        """Return a fact that is stored beside the trials; None if it is not stored."""
        for (text,) in self._rows("SELECT value FROM told WHERE name = ?", name):
            return read_as(STORED.get(name, object), text, f"{self._results}, {name}")
        return None

    def status(self) -> Status:
        """Return the status that was last written; its state is ``stopped`` if the process was
        killed."""
        try:
            status = read_as(Status, (self.folder / STATUS).read_bytes(), STATUS)
        except (OSError, StudyError):  # the status is written again soon
            return Status()
        if status.state == "running" and not self.is_running():
            words = "the program that ran it was ended; nothing that ended before is lost"
            return replace(
                status, state="stopped", words=words, seconds_left=None, busy=None, workers=[]
            )
        return status

    def is_running(self) -> bool:
        """Whether a process runs the study."""
        return is_locked(self.folder / FILE)

    @contextmanager
    def running(self) -> Iterator[Writer]:
        """Hold the study's lock, and yield the writer of its results.

        Raises:
            StudyError: If another process runs the study, or the folder cannot be written to.
        """
        until = time.monotonic() + 1.0
        with ExitStack() as held:
            try:
                lock = locked(self.folder / FILE, wait=lambda: time.monotonic() < until)
                mine = held.enter_context(lock)
            except OSError as error:
                raise StudyError(
                    f"{self.folder}: cannot be written to ({error.strerror or error})"
                ) from None
            if not mine:
                raise StudyError(
                    f'the study "{self.name}" is run by another process; stop that one, or give '
                    "this one another name"
                )
            writer = held.enter_context(Writer(self.folder))
            (self.folder / STOP).unlink(missing_ok=True)
            yield writer

    def ask_to_stop(self) -> None:
        """Request the process that runs the study to stop; its results remain stored."""
        (self.folder / STOP).touch()

    def asked_to_stop(self) -> bool:
        """Whether the process that runs the study was requested to stop."""
        return (self.folder / STOP).exists()

    def _rows(self, statement: str, *values: Any) -> list[Any]:
        """Return the rows of a query; none if there are no results yet."""
        if not self._results.exists():
            return []
        try:
            connection = sqlite3.connect(self._results, timeout=5.0, isolation_level=None)
            try:
                if not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
                    return []
                return connection.execute(statement, values).fetchall()
            finally:
                connection.close()
        except sqlite3.Error as error:
            raise StudyError(f"{self._results}: cannot be read ({error})") from None


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
            (ended,) = self._connection.execute("SELECT max(ended) FROM trials").fetchone()
        self._ended = float(ended or 0.0)
        self._outcomes: dict[str, str] = dict(rows)

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
        return None if text is None else read_as(Outcome, text, f"{self._path}, run {key}")

    def keep(self, outcome: Outcome) -> None:
        """Store the outcome of a run, unless it is stored already."""
        text = json.dumps(outcome.to_json(), ensure_ascii=False)
        self._insert("INSERT OR IGNORE INTO jobs VALUES (?, ?, ?)", outcome.key, text, time.time())
        self._outcomes.setdefault(outcome.key, text)

    def begin(self, number: int, values: dict[str, Any]) -> None:
        """Store the values of a trial that is under way from now on."""
        text = json.dumps(values, ensure_ascii=False)
        self._insert("INSERT INTO trials VALUES (?, 'running', ?, 0.0)", number, text)

    def end(self, trial: Trial) -> None:
        """Store a trial that ended, which is no longer under way."""
        # times increase even if the clock is set back, since readers ask for trials after a time
        self._ended = max(time.time(), self._ended + 1e-5)
        text = json.dumps({**trial.to_json(), "ended": self._ended}, ensure_ascii=False)
        statement = "INSERT OR REPLACE INTO trials VALUES (?, ?, ?, ?)"
        self._insert(statement, trial.number, trial.state, text, self._ended)

    def put_facts(self, **facts: Any) -> None:
        """Store facts beside the trials under their names (see :data:`STORED`), all or none."""
        rows = ", ".join(["(?, ?)"] * len(facts))
        texts = [(name, json.dumps(value, ensure_ascii=False)) for name, value in facts.items()]
        self._insert(f"INSERT OR REPLACE INTO told VALUES {rows}", *chain.from_iterable(texts))

    def _insert(self, statement: str, *values: Any) -> None:
        with self._explained():
            self._connection.execute(statement, values)

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
