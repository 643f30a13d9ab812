"""What a person teaches the open sequence: boxes of colours, the room's faces, entrances."""

from __future__ import annotations

import copy
import os
from pathlib import Path
from typing import Literal

from app.state.edits import Edits
from app.state.teaching.entrances import entrances_of
from app.state.teaching.taught import Taught
from app.state.teaching.values import METRE_DIGITS, at, rounded, take, within
from app.state.workbench import Workbench
from tracker.files.folders import home
from tracker.review import template_suggestions
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import FILE, given_folder
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import Values, taught_values, template_values

NEW_SIGMA = (0.3, 0.3, 0.15)
"""Standard deviations of an entrance that somebody adds, metres."""

Side = Literal["min", "max"]
Part = Literal["position", "sigma"]


class Teaching(Taught):
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
        super().__init__(workbench, edits, drafts)
        self._data = data

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

    def rename_template(self, index: int, name: str) -> None:
        """Say whose colours a template models.

        Raises:
            SequenceError: If there is no such template, or no name is given.
        """
        self.edit(lambda values: at(values, "template", index).update(name=name))

    def remove_template(self, index: int) -> None:
        """Take a template away."""
        self.edit(lambda values: take(values["template"], "template", index))

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
        self.edit(lambda values: take(values["room"]["entrances"], "entrance", index))

    def discard(self) -> None:
        """Have room and templates as the file has them."""
        saved = self._workbench.snapshot().saved
        if saved is not None:
            self.edit(lambda values: values.update(copy.deepcopy(taught_values(saved))))

    def save_copy(self, folder: Path) -> Path:
        """As :meth:`Taught.save_copy`, beside the others where a name alone is given."""
        folder = given_folder(folder)
        return super().save_copy(folder if folder.is_absolute() else self.copies_in() / folder)

    def why_not_in_place(self) -> str | None:
        """Why the sequence can only be saved as a copy; None where it can be saved."""
        return saving.why_not_in_place(self.sequence().folder)

    def copies_in(self) -> Path:
        """Where a copy goes that is given a name alone: a folder that can be written."""
        folder = self.sequence().folder
        beside = [] if saving.why_not_in_place(folder) else [folder.parent]
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
