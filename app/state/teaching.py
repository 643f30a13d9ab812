"""What the open sequence is taught: boxes of colours, the room's faces, entrances; its drafts.

Every edit makes another value of the sequence, checked as its file would be, and the jobs
compute its run as after a moved slider.
"""

from __future__ import annotations

import copy
import logging
import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from app.errors import sentence
from app.state.edits import Edits
from app.state.snapshot import Change
from app.state.workbench import Workbench
from tracker.files.folders import home
from tracker.files.validated import read_as, set_aside, write_json
from tracker.geometry.consistency.entrances import Door, not_yet_there, suggest_entrances
from tracker.parameters.catalogue import RunParameters
from tracker.review import template_suggestions
from tracker.runs import pipeline
from tracker.runs.run import Run
from tracker.sequences.built_in import EARLIER, earlier_key, key_of
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE, given_folder, saved_digest
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing.teaching import (
    Values,
    carried_over,
    changes,
    taught_values,
    template_values,
    with_taught,
)


def entrances_of(run: Run) -> list[Door]:
    """Where the tracks of a run begin and end, without what its room has already."""
    tracks = run.tracks
    found = suggest_entrances(
        tracks.frames, tracks.ids, tracks.positions, steps=run.done, fps=run.sequence.fps
    )
    return not_yet_there(found, [entrance.position for entrance in run.sequence.room.entrances])


logger = logging.getLogger("app")


@dataclass(frozen=True, slots=True)
class _Draft:
    """A draft as its file has it."""

    saved: Values
    """Room and templates as they were saved, by the keys of a ``sequence.toml``."""
    taught: Values
    """Room and templates as they were taught since."""


class Drafts:
    """One draft a sequence folder: room and templates as saved, and as taught since."""

    def __init__(self, folder: Path | None) -> None:
        """Keep them in a folder, a file each; in memory for this start where there is none."""
        self._folder = folder
        self._kept: dict[Path, tuple[Values, Values]] = {}
        self._moved: dict[Path, Path] = {}
        """Where recordings lie now, by the folders that they were in before."""

    def keep(self, sequence: Path, saved: Values, taught: Values) -> None:
        """Keep what is not saved of a sequence, instead of what was before; nothing, if all is."""
        sequence = self._moved.get(sequence, sequence)  # it may still be open as it was before
        if saved == taught:
            self.forget(sequence)
            return
        self._kept[sequence] = saved, taught
        if self._folder is None:
            return
        draft = {"sequence": str(sequence), "saved": saved, "taught": taught}
        try:
            write_json(self._file(sequence), draft)
        except OSError as error:
            logger.warning("what is not saved of %s would be lost at an end: %s", sequence, error)

    def read(self, sequence: Path) -> tuple[Values, Values] | None:
        """As saved and as taught; None where all was saved, or the file cannot be read."""
        if self._folder is None or sequence in self._kept:
            return self._kept.get(sequence)
        draft = _read(self._file(sequence))
        if draft is not None:
            self._kept[sequence] = draft
        return draft

    def move(self, before: Path, after: Path) -> None:
        """Keep what is not saved of a sequence for the folder into which it was moved."""
        draft = self.read(before)
        self._moved.pop(after, None)
        self._moved[before] = after
        if draft is not None and self.read(after) is None:
            self.keep(after, *draft)
            self.forget(before)

    def take_earlier(self, sequence: Path) -> tuple[Values, Values] | None:
        """What was saved and taught on a built-in room as it was rendered before; None where
        nothing was. The file gets another name, so that it is taken up once and nothing is lost."""
        key = earlier_key(sequence)
        if self._folder is None or key is None:
            return None
        path = self._folder / f"{key}.json"
        draft = _read(path)
        if draft is not None:
            path.rename(path.with_suffix(".taken-up.json"))
        return draft

    def forget(self, sequence: Path) -> None:
        """All of it is saved, or it cannot be taken up any more."""
        self._kept.pop(sequence, None)
        if self._folder is not None:
            self._file(sequence).unlink(missing_ok=True)

    def file_of(self, sequence: Path) -> Path | None:
        """The file of a draft; None where there is none."""
        kept = self._folder is not None and sequence in self._kept
        return self._file(sequence) if kept else None

    def _file(self, sequence: Path) -> Path:
        assert self._folder is not None
        return self._folder / f"{key_of(sequence)}.json"


def _read(path: Path) -> tuple[Values, Values] | None:
    try:
        draft = read_as(path, _Draft)
        changes(draft.saved, draft.taught)  # raises where another version wrote them
        return draft.saved, draft.taught
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        aside = set_aside(path)
        logger.warning("%s cannot be read and is now %s: %s", path, aside or path, error)
        return None


