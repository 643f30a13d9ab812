"""Pictures of an import brought into its folder: as they lie there, linked, or copied."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from tracker.files.atomic import replacing

PIECE = 1 << 22
"""Bytes that are copied at once."""

Told = Callable[[int], None]
"""Called with how many more bytes are copied; what it raises ends the copying."""


def free_place(path: Path) -> Path:
    """A path at which there is nothing yet: this one, or with a number after its name. A folder
    that is imported into itself keeps its own files."""
    number, found = 2, path
    while found.exists() or found.is_symlink():
        number, found = number + 1, path.with_name(f"{path.stem}-{number}{path.suffix}")
    return found


def bring(path: Path, folder: Path, name: str, copy: bool, told: Told) -> tuple[str, bool]:
    """A file in the folder: where it lies if it is inside, else a link to it, or a copy.

    Args:
        path: The file.
        folder: Of the recording.
        name: What it is called there, without its suffix.
        copy: Copy it, also where it could be linked.
        told: Of what is copied.

    Returns:
        Its path inside the folder; and whether it had to be copied where a link was wanted:
        another file system, or one without links.
    """
    real, home = path.resolve(), folder.resolve()
    if real.is_relative_to(home):
        return real.relative_to(home).as_posix(), False
    target = free_place(folder / f"{name}{path.suffix.lower()}")
    linked = _place(real, target, copy, told)
    return target.name, not copy and not linked


def bring_images(
    files: Sequence[Path], folder: Path, name: str, copy: bool, told: Told
) -> tuple[str, bool]:
    """Pictures under numbers that sort as they follow each other; as :func:`bring`."""
    own = free_place(folder / name)
    own.mkdir()
    width = len(str(len(files)))
    linked = [
        _place(path.resolve(), own / f"{number:0{width}}{path.suffix.lower()}", copy, told)
        for number, path in enumerate(files)
        if path.exists()  # one missing in the row of their numbers stays missing
    ]
    return f"{own.name}/*{files[0].suffix.lower()}", not copy and not all(linked)


def _place(real: Path, target: Path, copy: bool, told: Told) -> bool:
    """Whether it is a link."""
    if not copy:
        try:
            os.link(real, target)
            return True
        except OSError:
            pass
    _copy(real, target, told)
    return False


def _copy(source: Path, target: Path, told: Told) -> None:
    """A copy with the times of the original, so that what is known of its content stays so."""
    with source.open("rb") as reading, target.open("wb") as writing:
        while piece := reading.read(PIECE):
            writing.write(piece)
            told(len(piece))
    shutil.copystat(source, target)


def links_in(folder: Path) -> dict[Path, int]:
    """The files of a folder that are second names of others, with their bytes."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink():
            known = path.stat()
            if known.st_nlink > 1:
                found[path] = known.st_size
    return found


def copy_links(folder: Path, told: Told) -> None:
    """Make a file of its own of every link in a folder; whoever reads one goes on undisturbed.

    Args:
        folder: Of a recording.
        told: Of what is copied; files that are not copied yet stay links where it raises.

    Raises:
        OSError: If one cannot be copied.
    """
    for path in links_in(folder):
        with replacing(path) as temporary:
            _copy(path, temporary, told)
