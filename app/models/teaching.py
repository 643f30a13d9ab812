"""What a page asks for when it teaches a sequence; texts of fields are taken as numbers."""

from __future__ import annotations

from pydantic import Field

from app.models.base import GivenPath, Model, Vector


class NewTemplate(Model):
    """A box whose colours model a person."""

    camera: str = Field(max_length=200)
    """Its name."""
    step: int | None = None
    """Of the picture; the playhead's where none is given."""
    left: float
    top: float
    width: float
    height: float
    name: str = Field(default="", max_length=200)
    """Whose it is; a new person's where none is given."""


class TextChange(Model):
    """Another text."""

    value: str = Field(max_length=200)


class ValueChange(Model):
    """Another number, in metres."""

    value: float = Field(ge=-1e4, le=1e4, allow_inf_nan=False)


class TargetChange(Model):
    """How large a person is."""

    half_extents: Vector
    """Half width, depth and height, metres."""


class NewEntrance(Model):
    """Where people appear."""

    position: Vector | None = None
    """Metres; the middle of the room where none is given."""


class EditingChange(Model):
    """Handles on the room, or none."""

    on: bool


class DetectorRequest(Model):
    """A detection network for the pictures."""

    model: GivenPath | None = None
    """The path of an ONNX file on this machine; none takes the one away that there is."""


class CopyRequest(Model):
    """Where a copy goes."""

    folder: GivenPath
    """A path, or a name beside the offered one; new or empty."""
