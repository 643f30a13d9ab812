"""Teaching the open sequence: boxes of colours, the room's faces, entrances; and saving them.

Every edit makes another value of the sequence, checked as its file would be, and the jobs
compute its run as after a moved slider. What it was before is kept, so that undo brings
it back, its run included.
"""

from __future__ import annotations

import copy
import os
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from app.errors import sentence
from app.state.entrances import entrances_of
from app.state.kept.drafts import Drafts
from app.state.snapshot import Change
from app.state.workbench import Workbench
from tracker import pipeline
from tracker.folders import home
from tracker.parameters import RunParameters
from tracker.sequences.reader import FILE, given_folder
from tracker.sequences.sequence import Sequence, SequenceError
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import Values, changes, taught_values, with_taught

KEPT_STATES = 500
"""Rooms and templates that can be gone back to."""

PIXEL_DIGITS, METRE_DIGITS = 1, 3
"""Decimals to which a drawn box (pixels) and a dragged place (metres) are rounded."""

LEAST_BOX = 4.0
"""Pixels of a template's side: what is smaller has no colours to speak of."""

NEW_SIGMA = (0.3, 0.3, 0.15)
"""Standard deviations of an entrance that somebody adds, metres."""

Side = Literal["min", "max"]
Part = Literal["position", "sigma"]


