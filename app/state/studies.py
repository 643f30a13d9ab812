"""Studies beside the workbench: each is run by a process of its own, and read from its folder.

That process has a lower priority, and goes on when the server ends: the next one finds it at
work. Nothing of a study is kept here but when its files were last seen to change.
"""

from __future__ import annotations

import errno
import json
import logging
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.state.workbench import Workbench
from tracker.files.atomic import write_whole
from tracker.studies.cluster import worker_count
from tracker.studies.definition import StudyDefinition
from tracker.studies.errors import StudyError
from tracker.studies.store import FILE, Store, Trial, create, find, read_as, stores
from tracker.studies.summary import Summary, summary_of

logger = logging.getLogger("app")

LOOKS_SECONDS = 0.5
"""How often it is looked whether a study has news."""

LOG = "log.txt"
"""What the process of a study said last."""

PLACE = "place.json"
"""Where a study that the page started runs."""

START_SECONDS = 30.0
"""How long a study's process is waited for until it tells that it runs, or why it cannot."""

STOP_SECONDS = 5.0
ENDING_SECONDS = 20.0

_NICENESS = 5


@dataclass(frozen=True, slots=True)
class Place:
    """Where a study runs: with neither, on this machine with one process a core."""

    workers: int | None = None
    scheduler: str | None = None


