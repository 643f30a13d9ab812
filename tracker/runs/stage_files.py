"""Finished results of stage 1 on disk, of which the least recently used are deleted first.

A file is an uncompressed NumPy archive: every array carries a checksum and its index
stands at the end, so that a file that a crash truncated or a disk damaged is recognised when it
is read. A file is written beside its place and renamed when it is complete; of two
processes that write the same one the later wins, and both write the same.

The results of all steps of a camera are packed into a few long arrays, a column for each field.
:func:`pack` and :func:`unpack` read the fields from the dataclass, so that a new field needs no
change here.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import logging
import os
import tempfile
import time
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from jaxtyping import AbstractArray
from numpy import ndarray
from numpy.lib.npyio import NpzFile
from pydantic import TypeAdapter

from tracker.files.atomic import sync_folder
from tracker.single_view.protocol import ViewResult

Value = TypeVar("Value")

logger = logging.getLogger(__name__)

FORMAT = 1
"""Version of the files; those of other versions are not read."""

LIMIT_BYTES = 2 << 30
"""Disk space of all files together, bytes."""

ABANDONED_SECONDS = 3600.0
"""Time without a write after which a temporary file counts as left by a dead process, seconds."""

_UNREADABLE = (
    OSError, ValueError, KeyError, EOFError, NotImplementedError, RuntimeError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What the libraries raise for a file that is no archive, or a damaged one."""

_HEAD = "head"
_BEGUN = ".part"

Views = list[tuple[ViewResult, ...]]
"""The results of stage 1 of each step, one for each camera."""


