"""What a command is, and what it acts on."""

from __future__ import annotations

from dataclasses import dataclass

from app.models import Model
from app.state.correcting import Correcting
from app.state.doubting import Doubting
from app.state.marking import Marking
from app.state.teaching import Teaching
from app.state.workbench import Workbench


@dataclass(frozen=True, slots=True)
class Owners:
    """Those who own what commands change."""

    workbench: Workbench
    teaching: Teaching
    correcting: Correcting
    doubting: Doubting
    marking: Marking


class Command(Model):
    """Something that a person does; the field ``name`` of each kind tells it from the others."""

    def apply(self, owners: Owners) -> Model | None:
        """Do it, and answer what only who asked needs; parts of the state are told to everyone.

        Raises:
            ApiError: If it cannot be done; nothing is changed then.
        """
        raise NotImplementedError
