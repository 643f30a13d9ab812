"""Atomic writing: a file or folder is written beside its place and renamed once it is complete."""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import secrets
import shutil
import stat
import time
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


def file_names(names: Sequence[str]) -> list[str]:
    """Convert camera names to distinct file names, none of which leads into another folder."""
    found: list[str] = []
    for name in names:
        plain = "".join(c if c.isprintable() and c not in "/\\" else "-" for c in name)
        found.append(plain if plain not in found else f"{plain}-{len(found) + 1}")
    return found


_BEGUN = "part"
"""The part of a temporary file's name by which it is recognised."""

_LONGEST = 200
"""Most bytes of a name that are repeated in the name of its temporary file: with what stands before
them they are within the 255 bytes that file systems allow (NAME_MAX of Linux and macOS)."""

ABANDONED_SECONDS = 3600.0
"""Time without a write after which a temporary file counts as left by a dead process, seconds. A
write takes seconds; a process that was suspended for longer finds its file gone and fails."""


@contextmanager
def replacing(path: Path, *, transient: bool = False) -> Iterator[Path]:
    """Yield a temporary file that replaces a file when the block ends without an exception.

    A pipe or device is yielded itself: it has no content that could be replaced.

    Args:
        path: The file to write; an existing one is replaced.
        transient: Whether the file is written again soon, so that it may be lost when the machine
            loses power: it is then not forced to disk.

    Raises:
        OSError: If the file cannot be written; the message names the file and the reason, and an
            existing file is unchanged.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a file to write, found a folder; add a name")
    if path.exists() and not path.is_file():
        yield path
        return
    _check_folder(path)
    path = path.resolve()  # a symbolic link stays, and what it names is replaced
    sweep(path.parent, path.name)
    temporary = beside(path)
    try:
        yield temporary
        if not transient:
            sync_file(temporary)
        temporary.replace(path)
        if not transient:
            sync_folder(path.parent)
    except OSError as error:
        raise OSError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(path: Path, data: bytes) -> None:
    """Replace the content of a file atomically.

    Raises:
        OSError: If the file cannot be written; the message names the file and the reason.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def size_of(path: Path) -> int:
    """Return the size of a regular file, bytes.

    Raises:
        OSError: If there is no such file, or it is a pipe (on which reading blocks) or a device
            (which has no end).
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode):
        raise OSError(errno.EINVAL, "expected a file, found a folder, pipe or device")
    return there.st_size


def sync_file(path: Path) -> None:
    """Force the content of a file to disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Force the entries of a folder to disk, where the system lets folders be opened."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # some file systems cannot sync a folder
            os.fsync(handle)
    finally:
        os.close(handle)


def sweep(folder: Path, name: str) -> None:
    """Remove the temporary files and folders that dead processes left for a name in a folder."""
    with contextlib.suppress(OSError):
        now = time.time()
        for path in folder.glob(f".*.{_BEGUN}.{glob.escape(_end_of(name))}"):
            with contextlib.suppress(OSError):
                if abs(now - path.lstat().st_mtime) < ABANDONED_SECONDS:
                    continue
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink()


def beside(path: Path) -> Path:
    """Return the path of a new temporary file in the same folder, with a name of valid length."""
    return path.with_name(f".{secrets.token_hex(4)}.{_BEGUN}.{_end_of(path.name)}")


def _end_of(name: str) -> str:
    """Return the end of a name, of at most :data:`_LONGEST` bytes."""
    while len(os.fsencode(name)) > _LONGEST:
        name = name[1:]
    return name


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder that is renamed when the block ends without an exception.

    Args:
        folder: The folder to make. If it exists it must be empty, so that the new files are not
            mixed with others.

    Raises:
        OSError: If the folder cannot be written; the message names the folder and the reason.
    """
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise FileExistsError(
            f"{folder}: expected a new folder, found one with files; name another"
        )
    _check_folder(folder)
    folder = folder.resolve()
    sweep(folder.parent, folder.name)
    temporary = beside(folder)
    try:
        temporary.mkdir()
        yield temporary
        for inside in sorted(temporary.rglob("*")):
            if inside.is_dir():
                sync_folder(inside)
            elif inside.is_file():
                sync_file(inside)
        sync_folder(temporary)
        if folder.is_dir():
            folder.rmdir()
        temporary.replace(folder)
        sync_folder(folder.parent)
    except OSError as error:
        raise OSError(f"{folder}: cannot be written ({error.strerror or error})") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def zip_folder(folder: Path, archive: Path) -> None:
    """Write all files below a folder into one ZIP file, in the order of their names."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in sorted(path for path in folder.rglob("*") if path.is_file()):
            packed.write(file, file.relative_to(folder).as_posix())


def _check_folder(path: Path) -> None:
    if not path.absolute().parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent} to write it to")
