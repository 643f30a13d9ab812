"""The generator of rooms: scenes with exact truth, drawn by the project itself.

Three are the built-in sequences, which ``python -m tests.rooms ship`` makes, and the stage of
the experiments that must know who hides whom: :func:`render` writes an ordinary sequence folder.
Any number of others are drawn by a seed, with all that makes tracking hard:
:func:`render_random`.
"""

from __future__ import annotations

from tests.rooms.folder import read_visibility, render
from tests.rooms.random_rooms import choose, render_random
from tests.rooms.rooms import ROOMS, RoomSpec
from tests.rooms.writing import RenderCancelled

__all__ = [
    "ROOMS",
    "RenderCancelled",
    "RoomSpec",
    "choose",
    "read_visibility",
    "render",
    "render_random",
]
