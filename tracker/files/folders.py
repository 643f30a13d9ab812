"""Where the program keeps what it can make again, and what a person has set."""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import tempfile
from functools import cache
from pathlib import Path

import platformdirs


def home() -> Path:
    """The person's folder; where the system knows of none, as in some containers and services, one
    among the temporary files that nobody else can open."""
    try:
        return Path.home()
    except RuntimeError:
        return _instead()


@cache
def _instead() -> Path:
    place = Path(tempfile.gettempdir()) / f"multiview-phd-{os.getuid()}"
    with contextlib.suppress(OSError):
        place.mkdir(mode=0o700)
    with contextlib.suppress(OSError):
        found = place.lstat()
        # somebody else may have made it, or have put a link there
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o77:
            return place
    return Path(tempfile.mkdtemp(prefix="multiview-phd-"))


def data_folder() -> Path:
    """The platform's place for what a person keeps."""
    try:
        found = platformdirs.user_data_path("multiview-phd", appauthor=False)
    except RuntimeError:  # there is no home
        found = Path("~")
    return found if found.is_absolute() else home() / "multiview-phd"


def cache_folder() -> Path:
    """``$MULTIVIEW_PHD_CACHE``, else the platform's place for caches.

    Rendered rooms, finished columns of runs and compiled kernels live there, each in a
    folder of its own; all of it may be deleted at any time.
    """
    own = os.environ.get("MULTIVIEW_PHD_CACHE")
    if own:
        return Path(own).expanduser().absolute()
    if sys.platform == "darwin":
        base = home() / "Library" / "Caches"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home() / "AppData" / "Local")
    else:
        given = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = given if given.is_absolute() else home() / ".cache"
    return base / "multiview-phd"


def settings_folder() -> Path:
    """``$MULTIVIEW_PHD_SETTINGS``, else the platform's place for what a person has set.

    Unlike the caches, nothing in it can be made again.
    """
    own = os.environ.get("MULTIVIEW_PHD_SETTINGS")
    if own:
        return Path(own).expanduser().absolute()
    if sys.platform == "darwin":
        base = home() / "Library" / "Application Support"
    elif sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or home() / "AppData" / "Roaming")
    else:
        given = Path(os.environ.get("XDG_CONFIG_HOME", ""))
        base = given if given.is_absolute() else home() / ".config"
    return base / "multiview-phd"


def library_file() -> Path:
    """``$MULTIVIEW_PHD_LIBRARY``, else ``library.sqlite3`` in the platform's place for data."""
    own = os.environ.get("MULTIVIEW_PHD_LIBRARY")
    if own:
        return Path(own).expanduser().absolute()
    return data_folder() / "library.sqlite3"


def files_matching(folder: Path, pattern: str) -> list[Path]:
    """The files below a folder whose path in it is as a pattern says, sorted.

    Raises:
        ValueError: With the reason, if it is no pattern of paths below a folder.
    """
    if not Path(pattern).parts:  # "." names the folder itself, for which `glob` has no word
        raise ValueError("it names no file")
    try:
        return sorted(path for path in folder.glob(pattern) if path.is_file())
    except NotImplementedError as error:
        raise ValueError(str(error)) from None
