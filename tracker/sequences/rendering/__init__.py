"""The rendered rooms: scenes with exact truth, drawn by the project itself.

Three are the sequences of a first start, and the stage of the experiments that
must know who hides whom: :func:`render` writes an ordinary sequence folder. Any
number of others are drawn by a seed, with all that makes tracking hard:
:func:`render_random`.
"""

from __future__ import annotations

from tracker.sequences.rendering.folder import VERSION, read_visibility, render
from tracker.sequences.rendering.random_rooms import choose, render_random
from tracker.sequences.rendering.rooms import ROOMS, RoomSpec
from tracker.sequences.rendering.writing import RenderCancelled

__all__ = [
    "ROOMS",
    "VERSION",
    "RenderCancelled",
    "RoomSpec",
    "choose",
    "read_visibility",
    "render",
    "render_random",
]
