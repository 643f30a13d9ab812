"""What a sequence was taught, and the detector that a page asks for."""

from __future__ import annotations

from app.models.base import Box, GivenPath, Model, Vector


class DetectorRequest(Model):
    """A detection network for the pictures."""

    model: GivenPath | None = None
    """The path of an ONNX file on this machine; none takes the one away that there is."""


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
