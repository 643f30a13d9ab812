"""Writes runs in the forms of other programs, one at a time, in a thread of its own."""

from __future__ import annotations

import logging
import re
import shutil
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from app.errors import sentence
from app.state.snapshot import Task
from app.state.workbench import Workbench
from app.state.workers.threads import CLOSING_SECONDS, be_nice
from tracker.export.exported_run import ExportedRun, Options, Stopped
from tracker.export.registry import Format, save

logger = logging.getLogger("app")

Phase = Literal["idle", "writing", "done", "failed", "cancelled"]


@dataclass(frozen=True, slots=True)
class Exporting:
    """How far it is."""

    number: int = 0
    """Counts the files that were asked for."""
    state: Phase = "idle"
    format: str = ""
    name: str = ""
    """Of the file."""
    done: int = 0
    total: int = 0
    error: str | None = None


class Exporter:
    """The newest wish wins; what was written stays until the next one."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._lock = threading.Lock()
        self._now = Exporting()
        self._cancelled = threading.Event()
        self._folder: Path | None = None
        self._thread: threading.Thread | None = None

    @property
    def now(self) -> Exporting:
        """How far the newest is."""
        return self._now

    @property
    def file(self) -> Path | None:
        """What was written, once it is."""
        with self._lock:
            if self._now.state != "done" or self._folder is None:
                return None
            return self._folder / self._now.name

    def start(
        self, form: Format, make: Callable[[], ExportedRun], name: str, options: Options
    ) -> Exporting:
        """Begin to write, instead of what is under way.

        Args:
            form: Which form.
            make: Gives the run; called in the thread, since it may have to be read.
            name: Of the run, for the file's name.
            options: Range and speed; progress and stopping are the exporter's.
        """
        self.cancel()
        with self._lock:
            self._cancelled.set()  # of one that another page began since
            self._forget()
            self._cancelled = cancelled = threading.Event()
            self._folder = Path(tempfile.mkdtemp(prefix="multiview-phd-export-"))
            plain = re.sub(r"[^A-Za-z0-9_.-]+", "-", name).strip("-.") or "tracks"
            ending = form.suffix or f"-{form.name}.zip"
            self._now = Exporting(self._now.number + 1, "writing", form.name, f"{plain}{ending}")
            number, path = self._now.number, self._folder / self._now.name
            self._show()

        def tell(**values: object) -> None:
            with self._lock:
                if self._now.number == number:
                    self._now = replace(self._now, **values)  # type: ignore[arg-type]
                    self._show()

        def work() -> None:
            be_nice()
            told = replace(
                options,
                progress=lambda done, total: tell(done=done, total=total),
                stopped=cancelled.is_set,
            )
            try:
                save(path, form, make(), told, zipped=True)
            except Stopped:
                tell(state="cancelled")
            except (ValueError, OSError) as error:
                tell(state="failed", error=sentence(error))
            except Exception as error:
                logger.exception("an export failed")
                tell(state="failed", error=sentence(error))
            else:
                tell(state="done")

        self._thread = threading.Thread(target=work, name="export", daemon=True)
        self._thread.start()
        return self._now

    def _show(self) -> None:
        now = self._now
        told = Task(str(now.number), now.state, now.done, now.total, now.name, now.error)
        self._workbench.show_task("export", told)

    def cancel(self) -> None:
        """Stop what is under way; nothing of it is left."""
        self._cancelled.set()
        if self._thread is not None:
            self._thread.join(timeout=CLOSING_SECONDS)

    def close(self) -> None:
        """Stop, and remove what was written."""
        self.cancel()
        with self._lock:
            self._forget()

    def _forget(self) -> None:
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None
