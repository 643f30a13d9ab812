"""What a person edited, in its order: undone and redone by the same keys wherever it was done.

An edit holds what it changed, part by part, before and after. Parameters and what the sequence
was taught are compared here whenever one of them changes, whoever changes it; who owns another part
reports its edits by :meth:`Edits.done`, and every owner says how its part is put back.

Edits of a recording are stored in a file of that recording and taken up when it is opened; those of
presets and of kept runs belong to none and are stored once.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from app.errors import sentence
from app.state.snapshot import DRAG_SECONDS, PRESET_ORIGIN, Change, Snapshot
from app.state.workbench import Workbench
from tracker.corrections import Correction, CorrectionError
from tracker.files.validated import read_as, write_json
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import changed_values, label_of, value_of
from tracker.sequences.built_in import key_of
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.teaching import Values, changes, taught_values

logger = logging.getLogger("app")

Part = Literal["parameters", "taught", "corrections", "presets", "runs"]

EVERYWHERE: frozenset[Part] = frozenset({"presets", "runs"})
"""The parts that belong to no recording."""

MOST = 500
"""Edits that can be undone, of a recording and of what belongs to none."""

WRITES_AFTER = 0.5
"""Time after an edit at which it is written, seconds: a slider that is dragged is written once."""

OPENS_WITHIN = 10.0
"""How long an undo waits for the edits of a recording that was just opened, seconds."""

Parts = Mapping[Part, tuple[Any, Any]]
"""Each part that an edit changed, before and after. ``parameters``, ``presets`` and ``runs`` have
what differs alone, by key; ``taught`` and ``corrections`` have all of it."""


class EditError(ValueError):
    """Nothing can be undone or redone, or it cannot be put back; the message says why."""


@dataclass(frozen=True, slots=True)
class Edit:
    """One thing that a person did."""

    words: str
    parts: Parts
    time: float
    """When it was done, seconds since 1970."""


@dataclass(frozen=True, slots=True)
class _StoredEdit:
    """An edit as its file has it: corrections by their ids."""

    words: str
    time: float
    parts: dict[Part, tuple[Any, Any]]


@dataclass(frozen=True, slots=True)
class _Stored:
    """The file of the edits of one recording, or of those that belong to none."""

    done: list[_StoredEdit]
    undone: list[_StoredEdit]
    corrections: dict[str, dict[str, Any]]
    """Each correction of all edits once, by its id."""
    parameters: dict[str, Any]
    """What differed from the defaults when it was written."""


@dataclass(frozen=True, slots=True)
class _EarlierAction:
    """An action on corrections as versions before 2026-12 stored it."""

    words: str
    before: list[str]
    after: list[str]


@dataclass(frozen=True, slots=True)
class _Earlier:
    """The file of corrections' actions that those versions wrote."""

    done: list[_EarlierAction]
    undone: list[_EarlierAction]
    corrections: dict[str, dict[str, Any]]


