"""What was computed when a start of the program crashed, so that the next one does not do it again.

A native crash (a fault in compiled code) ends the whole process. What was taught and not saved is
taken up again at the next start, and would crash that as well: so a start notes which draft it
computes with, the interpreter writes where a crash happened, and the next start puts the draft
aside. An end by a signal from outside leaves no such report, and its draft is taken up as always.
"""

from __future__ import annotations

import contextlib
import faulthandler
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from app.state.kept.json_files import set_aside

LAST = "last-crash.txt"
"""What the interpreter wrote at the last crash: for whoever reports it."""


class Crashes:
    """The notes of this start, and those that an earlier one left."""

    def __init__(self, folder: Path | None) -> None:
        """Nothing is written before :meth:`watch`.

        Args:
            folder: Where; None notes nothing.
        """
        self._folder = folder
        self._report: TextIO | None = None

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
    def computing(self, draft: Path | None) -> Iterator[None]:
        """Within it something is computed with what this draft holds; None: with what is saved."""
        if self._report is None or draft is None:
            yield
            return
        note = self._own("json")
        with contextlib.suppress(OSError):
            note.write_text(json.dumps(str(draft)), encoding="utf-8")
        try:
            yield
        finally:
            note.unlink(missing_ok=True)

    def tidy(self) -> list[str]:
        """Put aside what crashed earlier starts; a sentence for each that did."""
        if self._folder is None or not self._folder.is_dir():
            return []
        told = []
        for report in sorted(self._folder.glob("start-*.txt")):
            number = report.stem.removeprefix("start-")
            if not number.isdecimal() or _is_alive(int(number)):
                continue
            note = report.with_suffix(".json")
            with contextlib.suppress(OSError, ValueError):
                if report.stat().st_size:
                    report.replace(self._folder / LAST)
                    told.append(self._of_crash(note))
            for left in (report, note):
                left.unlink(missing_ok=True)
        return told

    def _of_crash(self, note: Path) -> str:
        assert self._folder is not None
        words = f"The program crashed at an earlier start; {self._folder / LAST} says where"
        try:
            draft = Path(json.loads(note.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return words
        aside = set_aside(draft) if draft.is_file() else None
        if aside is None:
            return words
        return f"{words}. It computed with changes that were not saved: they are now in {aside}"

    def _own(self, kind: str) -> Path:
        assert self._folder is not None
        return self._folder / f"start-{os.getpid()}.{kind}"


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
