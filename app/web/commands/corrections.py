"""Commands of corrections: what is true of tracks, and of the moments under review."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from app.models.correcting import CorrectionWish
from app.state.snapshot import Snapshot
from app.web.commands.command import Command, Owners
from app.web.corrections.items import alternative_of, known_item
from app.web.corrections.wishes import corrections_of
from app.web.dependencies import nothing_open
from tracker.review.queue.item import confirm


def _open(owners: Owners) -> Snapshot:
    snapshot = owners.workbench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    return snapshot


class Correct(Command):
    """Put some things right, which are undone at once; the run follows."""

    name: Literal["correct"]
    corrections: list[CorrectionWish] = Field(min_length=1, max_length=50)
    note: str = Field(default="", max_length=1000)

    def apply(self, owners: Owners) -> None:
        snapshot = _open(owners)
        wishes = self.corrections
        owners.correcting.add(
            [one for wish in wishes for one in corrections_of(wish, snapshot, self.note)]
        )


class DropCorrection(Command):
    """Take one correction out, wherever it stands."""

    name: Literal["drop_correction"]
    id: str = Field(max_length=200)

    def apply(self, owners: Owners) -> None:
        _open(owners)
        owners.correcting.remove(self.id)


class Answer(Command):
    """Say what is true of a moment under review, of the shown run or of one before it; that it is
    as it is, is stored too."""

    name: Literal["answer"]
    doubt: str = Field(max_length=40)
    alternative: int = Field(ge=0, le=20)
    """0: as it is."""

    def apply(self, owners: Owners) -> None:
        item = known_item(owners.doubting.told(_open(owners), self.doubt), self.doubt)
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
        _open(owners)
        owners.correcting.skipped.add(self.doubt)


CorrectionsCommand = Correct | DropCorrection | Answer | Skip