PIXEL_DIGITS, METRE_DIGITS = 1, 3
"""Decimals to which a drawn box (pixels) and a dragged place (metres) are rounded."""

LEAST_BOX = 4.0
"""Pixels of a template's side: what is smaller has no colours to speak of."""


def rounded(value: float) -> float:
    """A place as it is written: rounded, and without a negative zero."""
    return round(float(value), METRE_DIGITS) + 0.0


def within(sequence: Sequence, camera: str, box: tuple[float, float, float, float]) -> list[float]:
    """A drawn box without what sticks out of its picture.

    Raises:
        SequenceError: If less than :data:`LEAST_BOX` is left.
    """
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


def at(values: Values, key: str, index: int) -> dict[str, Any]:
    """One table of a list of tables.

    Raises:
        SequenceError: If there is none of that number.
    """
    found: list[dict[str, Any]] = values[key]
    if not 0 <= index < len(found):
        raise SequenceError(f"{key}: expected one of {len(found)}, found number {index + 1}")
    return found[index]


def take(values: Values, key: str, index: int) -> None:
    """Take a table out of a list of tables.

    Raises:
        SequenceError: If there is none of that number.
    """
    at(values, key, index)
    del values[key][index]


Check = Callable[[Sequence], None]
"""Raises a :class:`SequenceError` if a sequence will not do."""


NEW_SIGMA = (0.3, 0.3, 0.15)
"""Standard deviations of an entrance that somebody adds, metres."""

Side = Literal["min", "max"]
Part = Literal["position", "sigma"]


