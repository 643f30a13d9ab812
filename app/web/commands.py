"""What a person edits, as typed commands: one address takes them all, by their names."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from fastapi import APIRouter, Body, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import Field

from app.errors import COMMANDS, ApiError, as_sentence, sentence
from app.messages import GivenPath, Marks, Model, RowNumber, Vector
from app.state.edits import Edit, EditError
from app.state.teaching import Part, Side, Teaching
from app.web import results
from app.web.corrections import CorrectionWish, alternative_of, known_item, stated_corrections
from app.web.dependencies import ERRORS, Owned, Owners, opened
from app.web.results import State
from app.web.studies import no_trial, store_of
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import changed_values, value_of, with_values
from tracker.review.queue.item import confirm
from tracker.studies.errors import StudyError


class Command(Model):
    """Something that a person does; the field ``name`` of each kind tells it from the others."""

    in_order: ClassVar = False
    """Whether it waits for no file, and is done before the next command is looked at."""

    def apply(self, owners: Owners) -> Model | None:
        """Do it, and answer what only who asked needs; parts of the state are told to everyone.

        Raises:
            ApiError: If it cannot be done; nothing is changed then.
        """
        raise NotImplementedError


class ToState(Command):
    """A command that answers with the state that it leads to."""

    def apply(self, owners: Owners) -> State:
        self.change(owners)
        return results.state_of(owners.workbench.snapshot())

    def change(self, owners: Owners) -> None:
        """Do it.

        Raises:
            ParameterError: If a value does not fit; nothing is changed then.
        """
        raise NotImplementedError


class SetParameters(ToState):
    """Change some values, all or none; what depends on them is computed anew."""

    in_order: ClassVar = True
    name: Literal["set_parameters"]
    changes: dict[str, Any]
    """By key."""
    origin: str = Field("", max_length=100)

    def change(self, owners: Owners) -> None:
        owners.workbench.set_parameters(self.changes, self.origin or "api")


class ResetParameters(ToState):
    """Return some values, or all, to their defaults."""

    in_order: ClassVar = True
    name: Literal["reset_parameters"]
    keys: list[str] | None = None
    """All, the methods included, where none are named."""

    def change(self, owners: Owners) -> None:
        owners.workbench.reset_parameters(self.keys)


class ApplyPreset(ToState):
    """Take a preset's values, and the defaults where it has none."""

    in_order: ClassVar = True
    name: Literal["apply_preset"]
    preset: str

    def change(self, owners: Owners) -> None:
        owners.workbench.apply_preset(self.preset)


class UseAgain(ToState):
    """Set all values, and what was taught, to those of an earlier run of this start."""

    name: Literal["use_again"]
    run: int
    """The run's number in the tab Runs."""

    def change(self, owners: Owners) -> None:
        owners.history.use_again(self.run, owners.teaching.restore)


class SavePreset(ToState):
    """Save what differs from the defaults now, under a name."""

    name: Literal["save_preset"]
    preset: str = Field(max_length=4096)

    def change(self, owners: Owners) -> None:
        owners.presets.save(self.preset)


class RenamePreset(ToState):
    """Give a saved preset another name."""

    name: Literal["rename_preset"]
    preset: str
    to: str = Field(max_length=4096)

    def change(self, owners: Owners) -> None:
        owners.presets.rename(self.preset, self.to)


class RemovePreset(ToState):
    """Forget a saved preset."""

    name: Literal["remove_preset"]
    preset: str

    def change(self, owners: Owners) -> None:
        owners.presets.remove(self.preset)


class Undo(ToState):
    """Put back what was before the last edit, whatever it was of; those of an earlier start too."""

    name: Literal["undo"]

    def change(self, owners: Owners) -> None:
        _turn(owners, "Undone", owners.edits.undo)


class Redo(ToState):
    """Do again what was undone last."""

    name: Literal["redo"]

    def change(self, owners: Owners) -> None:
        _turn(owners, "Done again", owners.edits.redo)


def _turn(owners: Owners, what: str, act: Callable[[], Edit]) -> None:
    try:
        edit = act()
    except EditError as error:
        words = as_sentence(str(error))
        raise ApiError(409, "no_edit", words, hint="Nothing was changed.") from None
    owners.workbench.notify("info", f"{what}: {edit.words}")


ParametersCommand = (
    SetParameters | ResetParameters | ApplyPreset | UseAgain
    | SavePreset | RenamePreset | RemovePreset | Undo | Redo
)  # fmt: skip


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
    """A command on what the open sequence is taught; the run follows at once.

    Where nothing else is said it is the method of :class:`Teaching` of its name, with its fields.
    """

    def apply(self, owners: Owners) -> None:
        """Do it, where a sequence is open."""
        opened(owners.workbench)
        with refusing():
            self.teach(owners.teaching)

    def teach(self, teaching: Teaching) -> None:
        """Change what is taught.

        Raises:
            ValueError: If it does not fit; nothing is changed then.
        """
        fields = self.model_dump()
        getattr(teaching, fields.pop("name"))(**fields)


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


class RemoveTemplate(_Teach):
    """Take a template away."""

    name: Literal["remove_template"]
    index: int


class OfferTemplates(_Teach):
    """List the templates that the tracks of the shown run offer; they change nothing yet."""

    name: Literal["offer_templates"]


class TakeOffers(_Teach):
    """Add offered templates to the others."""

    name: Literal["take_offers"]
    index: int | None = None
    """Of the one; null for all that are offered."""


