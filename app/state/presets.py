"""A person's own presets: named sets of values, kept in a file for every later start.

The file holds one object by name; each has the values, by key, that were not at their
defaults. Several workbenches may have it open: each changes what is in the file then, one at a
time, so that none undoes what another saved.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from app.errors import FULL, sentence
from app.state.edits import Edits
from app.state.snapshot import Presets
from app.state.workbench import Workbench
from tracker.files.lock import locked
from tracker.files.validated import set_aside, write_json
from tracker.parameters.catalogue import PRESETS
from tracker.parameters.presets import read_presets, stored_presets
from tracker.parameters.values import ParameterError, changed_values

YOURS = "The tab Parameters lists your presets."

LONGEST_NAME = 60
"""Characters."""


class OwnPresets:
    """Saves, renames and removes the presets of a workbench."""

    def __init__(self, workbench: Workbench, edits: Edits, path: Path | None) -> None:
        """Read what was saved before.

        Args:
            workbench: Shows them.
            edits: Where what is done with them can be undone.
            path: Their file; None keeps them for this start only.
        """
        self._workbench, self._edits = workbench, edits
        edits.own("presets", self._restore)
        self._path = path
        if path is not None:
            workbench.set_presets(self._read(path))

    def save(self, name: str) -> None:
        """Keep what differs from the defaults now under a name, instead of what had it before.

        Raises:
            ParameterError: If the name is empty, too long or a built-in preset's.
        """
        now = self._workbench.snapshot()
        self.keep(name, changed_values(now.parameters, now.defaults))

    def keep(self, name: str, values: Mapping[str, Any]) -> None:
        """Keep values, by key against the defaults, under a name.

        Raises:
            ParameterError: If the name is empty, too long or a built-in preset's.
        """
        name = _checked(name)
        self._change(f"preset {name} saved", lambda presets: {**presets, name: dict(values)})

    def rename(self, name: str, new: str) -> None:
        """Give a preset another name, which no other one may have.

        Raises:
            ParameterError: If there is no such preset, or the new name does not do.
        """
        new = _checked(new)

        def renamed(presets: Presets) -> Presets:
            _check_known(presets, name)
            if new != name and new in presets:
                raise ParameterError("name", f"expected a name that is free, got {new!r}", YOURS)
            return {new if key == name else key: values for key, values in presets.items()}

        self._change(f"preset {name} renamed {new}", renamed)

    def remove(self, name: str) -> None:
        """Forget a preset.

        Raises:
            ParameterError: If there is no such preset.
        """

        def removed(presets: Presets) -> Presets:
            _check_known(presets, name)
            return {key: values for key, values in presets.items() if key != name}

        self._change(f"preset {name} removed", removed)

    def _restore(self, values: Mapping[str, Mapping[str, Any] | None]) -> None:
        """Have some presets as they were once, and those that were not there no more."""

        def restored(presets: Presets) -> Presets:
            every = {**presets, **values}
            return {name: one for name, one in every.items() if one is not None}

        self._change("", restored)

    def _change(self, words: str, change: Callable[[Presets], Presets]) -> None:
        """Change what is saved: in the file as it is now, whoever wrote it last.

        Raises:
            ParameterError: If the file cannot be written; the presets are as they were.
        """
        before = self._workbench.snapshot().presets
        try:
            if self._path is None:
                presets = change(before)
            else:
                with locked(self._path):
                    before = self._read(self._path)
                    presets = change(before)
                    write_json(self._path, dict(presets))
        except OSError as error:
            if error.errno in FULL:
                raise  # the answer says so: it is not the name
            raise ParameterError(
                "name",
                f"your presets cannot be saved: {sentence(error)}",
                "See who may write there.",
            ) from None
        self._workbench.set_presets(presets)
        names = [name for name in {**before, **presets} if before.get(name) != presets.get(name)]
        old, new = ({name: one.get(name) for name in names} for one in (before, presets))
        self._edits.done(words, "presets", old, new)

    def _read(self, path: Path) -> Presets:
        """What the file has; a spoilt one is set aside, and what is known stays."""
        try:
            return read_presets(path)
        except FileNotFoundError:
            return self._workbench.snapshot().presets
        except (OSError, ValueError) as error:
            aside = set_aside(path)
            self._workbench.notify(
                "warn",
                f"Your presets cannot be read: {sentence(error)}.",
                f"The file was moved to {aside}; mend it there and move it back."
                if aside
                else f"{path} was left as it is.",
            )
            return self._workbench.snapshot().presets


def keep_preset(path: Path, name: str, values: Mapping[str, Any]) -> None:
    """Put a preset into the file without a workbench; the next start shows it.

    Raises:
        ParameterError: If the name does not do.
        ValueError: If the file cannot be read, or is not as it was written.
        OSError: If it cannot be written.
    """
    name = _checked(name)
    with locked(path):
        write_json(path, {**stored_presets(path), name: dict(values)})


def _checked(name: str) -> str:
    name = " ".join(name.split())
    if not 0 < len(name) <= LONGEST_NAME:
        raise ParameterError(
            "name", f"expected 1 to {LONGEST_NAME} characters, got {len(name)}", YOURS
        )
    if not name.isprintable():
        raise ParameterError("name", f"expected letters that can be seen, got {name!r}", YOURS)
    if name in PRESETS:
        raise ParameterError(
            "name", f"expected a name of your own: {name} is a built-in preset", YOURS
        )
    return name


def _check_known(presets: Presets, name: str) -> None:
    if name not in presets:
        known = ", ".join(presets) or "none is saved"
        raise ParameterError("name", f"expected one of your presets ({known}), got {name!r}", YOURS)
