"""Keeps the runs of a workbench in the library, from a thread of its own, and marks them.

A figure that was made before a run was finished is replaced once its run is opened and scored.

A library that cannot be used is told of once and tried again now and then; the workbench goes on
without it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import sentence
from app.state.edits import Edits
from app.state.opening_step import is_settled
from app.state.snapshot import DRAG_SECONDS, Change, Snapshot
from app.state.threads import CLOSING_SECONDS, be_nice
from app.state.workbench import Workbench
from tracker.library import KEEP
from tracker.library.errors import LibraryError
from tracker.library.keeping import (
    figures_of,
    ospa_of,
    record_of_recording,
    record_of_run,
    thumbnail_of,
)
from tracker.library.records import KeptRun
from tracker.library.store import Library, open_library
from tracker.runs.gaps import gaps
from tracker.runs.run import Run, given_names
from tracker.sequences.sequence import Sequence

logger = logging.getLogger("app")


RETRY_SECONDS = 20.0
"""A library that could not be used, since another program held it or a disk was full, is tried
again after so long."""


class Keeper:
    """Writes down recordings that are opened and runs that come to their end."""

    def __init__(
        self,
        workbench: Workbench,
        path: Path | None,
        keep: int = KEEP,
        names: Callable[[Run], Mapping[int, str]] = given_names,
    ) -> None:
        """Follow a workbench.

        Args:
            workbench: Whose runs.
            path: The library's file; None keeps nothing.
            keep: How many untouched runs stay; 0 keeps no run by itself.
            names: The names of a finished run's tracks, by id.
        """
        self.path = path
        self.error: str | None = None
        """Why there is no library, in one sentence."""
        self._workbench = workbench
        self._keep, self._names = keep, names
        self._lock = threading.Lock()
        self._library: Library | None = None
        self._opened: Sequence | None = None
        self._retry_at = 0.0
        self._told = ""
        self._computing = ""
        self._begun: tuple[str, float] = ("", 0.0)
        self._kept: set[str] = set()
        self._news = threading.Event()
        self._closed = False
        self._unsubscribe = workbench.subscribe(self._on_change)
        self._thread = threading.Thread(target=self._work, name="library", daemon=True)
        self._thread.start()

    def library(self) -> Library:
        """The library, opened when it is first asked for; one that could not be opened is tried
        again after a while.

        Raises:
            LibraryError: If there is none.
        """
        with self._lock:
            if self._library is None:
                if self.path is None:
                    raise LibraryError("this workbench was started without a library")
                if self.error is not None and (self._closed or time.monotonic() < self._retry_at):
                    raise LibraryError(self.error)
                try:
                    self._library = open_library(self.path)
                except LibraryError as error:
                    self.error = sentence(error)
                    self._retry_at = time.monotonic() + RETRY_SECONDS
                    raise
                self.error = None
            return self._library

    def close(self) -> None:
        """Keep what is settled, and stop."""
        self._unsubscribe()
        self._closed = True
        self._news.set()
        self._thread.join(timeout=CLOSING_SECONDS)
        with self._lock:
            if self._library is not None:
                self._library.close()
                self._library = None
                self.error = "the workbench is ending"

    def _on_change(self, change: Change) -> None:
        if change in ("sequence", "run", "evaluation"):
            state = self._workbench.snapshot().run_state
            computing = state.key if state.state == "computing" else ""
            if computing and computing != self._computing:
                self._begun = (computing, time.time())
                self._kept.discard(computing)  # it is made anew: perhaps it was deleted since
            self._computing = computing
            self._news.set()

    def _work(self) -> None:
        be_nice()
        if self.path is None:
            return
        wait: float | None = None
        while not self._closed:
            self._news.wait(wait)
            self._news.clear()
            wait = None
            try:
                self._note(self._workbench.snapshot())
                self._told = ""
            except LibraryError as error:
                if self._closed:
                    return
                wait = RETRY_SECONDS
                if self._told != sentence(error):
                    self._told = sentence(error)
                    self._workbench.notify(
                        "warn",
                        f"Runs are not kept: {self._told}.",
                        "Everything else works as it does; it is tried again by itself.",
                    )
            except Exception:
                logger.exception("a run was not kept")

    def _note(self, now: Snapshot) -> None:
        sequence, reader = now.sequence, now.reader
        if sequence is None or reader is None:
            return
        if self._opened is None or sequence.views is not self._opened.views:
            library = self.library()
            if not library.read_only:
                picture = thumbnail_of(sequence, reader)
                library.open_recording(record_of_recording(sequence, now.opened_as, picture))
            self._opened = sequence
        if not is_settled(now):
            return
        if now.run_state.kept is not None:
            self._score_again(now, now.run_state.kept)
            return
        if not self._keep:
            return
        key = now.run_state.key
        if key in self._kept:
            return
        if self._stays(key):
            self._keep_run(now, key)

    def _stays(self, key: str) -> bool:
        """Whether no other run takes the place of a finished one: of those that a dragged slider
        passes none is kept. The wait ends with the workbench."""
        until = time.monotonic() + DRAG_SECONDS
        while not self._closed and (left := until - time.monotonic()) > 0.0:
            self._news.wait(left)
            if self._workbench.snapshot().run_state.key != key:
                self._news.set()
                return False
            self._news.clear()
        return True

    def _keep_run(self, now: Snapshot, key: str) -> None:
        run, scored = now.run, now.scores.shown
        library = self.library()
        if run is None or library.read_only:
            return
        if any(gap.unexpected for gap in gaps(run)):  # another result when the files are whole
            return
        speed = now.run_state.steps_per_second
        began = self._begun[1] if self._begun[0] == key else time.time()
        new = record_of_run(
            run,
            source="page",
            began=began,
            seconds=run.done / speed if speed > 0.0 else 0.0,
            evaluation=None if scored is None else scored.evaluation,
            names=self._names(run),
        )
        library.keep(record_of_recording(now.saved or run.sequence, now.opened_as), new, self._keep)
        self._kept.add(key)

    def _score_again(self, now: Snapshot, number: int) -> None:
        """Store the figures of a kept run that is shown, where those that it has are provisional.

        They are those of its tracks as long as the recording is the one that was tracked.
        """
        run, scored, library = now.run, now.scores.shown, self.library()
        if run is None or scored is None or not scored.is_final_of(run) or library.read_only:
            return
        evaluation = scored.evaluation
        if evaluation is None or not library.run(number).provisional:
            return
        stored = library.result(number)
        same = np.array_equal(stored.kept.tracks.positions, run.tracks.positions)
        if same and stored.run.digest == run.sequence.digest:
            library.score(number, figures_of(evaluation), ospa_of(evaluation))


Marks = Mapping[str, Any]
"""By ``name``, ``star``, ``note``, ``tags`` or ``deleted``, what is said of a run."""


class Marking:
    """Marks and deletes runs of a library, so that it can be undone."""

    def __init__(self, workbench: Workbench, edits: Edits, library: Callable[[], Library]) -> None:
        """Mark runs of a library."""
        self._workbench, self._edits, self._library = workbench, edits, library
        edits.own("runs", self._restore)

    def mark(self, number: int, marks: Marks) -> KeptRun:
        """Name, star, note or tag a run; the run as it is then.

        Raises:
            LibraryError: If there is no such run, or the library cannot be written.
        """
        library = self._library()
        run = library.run(number)
        before = {
            "name": run.name, "star": bool(run.star), "note": run.note, "tags": list(run.tags),
        }  # fmt: skip
        self._restore({str(number): marks})
        words = f"{run.title}: {', '.join(marks)}"
        if "star" in marks:
            words = f"{run.title} {'starred' if marks['star'] else 'not starred'}"
        elif "name" in marks:
            words = f"{run.title} renamed"
        old = {str(number): {key: before[key] for key in marks}}
        self._edits.done(words, "runs", old, {str(number): dict(marks)})
        return library.run(number)

    def delete(self, numbers: list[int]) -> int:
        """Delete runs; the size of their tracks, bytes.

        Raises:
            LibraryError: If there is no such run, or the library cannot be written.
        """
        size = self._library().delete(numbers)
        self._workbench.runs_marked()
        words = f"run {numbers[0]} deleted" if len(numbers) == 1 else f"{len(numbers)} runs deleted"
        before, after = (
            {str(number): {"deleted": deleted} for number in numbers} for deleted in (False, True)
        )
        self._edits.done(words, "runs", before, after)
        return size

    def _restore(self, runs: Mapping[str, Marks]) -> None:
        library = self._library()
        for deleted, act in ((False, library.restore), (True, library.delete)):
            numbers = [
                int(number) for number, marks in runs.items() if marks.get("deleted") is deleted
            ]
            if numbers:
                act(numbers)
        write: dict[str, Callable[[int, Any], None]] = {
            "name": library.rename, "star": library.star, "note": library.note, "tags": library.tag,
        }  # fmt: skip
        for number, marks in runs.items():
            for key, value in marks.items():
                if key in write:
                    write[key](int(number), value)
        self._workbench.runs_marked()