class Teaching:
    """Edits what the open sequence was taught; any thread may ask."""

    def __init__(
        self, workbench: Workbench, data: Path | None = None, drafts: Path | None = None
    ) -> None:
        """Follow a workbench.

        Args:
            workbench: Whose sequence.
            data: Where a copy is offered to be put.
            drafts: Where what is not saved is kept for the next start; None: not beyond this one.
        """
        self._workbench = workbench
        self._data = data
        self._lock = threading.RLock()
        self._opened: Sequence | None = None
        self._states: OrderedDict[str, Values] = OrderedDict()
        self._drafts = Drafts(drafts)
        self._unsubscribe = workbench.subscribe(self._on_change)

    def close(self) -> None:
        """Stop following."""
        self._unsubscribe()

    def draft_of(self, folder: Path) -> Path | None:
        """The file that keeps what was taught of a sequence and not saved; None where all is."""
        return self._drafts.file_of(folder)

    # what a person does

    def add_template(
        self,
        camera: str,
        step: int,
        box: tuple[float, float, float, float],
        name: str | None = None,
    ) -> None:
        """Add a box whose colours model a person.

        Args:
            camera: Its name.
            step: Of the picture that the box lies in.
            box: left, top, width, height in pixels; what sticks out is cut off.
            name: Whose it is; a new person's where none is given.

        Raises:
            SequenceError: If the box or the name does not fit.
        """
        sequence = self._sequence()
        names = [template.name for template in sequence.templates]
        name = name or next(
            word for k in range(1, len(names) + 2) if (word := f"person{k}") not in names
        )
        template = {
            "name": name, "camera": camera, "frame": step, "box": _within(sequence, camera, box)
        }  # fmt: skip

        def add(values: Values) -> None:
            values["template"].append(template)

        self._edit(add, self._can_be_read)

    def rename_template(self, index: int, name: str) -> None:
        """Say whose colours a template models.

        Raises:
            SequenceError: If there is no such template, or no name is given.
        """
        self._edit(lambda values: _at(values, "template", index).update(name=name))

    def remove_template(self, index: int) -> None:
        """Take a template away."""
        self._edit(lambda values: _take(values["template"], "template", index))

    def set_face(self, side: Side, axis: int, metres: float) -> None:
        """Move one of the room's six faces.

        Raises:
            SequenceError: If nothing of the room were left.
        """

        def move(values: Values) -> None:
            values["room"][side][axis] = _metres(metres)

        self._edit(move)

    def set_target(self, half_extents: tuple[float, float, float]) -> None:
        """Say how large a person is: half width, depth and height, metres.

        Raises:
            SequenceError: If it has no size.
        """
        half = [round(float(value), METRE_DIGITS + 1) for value in half_extents]
        self._edit(lambda values: values["target"].update(half_extents=half))

    def add_entrance(self, position: tuple[float, float, float] | None = None) -> None:
        """Add an entrance, in the middle of the room where no place is given."""
        room = self._sequence().room
        if position is None:
            x, y, z = ((room.minimum + room.maximum) / 2.0).tolist()
            position = (x, y, z)
        if room.entrances:  # people are as tall at every door
            position = (position[0], position[1], float(room.entrances[0].position[2]))
        entrance = {"position": [_metres(value) for value in position], "sigma": [*NEW_SIGMA]}
        self._edit(lambda values: values["room"]["entrances"].append(entrance))

    def suggest_entrances(self) -> None:
        """Add the entrances that the tracks of the shown run tell of, beside those there are.

        Raises:
            SequenceError: If they tell of no other.
        """
        run = self._workbench.snapshot().run
        doors = [] if run is None else entrances_of(run)
        if not doors:
            raise SequenceError(
                "the tracks begin and end together at no other place; wait for the end of the "
                "run, or add an entrance by hand"
            )
        new = [{"position": d.position.tolist(), "sigma": d.sigma.tolist()} for d in doors]
        self._edit(lambda values: values["room"]["entrances"].extend(new))

    def set_entrance(self, index: int, part: Part, changed: dict[int, float]) -> None:
        """Move an entrance, or make it wider.

        Args:
            index: Which.
            part: Its mean or its standard deviation.
            changed: Metres by axis; the others stay.

        Raises:
            SequenceError: If there is no such entrance, or a value does not fit.
        """

        def move(values: Values) -> None:
            entrance = _at(values["room"], "entrances", index)
            for axis, metres in changed.items():
                entrance[part][axis] = _metres(metres)

        self._edit(move)

    def remove_entrance(self, index: int) -> None:
        """Take an entrance away."""
        self._edit(lambda values: _take(values["room"]["entrances"], "entrance", index))

    def restore(self, key: str, changes: Mapping[str, Any] = MappingProxyType({})) -> bool:
        """Go back, or on again, to what was taught once, and to the values that went with it.

        Args:
            key: As the state named it.
            changes: Values by key.

        Returns:
            Whether it is still known; nothing changes where it is not.
        """
        with self._lock:
            known = self._states.get(key)
            if known is None:
                return False
            self._put(copy.deepcopy(known), changes=changes)
            return True

    def discard(self) -> None:
        """Have room and templates as the file has them."""
        saved = self._workbench.snapshot().saved
        if saved is not None:
            self._edit(lambda values: values.update(copy.deepcopy(taught_values(saved))))

    # saving

    def save(self) -> Path:
        """Write what was taught into the sequence's file; the backup of what was there.

        Raises:
            SequenceError: If it cannot be; nothing is lost then.
        """
        with self._lock:
            sequence, saved = self._sequence(), self._workbench.snapshot().saved
            assert saved is not None
            backup = saving.save(sequence, saved)
            self._workbench.mark_saved(sequence, sequence)
            return backup

    def save_copy(self, folder: Path) -> Path:
        """Write the sequence with what was taught into another folder, and go on in that.

        Raises:
            SequenceError: If it cannot be; nothing is lost then.
        """
        with self._lock:
            sequence, saved = self._sequence(), self._workbench.snapshot().saved
            assert saved is not None
            folder = given_folder(folder)
            if not folder.is_absolute():
                folder = self.copies_in() / folder
            copied = saving.save_copy(sequence, saved, folder)
            self._drafts.forget(sequence.folder)
            self._opened = _moved(self._opened or sequence, copied)
            shown = _moved(sequence, copied)
            self._workbench.mark_saved(shown, shown)
            return copied.folder

    def why_not_in_place(self) -> str | None:
        """Why the sequence can only be saved as a copy; None where it can be saved."""
        return saving.why_not_in_place(self._sequence().folder)

    def copies_in(self) -> Path:
        """Where a copy goes that is given a name alone: a folder that can be written."""
        folder = self._sequence().folder
        beside = [] if saving.why_not_in_place(folder) else [folder.parent]
        places = [*([self._data.absolute()] if self._data else []), *beside, Path.cwd()]
        return next((place for place in places if os.access(place, os.W_OK)), home())

    def copy_folder(self) -> Path:
        """A folder that is not there yet, to be offered for a copy."""
        place, name = self.copies_in(), f"{self._sequence().name}-taught"
        folder, number = place / name, 1
        while folder.exists():
            number += 1
            folder = place / f"{name}-{number}"
        return folder

    # how it is done

    def _sequence(self) -> Sequence:
        sequence = self._workbench.snapshot().sequence
        if sequence is None:
            raise SequenceError("no sequence is open; open one first")
        return sequence

    def _edit(
        self, edit: Callable[[Values], object], check: Callable[[Sequence], None] | None = None
    ) -> None:
        with self._lock:
            values = copy.deepcopy(taught_values(self._sequence()))
            edit(values)
            self._put(values, check)

    def _put(
        self,
        values: Values,
        check: Callable[[Sequence], None] | None = None,
        changes: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        now, opened = self._sequence(), self._opened
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
        self._remember(sequence)
        self._workbench.teach(sequence, _defaults(sequence), changes)

    def _remember(self, sequence: Sequence) -> None:
        self._states[sequence.digest] = taught_values(sequence)
        self._states.move_to_end(sequence.digest)
        while len(self._states) > KEPT_STATES:
            self._states.popitem(last=False)

    def _can_be_read(self, sequence: Sequence) -> None:
        """Whether there is a picture for the template that is new."""
        template = sequence.templates[-1]
        reader = self._workbench.snapshot().reader
        index = [camera.name for camera in sequence.cameras].index(template.camera)
        if reader is None or reader.picture(index, template.frame) is None:
            raise SequenceError(
                f'{sequence.folder.name}/{FILE}, template "{template.name}", frame: camera '
                f'"{template.camera}" has no picture of step {template.frame}; choose another step'
            )

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
            self._states.clear()
            self._remember(sequence)
            self._take_up(sequence)

    def _take_up(self, sequence: Sequence) -> None:
        """Go on with what was not saved when the sequence was open before."""
        draft = self._drafts.read(sequence.folder)
        if draft is None:
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


def _moved(sequence: Sequence, copied: Sequence) -> Sequence:
    """A sequence under the name and in the folder of its copy."""
    return replace(sequence, name=copied.name, folder=copied.folder)


def _defaults(sequence: Sequence) -> RunParameters | None:
    try:
        return pipeline.default_parameters(sequence)
    except ValueError:
        return None


def _metres(value: float) -> float:
    return round(float(value), METRE_DIGITS) + 0.0  # no negative zero


def _within(sequence: Sequence, camera: str, box: tuple[float, float, float, float]) -> list[float]:
    """A drawn box without what sticks out of its picture; of no size where nothing is left."""
    sizes = {c.name: c.image_size for c in sequence.cameras}
    if camera not in sizes or not all(abs(value) < 1e6 for value in box):
        return list(box)  # the check says what is wrong with it
    left, top, width, height = box
    ends = [(left, width, sizes[camera][0]), (top, height, sizes[camera][1])]
    (x0, x1), (y0, y1) = ((max(0.0, a), min(float(size), a + b)) for a, b, size in ends)
    cut = [round(value, PIXEL_DIGITS) for value in (x0, y0, x1 - x0, y1 - y0)]
    if min(cut[2:]) < LEAST_BOX:
        raise SequenceError(
            f"{sequence.folder.name}/{FILE}, new template, box: expected at least {LEAST_BOX:g} "
            f"pixels a side inside the picture, found {max(0.0, cut[2]):g} × {max(0.0, cut[3]):g}; "
            "drag a larger one"
        )
    return cut


def _at(values: Values, key: str, index: int) -> dict[str, Any]:
    found: list[dict[str, Any]] = values[key]
    if not 0 <= index < len(found):
        raise SequenceError(f"{key}: expected one of {len(found)}, found number {index + 1}")
    return found[index]


def _take(found: list[Any], word: str, index: int) -> None:
    if not 0 <= index < len(found):
        raise SequenceError(f"{word}: expected one of {len(found)}, found number {index + 1}")
    del found[index]
