"""Keeps the runs of a workbench in the library, from a thread of its own.

A library that cannot be used is told of once; the workbench goes on without it.
"""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path

from app.errors import sentence
from app.state.opening_step import is_settled
from app.state.snapshot import Change, Snapshot
from app.state.workbench import Workbench
from app.state.workers.jobs import CLOSING_SECONDS, be_nice
from tracker.library import KEEP
from tracker.library.errors import LibraryError
from tracker.library.keeping import recording_of, run_of, thumbnail_of
from tracker.library.store import Library, open_library
from tracker.runs.gaps import gaps
from tracker.sequences.sequence import Sequence

logger = logging.getLogger("app")

SETTLED_SECONDS = 1.0
"""A finished run is kept when no other one has taken its place for so long: who drags a slider
wants one of the runs that he passed, not all."""


class Keeper:
    """Writes down recordings that are opened and runs that come to their end."""

    def __init__(self, workbench: Workbench, path: Path | None, keep: int = KEEP) -> None:
        """Follow a workbench.

        Args:
            workbench: Whose runs.
            path: The library's file; None keeps nothing.
            keep: How many untouched runs stay; 0 keeps no run by itself.
        """
        self.path = path
        self.error: str | None = None
        """Why there is no library, in one sentence."""
        self._workbench = workbench
        self._keep = keep
        self._lock = threading.Lock()
        self._library: Library | None = None
        self._opened: Sequence | None = None
        self._begun: tuple[str, float] = ("", 0.0)
        self._kept: set[str] = set()
        self._news = threading.Event()
        self._closed = False
        self._unsubscribe = workbench.subscribe(self._on_change)
        self._thread = threading.Thread(target=self._work, name="library", daemon=True)
        self._thread.start()

    def library(self) -> Library:
        """The library, opened when it is first asked for.

        Raises:
            LibraryError: If there is none.
        """
        with self._lock:
            if self._library is None:
                if self.path is None:
                    raise LibraryError("this workbench was started without a library")
                if self.error is not None:
                    raise LibraryError(self.error)
                try:
                    self._library = open_library(self.path)
                except LibraryError as error:
                    self.error = sentence(error)
                    raise
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
            now = self._workbench.snapshot()
            if now.run_state.state == "computing" and now.run_state.key != self._begun[0]:
                self._begun = (now.run_state.key, time.time())
            self._news.set()

    def _work(self) -> None:
        be_nice()
        if self.path is None:
            return
        while not self._closed:
            self._news.wait()
            self._news.clear()
            try:
                self._note(self._workbench.snapshot())
            except LibraryError as error:
                if self._closed:
                    return
                self._workbench.notify(
                    "warn",
                    f"Runs are not kept: {sentence(error)}.",
                    "Everything else works as it does.",
                )
                return
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
                library.open_recording(recording_of(sequence, now.opened_as, picture))
            self._opened = sequence
        if not self._keep or not is_settled(now) or now.run_state.kept is not None:
            return
        key = now.run_state.key
        if key in self._kept:
            return
        if sequence.ground_truth is None:  # else it was settled before it was scored
            self._news.wait(SETTLED_SECONDS)
            if self._workbench.snapshot().run_state.key != key:
                return
        self._keep_run(now, key)

    def _keep_run(self, now: Snapshot, key: str) -> None:
        run, scored = now.run, now.scores.shown
        library = self.library()
        if run is None or library.read_only:
            return
        if any(gap.unexpected for gap in gaps(run)):  # another result when the files are whole
            return
        speed = now.run_state.steps_per_second
        began = self._begun[1] if self._begun[0] == key else time.time()
        new = run_of(
            run,
            source="page",
            began=began,
            seconds=run.done / speed if speed > 0.0 else 0.0,
            evaluation=scored.evaluation if scored is not None and scored.key == key else None,
        )
        library.keep(recording_of(now.named(run.sequence), now.opened_as), new, self._keep)
        self._kept.add(key)
