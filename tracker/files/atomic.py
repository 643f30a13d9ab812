"""Where what is written goes: beside its place until it is complete, then there at once."""

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
from types import ModuleType

fcntl: ModuleType | None
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None


def file_names(names: Sequence[str]) -> list[str]:
    """Names of cameras as names of files: each its own, none that leads into another folder."""
    found: list[str] = []
    for name in names:
        plain = "".join(c if c.isprintable() and c not in "/\\" else "-" for c in name)
        found.append(plain if plain not in found else f"{plain}-{len(found) + 1}")
    return found


_BEGUN = "part"
_LONGEST = 200
"""Characters of a name that go into the name of what is to take its place."""

ABANDONED_SECONDS = 3600.0
"""A file that was begun and not written to for so many seconds was left by a process that died."""


@contextmanager
def replacing(path: Path, *, passing: bool = False) -> Iterator[Path]:
    """A file to write, which takes its place when it is complete and never before.

    Args:
        path: Replaced if it is there.
        passing: Whether it is soon written anew, so that a machine that loses its power may lose
            it: then nobody waits for the disk.

    Raises:
        OSError: With a sentence, if it cannot be written; what was there still is.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a file to write, found a folder; add a name")
    _check_folder(path)
    path = path.resolve()  # a symbolic link stays, and what it names is replaced
    sweep(path.parent, path.name)
    temporary = beside(path)
    try:
        yield temporary
        if not passing:
            sync_file(temporary)
        temporary.replace(path)
        if not passing:
            sync_folder(path.parent)
    except OSError as error:
        raise OSError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(path: Path, data: bytes) -> None:
    """Have a file hold this: all of it or, whatever happens, what it held before.

    Raises:
        OSError: With a sentence, if it cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def size_of(path: Path) -> int:
    """The bytes of an ordinary file.

    Raises:
        OSError: If there is none: whoever reads a pipe waits, and a device has no end.
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode):
        raise OSError(errno.EINVAL, "it is a folder, pipe or device")
    return there.st_size


def sync_file(path: Path) -> None:
    """Have the disk hold what was written into a file."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Have the disk hold the names in a folder, where the system lets folders be opened."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # some file systems know no such thing
            os.fsync(handle)
    finally:
        os.close(handle)


def sweep(folder: Path, name: str) -> None:
    """Remove what processes that died began to write under this name, or in a folder of it."""
    with contextlib.suppress(OSError):
        now = time.time()
        for path in folder.glob(f".*.{_BEGUN}.{glob.escape(name[-_LONGEST:])}"):
            with contextlib.suppress(OSError):
                if abs(now - path.lstat().st_mtime) < ABANDONED_SECONDS:
                    continue
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink()


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Only one process at a time does what is done within it, for a file that several change.

    The lock is of a file beside it, which stays. Where the system has no locks there is none.

    Raises:
        OSError: If there is no place for it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_name(f".{path.name}.lock").open("ab") as file:
        if fcntl is not None:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX)
        yield


def beside(path: Path) -> Path:
    """A name for what is to take a place, in the same folder; of a length that fits."""
    return path.with_name(f".{secrets.token_hex(4)}.{_BEGUN}.{path.name[-_LONGEST:]}")


@contextmanager
def filling(folder: Path) -> Iterator[Path]:
    """A folder to fill, which takes its place when it is complete and never before.

    Args:
        folder: It must not be there, or be empty: nobody's files are mixed with ours.

    Raises:
        OSError: With a sentence, if it cannot be written.
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
