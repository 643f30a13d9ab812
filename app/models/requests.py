"""What a page asks for."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from app.models.base import GivenPath, Model


class OpenRequest(Model):
    """Open another sequence."""

    name: GivenPath
    """A built-in name, a name of the list, or a folder."""


class TrailChanges(Model):
    """How trails are drawn, in 3D and in pictures."""

    seconds: float | None = Field(None, ge=0.5, le=600.0)
    """How far back they go."""
    fades: bool | None = None
    """Whether they are fainter the older they are."""


class CurveRequest(Model):
    """Compute what some parameters would change."""

    keys: list[str] = Field(max_length=40)


class LayerChanges(Model):
    """Layers of the 3D view, by name."""

    changes: dict[str, bool]


class ViewChange(Model):
    """Look through a camera in 3D."""

    camera: int | Literal["top"] | None
    """Its index; null for the free view."""


class ThemeChange(Model):
    """Have the 3D view dark or light."""

    theme: Literal["dark", "light"]


class SelectChange(Model):
    """Select a track."""

    id: int | None


class SeekChange(Model):
    """Move the playhead."""

    step: int
    origin: str = Field("", max_length=100)


class StreamSeek(SeekChange):
    """From the page over the socket."""

    type: Literal["seek"]


class StreamSelect(SelectChange):
    """From the page over the socket."""

    type: Literal["select"]


class StreamMotion(Model):
    """From the page over the socket: whether its browser asks for reduced motion."""

    type: Literal["motion"]
    flies: bool
    """Whether the 3D view may animate a change of viewpoint; false for reduced motion."""


class StreamPing(Model):
    """From the page over the socket: asks for a ``pong``, which shows that the server answers."""

    type: Literal["ping"]