class Edits:
    """The edits of a workbench, of every part; any thread may ask."""

    def __init__(
        self, workbench: Workbench, folder: Path | None = None, earlier: Path | None = None
    ) -> None:
        """Take up the edits that belong to no recording.

        Args:
            workbench: The workbench whose parameters and teaching are followed.
            folder: Where edits are stored for the next start; None: for this one only.
            earlier: Where earlier versions stored the actions on corrections.
        """
        self._workbench, self._folder, self._earlier = workbench, folder, earlier
        self._lock = threading.RLock()
        self._opened = threading.Condition(self._lock)
        self._telling, self._turning = threading.Lock(), threading.Lock()
        self._done: list[Edit] = []
        self._undone: list[Edit] = []
        self._put: dict[Part, Callable[[Any], object]] = {}
        self._teach: Callable[[Values, Mapping[str, Any]], object] = lambda *_: None
        self._sequence: Sequence | None = None
        self._parameters = self._defaults = RunParameters()
        self._origin, self._at, self._edited_at = "", 0.0, 0.0
        self._restoring = 0
        """The thread that puts an edit back: its changes are none of their own."""
        self._timer: threading.Timer | None = None
        if folder is not None:
            self._take_up(folder / "everywhere.json")
        self._unsubscribe: Callable[[], None] | None = None
        self._show_words()

    def follow(self) -> None:
        """Compare parameters and what is taught from now on: after those who take up what was
        taught and not saved when a recording is opened, which is no edit."""
        self._unsubscribe = self._workbench.subscribe(self._on_change)

    def close(self) -> None:
        """Follow no more, and write what is not written yet."""
        if self._unsubscribe is not None:
            self._unsubscribe()
        self._write()

    def own(self, part: Part, put: Callable[[Any], object]) -> None:
        """Say how a part is put back: by a function of what an edit holds of it."""
        self._put[part] = put

    def own_teaching(self, put: Callable[[Values, Mapping[str, Any]], object]) -> None:
        """Say how what was taught is put back, with parameters by key, in one change."""
        self._teach = put

    def done(self, words: str, part: Part, before: Any, after: Any) -> None:
        """Report an edit of a part that this class does not compare itself.

        Args:
            words: What was done, as a note says it.
            part: What was changed.
            before: What its owner puts back to undo it.
            after: What its owner puts back to redo it.
        """
        if self._restoring == threading.get_ident() or before == after:
            return
        with self._lock:
            self._add(Edit(words, {part: (before, after)}, time.time()), "")
        self._show_words()

    def forget(self, part: Part) -> None:
        """Drop the edits of a part that something else than the workbench has changed."""
        with self._lock:
            self._drop(part)
            self._written_soon()
        self._show_words()

    def _drop(self, part: Part) -> None:
        self._done = [edit for edit in self._done if part not in edit.parts]
        self._undone = [edit for edit in self._undone if part not in edit.parts]

    def undo(self) -> Edit:
        """Put back what was before the last edit.

        Raises:
            EditError: If there is none, or it cannot be put back.
        """
        return self._turn(0)

    def redo(self) -> Edit:
        """Do again what was undone last.

        Raises:
            EditError: If nothing was undone, or it cannot be done again.
        """
        return self._turn(1)

    def _turn(self, side: Literal[0, 1]) -> Edit:
        with self._turning:
            with self._lock:
                self._opened.wait_for(self._has_taken_up, OPENS_WITHIN)
                stack = (self._done, self._undone)[side]
                if not stack:
                    raise EditError(f"there is nothing to {'redo' if side else 'undo'}")
                edit = stack[-1]
            try:
                self._restore(edit, side)
            except (CorrectionError, OSError) as error:  # a file can be mended, then it goes
                raise EditError(f"{edit.words}: {sentence(error)}") from error
            except ValueError as error:
                self._move(edit, None)
                raise EditError(f"{edit.words}: {sentence(error)}") from error
            self._move(edit, 1 - side)
        return edit

    def _has_taken_up(self) -> bool:
        """Whether the edits are those of the recording that is open: who opens it tells others
        first."""
        now, own = self._workbench.snapshot().sequence, self._sequence
        if self._unsubscribe is None or now is None:
            return True
        return own is not None and own.views is now.views

    def _restore(self, edit: Edit, side: Literal[0, 1]) -> None:
        values = {part: pair[side] for part, pair in edit.parts.items()}
        self._restoring = threading.get_ident()
        try:
            parameters = values.pop("parameters", {})
            if "taught" in values:
                self._teach(values.pop("taught"), parameters)
            elif parameters:
                self._workbench.set_parameters(parameters, "undo")
            for part, value in values.items():
                self._put[part](value)
        finally:
            self._restoring = 0

    def _move(self, edit: Edit, to: int | None) -> None:
        """Take an edit from where it is to what is done, 0, or undone, 1; None drops it."""
        with self._lock:
            self._done = [one for one in self._done if one is not edit]
            self._undone = [one for one in self._undone if one is not edit]
            if to is not None:
                (self._done, self._undone)[to].append(edit)
            self._at = 0.0
            self._written_soon()
        self._show_words()

    def _add(self, edit: Edit, origin: str) -> None:
        now = time.monotonic()
        last = self._done[-1] if self._done else None
        drags = origin == self._origin and now - self._at < DRAG_SECONDS
        if last is not None and drags and _moved(edit.parts) == _moved(last.parts) is not None:
            parts: Parts = {
                part: (last.parts[part][0], after) for part, (_, after) in edit.parts.items()
            }
            edit = Edit(_words_of_number(parts) or edit.words, parts, edit.time)
            self._done.pop()
        self._undone.clear()
        self._origin, self._at, self._edited_at = origin, now, now
        if any(before != after for before, after in edit.parts.values()):
            self._done.append(edit)
            own = [one for one in self._done if _is_everywhere(one) == _is_everywhere(edit)]
            if len(own) > MOST:
                self._done.remove(own[0])
        self._written_soon()

    def _show_words(self) -> None:
        with self._telling:
            with self._lock:
                words = [stack[-1].words if stack else None for stack in (self._done, self._undone)]
            self._workbench.show_edits(*words)

    # parameters and what was taught

    def _on_change(self, change: Change) -> None:
        if change in ("run", "progress"):
            with self._lock:
                now_at = time.monotonic()
                # a slow browser moves on with each result; news of a long run are no drag
                recent = now_at - self._edited_at < 2.0 * DRAG_SECONDS
                if recent and now_at - self._at < DRAG_SECONDS:
                    self._at = now_at
            return
        if change not in ("sequence", "taught", "parameters"):
            return
        with self._lock:
            now = self._workbench.snapshot()
            if now.sequence is None:
                return
            before, values = self._sequence, self._parameters
            if before is None or before.views is not now.sequence.views:
                self._open(now)
                self._opened.notify_all()
            else:
                self._sequence, self._parameters = now.sequence, now.parameters
                self._defaults = now.defaults
                if before.folder != now.sequence.folder:  # it goes on in a copy
                    self._written_soon()
                edit = None
                if self._restoring != threading.get_ident():
                    edit = _edit_of(before, values, now)
                if edit is None:
                    return
                self._add(edit, now.parameters_origin)
        self._show_words()

    def _open(self, now: Snapshot) -> None:
        """Leave the recording that was open, and take up the edits of another."""
        assert now.sequence is not None
        self._write()
        self._done = [edit for edit in self._done if _is_everywhere(edit)]
        self._undone = [edit for edit in self._undone if _is_everywhere(edit)]
        self._sequence = now.sequence
        self._parameters, self._defaults = now.parameters, now.defaults
        self._at = 0.0
        path = self._path(now.sequence.folder)
        if path is None:
            return
        name = f"{key_of(now.sequence.folder)}.history.json"
        self._take_up(path, None if self._earlier is None else self._earlier / name)
        self._check("corrections", now.corrections)
        self._check("taught", taught_values(now.sequence))

    def _check(self, part: Part, value: Any) -> None:
        """Drop the edits of a part that is another by now than they left it."""
        done = [edit.parts[part][1] for edit in self._done if part in edit.parts]
        undone = [edit.parts[part][0] for edit in self._undone if part in edit.parts]
        if (done or undone) and value != (done or undone)[-1]:
            self._drop(part)

    # over a start

    def parameters_of(self, recording: Path) -> dict[str, Any]:
        """Return the parameters that a recording was left with, by key: those its edits led to,
        as far as they were not its defaults.

        Args:
            recording: The folder of the recording.
        """
        self._write()
        path = self._path(recording)
        with suppress(OSError, ValueError):  # of a file that cannot be read, its edits tell
            return {} if path is None else read_as(path, _Stored).parameters
        return {}

    def _path(self, recording: Path) -> Path | None:
        """The file of a recording's edits."""
        if self._folder is None:
            return None
        return self._folder / f"{key_of(recording)}.recording.json"

    def _written_soon(self) -> None:
        if self._folder is not None and self._timer is None:
            self._timer = threading.Timer(WRITES_AFTER, self._write)
            self._timer.daemon = True
            self._timer.start()

    def _write(self) -> None:
        with self._lock:
            if self._timer is None or self._folder is None:
                return
            self._timer.cancel()
            self._timer = None
            self._write_those(self._folder / "everywhere.json", everywhere=True)
            own = self._sequence
            path = None if own is None else self._path(own.folder)
            if path is not None:
                self._write_those(path, everywhere=False)

    def _write_those(self, path: Path, everywhere: bool) -> None:
        known: dict[str, Any] = {}

        def plain(edit: Edit) -> dict[str, Any]:
            parts: dict[Part, Any] = {**edit.parts}
            for one in (one for side in parts.get("corrections", ()) for one in side):
                known[one.id] = one.model_dump(mode="json", exclude_none=True)
            if "corrections" in parts:
                parts["corrections"] = [[one.id for one in side] for side in parts["corrections"]]
            return {"words": edit.words, "time": edit.time, "parts": parts}

        done, undone = (
            [plain(edit) for edit in stack if _is_everywhere(edit) == everywhere]
            for stack in (self._done, self._undone)
        )
        if not done and not undone and not path.is_file():
            return
        left: dict[str, Any] = {}
        if not everywhere:
            left = changed_values(self._parameters, self._defaults)
        value = {"done": done, "undone": undone, "corrections": known, "parameters": left}
        try:
            write_json(path, value)
        except OSError as error:
            logger.warning("what was done cannot be undone after an end: %s", error)

    def _take_up(self, path: Path, earlier: Path | None = None) -> None:
        """Take up the edits of a file; of what an earlier version stored where there is none."""
        try:
            if earlier is not None and not path.is_file():
                path, stored = earlier, _brought_up(read_as(earlier, _Earlier))
            else:
                stored = read_as(path, _Stored)
            known = {key: Correction.model_validate(v) for key, v in stored.corrections.items()}
            done = [_edit(one, known) for one in stored.done]
            undone = [_edit(one, known) for one in stored.undone]
        except FileNotFoundError:
            return
        except (OSError, ValueError, LookupError) as error:
            logger.warning("%s cannot be read; what it has cannot be undone: %s", path, error)
            return
        self._done = sorted([*self._done, *done], key=lambda edit: edit.time)
        self._undone = sorted([*self._undone, *undone], key=lambda edit: -edit.time)


