"""Commands of the library: what a person says of stored runs, and which are deleted."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from app.models.base import Model, RowNumber
from app.web.commands.command import Command, Owners
from app.wishes import Marks


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
