"""Files that a page sends in pieces: what they may be called, how large they may be."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

MOST_BYTES = 64 << 30
"""Of all files of a recording together."""

MOST_FILES = 50_000
MOST_PARTS = 10
"""Folders within each other, the file's own name counted."""

LONGEST_PART = 200
SPARED_BYTES = 256 << 20
"""So much is left free on the disk."""

_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


class UploadError(ValueError):
    """A file cannot be taken; the message names it, expected, found, what to do."""


@dataclass(frozen=True, slots=True)
class Announced:
    """A file that is to come."""

    path: str
    """From the folder that was dropped, with slashes; or its name alone."""
    bytes: int


def safe_path(path: str) -> PurePosixPath:
    """A file's path inside the folder of its upload.

    Raises:
        UploadError: If it leads elsewhere, or is none that every file system takes.
    """
    shown = repr(path[:100])
    parts = path.split("/")
    if "\\" in path or ":" in path:
        raise UploadError(
            f"{shown}: expected a name without backslash and colon; rename the file and try again"
        )
    if any(ord(letter) < 32 or ord(letter) == 127 for letter in path):
        raise UploadError(f"{shown}: expected a name without control characters; rename the file")
    if path.startswith("/") or any(part in ("", ".", "..") for part in parts):
        raise UploadError(
            f"{shown}: expected a path inside the dropped folder, found one that leads elsewhere; "
            "drop the folder itself"
        )
    if len(parts) > MOST_PARTS:
        raise UploadError(
            f"{shown}: lies in more than {MOST_PARTS - 1} folders within each other; drop the "
            "folder of the recording itself"
        )
    for part in parts:
        if len(part.encode()) > LONGEST_PART:
            raise UploadError(
                f"{shown}: has a name of more than {LONGEST_PART} bytes; rename the file"
            )
        if _DEVICES.fullmatch(part) or part.endswith((" ", ".")):
            raise UploadError(f"{shown}: is a name that not every file system takes; rename it")
    return PurePosixPath(*parts)


class Upload:
    """A folder that is filled piece by piece. One thread at a time."""

    def __init__(self, folder: Path) -> None:
        """Begin.

        Args:
            folder: New; the files go below it.
        """
        self.folder = folder
        self._files: list[Announced] = []
        self._paths: list[Path] = []
        self._received: list[int] = []

    @property
    def size(self) -> int:
        """All files that were announced."""
        return sum(file.bytes for file in self._files)

    @property
    def received(self) -> int:
        """Bytes that are here."""
        return sum(self._received)

    @property
    def complete(self) -> bool:
        """Whether all announced files are here."""
        return self.received == self.size

    @property
    def files(self) -> int:
        """How many were announced."""
        return len(self._files)

    def names(self, most: int) -> list[str]:
        """Of the announced files, the first so many."""
        return [file.path for file in self._files[:most]]

    def announce(self, files: Sequence[Announced]) -> int:
        """More files are to come; the number of the first of them.

        Raises:
            UploadError: If one cannot be taken, or all together have no room; none is then.
        """
        first, known = len(self._files), {path for path in self._paths}
        paths: list[Path] = []
        for file in files:
            path = self.folder / safe_path(file.path)
            if path in known:
                raise UploadError(f"{file.path!r}: is among the files already; rename one")
            known.add(path)
            paths.append(path)
        if len(known) > MOST_FILES:
            raise UploadError(
                f"expected at most {MOST_FILES:,} files, found {len(known):,}: open the folder "
                "by its path"
            )
        self._check_room(sum(file.bytes for file in files))
        made: list[Path] = []
        for path, file in zip(paths, files, strict=True):
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.touch(exist_ok=False)
                made.append(path)
            except OSError as error:  # a file where another one needs a folder
                for other in made:
                    other.unlink(missing_ok=True)
                raise UploadError(f"{file.path!r}: cannot be written ({error.strerror})") from None
        self._files += files
        self._paths += paths
        self._received += [0] * len(files)
        return first

    def _check_room(self, more: int) -> None:
        if self.size + more > MOST_BYTES:
            raise UploadError(
                f"expected at most {MOST_BYTES >> 30} GB, found {(self.size + more) / 2**30:.1f}: "
                "open the folder by its path"
            )
        left = self.size - self.received
        free = shutil.disk_usage(self.folder.parent).free - SPARED_BYTES
        if left + more > free:
            raise UploadError(
                f"{self.folder.parent} has room for {max(0, free) / 2**30:.1f} GB, the files need "
                f"{(left + more) / 2**30:.1f}; make room, or open a folder by its path"
            )

    def receive(self, number: int, offset: int, data: bytes) -> None:
        """The next piece of a file.

        Raises:
            UploadError: If there is no such file, or the piece is not the next one.
        """
        if not 0 <= number < len(self._files):
            raise UploadError(f"expected a file that was announced, found number {number}")
        file, here = self._files[number], self._received[number]
        if offset != here:
            raise UploadError(
                f"{file.path}: expected the piece from byte {here} on, found one from {offset}"
            )
        if offset + len(data) > file.bytes:
            raise UploadError(
                f"{file.path}: expected {file.bytes:,} bytes as announced, found more; it was "
                "changed meanwhile: drop it again"
            )
        # by its place: of a piece that the disk had no room for, a part may be there already
        with self._paths[number].open("r+b") as stream:
            stream.seek(offset)
            stream.write(data)
        self._received[number] += len(data)