def _brought_up(earlier: _Earlier) -> _Stored:
    """An earlier version's file as this one would have written it."""
    done, undone = (
        [_StoredEdit(one.words, 0.0, {"corrections": (one.before, one.after)}) for one in stack]
        for stack in (earlier.done, earlier.undone)
    )
    return _Stored(done, undone, earlier.corrections, {})


def _is_everywhere(edit: Edit) -> bool:
    return edit.parts.keys() <= EVERYWHERE


def _edit(stored: _StoredEdit, corrections: Mapping[str, Correction]) -> Edit:
    """Return a stored edit with its corrections.

    Raises:
        KeyError: If one of them is missing.
    """
    parts: dict[Part, tuple[Any, Any]] = {**stored.parts}
    if "corrections" in parts:
        before, after = (tuple(corrections[one] for one in side) for side in parts["corrections"])
        parts["corrections"] = before, after
    return Edit(stored.words, parts, stored.time)


def _edit_of(sequence: Sequence, parameters: RunParameters, now: Snapshot) -> Edit | None:
    """What changed since the sequence and the parameters were these; None where nothing did."""
    parts: dict[Part, tuple[Any, Any]] = {}
    words = []
    if now.sequence is not None and now.sequence is not sequence:
        before, after = taught_values(sequence), taught_values(now.sequence)
        if before != after:
            parts["taught"] = before, after
            words = changes(before, after)
    if now.parameters is not parameters:
        values = changed_values(now.parameters, parameters)
        if values:
            parts["parameters"] = {key: value_of(parameters, key) for key in values}, dict(values)
            words = words or [_words_of(parts, now)]
    if not parts:
        return None
    more = f" and {len(words) - 2} more" if len(words) > 2 else ""
    return Edit("; ".join(words[:2]) + more, parts, time.time())


