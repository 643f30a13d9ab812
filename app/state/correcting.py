"""What was put right by hand in the open recording: kept as a log, taken back, said again."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.state.snapshot import Change
from app.state.workbench import Workbench
from tracker.corrections import Correction, CorrectionError
from tracker.corrections.contradictions import find_repeated, refuse_contradiction
from tracker.corrections.log import Log, open_log, own_place, remark_on, write_log, writing_place
from tracker.files.validated import read_as, write_json
from tracker.sequences.built_in import key_of
from tracker.sequences.sequence import Sequence as Recording

logger = logging.getLogger("app")

MOST = 500
"""Actions that can be taken back."""

_MEND = "Mend the file, or move it away; it is read again then."

Told = tuple[Correction, ...]


@dataclass(frozen=True, slots=True)
class Action:
    """One thing that a person did, from one list of corrections to another."""

    words: str
    before: Told
    after: Told


@dataclass(frozen=True, slots=True)
class _StoredAction:
    """An action as the file of the history has it."""

    words: str
    before: list[str]
    """The ids of the corrections before it."""
    after: list[str]
    """The ids of the corrections after it."""


@dataclass(frozen=True, slots=True)
class _History:
    """The file of the actions that can be taken back or done again."""

    done: list[_StoredAction]
    undone: list[_StoredAction]
    corrections: dict[str, dict[str, Any]]
    """Each correction of all actions once, by its id."""


def _action(stored: _StoredAction, corrections: Mapping[str, Correction]) -> Action:
    """Return a stored action with its corrections.

    Raises:
        KeyError: If one of them is missing.
    """
    before = tuple(corrections[one] for one in stored.before)
    return Action(stored.words, before, tuple(corrections[one] for one in stored.after))


def _mark_of(path: Path) -> tuple[int, int, int] | None:
    """What changes when a file is written: which it is, when that was, and its length."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


