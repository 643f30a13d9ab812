"""The paths of the page's files and of the manual."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def static_folder() -> Path:
    """The folder of the page: inside the package when installed, beside it in a checkout."""
    inside = _PACKAGE / "static"
    return inside if inside.is_dir() else _PACKAGE.parent / "static"


def manual_folder() -> Path:
    """The folder of the built manual: inside the package, or where a checkout builds it."""
    inside = _PACKAGE / "manual"
    return inside if inside.is_dir() else _PACKAGE.parent / "build" / "manual"