def _words_of(parts: Parts, now: Snapshot) -> str:
    """What changes of parameters are called."""
    after = parts["parameters"][1]
    if now.parameters_origin.startswith(PRESET_ORIGIN):
        return now.parameters_origin
    if len(after) == 1:
        ((key, value),) = after.items()
        if isinstance(value, bool):
            return f"{label_of(key)} {'on' if value else 'off'}"
        return _words_of_number(parts) or f"{label_of(key)} {value}"
    if now.parameters == now.defaults:
        return "all parameters reset"
    return f"preset {now.preset}" if now.preset is not None else f"{len(after)} parameters"


def _words_of_number(parts: Parts) -> str | None:
    """``Survival probability 0.95 → 0.9``; None where something else than one number changed."""
    if parts.keys() != {"parameters"} or len(parts["parameters"][1]) != 1:
        return None
    before, after = parts["parameters"]
    ((key, value),) = after.items()
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    unit = PARAMETERS[key].unit
    return f"{label_of(key)} {before[key]:.6g} → {value:.6g}{unit and ' '}{unit}"


def _moved(parts: Parts) -> set[tuple[Any, ...]] | None:
    """The paths of the numbers that an edit changed; None where it changed anything else."""
    found: set[tuple[Any, ...]] = set()
    with suppress(_NoNumbers):
        for part, (before, after) in parts.items():
            found |= {(part, *path) for path in _numbers(before, after)}
        return found
    return None


class _NoNumbers(Exception):
    """Two values differ in something else than numbers."""


def _numbers(before: Any, after: Any) -> Iterator[tuple[Any, ...]]:
    if before == after:
        return
    if isinstance(before, dict) and isinstance(after, dict) and before.keys() == after.keys():
        pairs = [(key, value, after[key]) for key, value in before.items()]
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        pairs = [(k, *pair) for k, pair in enumerate(zip(before, after, strict=True))]
    elif all(isinstance(one, int | float) and not isinstance(one, bool) for one in (before, after)):
        yield ()
        return
    else:
        raise _NoNumbers
    for key, old, new in pairs:
        yield from ((key, *path) for path in _numbers(old, new))
