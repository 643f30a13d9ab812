"""What can be done to a file of any kind: by bad luck, by other programs, by malice.

The table has a sentence for each of :data:`OF_A_FILE` and each kind of file; random cases draw
from these too.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from random import Random

MOST_BYTES = 8 * 2**20
"""A file that has grown beyond that is not read here: it would take longer than its case."""

Change = Callable[[Path, float, int], object]
"""Changes a file at a place, 0 … 1 of its length, with one of the values that can be put there."""


def instead(make: Callable[[Path, int], object]) -> Change:
    """Something else where the file was."""

    def changed(path: Path, place: float, what: int) -> None:
        path.unlink()
        make(path, what)

    return changed


def random_bytes(count: int | None) -> Change:
    """Random bytes: one bit of one, some, or (None) all of them."""

    def changed(path: Path, place: float, what: int) -> None:
        size = path.stat().st_size
        if size > MOST_BYTES:
            return
        data, source = bytearray(path.read_bytes()), Random(what)
        at = 0 if count is None else int(place * size)
        for k in range(at, size if count is None else min(size, at + 1 + what % count)):
            data[k] = data[k] ^ (1 << what % 8) if count == 1 else source.randrange(256)
        path.write_bytes(data)

    return changed


def grow(path: Path, size: int) -> None:
    with path.open("r+b") as file:  # no room on the disk
        file.truncate(size)


def _not_utf_8(path: Path, place: float, what: int) -> None:
    if path.stat().st_size > MOST_BYTES:  # another damage has grown it
        return
    data = path.read_bytes()
    at = data.index(b"\n") + 1 if b"\n" in data else 0
    path.write_bytes(data[:at] + b"\xff\xfe" + data[at:])


OUTSIDE = ("/etc/passwd", "/dev/zero", "/", "/nowhere")

OF_A_FILE: dict[str, Change] = {
    "missing": lambda path, place, what: path.unlink(),
    "empty": lambda path, place, what: path.write_bytes(b""),
    "cut off": lambda path, place, what: os.truncate(path, int(place * path.stat().st_size)),
    "garbage": random_bytes(None),
    "not UTF-8": _not_utf_8,
    "folder": instead(lambda path, what: path.mkdir()),
    "pipe": instead(lambda path, what: os.mkfifo(path)),
    "link out": instead(lambda path, what: path.symlink_to(OUTSIDE[what % len(OUTSIDE)])),
    "link to itself": instead(lambda path, what: path.symlink_to(path)),
    "too large": lambda path, place, what: grow(path, 3 * 2**30),
}
"""What can be done to a file of any kind; the table has a sentence for each."""
