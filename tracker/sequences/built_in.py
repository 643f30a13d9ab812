"""The rooms that come with the program, and what names a recording in the user's own folders.

The files of a built-in sequence are part of the installed program and are never written to. What
a person adds to one, corrections or templates, lies in the user's settings under its name.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from tracker.files.folders import cache_folder

ROOMS = Path(__file__).resolve().parent / "rooms"
BUILT_IN = ("room24-2p", "room35-2p", "room44-3p")

EARLIER = (
    "made on the sequence as it was rendered before, which was longer: steps beyond its present "
    "end do not fit"
)
"""A remark about what lies in the user's settings from before the sequences came as files."""


def built_in_name(folder: Path) -> str | None:
    """The name of a built-in sequence by its folder; None for any other folder."""
    name = folder.name
    return name if name in BUILT_IN and folder.absolute() == ROOMS / name else None


def opens_by_name(folder: Path) -> bool:
    """Whether a folder is opened by its name: a built-in sequence, or a room in the cache."""
    return built_in_name(folder) is not None or folder.absolute().is_relative_to(cache_folder())


def cached_rooms() -> Path:
    """Where earlier versions of the program rendered rooms: two cameras or three, or by a seed."""
    return cache_folder() / "rooms" / "version-4"


def key_of(folder: Path) -> str:
    """The name of a recording's files in the user's settings.

    Args:
        folder: Of the recording.

    Returns:
        A built-in sequence's own name, which stays the same wherever the program is installed;
        a hash of the path of any other folder.
    """
    return built_in_name(folder) or _hash(folder)


def earlier_key(folder: Path) -> str | None:
    """The key of a built-in sequence while it was rendered into the cache; None for others."""
    name = built_in_name(folder)
    return None if name is None else _hash((cached_rooms() / f"{name}-2-cameras").resolve())


def _hash(folder: Path) -> str:
    return hashlib.sha256(str(folder.absolute()).encode()).hexdigest()[:16]
