"""Where imports are under way: begun by a page, from files it sends or a folder on the disk."""

from __future__ import annotations

import os
import secrets
import shutil
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from app.errors import sentence
from app.state.importing.draft import Draft, folder_name
from app.state.importing.uploads import Announced, UploadError
from app.state.workbench import Workbench
from tracker.files.folders import settings_folder
from tracker.sequences.reader import FILE, given_folder

MOST_DRAFTS = 4
"""Imports that are begun and neither written nor given up; the oldest makes room for another."""

FORGOTTEN_SECONDS = 86400.0
"""What an earlier start left half uploaded is removed after this time."""


class Desk:
    """Thread-safe owner of all drafts."""

    def __init__(self, workbench: Workbench, data: Path | None = None) -> None:
        """Nothing is written yet.

        Args:
            workbench: Shows how far imports are.
            data: Where recordings are; the person's own place where none is given or it can only
                be read.
        """
        self._workbench = workbench
        own = settings_folder() / "recordings"
        self.home = data.absolute() if data is not None and os.access(data, os.W_OK) else own
        self._data = data.absolute() if data is not None else self.home
        self._lock = threading.Lock()
        self._drafts: dict[str, Draft] = {}

    def begin(self, files: Sequence[Announced]) -> Draft:
        """An import of files that a page is going to send.

        Raises:
            UploadError: If one of them cannot be taken.
        """
        first = files[0].path.split("/")[0] if files else "recording"
        name = first if any("/" in file.path for file in files) else "recording"
        draft = self._new(name, None)
        try:
            draft.upload.announce(files)
        except UploadError:
            self.discard(draft.key)
            raise
        return draft

    def begin_from(self, path: str) -> Draft | Path:
        """An import of files on this machine; where they are a recording already, its folder.

        Args:
            path: A folder or file, in full or from the data folder on. Whoever may use the
                workbench may name any: the manual's page on security says why.

        Raises:
            UploadError: If it is not there.
        """
        try:
            given = given_folder(path)
            place = (self._data / given).resolve()
        except (ValueError, RuntimeError) as error:  # a null byte, no such person, a circle
            raise UploadError(sentence(error)) from None
        if place.name == FILE:
            place = place.parent
        if (place / FILE).is_file():
            return place
        if not place.exists():
            where = "" if given.is_absolute() else f" in {self._data}"
            raise UploadError(f"{path}: there is no such file or folder{where}")
        if not (place.is_dir() or place.is_file()):
            raise UploadError(f"{path}: expected a folder or a file, found neither; name one")
        return self._new(place.stem if place.is_file() else place.name, place)

    def folders(self) -> list[str]:
        """Folders below the data folder that are no recordings yet."""
        if not self._data.is_dir():
            return []
        return sorted(
            path.name
            for path in self._data.iterdir()
            # of the module, for a method fails at a folder that may not be read
            if path.is_dir() and not path.name.startswith(".") and not os.path.isfile(path / FILE)
        )

    def free(self) -> int:
        """Bytes on the disk of the recordings."""
        place = next(one for one in (self.home, *self.home.parents) if one.exists())
        return shutil.disk_usage(place).free

    def _new(self, name: str, source: Path | None) -> Draft:
        try:
            self.home.mkdir(parents=True, exist_ok=True)
            self._tidy()
            draft = Draft(
                secrets.token_hex(8),
                self.home,
                self._free_name(name),
                self._workbench.show_task,
                source,
            )
        except OSError as error:
            raise UploadError(
                f"{self.home}: cannot be written ({error.strerror}); start the workbench with "
                "--data and a folder that can"
            ) from None
        with self._lock:
            self._drafts[draft.key] = draft
            begun = ("writing", "copying")
            waiting = [key for key, d in self._drafts.items() if d.known.phase not in begun]
        for key in waiting[:-MOST_DRAFTS]:
            self.discard(key)
        return draft

    def _free_name(self, name: str) -> str:
        plain = folder_name(name)
        found, number = plain, 1
        while (self.home / found).exists():
            number += 1
            found = f"{plain}-{number}"
        return found

    def _tidy(self) -> None:
        """Without what an earlier start left here."""
        for path in self.home.glob(".import-*"):
            own = path.name.removeprefix(".import-") in self._drafts
            if not own and time.time() - path.stat().st_mtime > FORGOTTEN_SECONDS:
                shutil.rmtree(path, ignore_errors=True)

    def draft(self, key: str) -> Draft | None:
        """One that is under way."""
        return self._drafts.get(key)

    def discard(self, key: str) -> None:
        """Give one up; what was uploaded for it is removed."""
        with self._lock:
            draft = self._drafts.pop(key, None)
        if draft is not None:
            draft.discard()

    def close(self) -> None:
        """Give up all."""
        for key in list(self._drafts):
            self.discard(key)
