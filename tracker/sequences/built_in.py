"""The built-in recordings, and the names of a recording's files in the user's settings.

The files of a built-in recording are part of the installed program and are never written to.
Corrections and templates that a user adds to one are stored in the user's settings under its name.
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
"""The remark on files in the user's settings that were made for the longer recordings of earlier
versions, which were rendered by the program."""


def built_in_name(folder: Path) -> str | None:
    """Return the name of a built-in recording by its folder; None for any other folder."""
    name = folder.name
    return name if name in BUILT_IN and folder.absolute() == ROOMS / name else None


def opens_by_name(folder: Path) -> bool:
    """Whether a folder is opened by its name: a built-in recording, or a rendered one in the
    cache."""
    return built_in_name(folder) is not None or folder.absolute().is_relative_to(cache_folder())


def place_of(folder: Path) -> str:
    """Return what opens a recording again, wherever the program is started: its name or folder."""
    return folder.name if opens_by_name(folder) else str(folder.absolute())


def cached_rooms() -> Path:
    """Return the folder into which earlier versions of the program rendered recordings."""
    return cache_folder() / "rooms" / "version-4"


def key_of(folder: Path) -> str:
    """Return the name of a recording's files in the user's settings.

    Args:
        folder: The folder of the recording.

    Returns:
        The name of a built-in recording, which does not depend on where the program is installed,
        or a hash of the path of any other folder.
    """
    return built_in_name(folder) or _hash(folder)


def earlier_key(folder: Path) -> str | None:
    """Return the key that a built-in recording had in earlier versions, which rendered it into the
    cache; None for other folders."""
    name = built_in_name(folder)
    return None if name is None else _hash((cached_rooms() / f"{name}-2-cameras").resolve())


def _hash(folder: Path) -> str:
    return hashlib.sha256(str(folder.absolute()).encode()).hexdigest()[:16]
