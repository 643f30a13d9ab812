"""A person's own presets: named sets of values, kept in a file for every later start.

The file holds one object by name; each has the values, by key, that were not at their
defaults. It is written atomically.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.state.kept.json_files import write_json
from app.state.snapshot import Presets
from app.state.workbench import Workbench
from tracker import parameters as table
from tracker.parameters import ParameterError

YOURS = "GET /api/state lists your presets."

LONGEST_NAME = 60
"""Characters."""


class OwnPresets:
    """Saves, renames and removes the presets of a workbench."""

    def __init__(self, workbench: Workbench, path: Path | None) -> None:
        """Read what was saved before.

        Args:
            workbench: Shows them.
            path: Their file; None keeps them for this start only.
        """
        self._workbench = workbench
        self._path = path
        if path is not None and path.is_file():
            try:
                workbench.set_presets(_read(path))
            except (OSError, ValueError) as error:
                aside = path.with_suffix(".unreadable.json")
                path.replace(aside)
                workbench.notify(
                    "warn",
                    f"Your presets cannot be read: {error}.",
                    f"The file was moved to {aside}; mend it there and move it back.",
                )

    def save(self, name: str) -> None:
        """Keep what differs from the defaults now under a name, instead of what had it before.

        Raises:
            ParameterError: If the name is empty, too long or a built-in preset's.
        """
        now = self._workbench.snapshot()
        self.keep(name, table.changed(now.parameters, now.defaults))

    def keep(self, name: str, values: Mapping[str, Any]) -> None:
        """Keep values, by key against the defaults, under a name.

        Raises:
            ParameterError: If the name is empty, too long or a built-in preset's.
        """
        self._put({**self._workbench.snapshot().presets, _checked(name): values})

    def rename(self, name: str, new: str) -> None:
        """Give a preset another name, which no other one may have.

        Raises:
            ParameterError: If there is no such preset, or the new name does not do.
        """
        presets = self._known(name)
        new = _checked(new)
        if new != name and new in presets:
            raise ParameterError("name", f"expected a name that is free, got {new!r}", YOURS)
        self._put({new if key == name else key: values for key, values in presets.items()})

    def remove(self, name: str) -> None:
        """Forget a preset.

        Raises:
            ParameterError: If there is no such preset.
        """
        self._put({key: values for key, values in self._known(name).items() if key != name})

    def _known(self, name: str) -> Presets:
        presets = self._workbench.snapshot().presets
        if name not in presets:
            known = ", ".join(presets) or "none is saved"
            raise ParameterError(
                "name", f"expected one of your presets ({known}), got {name!r}", YOURS
            )
        return presets

    def _put(self, presets: Presets) -> None:
        if self._path is not None:
            write_json(self._path, dict(presets))
        self._workbench.set_presets(presets)


def keep_preset(path: Path, name: str, values: Mapping[str, Any]) -> None:
    """Put a preset into the file without a workbench; the next start shows it.

    Raises:
        ParameterError: If the name does not do.
        ValueError: If the file is not as it was written.
        OSError: If it cannot be written.
    """
    presets = _read(path) if path.is_file() else {}
    write_json(path, {**presets, _checked(name): dict(values)})


def _checked(name: str) -> str:
    name = " ".join(name.split())
    if not 0 < len(name) <= LONGEST_NAME:
        raise ParameterError(
            "name", f"expected 1 to {LONGEST_NAME} characters, got {len(name)}", YOURS
        )
    if not name.isprintable():
        raise ParameterError("name", f"expected letters that can be seen, got {name!r}", YOURS)
    if name in table.PRESETS:
        raise ParameterError(
            "name", f"expected a name of your own: {name} is a built-in preset", YOURS
        )
    return name


def _read(path: Path) -> dict[str, Mapping[str, Any]]:
    found = json.loads(path.read_text(encoding="utf-8"))
    if not isinstance(found, dict) or not all(isinstance(v, dict) for v in found.values()):
        raise ValueError(f"{path.name}: expected an object of values for each name")
    return found
