"""Where what is written goes: beside its place until it is complete, then there at once."""

from __future__ import annotations

import os
import secrets
import shutil
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


def file_names(names: Sequence[str]) -> list[str]:
    """Names of cameras as names of files: each its own, none that leads into another folder."""
    found: list[str] = []
    for name in names:
        plain = "".join(c if c.isprintable() and c not in "/\\" else "-" for c in name)
        found.append(plain if plain not in found else f"{plain}-{len(found) + 1}")
    return found


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file to write, which takes its place when it is complete and never before.

    Args:
        path: Replaced if it is there.

    Raises:
        OSError: With a sentence, if it cannot be written; what was there still is.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a file to write, found a folder; add a name")
    _check_folder(path)
    path = path.resolve()  # a symbolic link stays, and what it names is replaced
    temporary = path.with_name(f".{secrets.token_hex(4)}.{path.name}")
    try:
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        raise OSError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


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
    temporary = folder.with_name(f".{secrets.token_hex(4)}.{folder.name}")
    try:
        temporary.mkdir()
        yield temporary
        if folder.is_dir():
            folder.rmdir()
        temporary.replace(folder)
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
