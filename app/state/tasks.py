"""Work in the background that a person asks for: exports, the fetching of a network, identities."""

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
from app.messages import Model
from app.state.snapshot import Change, Task
from app.state.threads import CLOSING_SECONDS, be_nice
from app.state.workbench import Workbench
from tracker.export.exported_run import ExportedRun, Options, Stopped
from tracker.export.registry import Format, save
from tracker.review.self_consistency import Estimate, estimate
from tracker.runs.pipeline import Cancelled, Run
from tracker.runs.processes import available_cores

logger = logging.getLogger("app")

Phase = Literal["idle", "writing", "done", "failed", "cancelled"]


class ExportInfo(Model):
    """How far the newest export is."""

    number: int = 0
    """Counts the files that were asked for."""
    state: Phase = "idle"
    format: str = ""
    name: str = ""
    """Of the file."""
    done: int = 0
    total: int = 0
    """0 while it is not known."""
    error: str | None = None


class Exporter:
    """The newest wish wins; what was written stays until the next one."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._lock = threading.Lock()
        self._now = ExportInfo()
        self._cancelled = threading.Event()
        self._folder: Path | None = None
        self._thread: threading.Thread | None = None

    @property
    def now(self) -> ExportInfo:
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
    ) -> ExportInfo:
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
            self._now = ExportInfo(
                number=self._now.number + 1, state="writing", format=form.name,
                name=f"{plain}{ending}",
            )  # fmt: skip
            number, path = self._now.number, self._folder / self._now.name
            self._show()

        def tell(**values: object) -> None:
            with self._lock:
                if self._now.number == number:
                    self._now = self._now.model_copy(update=values)
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
        task = Task(
            of=str(now.number), state=now.state, done=now.done, total=now.total,
            words=now.name, error=now.error,
        )  # fmt: skip
        self._workbench.show_task("export", task)

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


class DetectorFetching:
    """At most one fetching at a time, whose progress is part of the workbench's state."""

    def __init__(self, workbench: Workbench, take_up: Callable[[], object]) -> None:
        """Fetch nothing yet.

        Args:
            workbench: Shows the progress, and says how it ended.
            take_up: Opens what is open again, with the network at hand: the method is the one that
                then fits, which with marked people is still the one by their colours.
        """
        self._workbench = workbench
        self._take_up = take_up
        self._lock = threading.Lock()
        self._cancelled = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to fetch, unless that is under way."""
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                return
            self._cancelled = threading.Event()
            self._workbench.show_fetching(0)
            self._thread = threading.Thread(
                target=self._fetch, args=(self._cancelled,), name="fetching", daemon=True
            )
            self._thread.start()

    def cancel(self) -> None:
        """Stop what is under way; nothing of it is kept."""
        with self._lock:
            self._cancelled.set()
            thread = self._thread
        if thread is not None:
            thread.join(timeout=CLOSING_SECONDS)

    def close(self) -> None:
        """Stop, at the end of the program."""
        self.cancel()

    def _fetch(self, cancelled: threading.Event) -> None:
        from tracker.single_view.onnx import fetching  # at its first use

        be_nice()

        def progress(done: int, total: int) -> None:
            self._workbench.show_fetching(100 * done // max(total, 1))

        try:
            found = fetching.fetch(fetching.NANODET, progress, cancelled.is_set)
        except fetching.FetchCancelled:
            self._workbench.show_fetching(None)
        except Exception as error:
            if not isinstance(error, ValueError | OSError):
                logger.exception("fetching a detector failed")
            self._workbench.show_fetching(None)
            words = sentence(error)
            self._workbench.notify("error", f"No detector was fetched: {words}")
        else:
            self._workbench.show_fetching(None)
            self._workbench.notify("info", f"The detector {found.name} is at hand.")
            if not cancelled.is_set() and self._workbench.snapshot().sequence is not None:
                self._take_up()


@dataclass(frozen=True, slots=True)
class Checked:
    """How far the newest check is."""

    run: str = ""
    """Key of the run that is looked at."""
    state: Literal["idle", "looking", "done", "failed", "cancelled"] = "idle"
    done: int = 0
    total: int = 0
    error: str | None = None
    found: Estimate | None = None


class IdentityCheck:
    """One check at a time, in a thread of its own and in processes of its own; another run that
    somebody asks for ends it, since both want all cores."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._lock = threading.Lock()
        self._now = Checked()
        self._cancelled = threading.Event()
        self._thread: threading.Thread | None = None
        self._unsubscribe = workbench.subscribe(self._on_change)

    @property
    def now(self) -> Checked:
        """How far it is."""
        return self._now

    def start(self, run: Run) -> Checked:
        """Look at a run's recording in other ways; a check of the same run goes on.

        Raises:
            ValueError: If the run has no boxes of the cameras, or not all its steps.
        """
        if not run.complete:
            raise ValueError(f"{run.done} of {run.sequence.frames} steps are there")
        if run.only_tracks:
            raise ValueError("the boxes of the cameras were not kept with this run")
        with self._lock:
            if self._now.run == run.key and self._now.state in ("looking", "done"):
                return self._now
            self._cancelled.set()
            self._cancelled = cancelled = threading.Event()
            self._now = Checked(run.key, "looking")
            self._show()
            self._thread = threading.Thread(
                target=self._work, args=(run, cancelled), name="identity", daemon=True
            )
            self._thread.start()
            return self._now

    def cancel(self) -> None:
        """Stop what is under way; its processes, which may just begin, end when they hear of it."""
        with self._lock:
            self._cancelled.set()
            if self._now.state == "looking":
                self._now = replace(self._now, state="cancelled")
                self._show()

    def close(self) -> None:
        """Stop, and wait a moment for the processes to end."""
        self._unsubscribe()
        self.cancel()
        if self._thread is not None:
            self._thread.join(timeout=CLOSING_SECONDS)

    def _show(self) -> None:
        now = self._now
        task = Task(of=now.run, state=now.state, done=now.done, total=now.total, error=now.error)
        self._workbench.show_task("identity", task)

    def _on_change(self, change: Change) -> None:
        if change in ("sequence", "run") and self._now.state == "looking":
            state = self._workbench.snapshot().run_state
            if state.key != self._now.run:
                self.cancel()

    def _work(self, run: Run, cancelled: threading.Event) -> None:
        be_nice()

        def tell(**values: object) -> None:
            with self._lock:
                if not cancelled.is_set():
                    self._now = replace(self._now, **values)  # type: ignore[arg-type]
                    self._show()

        try:
            found = estimate(
                run,
                processes=available_cores(),
                on_progress=lambda done, total: tell(done=done, total=total),
                cancelled=cancelled.is_set,
            )
        except Cancelled:
            pass  # who stopped it has told of it
        except Exception as error:
            if not isinstance(error, ValueError | OSError):
                logger.exception("the check of identities failed")
            tell(state="failed", error=sentence(error))
        else:
            tell(state="done", found=found)
