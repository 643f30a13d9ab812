"""The rendered rooms: three scenes with exact truth, drawn by the project itself.

They are the sequences of a first start, and the stage of the experiments that
must know who hides whom. :func:`render` writes an ordinary sequence folder.
"""

from __future__ import annotations

from tracker.sequences.rendering.folder import (
    VERSION,
    RenderCancelled,
    read_visibility,
    render,
)
from tracker.sequences.rendering.rooms import ROOMS, RoomSpec

__all__ = ["ROOMS", "VERSION", "RenderCancelled", "RoomSpec", "read_visibility", "render"]
