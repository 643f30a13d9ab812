"""Presets: named sets of values, built in or the user's own, by whose name values are chosen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tracker.files.folders import settings_folder
from tracker.files.text import shown
from tracker.files.validated import read_as
from tracker.parameters.catalogue import PRESETS, REMOVED
from tracker.parameters.values import with_current_keys

_KIND = dict[str, dict[str, Any]]


def presets_file() -> Path:
    """Return the file with the user's own presets."""
    return settings_folder() / "presets.json"


def read_presets(path: Path) -> dict[str, dict[str, Any]]:
    """Return the presets of a file by name, with their values by the keys of now.

    Values of parameters that no longer exist are included, so that whoever chooses the preset
    learns of them.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is invalid; the message names the field.
    """
    return {
        name: with_current_keys(values) | {k: v for k, v in values.items() if k in REMOVED}
        for name, values in read_as(path, _KIND).items()
    }


def stored_presets(path: Path) -> dict[str, dict[str, Any]]:
    """Return the presets of a file by name; none if it does not exist.

    Raises:
        ValueError: If the file cannot be read or is invalid; the message names it.
    """
    try:
        return read_presets(path)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def preset_values(name: str) -> dict[str, Any]:
    """Return the values of a preset, a built-in one or one of the user's own, by key.

    Raises:
        ValueError: If there is no such preset, or the user's own cannot be read.
    """
    if name in PRESETS:
        return dict(PRESETS[name])
    own = stored_presets(presets_file())
    if name not in own:
        raise ValueError(f"expected one of {', '.join((*PRESETS, *own))}, found {shown(name)}")
    return own[name]
