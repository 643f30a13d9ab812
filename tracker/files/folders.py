"""The user's folders: caches, data and settings, and the search for files in a folder."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import platformdirs

CACHE_BYTES = 2 << 30
"""Disk space for results of finished stages where no other is set, bytes. Measured was stage 1 of
``room44-3p`` by colour: 4.7 kB a step and camera, which makes 0.4 GB an hour at 25 fps."""

MOST_GB = 65536
"""Largest limit of memory or disk space that can be set, GB."""


def home() -> Path:
    """Return the home folder; where there is none, as in some containers and services, a private
    folder among the temporary files."""
    try:
        return Path.home()
    except RuntimeError:
        return _instead()


@cache
def _instead() -> Path:
    """Return a folder among the temporary files that no other user can read or write."""
    place = Path(tempfile.gettempdir()) / f"multiview-phd-{os.getuid()}"
    with contextlib.suppress(OSError):
        place.mkdir(mode=0o700)
    with contextlib.suppress(OSError):
        found = place.lstat()
        # another user may have made the folder, or have put a link in its place
        if stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o77:
            return place
    return Path(tempfile.mkdtemp(prefix="multiview-phd-"))


def _from_environment(variable: str) -> Path | None:
    """The folder or file that a variable of the environment names."""
    own = os.environ.get(variable)
    return Path(own).expanduser().absolute() if own else None


def _of_platform(place: Callable[..., Path], otherwise: str) -> Path:
    """One of the platform's folders of this program, or a folder of home where there is none."""
    try:
        found = place("multiview-phd", appauthor=False)
    except RuntimeError:  # there is no home
        found = Path("~")
    return found if found.is_absolute() else home() / otherwise


def data_folder() -> Path:
    """Return the platform's folder for user data."""
    return _of_platform(platformdirs.user_data_path, "multiview-phd")


def cache_folder() -> Path:
    """Return ``$MULTIVIEW_PHD_CACHE``, else the platform's folder for caches.

    Rendered recordings, results of finished stages and compiled kernels each have a folder in it.
    All of it can be computed again and may be deleted at any time.
    """
    usual = _of_platform(platformdirs.user_cache_path, ".cache/multiview-phd")
    return _from_environment("MULTIVIEW_PHD_CACHE") or usual


def cache_bytes() -> int:
    """Return ``$MULTIVIEW_PHD_CACHE_GB`` in bytes, else :data:`CACHE_BYTES`.

    Raises:
        ValueError: If the variable is no number of GB from 0 to 65,536.
    """
    text = os.environ.get("MULTIVIEW_PHD_CACHE_GB")
    if not text:
        return CACHE_BYTES
    try:
        size = float(text)
    except ValueError:
        size = -1.0
    if not 0.0 <= size <= MOST_GB:
        raise ValueError(f"MULTIVIEW_PHD_CACHE_GB: expected 0 to {MOST_GB} GB, got {text!r}")
    return int(size * 2**30)


def settings_folder() -> Path:
    """Return ``$MULTIVIEW_PHD_SETTINGS``, else the platform's folder for user settings.

    Unlike the caches, the settings cannot be computed again.
    """
    usual = _of_platform(
        partial(platformdirs.user_config_path, roaming=True), ".config/multiview-phd"
    )
    return _from_environment("MULTIVIEW_PHD_SETTINGS") or usual


def library_file() -> Path:
    """Return ``$MULTIVIEW_PHD_LIBRARY``, else ``library.sqlite3`` in :func:`data_folder`."""
    return _from_environment("MULTIVIEW_PHD_LIBRARY") or data_folder() / "library.sqlite3"


def detectors_folder() -> Path:
    """Return ``$MULTIVIEW_PHD_DETECTORS``, else ``detectors`` in :func:`data_folder`."""
    return _from_environment("MULTIVIEW_PHD_DETECTORS") or data_folder() / "detectors"


def files_matching(folder: Path, pattern: str) -> list[Path]:
    """Return the files below a folder that match a glob pattern, sorted.

    Args:
        folder: The folder to search.
        pattern: A pattern of paths relative to the folder, for instance ``videos/*.mp4``.

    Raises:
        ValueError: If the pattern is not one of paths below a folder; the message is the reason.
    """
    if not Path(pattern).parts:  # "." is the folder itself and no pattern
        raise ValueError("it names no file")
    try:
        return sorted(path for path in folder.glob(pattern) if path.is_file())
    except NotImplementedError as error:
        raise ValueError(str(error)) from None