class ForgetOffers(_Teach):
    """List no offered templates any more."""

    name: Literal["forget_offers"]


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


class SuggestEntrances(_Teach):
    """Add the entrances at which the tracks of the shown run begin and end."""

    name: Literal["suggest_entrances"]


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


class Correct(Command):
    """Put some things right, which are undone at once; the run follows."""

    name: Literal["correct"]
    corrections: list[CorrectionWish] = Field(min_length=1, max_length=50)
    note: str = Field(default="", max_length=1000)

    def apply(self, owners: Owners) -> None:
        snapshot, _ = opened(owners.workbench)
        wishes = self.corrections
        owners.correcting.add(
            [one for wish in wishes for one in stated_corrections(wish, snapshot, self.note)]
        )


class DropCorrection(Command):
    """Take one correction out, wherever it stands."""

    name: Literal["drop_correction"]
    id: str = Field(max_length=200)

    def apply(self, owners: Owners) -> None:
        opened(owners.workbench)
        owners.correcting.remove(self.id)


class Answer(Command):
    """Say what is true of a moment under review, of the shown run or of one before it; that it is
    as it is, is stored too."""

    name: Literal["answer"]
    doubt: str = Field(max_length=40)
    alternative: int = Field(ge=0, le=20)
    """0: as it is."""

    def apply(self, owners: Owners) -> None:
        item = known_item(owners.doubting.told(opened(owners.workbench)[0], self.doubt), self.doubt)
        chosen = item.alternatives[alternative_of(item, self.alternative)]
        if not chosen.corrections:
            owners.correcting.skipped.add(item.id)
            return
        note = item.title if self.alternative else ""
        owners.correcting.add(confirm(chosen.corrections, note))


class Skip(Command):
    """Pass over a moment under review until the program ends."""

    name: Literal["skip"]
    doubt: str = Field(max_length=40)

    def apply(self, owners: Owners) -> None:
        opened(owners.workbench)
        owners.correcting.skipped.add(self.doubt)


CorrectionsCommand = Correct | DropCorrection | Answer | Skip


class MarkRun(Marks, Command):
    """Name, star, note and tag a stored run; what is null stays."""

    name: Literal["mark_run"]
    run: RowNumber

    def apply(self, owners: Owners) -> None:
        own = set(Marks.model_fields)
        owners.marking.mark(
            self.run, self.model_dump(include=own, exclude_none=True, by_alias=True)
        )


class Deleted(Model):
    """What was deleted."""

    bytes: int
    """Size of the tracks."""


class DeleteRuns(Command):
    """Delete stored runs; this can be undone for a day."""

    name: Literal["delete_runs"]
    runs: list[RowNumber] = Field(min_length=1, max_length=10_000)

    def apply(self, owners: Owners) -> Deleted:
        return Deleted(bytes=owners.marking.delete(self.runs))


LibraryCommand = MarkRun | DeleteRuns


class _OfStudy(ToState):
    study: str
    """The study's name."""
    trial: int | None = None
    """The trial's number, 0 for what the study began with; null for what the study proposes."""

    def parameters(self, owners: Owners) -> RunParameters:
        """The values of the trial, what its study holds, and the defaults."""
        values = self._values(owners)
        snapshot, _ = opened(owners.workbench)
        return with_values(snapshot.defaults, values)

    def _values(self, owners: Owners) -> dict[str, Any]:
        store = store_of(owners.studies, self.study)
        if self.trial is not None:
            try:
                found, definition = store.trial(self.trial), store.definition()
            except StudyError as error:
                raise no_trial(error, "trial") from None
            return {**definition.held(), **(found.values if self.trial else {})}
        proposed, definition = store.fact("tuned"), store.definition()
        if proposed is None or not proposed["better"]:
            raise ApiError(409, "nothing_better", f"The study {store.name} proposes nothing.")
        return {**definition.held(), **proposed["values"]}


class UseTrial(_OfStudy):
    """Set all parameters to those of a study's trial, or to what the study proposes."""

    name: Literal["use_trial"]

    def change(self, owners: Owners) -> None:
        parameters = self.parameters(owners)
        values = {key: value_of(parameters, key) for key in (*METHODS, *PARAMETERS)}
        owners.workbench.set_parameters(values, "api")


class KeepTrial(_OfStudy):
    """Save the values of a study's trial, or what the study proposes, as a preset."""

    name: Literal["keep_trial"]
    preset: str = Field(max_length=4096)

    def change(self, owners: Owners) -> None:
        defaults = owners.workbench.snapshot().defaults
        owners.presets.keep(self.preset, changed_values(self.parameters(owners), defaults))


StudiesCommand = UseTrial | KeepTrial


AnyCommand = (
    ParametersCommand | TeachingCommand | CorrectionsCommand | LibraryCommand | StudiesCommand
)

DONE = {"description": "It is done; what has changed is told over the socket."}

router = APIRouter(responses=ERRORS)


@router.post(COMMANDS, response_model=State | Deleted, responses={204: DONE})
async def do(
    command: Annotated[AnyCommand, Body(discriminator="name")],
    owners: Owned,
) -> Model | Response:
    """Do one thing; everyone who looks is told what has changed."""
    if command.in_order:
        answer = command.apply(owners)
    else:
        answer = await run_in_threadpool(command.apply, owners)
    return Response(status_code=204) if answer is None else answer
