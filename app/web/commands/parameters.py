"""Commands of parameters and presets, and of going back over every edit.

They answer with the state that they lead to: a page goes on from it, when it takes values from its
address, or undoes two edits at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal

from pydantic import Field

from app.errors import ApiError, as_sentence
from app.models import State
from app.state.edits import Edit, EditError
from app.web.commands.command import Command, Owners
from app.web.views import results


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