class StudyDesk:
    """Starts, stops and reads the studies of one folder."""

    def __init__(self, workbench: Workbench, folder: Path) -> None:
        """Begin to look for news."""
        self.folder = folder
        self._workbench = workbench
        self._seen: dict[str, tuple[float, str]] = {}
        self._summaries: dict[str, tuple[float, Summary]] = {}
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._started: list[subprocess.Popen[bytes]] = []
        self._thread = threading.Thread(target=self._look, name="studies", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Look no more; what is at work goes on."""
        self._closed.set()
        self._thread.join(timeout=2.0 * LOOKS_SECONDS)

    def all(self) -> list[Store]:
        """Every study, the one that was at work last first."""
        return stores(self.folder)

    def store(self, name: str) -> Store:
        """One study.

        Raises:
            StudyError: If there is none of that name.
        """
        if "/" in name or "\\" in name or name.startswith("."):
            raise StudyError(f"expected the name of a study, got {name!r}")
        return find(name, self.folder)

    def define(self, definition: StudyDefinition) -> Store:
        """Make a study's folder.

        Raises:
            StudyError: If there is another one of that name.
        """
        if (self.folder / definition.name / FILE).is_file():
            raise StudyError(
                f'there is a study "{definition.name}" already; give this one another name'
            )
        return create(definition, self.folder)

    def check_place(self, workers: int | None, scheduler: str | None) -> None:
        """Whether a study can run there.

        Raises:
            StudyError: If there would be more workers than this machine can bear, or what is said
                to be a scheduler's address is none.
        """
        if scheduler is None:
            worker_count(workers)
        else:
            from tracker.studies.cluster import check_address

            check_address(scheduler)

    def start(self, name: str, workers: int | None, scheduler: str | None) -> Store:
        """Have a process run a study, or go on with it; one that is just ending is waited for.

        Args:
            name: Of the study.
            workers: Processes on this machine.
            scheduler: Address of a cluster's. With neither it runs where it ran last, and at first
                with one process a core of this machine.

        Raises:
            StudyError: If it runs already, no process can be started, or there would be more
                workers than this machine can bear.
        """
        store = self.store(name)
        place = Place(workers, scheduler)
        if place == Place():
            place = self._last_place(store)
        self.check_place(place.workers, place.scheduler)
        if self._goes_on(store):
            raise StudyError(f'the study "{name}" runs already')
        line = [sys.executable, "-m", "app", "study", "resume", str(store.folder)]
        line += ["--workers", str(place.workers)] if place.workers else []
        line += ["--scheduler", place.scheduler] if place.scheduler else []
        try:
            write_whole(store.folder / PLACE, json.dumps(asdict(place)).encode())
        except OSError as error:
            raise StudyError(
                f"{store.folder / PLACE}: cannot be written ({error.strerror or error})"
            ) from None
        self.run(store, line)
        return store

    def _goes_on(self, store: Store) -> bool:
        """Whether a study runs; one that is just ending is waited for."""
        until = time.monotonic() + ENDING_SECONDS
        while (running := store.is_running()) and time.monotonic() < until:
            if store.status().state == "running" and not store.asked_to_stop():
                break
            time.sleep(0.05)  # its workers end before it does
        return running

    def _last_place(self, store: Store) -> Place:
        try:
            text = (store.folder / PLACE).read_bytes()
        except FileNotFoundError:
            return Place()
        return read_as(Place, text, str(store.folder / PLACE))

    def run(self, store: Store, line: list[str]) -> None:
        """Start the process of a study, with a lower priority, on its own."""
        if sys.platform != "win32":
            line = ["nice", "-n", str(_NICENESS), *line]
        before = store.status().written
        try:
            with (store.folder / LOG).open("wb") as log:
                process = subprocess.Popen(
                    line, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
                )
        except OSError as error:
            raise StudyError(f'the study "{store.name}" cannot be started ({error})') from None
        self._started.append(process)
        until = time.monotonic() + START_SECONDS
        while time.monotonic() < until and process.poll() is None:
            if store.status().written > before:
                return
            time.sleep(0.05)
        if process.poll() not in (None, 0):
            raise StudyError(self._last_words(store))

    def _last_words(self, store: Store) -> str:
        try:
            lines = (store.folder / LOG).read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        words = lines[-1].removeprefix("multiview-phd: ") if lines else "it said nothing"
        return f'the study "{store.name}" ended at once: {words}'

    def stop(self, name: str) -> Store:
        """Have a study end, with everything kept; waits for it a moment."""
        store = self.store(name)
        if store.is_running():
            store.ask_to_stop()
            until = time.monotonic() + STOP_SECONDS
            while store.is_running() and time.monotonic() < until:
                time.sleep(0.05)
        return store

    def remove(self, name: str) -> None:
        """Delete a study with everything in it; one that is just ending is waited for.

        Raises:
            StudyError: If it runs.
            OSError: If it cannot be deleted.
        """
        store = self.store(name)
        if self._goes_on(store):
            raise StudyError(f'the study "{name}" runs; stop it first')
        until = time.monotonic() + ENDING_SECONDS
        while store.folder.exists():
            try:
                shutil.rmtree(store.folder)
            except OSError as error:
                # a worker's last files come or go meanwhile
                passes = error.errno in (errno.ENOENT, errno.ENOTEMPTY)
                if not passes or time.monotonic() > until:
                    raise
                time.sleep(0.05)
        with self._lock:
            self._summaries.pop(name, None)
            self._seen.pop(name, None)

    def summary(self, store: Store) -> Summary:
        """A study as it is read; kept, and only what is new is read when its files change."""
        touched = store.touched()
        with self._lock:
            kept = self._summaries.get(store.name)
        if kept is not None and kept[0] == touched:
            return kept[1]
        summary = summary_of(store, None if kept is None else kept[1])
        with self._lock:
            self._summaries[store.name] = touched, summary
        return summary

    def info(self, store: Store) -> dict[str, Any]:
        """A study in a line: state, how far, and the leading figure of default and best."""
        summary = self.summary(store)
        status = store.status()
        best, default = summary.best, summary.default

        def lead(trial: Trial | None) -> float | None:
            return None if trial is None or trial.objectives is None else trial.objectives[0]

        return {
            "name": store.name,
            "state": status.state,
            "words": status.words,
            "done": len(summary.trials),
            "trials": None
            if summary.definition.by_time_alone
            else max(status.trials, summary.definition.trials),
            "touched": store.touched(),
            "seconds_left": status.seconds_left,
            "objective": summary.objectives[0].name,
            "best": lead(best),
            "default": lead(default),
        }

    def _look(self) -> None:
        """Tell the pages of what has changed."""
        first = True
        while not self._closed.wait(0.0 if first else LOOKS_SECONDS):
            self._started = [one for one in self._started if one.poll() is None]
            try:
                for store in self.all():
                    now = store.touched(), store.status().state
                    if self._seen.get(store.name) != now:
                        self._seen[store.name] = now
                        if not first or now[1] == "running":
                            self._workbench.study_changed(self.info(store))
            except (OSError, StudyError) as error:  # a folder that is being made or deleted
                logger.debug("studies: %s", error)
            first = False
