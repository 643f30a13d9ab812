"""Teaching a sequence: what a page asks for, where texts of fields are taken as numbers, and what
the sequence was taught."""

from __future__ import annotations

from pydantic import Field

from app.models.base import Box, GivenPath, Model, Vector


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


class TemplateInfo(Model):
    """A box whose colours model a person."""

    name: str
    camera: str
    """The camera's name."""
    step: int
    box: Box


class OfferInfo(Model):
    """A template that the tracks offer."""

    template: TemplateInfo
    track: int
    reason: str
    """What speaks for it."""


class DetectorInfo(Model):
    """A detection network that is at hand."""

    name: str
    path: str | None
    """The file that somebody named for this recording; null for a fetched network."""


class Taught(Model):
    """What the open sequence was taught; room, entrances and target are in its state."""

    templates: list[TemplateInfo]
    offers: list[OfferInfo] | None
    """Null before they are asked for."""
    method: str
    """The single-view method in use."""
    looking: str | None
    """A method that looks at templates, where that in use does not."""
    detector: DetectorInfo | None
    fetching: int | None
    """Percentage of a network that is being fetched."""
    sizes: dict[str, Vector]
    """Half width, depth and height of common targets in metres, by their words."""
    unsaved: list[str]
    """What the sequence's file does not have, in words."""
    file: str
    """The sequence's file, with its folder."""
    read_only: str | None
    """Why it can only be saved as a copy; null where it can be saved."""
    built_in: bool
    copy_to: str
    """A folder that is not there yet, to be offered for a copy."""
