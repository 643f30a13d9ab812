"""What the library holds: recordings, their runs, and the runs' tracks."""

from __future__ import annotations

import json
import os
import sqlite3
import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tracker.library import KEEP, columns
from tracker.library.errors import LibraryError, NoSuchRun, told
from tracker.library.file import WAIT_SECONDS, LibraryFile
from tracker.library.records import HEADLINES, KeptRun, NewRecording, NewRun, Recording, Result
from tracker.parameters import RunParameters, with_values

UNDO_SECONDS = 24 * 3600.0
"""A deleted run can be taken back for so long, unless the space is freed before."""

OSPA = "ospa over time"
"""Beside a run's figures: a curve in small."""

_RUN = ", ".join(
    {
        "recording_name": "recordings.name",
        "changes_json": "changes",
        "tags_json": "tags",
    }.get(name, f"runs.{name}")
    for name in KeptRun._fields
)
_RUNS = f"SELECT {_RUN} FROM runs JOIN recordings ON recordings.id = runs.recording"
_UNTOUCHED = "star = 0 AND name = '' AND note = '' AND tags = '[]'"


class Library(LibraryFile):
    """One open library. Thread-safe; close it, or use ``with``."""

    # reading

    def recordings(self) -> list[Recording]:
        """All of them, the one that was opened last first."""
        with self._reading() as connection:
            found = connection.execute(
                "SELECT recordings.id, place, recordings.name, kind, recordings.digest, cameras, "
                "frames, fps, has_pictures, has_detections, people, opened, "
                "(SELECT count(*) FROM runs WHERE runs.recording = recordings.id "
                "AND deleted IS NULL) FROM recordings ORDER BY opened DESC"
            )
            return [Recording._make(row) for row in found]

    def thumbnail(self, recording: int) -> bytes | None:
        """A JPEG of a recording; None where it has none, or there is no such recording."""
        with self._reading() as connection:
            found = connection.execute(
                "SELECT thumbnail FROM recordings WHERE id = ?", (recording,)
            ).fetchone()
            return None if found is None or found[0] is None else bytes(found[0])

    def runs(self, recording: int | None = None) -> list[KeptRun]:
        """The runs of one recording, or all, the newest first; without the deleted ones."""
        where, values = "deleted IS NULL", []
        if recording is not None:
            where, values = where + " AND recording = ?", [recording]
        with self._reading() as connection:
            found = connection.execute(f"{_RUNS} WHERE {where} ORDER BY began DESC", values)
            return [KeptRun._make(row) for row in found]

    def run(self, number: int) -> KeptRun:
        """One run.

        Raises:
            LibraryError: If there is no such run, or it was deleted.
        """
        with self._reading() as connection:
            row = connection.execute(
                f"{_RUNS} WHERE runs.id = ? AND deleted IS NULL", (number,)
            ).fetchone()
            if row is None:
                raise NoSuchRun(
                    f"{self.path}: there is no run {number}; `multiview-phd runs` lists them"
                )
            return KeptRun._make(row)

    def find(self, text: str) -> KeptRun:
        """One run by its number, or by its name where no other has it.

        Raises:
            LibraryError: If there is none, or several have that name.
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
        """The run of this recording, these parameters, seed and code; None where it is not kept."""
        with self._reading() as connection:
            row = connection.execute(
                f"{_RUNS} WHERE runs.key = ? AND deleted IS NULL ORDER BY runs.id DESC", (key,)
            ).fetchone()
            return None if row is None else KeptRun._make(row)

    def result(self, number: int) -> Result:
        """One run with its parameters, figures and tracks.

        Raises:
            LibraryError: If there is no such run, or its tracks are damaged.
        """
        with self._reading() as connection:
            run = self.run(number)
            row = connection.execute(
                "SELECT parameters, figures, columns, place, key, runs.digest, machine, "
                "corrections FROM runs JOIN results ON run = runs.id "
                "JOIN recordings ON recordings.id = recording WHERE runs.id = ?",
                (number,),
            ).fetchone()
            if row is None:
                raise LibraryError(f"{self.path}: the tracks of run {number} are not there")
            values, figures = _inflated(row[0]), _inflated(row[1])
            parameters, unknown = parameters_of(values)
            kept = columns.unpack(row[2])
            place, key, digest, machine = row[3:7]
            said = tuple(_inflated(row[7])["corrections"]) if row[7] is not None else ()
            ospa = tuple(figures.pop(OSPA, ()))
            return Result(
                run, place, key, digest, machine, parameters, unknown, values, figures, kept, ospa,
                said,
            )  # fmt: skip

    def size(self) -> int:
        """Bytes on disk."""
        beside = (self.path, self.path.with_name(self.path.name + "-wal"))
        return sum(part.stat().st_size for part in beside if part.exists())

    # writing

    def open_recording(self, new: NewRecording) -> int:
        """Write down that a recording was opened; its number."""
        with self._writing() as connection:
            return self._recording(connection, new)

    def keep(self, recording: NewRecording, new: NewRun, budget: int = KEEP) -> int:
        """Keep a run, and let the oldest untouched ones beyond the budget fall out.

        The same run computed again (same key) is one run; a deleted one comes back.

        Args:
            recording: Of which it is.
            new: It.
            budget: How many untouched runs stay, this one among them.

        Returns:
            The run's number.
        """
        figures = {**new.figures, OSPA: list(new.ospa)} if new.ospa else new.figures
        said = _deflated({"corrections": new.corrections}) if new.corrections else None
        packed = (_deflated(new.parameters), _deflated(figures), columns.pack(new.kept), said)
        with self._writing() as connection:
            place = self._recording(connection, recording)
            known = connection.execute(
                "SELECT id FROM runs WHERE key = ? AND recording = ? ORDER BY id DESC",
                (new.key, place),
            ).fetchone()
            number = known[0] if known else self._insert(connection, place, new)
            if known:
                connection.execute(
                    "UPDATE runs SET began = ?, deleted = NULL WHERE id = ?", (new.began, number)
                )
                if new.figures:  # scored anew, perhaps by another gate: the list tells the same
                    self._list_figures(connection, number, new.figures)
            connection.execute(
                "INSERT OR REPLACE INTO results (run, parameters, figures, columns, corrections) "
                "VALUES (?, ?, ?, ?, ?)",
                (number, *packed),
            )
            connection.execute(
                # this one stays, whatever the clock says of the others
                f"DELETE FROM runs WHERE id IN (SELECT id FROM runs WHERE {_UNTOUCHED} "
                "AND deleted IS NULL ORDER BY id = ? DESC, began DESC LIMIT -1 OFFSET ?)",
                (number, max(budget, 1)),
            )
            connection.execute("DELETE FROM runs WHERE deleted < ?", (time.time() - UNDO_SECONDS,))
            return int(number)

    def score(
        self, number: int, figures: dict[str, float | int | None], ospa: Sequence[float]
    ) -> None:
        """Store the figures of a run anew: those of the tracks that are stored with it.

        Args:
            number: Of the run.
            figures: By name; others that the run has stay.
            ospa: OSPA over time, as :attr:`NewRun.ospa` has it.

        Raises:
            LibraryError: If there is no such run.
        """
        with self._writing() as connection:
            known = self.result(number).figures
            stored = _deflated({**known, **figures, OSPA: list(ospa)})
            connection.execute("UPDATE results SET figures = ? WHERE run = ?", (stored, number))
            self._list_figures(connection, number, figures)

    def move(self, recording: int, place: str) -> None:
        """Have a recording opened from another place from now on.

        Raises:
            LibraryError: If there is no such recording, or another one lies at that place.
        """
        with self._writing() as connection:
            taken = connection.execute(
                "SELECT name FROM recordings WHERE place = ? AND id <> ?", (place, recording)
            ).fetchone()
            if taken is not None:
                raise LibraryError(f"{self.path}: {place} is recording {taken[0]} already")
            changed = connection.execute(
                "UPDATE recordings SET place = ? WHERE id = ?", (place, recording)
            )
            if not changed.rowcount:
                raise LibraryError(f"{self.path}: there is no recording {recording}")

    def rename(self, number: int, name: str) -> None:
        """Give a run a name; an empty one takes it away."""
        self._set(number, "name", " ".join(name.split()))

    def star(self, number: int, on: bool = True) -> None:
        """Keep a run for ever, or as long as the others."""
        self._set(number, "star", int(on))

    def note(self, number: int, text: str) -> None:
        """Write something beside a run."""
        self._set(number, "note", text.strip())

    def tag(self, number: int, tags: Sequence[str]) -> None:
        """Put words to a run, instead of those it has."""
        self._set(number, "tags", json.dumps(sorted(set(tags)), ensure_ascii=False))

    def delete(self, numbers: Sequence[int]) -> int:
        """Delete runs; they can be taken back for a day.

        Returns:
            The bytes that their tracks take.
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

    def take_back(self, numbers: Sequence[int]) -> None:
        """Have deleted runs again.

        Raises:
            LibraryError: If one is gone for good.
        """
        with self._writing() as connection:
            for number in numbers:
                done = connection.execute("UPDATE runs SET deleted = NULL WHERE id = ?", (number,))
                if not done.rowcount:
                    raise LibraryError(f"{self.path}: run {number} cannot be taken back any more")

    def collect(self, budget: int = KEEP) -> tuple[int, int]:
        """Free the space of deleted runs and of untouched ones beyond the budget.

        Returns:
            How many runs went, and by how many bytes the file is smaller.
        """
        before = self.size()
        with self._writing() as connection:
            gone = connection.execute("DELETE FROM runs WHERE deleted IS NOT NULL").rowcount
            gone += connection.execute(
                f"DELETE FROM runs WHERE id IN (SELECT id FROM runs WHERE {_UNTOUCHED} "
                "ORDER BY began DESC LIMIT -1 OFFSET ?)",
                (max(budget, 0),),
            ).rowcount
        with self._lock, told(self.path):
            self._connection.execute("VACUUM")
            self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        return gone, max(0, before - self.size())

    # inside

    def _recording(self, connection: sqlite3.Connection, new: NewRecording) -> int:
        values = {
            "place": new.place,
            "name": new.name,
            "kind": new.kind,
            "digest": new.digest,
            "cameras": new.cameras,
            "frames": new.frames,
            "fps": new.fps,
            "has_pictures": int(new.has_pictures),
            "has_detections": int(new.has_detections),
            "people": new.people,
            "thumbnail": new.thumbnail,
            "opened": time.time(),
        }
        names = ", ".join(values)
        marks = ", ".join("?" * len(values))
        renewed = ", ".join(
            f"{name} = coalesce(excluded.thumbnail, thumbnail)"
            if name == "thumbnail"
            else f"{name} = excluded.{name}"
            for name in values
            if name != "place"
        )
        (number,) = connection.execute(
            f"INSERT INTO recordings ({names}) VALUES ({marks}) "
            f"ON CONFLICT (place) DO UPDATE SET {renewed} RETURNING id",
            tuple(values.values()),
        ).fetchone()
        return int(number)

    def _list_figures(
        self,
        connection: sqlite3.Connection,
        number: int,
        figures: dict[str, float | int | None],
    ) -> None:
        """Have the figures of a finished run in the list of runs."""
        columns = ", ".join(f"{name} = ?" for name in HEADLINES)
        values = [figures.get(name) for name in HEADLINES]
        connection.execute(f"UPDATE runs SET {columns}, final = 1 WHERE id = ?", (*values, number))

    def _insert(self, connection: sqlite3.Connection, recording: int, new: NewRun) -> int:
        values: dict[str, Any] = {
            "recording": recording,
            **{
                name: getattr(new, name)
                for name in (
                    "key", "digest", "began", "seconds", "steps", "single_view", "fusion_method",
                    "seed", "version", "code", "machine", "source", "targets", "name", "note",
                )
            },
            **{name: new.figures.get(name) for name in HEADLINES},
            "changes": json.dumps(new.changes, ensure_ascii=False),
            "corrected": len(new.corrections),
            "final": 1,
        }  # fmt: skip
        marks = ", ".join("?" * len(values))
        done = connection.execute(
            f"INSERT INTO runs ({', '.join(values)}) VALUES ({marks})", tuple(values.values())
        )
        assert done.lastrowid is not None
        return done.lastrowid

    def _set(self, number: int, column: str, value: str | int) -> None:
        with self._writing() as connection:
            self.run(number)
            connection.execute(f"UPDATE runs SET {column} = ? WHERE id = ?", (value, number))