class Correcting:
    """Follows a workbench; the log is written before anybody hears of a change."""

    def __init__(self, workbench: Workbench, folder: Path | None) -> None:
        """Read the log of what is open, now and whenever something else is.

        Args:
            workbench: Whose recordings.
            folder: Where what can be taken back is kept over a start; None: not beyond this one.
        """
        self._workbench, self._folder = workbench, folder
        self._lock = threading.RLock()
        self._recording: Recording | None = None
        self._log = Log(Path())
        self._mark: tuple[int, int, int] | None = None
        """Of the log as it was read or written last."""
        self._done: list[Action] = []
        self._undone: list[Action] = []
        self.skipped: set[str] = set()
        """Doubtful places that somebody passed over, until the program ends."""
        self._unsubscribe = workbench.subscribe(self._on_change)

    def close(self) -> None:
        """Stop following."""
        self._unsubscribe()

    def refresh(self) -> None:
        """Read the log again where another program has written it: what it says then counts, and
        what was done before cannot be taken back any more."""
        with self._lock:
            if self._recording is None or _mark_of(self._log.path) == self._mark:
                return
            before, self._log = self._log, open_log(self._recording.folder)
            self._mark = _mark_of(self._log.path)
            if (before.corrections, before.problem) == (self._log.corrections, self._log.problem):
                return
            self._done, self._undone = [], []
            self._workbench.correct(self._recording, self._log.corrections)
        if self._log.problem is None:
            self._workbench.notify("info", f"{self._log.path.name} was changed and is read again")
        self._complain()

    def _complain(self) -> None:
        if self._log.problem is not None:
            self._workbench.notify("warn", f"Corrections are left out: {self._log.problem}", _MEND)

    @property
    def log(self) -> Log:
        """Where the log lies, and why it cannot be used, where it cannot."""
        return self._log

    @property
    def undo_words(self) -> str | None:
        """What would be taken back; None for nothing."""
        return self._done[-1].words if self._done else None

    @property
    def redo_words(self) -> str | None:
        """What would be said again; None for nothing."""
        return self._undone[-1].words if self._undone else None

    def add(self, new: Sequence[Correction]) -> None:
        """Say some things at once: one action.

        Raises:
            CorrectionError: If one contradicts what was said, or the log cannot be written;
                nothing changes then.
        """
        with self._lock:
            self.refresh()
            before = self._workbench.snapshot().corrections
            after = list(before)
            for one in new:
                old, again = find_repeated(after, one)
                if old is not None:
                    after.remove(old)
                refuse_contradiction(after, again)
                after.append(again)
            words = new[0].words if len(new) == 1 else f"{len(new)} corrections"
            self._do(Action(words, before, tuple(after)))

    def remove(self, identity: str) -> None:
        """Take one correction out, wherever it stands.

        Raises:
            CorrectionError: If there is none with this id, or the log cannot be written.
        """
        with self._lock:
            self.refresh()
            before = self._workbench.snapshot().corrections
            gone = next((one for one in before if one.id == identity), None)
            if gone is None:
                raise CorrectionError(f"there is no correction {identity}; read the list again")
            after = tuple(one for one in before if one is not gone)
            self._do(Action(f"{gone.words} dropped", before, after))

    def undo(self) -> None:
        """Take the last action back.

        Raises:
            CorrectionError: If there is nothing to take back, or the log cannot be written.
        """
        with self._lock:
            self.refresh()
            if not self._done:
                raise CorrectionError("there is nothing to take back")
            action = self._done[-1]
            self._put(action.before)
            self._undone.append(self._done.pop())
            self._keep_history()

    def redo(self) -> None:
        """Do again what was taken back last.

        Raises:
            CorrectionError: If nothing was, or the log cannot be written.
        """
        with self._lock:
            self.refresh()
            if not self._undone:
                raise CorrectionError("nothing was taken back that could be said again")
            action = self._undone[-1]
            self._put(action.after)
            self._done.append(self._undone.pop())
            self._keep_history()

    def _do(self, action: Action) -> None:
        self._put(action.after)
        self._done = [*self._done, action][-MOST:]
        self._undone = []
        self._keep_history()

    def _put(self, corrections: Told) -> None:
        if self._recording is None:
            raise CorrectionError("no recording is open")
        if self._log.problem is not None:
            raise CorrectionError(f"{self._log.problem}; mend the file, or move it away")
        path = writing_place(self._recording.folder)
        try:
            write_log(path, corrections)
        except OSError as error:
            if path == own_place(self._recording.folder):
                raise CorrectionError(str(error)) from None
            path = own_place(self._recording.folder)
            write_log(path, corrections)
        self._log, self._mark = Log(path, corrections), _mark_of(path)
        self._workbench.correct(self._recording, corrections)

    # over a start

    def _on_change(self, change: Change) -> None:
        recording = self._workbench.snapshot().sequence
        if recording is None or change not in ("sequence", "taught"):
            return
        with self._lock:
            same = self._recording is not None and self._recording.views is recording.views
            self._recording = recording
            if change == "taught" and same:
                return
            self._log = open_log(recording.folder)
            self._done, self._undone, self.skipped = [], [], set()
            self._read_history()
            self._mark = _mark_of(self._log.path)
        self._complain()
        if remark := remark_on(recording.folder):
            self._workbench.notify("info", remark)

    def _history_file(self) -> Path | None:
        if self._folder is None or self._recording is None:
            return None
        return self._folder / f"{key_of(self._recording.folder)}.history.json"

    def _keep_history(self) -> None:
        path = self._history_file()
        if path is None:
            return
        known: dict[str, Any] = {}

        def plain(action: Action) -> dict[str, Any]:
            for one in (*action.before, *action.after):
                known[one.id] = one.model_dump(mode="json", exclude_none=True)
            return {
                "words": action.words,
                "before": [one.id for one in action.before],
                "after": [one.id for one in action.after],
            }

        value = {"done": [plain(a) for a in self._done], "undone": [plain(a) for a in self._undone]}
        try:
            write_json(path, {**value, "corrections": known})
        except OSError as error:
            logger.warning("what was done cannot be taken back after an end: %s", error)

    def _read_history(self) -> None:
        """What can be taken back, unless somebody else has changed the log meanwhile."""
        path = self._history_file()
        try:
            if path is None:
                return
            stored = read_as(path, _History)
            known = {k: Correction.model_validate(v) for k, v in stored.corrections.items()}
            done = [_action(one, known) for one in stored.done]
            undone = [_action(one, known) for one in stored.undone]
        except FileNotFoundError:
            return
        except (OSError, ValueError, LookupError) as error:
            logger.warning("%s cannot be read; earlier corrections stay: %s", path, error)
            return
        now = done[-1].after if done else undone[-1].before if undone else ()
        if now == self._log.corrections:
            self._done, self._undone = done, undone
