"""Where the program keeps what it can make again, and what a person has set."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """``$MULTIVIEW_PHD_CACHE``, else the platform's place for caches.

    Rendered rooms, finished columns of runs and compiled kernels live there, each in a
    folder of its own; all of it may be deleted at any time.
    """
    own = os.environ.get("MULTIVIEW_PHD_CACHE")
    if own:
        return Path(own).expanduser().absolute()
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    else:
        given = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = given if given.is_absolute() else Path.home() / ".cache"
    return base / "multiview-phd"


def settings_folder() -> Path:
    """``$MULTIVIEW_PHD_SETTINGS``, else the platform's place for what a person has set.

    Unlike the caches, nothing in it can be made again.
    """
    own = os.environ.get("MULTIVIEW_PHD_SETTINGS")
    if own:
        return Path(own).expanduser().absolute()
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support"
    elif sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or Path.home() / "AppData" / "Roaming")
    else:
        given = Path(os.environ.get("XDG_CONFIG_HOME", ""))
        base = given if given.is_absolute() else Path.home() / ".config"
    return base / "multiview-phd"


def library_file() -> Path:
    """``$MULTIVIEW_PHD_LIBRARY``, else ``library.sqlite3`` in the platform's place for data."""
    own = os.environ.get("MULTIVIEW_PHD_LIBRARY")
    if own:
        return Path(own).expanduser().absolute()
    return platformdirs.user_data_path("multiview-phd", appauthor=False) / "library.sqlite3"
