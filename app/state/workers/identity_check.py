"""Asks how well people are told apart where no truth says so, when somebody wants to know."""

from __future__ import annotations

import logging
import threading
from dataclasses import dataclass, replace
from typing import Literal

from app.errors import sentence
from app.state.snapshot import Change, Task
from app.state.workbench import Workbench
from app.state.workers.threads import CLOSING_SECONDS, be_nice
from tracker.review.self_consistency import Estimate, estimate
from tracker.runs.pipeline import Cancelled, Run
from tracker.runs.processes import available_cores

logger = logging.getLogger("app")


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
        told = Task(now.run, now.state, now.done, now.total, error=now.error)
        self._workbench.show_task("identity", told)

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
