"""Where the page's files are."""

from __future__ import annotations

from pathlib import Path


def static_folder() -> Path:
    """The folder of the page: inside the package when installed, beside it in a checkout."""
    package = Path(__file__).resolve().parent
    inside = package / "static"
    return inside if inside.is_dir() else package.parent / "static"
