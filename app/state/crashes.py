"""What was computed when a start of the program crashed, so that the next one does not do it again.

A native crash (a fault in compiled code) ends the whole process. What was taught and not saved is
taken up again at the next start, and would crash that as well; so would the same run. So a start
notes what it computes, the interpreter writes where a crash happened, and the next start puts the
draft aside and leaves the run out, as all later ones do until it is asked for again. An end by a
signal from outside leaves no such report, and its draft is taken up as always.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import platform
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, TextIO

from tracker.files.validated import read_as, set_aside, write_json

LAST = "last-crash.txt"
"""What is known of the last crash: for whoever reports it."""

LEFT_OUT = "left-out.json"
"""The runs with which the program crashed."""

REPORT_LETTERS = 6000
"""Of what the interpreter wrote: its beginning tells of the thread that crashed."""


@dataclass(frozen=True, slots=True)
class Note:
    """What a start does."""

    place: str = ""
    """What opens the recording; empty while there is none."""
    opening: bool = False
    """Whether it was being opened."""
    draft: str | None = None
    """The file of what was taught and not saved, where it is computed with."""
    run: str | None = None
    """Key of the run under way."""
    values: dict[str, Any] = field(default_factory=dict)
    """Its parameters, where they are not the recording's own."""
    good: dict[str, Any] | None = None
    """Those of the last run that was done."""


@dataclass(frozen=True, slots=True)
class Crash:
    """An earlier start's."""

    words: str
    report: str
    """All that is known of it, to be passed on."""
    note: Note


class Crashes:
    """The notes of this start, and those that an earlier one left."""

    def __init__(self, folder: Path | None) -> None:
        """Nothing is written before :meth:`watch`.

        Args:
            folder: Where; None notes nothing.
        """
        self._folder = folder
        self._report: TextIO | None = None
        self._note = Note()
        self.left_out: dict[str, dict[str, Any] | None] = {}
        """The runs with which the program crashed, by key, of this start and all before it: the
        parameters of the last run before each that was done."""
        if folder is not None:
            with contextlib.suppress(OSError, ValueError):
                self.left_out = read_as(folder / LEFT_OUT, dict[str, dict[str, Any] | None])

    def watch(self) -> None:
        """Have the interpreter write where this process crashes, if it does."""
        if self._folder is None:
            return
        with contextlib.suppress(OSError):  # without such a place there is no report
            self._folder.mkdir(parents=True, exist_ok=True)
            self._report = self._own("txt").open("w", encoding="utf-8")
            faulthandler.enable(self._report)

    def close(self) -> None:
        """This start ends as it should."""
        if self._report is None or self._folder is None:
            return
        faulthandler.enable(sys.__stderr__) if sys.__stderr__ else faulthandler.disable()
        self._report.close()
        self._report = None
        for kind in ("txt", "json"):
            self._own(kind).unlink(missing_ok=True)

    @contextmanager
    def opening(self, place: str) -> Iterator[None]:
        """Within it a recording is opened."""
        before = self._note
        self._write(Note(place, opening=True))
        opened = before
        try:
            yield
            opened = Note(place)
        finally:
            self._write(opened)

    @contextmanager
    def computing(
        self, draft: Path | None, run: str = "", values: Mapping[str, Any] | None = None
    ) -> Iterator[None]:
        """Within it a run is computed.

        Args:
            draft: The file of what was taught and not saved; None: with what is saved.
            run: Its key.
            values: Its parameters, where they are not the recording's own.
        """
        place, good = self._note.place, self._note.good
        told = None if draft is None else str(draft)
        self._write(Note(place, False, told, run, dict(values or {}), good))
        try:
            yield
            good = dict(values or {})
        finally:
            if not self._note.opening:  # else another recording is on its way
                self._write(Note(self._note.place, good=good, values=dict(values or {})))

    def ask_again(self, run: str) -> None:
        """Leave out a run no more."""
        if run in self.left_out:
            del self.left_out[run]
            self._write_left_out()

    def _write_left_out(self) -> None:
        if self._folder is not None:
            with contextlib.suppress(OSError):  # they are left out by this start alone
                write_json(self._folder / LEFT_OUT, self.left_out)

    def _write(self, note: Note) -> None:
        self._note = note
        if self._report is not None:
            with contextlib.suppress(OSError):
                self._own("json").write_text(json.dumps(asdict(note)), encoding="utf-8")

    def tidy(self, ended: tuple[int, int] | None = None) -> list[Crash]:
        """Put aside what crashed earlier starts.

        Args:
            ended: Process and signal of the start before this one, where that is known.

        Returns:
            All that did, the one before this one last.
        """
        if self._folder is None or not self._folder.is_dir():
            return []
        found = []
        for report in sorted(self._folder.glob("start-*.txt"), key=_time_of):
            number = report.stem.removeprefix("start-")
            if not number.isdecimal() or _is_alive(int(number)):
                continue
            by = ended[1] if ended is not None and int(number) == ended[0] else None
            with contextlib.suppress(OSError, ValueError):
                if report.stat().st_size or by is not None:
                    found.append(self._of_crash(report, by))
            for left in (report, report.with_suffix(".json")):
                left.unlink(missing_ok=True)
        crashed = {one.note.run: one.note.good for one in found if one.note.run}
        if crashed:
            self.left_out |= crashed
            self._write_left_out()
        return found

    def _of_crash(self, report: Path, by: int | None) -> Crash:
        assert self._folder is not None
        note = _note_of(report.with_suffix(".json"))
        trace = report.read_text(encoding="utf-8", errors="replace")[:REPORT_LETTERS]
        told = _report(note, trace, by)
        words = "The program crashed"
        with contextlib.suppress(OSError):
            (self._folder / LAST).write_text(told, encoding="utf-8")
            words = f"The program crashed; {self._folder / LAST} says where"
        draft = Path(note.draft) if note.draft and trace else None
        aside = set_aside(draft) if draft is not None and draft.is_file() else None
        if aside is not None:
            words += f". It computed with changes that were not saved: they are now in {aside}"
        return Crash(words, told, note)

    def _own(self, kind: str) -> Path:
        assert self._folder is not None
        return self._folder / f"start-{os.getpid()}.{kind}"


def _note_of(path: Path) -> Note:
    try:
        return read_as(path, Note)
    except (OSError, ValueError):
        return Note()


def _report(note: Note, trace: str, by: int | None) -> str:
    """What somebody who is to mend it needs."""
    from tracker import __version__

    packages = ("numpy", "numba", "llvmlite", "opencv-python-headless", "av")
    known = [f"{name} {told}" for name in packages if (told := _version(name)) is not None]
    doing = f"opening {note.place}" if note.opening else f"open: {note.place or 'nothing'}"
    run = "no run under way"
    if note.run is not None:
        run = f"run {note.run} under way, values {json.dumps(note.values, ensure_ascii=False)}"
    return "\n".join(
        [
            f"multiview-phd {__version__}, Python {platform.python_version()}, "
            f"{platform.platform()}",
            ", ".join(known),
            "ended by a fault" if by is None else f"ended by signal {by}",
            doing,
            run,
            trace or "the interpreter wrote nothing, as where the system ended the process",
        ]
    )


def _version(package: str) -> str | None:
    try:
        return version(package)
    except ImportError:  # it is not there
        return None


def _time_of(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _is_alive(process: int) -> bool:
    if process == os.getpid():
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # another person's
        return True
    return True
