"""Commands of teaching: templates, the room, the target's size, entrances; saving."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from app.errors import ApiError, as_sentence, sentence
from app.models.base import GivenPath, Vector
from app.state.teaching import Part, Side, Teaching
from app.web.commands.command import Command, Owners
from app.web.dependencies import nothing_open

NOTHING_LOST = "Nothing was changed, and nothing is lost."

Axis = Annotated[int, Field(ge=0, le=2)]
"""0, 1, 2 for x, y, z."""

Metres = Annotated[float, Field(ge=-1e4, le=1e4, allow_inf_nan=False)]


@contextmanager
def refusing(code: str = "cannot_teach") -> Iterator[None]:
    """What does not fit, in the one shape of errors."""
    try:
        yield
    except (ValueError, OSError) as error:
        raise ApiError(422, code, as_sentence(sentence(error)), hint=NOTHING_LOST) from None


class _Teach(Command):
    """A command on what the open sequence is taught; the run follows at once."""

    def apply(self, owners: Owners) -> None:
        """Do it, where a sequence is open."""
        if owners.workbench.snapshot().sequence is None:
            raise nothing_open()
        with refusing():
            self.teach(owners.teaching)

    def teach(self, teaching: Teaching) -> None:
        """Change what is taught.

        Raises:
            ValueError: If it does not fit; nothing is changed then.
        """
        raise NotImplementedError


class AddTemplate(_Teach):
    """Add a box whose colours model a person."""

    name: Literal["add_template"]
    camera: str = Field(max_length=200)
    """The camera's name."""
    step: int | None = None
    """The step of the picture; the playhead's where none is given."""
    left: float
    top: float
    width: float
    height: float
    person: str = Field(default="", max_length=200)
    """The person whom it models; a new person's where none is given."""

    def teach(self, teaching: Teaching) -> None:
        box = (self.left, self.top, self.width, self.height)
        teaching.add_template(self.camera, self.step, box, self.person or None)


class RenameTemplate(_Teach):
    """Say whose colours a template models; templates of one name are of one person."""

    name: Literal["rename_template"]
    index: int
    person: str = Field(max_length=200)

    def teach(self, teaching: Teaching) -> None:
        teaching.rename_template(self.index, self.person)


class RemoveTemplate(_Teach):
    """Take a template away."""

    name: Literal["remove_template"]
    index: int

    def teach(self, teaching: Teaching) -> None:
        teaching.remove_template(self.index)


class OfferTemplates(_Teach):
    """List the templates that the tracks of the shown run offer; they change nothing yet."""

    name: Literal["offer_templates"]

    def teach(self, teaching: Teaching) -> None:
        teaching.offer_templates()


class TakeOffers(_Teach):
    """Add offered templates to the others."""

    name: Literal["take_offers"]
    index: int | None = None
    """Of the one; null for all that are offered."""

    def teach(self, teaching: Teaching) -> None:
        teaching.take_offers(self.index)


class ForgetOffers(_Teach):
    """List no offered templates any more."""

    name: Literal["forget_offers"]

    def teach(self, teaching: Teaching) -> None:
        teaching.forget_offers()


class SetRoomFace(_Teach):
    """Move one of the room's six faces."""

    name: Literal["set_room_face"]
    side: Side
    axis: Axis
    value: Metres

    def teach(self, teaching: Teaching) -> None:
        teaching.set_face(self.side, self.axis, self.value)


class SetTarget(_Teach):
    """Say how large a person is."""

    name: Literal["set_target"]
    half_extents: Vector
    """Half width, depth and height, metres."""

    def teach(self, teaching: Teaching) -> None:
        teaching.set_target(self.half_extents)


class SetTargetSide(_Teach):
    """Say how wide, deep or tall a person is."""

    name: Literal["set_target_side"]
    axis: Axis
    value: Metres

    def teach(self, teaching: Teaching) -> None:
        x, y, z = teaching.sequence().target_half_extents.tolist()
        half = {0: x, 1: y, 2: z, self.axis: self.value / 2.0}
        teaching.set_target((half[0], half[1], half[2]))


class AddEntrance(_Teach):
    """Add an entrance, where people appear."""

    name: Literal["add_entrance"]
    position: Vector | None = None
    """Metres; the middle of the room where none is given."""

    def teach(self, teaching: Teaching) -> None:
        teaching.add_entrance(self.position)


class SuggestEntrances(_Teach):
    """Add the entrances at which the tracks of the shown run begin and end."""

    name: Literal["suggest_entrances"]

    def teach(self, teaching: Teaching) -> None:
        teaching.suggest_entrances()


class SetEntrance(_Teach):
    """Move an entrance along an axis, or make it wider."""

    name: Literal["set_entrance"]
    index: int
    part: Part
    axis: Axis
    value: Metres

    def teach(self, teaching: Teaching) -> None:
        teaching.set_entrance(self.index, self.part, {self.axis: self.value})


class RemoveEntrance(_Teach):
    """Take an entrance away."""

    name: Literal["remove_entrance"]
    index: int

    def teach(self, teaching: Teaching) -> None:
        teaching.remove_entrance(self.index)


class DiscardTaught(_Teach):
    """Have room and templates as the file has them; undo brings the changes back."""

    name: Literal["discard_taught"]

    def teach(self, teaching: Teaching) -> None:
        teaching.discard()


class EditRoom(Command):
    """Have the 3D view with handles on the room, or without."""

    name: Literal["edit_room"]
    on: bool

    def apply(self, owners: Owners) -> None:
        owners.workbench.edit_room(self.on)


class SaveTaught(Command):
    """Write what was taught into the sequence's file, with a backup beside it."""

    name: Literal["save_taught"]

    def apply(self, owners: Owners) -> None:
        with refusing("cannot_save"):
            backup = owners.teaching.save()
        hint = f"What was there is in {backup.name}."
        owners.workbench.notify("info", f"Saved in {backup.parent.name}", hint)


class CopyTaught(Command):
    """Write the sequence with what was taught into another folder, and go on in that."""

    name: Literal["copy_taught"]
    folder: GivenPath
    """A path, or a name beside the offered one; new or empty."""

    def apply(self, owners: Owners) -> None:
        with refusing("cannot_save"):
            folder = owners.teaching.save_copy(Path(self.folder.strip()))
        hint = "The workbench is in the copy now."
        owners.workbench.notify("info", f"Saved a copy in {folder}", hint)


TeachingCommand = (
    AddTemplate | RenameTemplate | RemoveTemplate | OfferTemplates | TakeOffers | ForgetOffers
    | SetRoomFace | SetTarget | SetTargetSide
    | AddEntrance | SuggestEntrances | SetEntrance | RemoveEntrance
    | DiscardTaught | EditRoom | SaveTaught | CopyTaught
)  # fmt: skip
