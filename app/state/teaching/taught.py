"""What the open sequence was taught: its values now, and what is kept of them.

Every edit makes another value of the sequence, checked as its file would be, and the jobs
compute its run as after a moved slider.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from app.errors import sentence
from app.state.edits import Edits
from app.state.kept.drafts import Drafts
from app.state.snapshot import Change
from app.state.workbench import Workbench
from tracker.parameters.catalogue import RunParameters
from tracker.runs import pipeline
from tracker.sequences.built_in import EARLIER
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import (
    Values,
    carried_over,
    changes,
    taught_values,
    with_taught,
)

Check = Callable[[Sequence], None]
"""Raises a :class:`SequenceError` if a sequence will not do."""


class Taught:
    """The values of the open sequence and how they are replaced; any thread may ask."""

    def __init__(self, workbench: Workbench, edits: Edits, drafts: Path | None = None) -> None:
        """Follow a workbench.

        Args:
            workbench: Whose sequence.
            edits: Where what is taught can be undone.
            drafts: Where what is not saved is kept for the next start; None: not beyond this one.
        """
        self._workbench = workbench
        self._lock = threading.RLock()
        self._opened: Sequence | None = None
        self._drafts = Drafts(drafts)
        self._unsubscribe = workbench.subscribe(self._on_change)
        edits.own_teaching(self.restore)

    def close(self) -> None:
        """Stop following."""
        self._unsubscribe()

    def draft_of(self, folder: Path) -> Path | None:
        """The file that keeps what was taught of a sequence and not saved; None where all is."""
        return self._drafts.file_of(folder)

    def sequence(self) -> Sequence:
        """The open one.

        Raises:
            SequenceError: If none is.
        """
        sequence = self._workbench.snapshot().sequence
        if sequence is None:
            raise SequenceError("no sequence is open; open one first")
        return sequence

    def edit(self, edit: Callable[[Values], object], check: Check | None = None) -> None:
        """Change some values.

        Args:
            edit: Changes a copy of them in place.
            check: What else must hold of the sequence with them.

        Raises:
            SequenceError: If they do not fit; nothing is changed then.
        """
        with self._lock:
            values = copy.deepcopy(taught_values(self.sequence()))
            edit(values)
            self._put(values, check)

    def restore(self, values: Values, changes: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Have room and templates as they were once, and the parameters that went with them.

        Args:
            values: Room and templates, by the keys of a ``sequence.toml``.
            changes: Parameters by key.

        Raises:
            SequenceError: If they do not fit the open sequence; nothing is changed then.
        """
        with self._lock:
            self._put(copy.deepcopy(values), changes=changes)

    def save(self) -> Path:
        """Write what was taught into the sequence's file; the backup of what was there.

        Raises:
            SequenceError: If it cannot be; nothing is lost then.
        """
        with self._lock:
            sequence, saved = self.sequence(), self._workbench.snapshot().saved
            assert saved is not None
            backup = saving.save(sequence, saved)
            self._workbench.mark_saved(sequence, sequence)
            return backup

    def save_copy(self, folder: Path) -> Path:
        """Write the sequence with what was taught into another folder, and go on in that.

        Args:
            folder: Absolute.

        Raises:
            SequenceError: If it cannot be; nothing is lost then.
        """
        with self._lock:
            sequence, saved = self.sequence(), self._workbench.snapshot().saved
            assert saved is not None
            copied = saving.save_copy(sequence, saved, folder)
            self._drafts.forget(sequence.folder)
            self._opened = _moved(self._opened or sequence, copied)
            shown = _moved(sequence, copied)
            self._workbench.mark_saved(shown, shown)
            return copied.folder

    def _put(
        self,
        values: Values,
        check: Check | None = None,
        changes: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        now, opened = self.sequence(), self._opened
        if opened is None or opened.views is not now.views:
            raise SequenceError("another sequence was opened meanwhile; look at it and try again")
        if values == taught_values(now):
            self._workbench.teach(now, changes=changes)
            return
        sequence = with_taught(opened, values, f"{now.folder.name}/{FILE}")
        if check is not None:
            check(sequence)
        saved = self._workbench.snapshot().saved
        if saved is not None and values == taught_values(saved):
            sequence = saved
        defaults = _defaults(sequence)
        self._workbench.teach(sequence, defaults, {**self._fitting(defaults), **changes})

    def _fitting(self, defaults: RunParameters | None) -> Values:
        """Whoever looks for people in pictures by the default method goes on by the one that looks
        at what was just taught; boxes of a detector are somebody's choice."""
        now = self._workbench.snapshot()
        own, before = now.parameters.single_view, now.defaults.single_view
        if defaults is None or own != before or defaults.single_view == own:
            return {}
        used = now.parameters.method("single_view").used(now.parameters)
        looks = used.pictures and not used.detections and not used.detector
        return {"single_view": defaults.single_view} if looks else {}

    def _on_change(self, change: Change) -> None:
        if change not in ("sequence", "taught"):
            return
        with self._lock:
            now = self._workbench.snapshot()
            sequence, saved = now.sequence, now.saved
            if sequence is None or saved is None:
                return
            if change == "taught":
                if self._opened is not None and sequence.views is self._opened.views:
                    values = taught_values(saved), taught_values(sequence)
                    self._drafts.keep(sequence.folder, *values)
                return
            self._opened = sequence
            self._take_up(sequence)

    def _take_up(self, sequence: Sequence) -> None:
        """Go on with what was not saved when the sequence was open before."""
        draft = self._drafts.read(sequence.folder)
        if draft is None:
            self._take_up_earlier(sequence)
            return
        saved, taught = draft
        count = len(changes(saved, taught))
        words = f"{count} change{'s' if count > 1 else ''} of {sequence.name}"
        try:
            if saved != taught_values(sequence):
                raise SequenceError("its room or templates are others now")
            self._put(taught)
        except SequenceError as error:
            self._drafts.forget(sequence.folder)
            self._workbench.notify(
                "warn",
                f"{words} cannot be taken up: its file was changed meanwhile",
                f"{sentence(error)}. They were: {'; '.join(changes(saved, taught))}.",
            )
        else:
            self._workbench.notify(
                "info", f"{words} not saved, as you left it", "Save or discard it."
            )

    def _take_up_earlier(self, sequence: Sequence) -> None:
        """Go on with what was taught on a built-in room as it was rendered before."""
        draft = self._drafts.take_earlier(sequence.folder)
        if draft is None:
            return
        now = taught_values(sequence)
        values = carried_over(*draft, now, sequence.frames)
        try:
            self._put(values)
        except SequenceError:  # a template whose box is no longer in the picture
            self._put({**values, "template": now["template"]})
        taken = changes(now, taught_values(self.sequence()))
        left = [words for words in changes(*draft) if words not in taken]
        self._workbench.notify(
            "warn" if left else "info",
            f"Changes of {sequence.name} are taken up that were {EARLIER}",
            f"Left out: {'; '.join(left)}." if left else "Save or discard them.",
        )


def _moved(sequence: Sequence, copied: Sequence) -> Sequence:
    """A sequence under the name and in the folder of its copy."""
    return replace(sequence, name=copied.name, folder=copied.folder)


def _defaults(sequence: Sequence) -> RunParameters | None:
    try:
        return pipeline.default_parameters(sequence)
    except ValueError:
        return None