class Teaching:
    """Edits what the open sequence was taught; any thread may ask."""

    def __init__(
        self,
        workbench: Workbench,
        edits: Edits,
        data: Path | None = None,
        drafts: Path | None = None,
    ) -> None:
        """Follow a workbench.

        Args:
            workbench: Whose sequence.
            edits: Where what is taught can be undone.
            data: Where a copy is offered to be put.
            drafts: Where what is not saved is kept for the next start; None: not beyond this one.
        """
        self._workbench, self._data = workbench, data
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

    def move_draft(self, before: Path, after: Path) -> None:
        """Keep what was not saved of a sequence for the folder into which it was moved."""
        with self._lock:
            self._drafts.move(before, after)

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
        from tracker.sequences.writing import saving  # with tomlkit

        with self._lock:
            sequence, saved = self.sequence(), self._workbench.snapshot().saved
            assert saved is not None
            backup = saving.save(sequence, saved)
            written = replace(sequence, stored_digest=saved_digest(sequence))
            self._workbench.mark_saved(written, written)
            return backup

    def save_copy(self, folder: Path) -> Path:
        """Write the sequence with what was taught into another folder, and go on in that.

        Args:
            folder: Beside the others where it is a name alone.

        Raises:
            SequenceError: If it cannot be; nothing is lost then.
        """
        from tracker.sequences.writing import saving  # with tomlkit

        with self._lock:
            sequence, saved = self.sequence(), self._workbench.snapshot().saved
            assert saved is not None
            folder = given_folder(folder)
            place = folder if folder.is_absolute() else self.copies_in() / folder
            copied = saving.save_copy(sequence, saved, place)
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

    def add_template(
        self,
        camera: str,
        step: int | None,
        box: tuple[float, float, float, float],
        name: str | None = None,
    ) -> None:
        """Add a box whose colours model a person.

        Args:
            camera: Its name.
            step: The step of the picture that the box lies in; None for the playhead's.
            box: left, top, width, height in pixels; what sticks out is cut off.
            name: Whose it is; a new person's where none is given.

        Raises:
            SequenceError: If the box or the name does not fit.
        """
        sequence = self.sequence()
        names = [template.name for template in sequence.templates]
        name = name or next(
            word for k in range(1, len(names) + 2) if (word := f"person{k}") not in names
        )
        step = self._workbench.snapshot().playhead if step is None else step
        template = {
            "name": name, "camera": camera, "frame": step, "box": within(sequence, camera, box)
        }  # fmt: skip

        def add(values: Values) -> None:
            values["template"].append(template)

        self.edit(add, self._can_be_read)

    def rename_template(self, index: int, person: str) -> None:
        """Say whose colours a template models.

        Raises:
            SequenceError: If there is no such template, or no name is given.
        """
        self.edit(lambda values: at(values, "template", index).update(name=person))

    def remove_template(self, index: int) -> None:
        """Take a template away."""
        self.edit(lambda values: take(values, "template", index))

    def offer_templates(self) -> None:
        """List the templates that the shown run's tracks offer, to be taken or left.

        Raises:
            SequenceError: If there is no such run, or its tracks offer none.
        """
        now = self._workbench.snapshot()
        run, reader = now.run, now.reader
        if run is None or reader is None or run.sequence.views is not self.sequence().views:
            raise SequenceError("there is no run yet whose tracks could offer templates")
        if not run.complete or now.run_state.state == "computing":
            raise SequenceError("the run goes on; ask for templates when it has ended")
        if not run.sequence.has_pictures:
            raise SequenceError("no camera has pictures, so there are no colours to learn")
        found = template_suggestions.suggest_templates(run, reader)
        if not found:
            raise SequenceError(
                "the tracks offer no further template: nobody is seen whole, apart from others and "
                "by two cameras at once who has not a template alike; draw one by hand (C)"
            )
        self._workbench.show_offers(run.sequence, found)

    def take_offers(self, index: int | None = None) -> None:
        """Add an offered template to the others, or all that are listed; undo takes them away.

        Args:
            index: Which of those listed; None for all.

        Raises:
            SequenceError: If it is offered no more.
        """
        listed = self.offered()
        if index is not None and not 0 <= index < len(listed):
            raise SequenceError("that template is offered no more")
        taken = listed if index is None else [listed[index]]
        new = [template_values(one.template) for one in taken]
        self.edit(lambda values: values["template"].extend(new))

    def offered(self) -> list[template_suggestions.Suggestion]:
        """The templates that are offered and not taken yet."""
        now = self._workbench.snapshot()
        if now.sequence is None or now.offers is None:
            return []
        return template_suggestions.without_templates(now.offers, now.sequence)

    def forget_offers(self) -> None:
        """List none any more."""
        self._workbench.show_offers(self.sequence(), None)

    def set_face(self, side: Side, axis: int, metres: float) -> None:
        """Move one of the room's six faces.

        Raises:
            SequenceError: If nothing of the room were left.
        """

        def move(values: Values) -> None:
            values["room"][side][axis] = rounded(metres)

        self.edit(move)

    def set_target(self, half_extents: tuple[float, float, float]) -> None:
        """Say how large a person is: half width, depth and height, metres.

        Raises:
            SequenceError: If it has no size.
        """
        half = [round(float(value), METRE_DIGITS + 1) for value in half_extents]
        self.edit(lambda values: values["target"].update(half_extents=half))

    def add_entrance(self, position: tuple[float, float, float] | None = None) -> None:
        """Add an entrance, in the middle of the room where no place is given."""
        room = self.sequence().room
        if position is None:
            x, y, z = ((room.minimum + room.maximum) / 2.0).tolist()
            position = (x, y, z)
        if room.entrances:  # people are as tall at every door
            position = (position[0], position[1], float(room.entrances[0].position[2]))
        entrance = {"position": [rounded(value) for value in position], "sigma": [*NEW_SIGMA]}
        self.edit(lambda values: values["room"]["entrances"].append(entrance))

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
        self.edit(lambda values: values["room"]["entrances"].extend(new))

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
            entrance = at(values["room"], "entrances", index)
            for axis, metres in changed.items():
                entrance[part][axis] = rounded(metres)

        self.edit(move)

    def remove_entrance(self, index: int) -> None:
        """Take an entrance away."""
        self.edit(lambda values: take(values["room"], "entrances", index))

    def discard(self) -> None:
        """Have room and templates as the file has them."""
        saved = self._workbench.snapshot().saved
        if saved is not None:
            self.edit(lambda values: values.update(copy.deepcopy(taught_values(saved))))

    def why_not_in_place(self) -> str | None:
        """Why the sequence can only be saved as a copy; None where it can be saved."""
        from tracker.sequences.writing import saving  # with tomlkit

        return saving.why_not_in_place(self.sequence().folder)

    def copies_in(self) -> Path:
        """Where a copy goes that is given a name alone: a folder that can be written."""
        folder = self.sequence().folder
        beside = [] if self.why_not_in_place() else [folder.parent]
        places = [*([self._data.absolute()] if self._data else []), *beside, Path.cwd()]
        return next((place for place in places if os.access(place, os.W_OK)), home())

    def copy_folder(self) -> Path:
        """A folder that is not there yet, to be offered for a copy."""
        place, name = self.copies_in(), f"{self.sequence().name}-taught"
        folder, number = place / name, 1
        while folder.exists():
            number += 1
            folder = place / f"{name}-{number}"
        return folder

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


def _moved(sequence: Sequence, copied: Sequence) -> Sequence:
    """A sequence under the name, in the folder and with the files of its copy."""
    return replace(
        sequence,
        name=copied.name,
        folder=copied.folder,
        files=copied.files,
        own_file=copied.own_file,
        stored_digest=copied.stored_digest,
    )


def _defaults(sequence: Sequence) -> RunParameters | None:
    try:
        return pipeline.default_parameters(sequence)
    except ValueError:
        return None
