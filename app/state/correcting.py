"""Corrections of the open recording, stored as a log, and the moments of its run under review."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Sequence
from pathlib import Path

from app.state.edits import Edits
from app.state.snapshot import Change, Snapshot
from app.state.workbench import Workbench
from tracker.corrections import Correction, CorrectionError
from tracker.corrections.consistency import find_repeated, refuse_contradiction
from tracker.corrections.log import Log, open_log, own_place, remark_on, write_log, writing_place
from tracker.review.queue import Queue, ReviewItem, queue
from tracker.sequences.built_in import opens_by_name
from tracker.sequences.reader import WHERE_NOW, why_missing
from tracker.sequences.sequence import Sequence as Recording

_MEND = "Mend the file, or move it away; it is read again then."

Told = tuple[Correction, ...]


def _mark_of(path: Path) -> tuple[int, int, int] | None:
    """What changes when a file is written: which it is, when that was, and its length."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


def _why_missing(recording: Recording) -> str | None:
    """Why a recording with its log is not in its folder any more; None for what opens by its name
    and has its log in the settings."""
    return None if opens_by_name(recording.folder) else why_missing(recording.folder)


def _written(corrections: Told, places: Sequence[Path]) -> Path:
    """Write the log at the first of some places that can be written to, and return that place.

    Raises:
        CorrectionError: If none can be; it tells of the last.
    """
    why = ""
    for path in dict.fromkeys(places):
        try:
            write_log(path, corrections)
        except OSError as error:
            why = str(error)
        else:
            return path
    raise CorrectionError(why)


class Correcting:
    """Follows a workbench; the log is written before anybody hears of a change."""

    def __init__(self, workbench: Workbench, edits: Edits) -> None:
        """Read the log of what is open, now and whenever something else is."""
        self._workbench, self._edits = workbench, edits
        edits.own("corrections", self.restore)
        self._lock = threading.RLock()
        self._recording: Recording | None = None
        self._log = Log(Path())
        self._mark: tuple[int, int, int] | None = None
        """Of the log as it was read or written last."""
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
            # what it said counts as long as nobody says otherwise
            if _why_missing(self._recording):
                return
            before, self._log = self._log, open_log(self._recording.folder)
            self._mark = _mark_of(self._log.path)
            if (before.corrections, before.problem) == (self._log.corrections, self._log.problem):
                return
            self._edits.forget("corrections")
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
            self._do(words, before, tuple(after))

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
            self._do(f"{gone.words} dropped", before, after)

    def _do(self, words: str, before: Told, after: Told) -> None:
        self._put(after)
        self._edits.done(words, "corrections", before, after)

    def restore(self, corrections: Told) -> None:
        """Have these corrections again, or no more: what undo and redo do.

        Raises:
            CorrectionError: If another program has written the log meanwhile, or it cannot be
                written.
        """
        with self._lock:
            log = self._log
            self.refresh()
            if self._log is not log:
                raise CorrectionError(f"{log.path.name} was changed meanwhile; look at it first")
            self._put(corrections)

    def _put(self, corrections: Told) -> None:
        if self._recording is None:
            raise CorrectionError("no recording is open")
        if why := _why_missing(self._recording):  # elsewhere the log would never be read again
            raise CorrectionError(f"{why}; {WHERE_NOW}")
        if self._log.problem is not None:
            raise CorrectionError(f"{self._log.problem}; mend the file, or move it away")
        self._write(self._recording, corrections)
        self._workbench.correct(self._recording, corrections)

    def _write(self, recording: Recording, corrections: Told) -> None:
        own = own_place(recording.folder)
        path = _written(corrections, (writing_place(recording.folder), own))
        if self._log.path == own != path:  # the folder has again what was kept in the settings
            with contextlib.suppress(OSError):
                own.unlink()
        self._log, self._mark = Log(path, corrections), _mark_of(path)

    def _carry(self, recording: Recording) -> None:
        """Write the log into a copy of the recording, in which the workbench goes on."""
        try:
            self._write(recording, self._log.corrections)
        except CorrectionError as error:
            words = f"The copy has no corrections: {error}"
            self._workbench.notify("warn", words, "The recording that was copied has them.")

    def _on_change(self, change: Change) -> None:
        recording = self._workbench.snapshot().sequence
        if recording is None or change not in ("sequence", "taught"):
            return
        with self._lock:
            before, self._recording = self._recording, recording
            if change == "taught" and before is not None and before.views is recording.views:
                if before.folder != recording.folder and self._log.corrections:
                    self._carry(recording)
                return
            self._log = open_log(recording.folder)
            self.skipped = set()
            self._mark = _mark_of(self._log.path)
        self._complain()
        if remark := remark_on(recording.folder):
            self._workbench.notify("info", remark)


_NOTHING = Queue((), 0, "there is no run yet")

_MOST = 1000
"""Places that are known of queues before."""


class Doubting:
    """Keeps the queue of the run that was asked for last, and what queues before it had."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._made: tuple[tuple[str, int, bool, tuple[str, ...]], Queue] | None = None
        self._of = ""
        self._told: dict[str, ReviewItem] = {}

    def of(self, snapshot: Snapshot) -> Queue:
        """The doubtful places of what is shown, as far as it is computed."""
        run = snapshot.run
        if run is None:
            return _NOTHING
        complete = run.complete and snapshot.run_state.state != "computing"
        # what is answered is known at once, whether a run that obeys it is there or not
        said = snapshot.corrections
        key = (run.key, run.done // 50, complete, tuple(one.id for one in said))
        with self._lock:
            if self._made is None or self._made[0] != key:
                self._made = key, queue(run, corrections=said)
                self._remember(snapshot.sequence_key, self._made[1])
            return self._made[1]

    def _remember(self, sequence: str, made: Queue) -> None:
        if sequence != self._of:
            self._of, self._told = sequence, {}
        for one in made.items:
            self._told.pop(one.id, None)
            self._told[one.id] = one
        for old in list(self._told)[:-_MOST]:
            del self._told[old]

    def find(self, snapshot: Snapshot, identity: str) -> ReviewItem | None:
        """One of them; None where it is not there any more."""
        return next((one for one in self.of(snapshot).items if one.id == identity), None)

    def told(self, snapshot: Snapshot, identity: str) -> ReviewItem | None:
        """One of them, or of a run before: what somebody says of steps and places who still has
        it on the page is as true of the run that came meanwhile."""
        found = self.find(snapshot, identity)
        with self._lock:
            known = self._told if self._of == snapshot.sequence_key else {}
            return found or known.get(identity)
