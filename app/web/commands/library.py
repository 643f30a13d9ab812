"""Commands of the library: what a person says of stored runs, and which are deleted."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from app.models.base import Model, RowNumber
from app.web.commands.command import Command, Owners


class MarkRun(Command):
    """Name, star, note and tag a stored run; what is null stays."""

    name: Literal["mark_run"]
    run: RowNumber
    title: str | None = Field(default=None, max_length=200)
    """The run's name."""
    star: bool | None = None
    note: str | None = Field(default=None, max_length=10_000)
    tags: list[str] | None = Field(default=None, max_length=50)

    def apply(self, owners: Owners) -> None:
        said = {"name": self.title, "star": self.star, "note": self.note, "tags": self.tags}
        marks = {key: value for key, value in said.items() if value is not None}
        owners.marking.mark(self.run, marks)


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
