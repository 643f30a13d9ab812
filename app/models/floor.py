"""The grid on the floor of the room, as each camera sees it."""

from __future__ import annotations

from app.models.base import Model

Line = list[tuple[float, float]]
"""Points one after the other, x and y in pixels of the camera's picture."""


class CameraFloor(Model):
    """In the picture of one camera, bent as its lens bends what is straight."""

    lines: list[Line]
    """Of the grid; what the camera does not see is left out."""
    edges: list[Line]
    """Of the room's floor."""


class Floor(Model):
    """Of the open sequence's room."""

    cell: float
    """Metres between two lines."""
    height: float
    """z of the floor, metres."""
    cameras: list[CameraFloor]
