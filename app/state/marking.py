"""What a person says of kept runs: names, stars, notes, tags, and which are deleted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.state.edits import Edits
from app.state.workbench import Workbench
from tracker.library.records import KeptRun
from tracker.library.store import Library

Marks = Mapping[str, Any]
"""By ``name``, ``star``, ``note``, ``tags`` or ``deleted``, what is said of a run."""


class Marking:
    """Marks and deletes runs of a library, so that it can be undone."""

    def __init__(self, workbench: Workbench, edits: Edits, library: Callable[[], Library]) -> None:
        """Mark runs of a library.

        Args:
            workbench: Tells the pages of it.
            edits: Where it can be undone.
            library: Opens the library.
        """
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

    def delete(self, numbers: Sequence[int]) -> int:
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