def _deflated(value: dict[str, Any]) -> bytes:
    return zlib.compress(json.dumps(value, ensure_ascii=False).encode())


def _inflated(data: bytes) -> dict[str, Any]:
    try:
        return dict(json.loads(zlib.decompress(data)))
    except zlib.error as error:
        raise ValueError(str(error)) from None


def parameters_of(values: dict[str, Any]) -> tuple[RunParameters, tuple[str, ...]]:
    """The parameters that were written, and the keys that this version does not take."""
    try:
        return RunParameters.model_validate(values), ()
    except ValueError:
        pass
    taken, unknown = RunParameters(), []
    for group, value in values.items():
        pairs = (
            {f"{group}.{name}": one for name, one in value.items()}
            if isinstance(value, dict)
            else {group: value}
        )
        for key, one in pairs.items():
            try:
                taken = with_values(taken, {key: one})
            except ValueError:
                unknown.append(key)
    return taken, tuple(unknown)


def open_library(path: Path, *, wait_seconds: float = WAIT_SECONDS) -> Library:
    """A library to write to; one that cannot be written to is read.

    Raises:
        LibraryError: If it cannot be read either.
    """
    read_only = path.exists() and not (os.access(path, os.W_OK) and os.access(path.parent, os.W_OK))
    return Library(path, read_only=read_only, wait_seconds=wait_seconds)
