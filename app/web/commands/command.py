"""What a command is, and what it acts on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from app.models import Model
from app.state.correcting import Correcting
from app.state.doubting import Doubting
from app.state.edits import Edits
from app.state.kept.history import History
from app.state.kept.presets import OwnPresets
from app.state.marking import Marking
from app.state.studies import StudyDesk
from app.state.teaching import Teaching
from app.state.workbench import Workbench


@dataclass(frozen=True, slots=True)
class Owners:
    """Those who own what commands change."""

    workbench: Workbench
    edits: Edits
    presets: OwnPresets
    history: History
    teaching: Teaching
    correcting: Correcting
    doubting: Doubting
    marking: Marking
    studies: StudyDesk


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