class StageFiles:
    """A folder of results of stage 1, by their cache key. Several processes may use it at once."""

    def __init__(self, folder: Path, limit_bytes: int = LIMIT_BYTES) -> None:
        """Store the arguments; the folder is made when a file is written.

        Args:
            folder: The folder; all its files named ``*.npz`` and ``*.part`` belong to the cache.
            limit_bytes: Largest size of all files together; the least recently used are deleted.
        """
        self._folder = folder
        self._limit = limit_bytes

    def read(self, key: str, *, frames: int, cameras: int) -> Views | None:
        """Read the results of a finished stage 1; None if there is no usable file.

        Args:
            key: The cache key of the stage, a hash of sequence, parameters and code.
            frames: The number of steps that the file must have.
            cameras: The number of results at each step.
        """
        path = self._path(key)
        try:
            with (
                path.open("rb") as file,
                zipfile.ZipFile(file) as checked,
                NpzFile(file, allow_pickle=False) as archive,
            ):
                if (spoilt := checked.testzip()) is not None:
                    raise ValueError(f"{spoilt} is not what was written")
                head = json.loads(archive[_HEAD].tobytes())
                if head != _head(key, frames, cameras):
                    raise ValueError(f"expected {_head(key, frames, cameras)}, found {head}")
                columns = []
                for camera in range(cameras):
                    begin = f"{camera}/"
                    names = [name for name in archive.files if name.startswith(begin)]
                    arrays = {name.removeprefix(begin): archive[name] for name in names}
                    columns.append(unpack(arrays, ViewResult))
                    if len(columns[-1]) != frames:
                        raise ValueError(f"expected {frames} steps, found {len(columns[-1])}")
            os.utime(path)  # marks it as used
        except (FileNotFoundError, NotADirectoryError):
            return None
        except _UNREADABLE as error:
            logger.warning("%s cannot be used and is computed anew: %s", path, error)
            with contextlib.suppress(OSError):
                path.unlink()
            return None
        return list(zip(*columns, strict=True))

    def write(self, key: str, views: Sequence[tuple[ViewResult, ...]]) -> bool:
        """Write the results of a finished stage 1, and return whether the file now exists.

        An error is logged and has no other effect, since a cache may always be empty.
        """
        path = self._path(key)
        if path.exists():
            return True
        cameras = len(views[0]) if views else 0
        arrays = {_HEAD: _text(json.dumps(_head(key, len(views), cameras)))}
        for camera in range(cameras):
            packed = pack([step[camera] for step in views], ViewResult)
            arrays |= {f"{camera}/{name}": array for name, array in packed.items()}
        begun = None
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            descriptor, begun = tempfile.mkstemp(dir=self._folder, prefix=key, suffix=_BEGUN)
            with os.fdopen(descriptor, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(begun, path)
            sync_folder(self._folder)
        except OSError as error:
            logger.warning("%s cannot be written: %s", path, error)
            if begun is not None:
                with contextlib.suppress(OSError):
                    os.unlink(begun)
            return False
        self.prune()
        return True

    def prune(self) -> None:
        """Delete the least recently used files until the rest is within the limit."""
        now, found = time.time(), []
        for path in self._folder.glob("*"):
            with contextlib.suppress(OSError):  # another process prunes as well
                status = path.stat()
                if path.suffix == ".npz":
                    found.append((status.st_mtime, status.st_size, path))
                elif path.suffix == _BEGUN and now - status.st_mtime > ABANDONED_SECONDS:
                    path.unlink()
        total = sum(size for _, size, _ in found)
        for _, size, path in sorted(found):
            if total <= self._limit:
                break
            with contextlib.suppress(OSError):
                path.unlink()
            total -= size

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.npz"


def _head(key: str, frames: int, cameras: int) -> dict[str, object]:
    return {"format": FORMAT, "key": key, "frames": frames, "cameras": cameras}


def _text(text: str) -> np.ndarray:
    return np.frombuffer(text.encode(), dtype=np.uint8)


def pack(items: Sequence[Value], kind: type[Value]) -> dict[str, ndarray]:
    """Pack instances of a dataclass into arrays, by name.

    A field of arrays becomes the concatenated arrays, and their lengths, -1 for
    None; a field of dataclasses is packed in turn; every other field is written as JSON.

    Args:
        items: Instances of one dataclass.
        kind: The dataclass.

    Raises:
        TypeError: If a field has values that JSON cannot represent, or arrays of several shapes.
    """
    packed: dict[str, ndarray] = {}
    for name, hint in _hints(kind).items():
        values = [getattr(item, name) for item in items]
        inner = _dataclass_in(hint)
        if _is_array(hint):
            packed[name], packed[f"{name}#"] = _joined(name, values)
        elif inner is not None:
            there = [value for value in values if value is not None]
            packed[f"{name}?"] = np.array([value is not None for value in values], dtype=bool)
            packed |= {f"{name}.{key}": array for key, array in pack(there, inner).items()}
        else:
            text = json.dumps([_plain(value) for value in values])
            packed[name] = np.frombuffer(text.encode(), dtype=np.uint8)
    return packed


def unpack(packed: Mapping[str, ndarray], kind: type[Value]) -> list[Value]:
    """Restore the instances that :func:`pack` packed.

    Raises:
        ValueError: If the arrays do not match the fields of the dataclass.
    """
    columns: dict[str, list[Any]] = {}
    used: set[str] = set()
    for name, hint in _hints(kind).items():
        inner = _dataclass_in(hint)
        if _is_array(hint):
            columns[name] = _parted(_of(packed, name), _of(packed, f"{name}#"))
            used |= {name, f"{name}#"}
        elif inner is not None:
            begin = f"{name}."
            parts = {k.removeprefix(begin): v for k, v in packed.items() if k.startswith(begin)}
            there = iter(unpack(parts, inner))
            columns[name] = [
                next(there) if is_there else None for is_there in _of(packed, f"{name}?")
            ]
            used |= {f"{name}?", *(begin + key for key in parts)}
        else:
            columns[name] = _reader(kind, name).validate_json(_of(packed, name).tobytes())
            used.add(name)
    if used != set(packed) or len({len(column) for column in columns.values()}) > 1:
        raise ValueError(f"these are not columns of {kind.__name__}: {sorted(set(packed) ^ used)}")
    names = list(columns)
    return [
        kind(**dict(zip(names, row, strict=True))) for row in zip(*columns.values(), strict=True)
    ]


def _hints(kind: type[Any]) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


def _reader(kind: type[Any], name: str) -> TypeAdapter[list[Any]]:
    column: Any = list[_hints(kind)[name]]  # type: ignore[misc]
    return TypeAdapter(column)


def _is_array(hint: Any) -> bool:
    return any(
        isinstance(part, type) and issubclass(part, ndarray | AbstractArray)
        for part in (hint, *get_args(hint))
    )


def _dataclass_in(hint: Any) -> type[Any] | None:
    """Return the dataclass of a field whose type is a dataclass, optional or not; else None."""
    parts = [part for part in (get_args(hint) or (hint,)) if part is not type(None)]
    if len(parts) == 1 and isinstance(parts[0], type) and dataclasses.is_dataclass(parts[0]):
        return parts[0]
    return None


def _joined(name: str, values: list[ndarray | None]) -> tuple[ndarray, ndarray]:
    lengths = np.array([-1 if value is None else len(value) for value in values], dtype=np.int64)
    there = [value for value in values if value is not None]
    filled = [value for value in there if len(value)] or there[:1]
    if not filled:
        return np.zeros(0), lengths
    if len({(value.shape[1:], value.dtype) for value in filled}) > 1:
        raise TypeError(f"{name}: arrays of one column must agree in shape and type")
    return np.concatenate(filled), lengths


def _parted(joined: ndarray, lengths: ndarray) -> list[ndarray | None]:
    ends = np.cumsum(np.maximum(lengths, 0))
    if len(joined) != (ends[-1] if len(ends) else 0):
        raise ValueError("lengths do not add up")
    starts = (ends - np.maximum(lengths, 0)).tolist()
    return [
        joined[start:end] if length >= 0 else None
        for start, end, length in zip(starts, ends.tolist(), lengths.tolist(), strict=True)
    ]


def _plain(value: Any) -> Any:
    """Convert a value for JSON: dataclasses to mappings, NumPy's numbers to Python's."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    return value


def _of(packed: Mapping[str, ndarray], name: str) -> ndarray:
    if name not in packed:
        raise ValueError(f"there is no column {name}")
    return packed[name]
