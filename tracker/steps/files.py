"""Columns in a folder: one file for each array, which is mapped when it is read."""

from __future__ import annotations

import dataclasses
import json
import zlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray
from pydantic import TypeAdapter

from tracker.steps.columns import Block, Column, Form, starts_of

_CHUNK = 1 << 20
"""Bytes of a file that are read at once for its checksum."""


class Writing:
    """Writes arrays into a folder, each once."""

    def __init__(self, folder: Path) -> None:
        self.files: dict[str, int] = {}
        """The checksum of each file."""
        self._folder = folder
        self._names: dict[Any, str] = {}

    def column(self, columns: list[Column], blocks: list[Block]) -> dict[str, Any]:
        """Write one field of all blocks, and describe it for :class:`Reading`."""
        forms: dict[Any, int] = {}
        described: list[dict[str, Any]] = []
        rows: list[list[ndarray]] = []
        which, counts = [], []
        for column, block in zip(columns, blocks, strict=True):
            own = []
            for form, array in zip(column.forms, column.rows, strict=True):
                text = _described(form)
                key = json.dumps(text)
                if key not in forms:
                    forms[key] = len(described)
                    described.append(text)
                    rows.append([])
                own.append(forms[key])
                if array is not None and len(array):
                    rows[forms[key]].append(array)
            of_step = np.zeros(block.steps, int) if column.which is None else column.which
            which.append(np.array(own)[of_step])
            counts.append(column.each_count(block.steps))
        return {
            "forms": [
                text | {"file": self._file(parts, tuple(map(id, parts))) if parts else None}
                for text, parts in zip(described, rows, strict=True)
            ],
            "which": self._numbers(which),
            "counts": self._numbers(counts),
        }

    def _numbers(self, parts: list[ndarray]) -> str | int:
        """Write an integer for each step; one that all have is returned itself."""
        whole = np.concatenate(parts) if parts else np.zeros(0, np.int64)
        if not len(whole) or (whole == whole[0]).all():
            return int(whole[0]) if len(whole) else 0
        whole = whole.astype(np.int32)
        return self._file([whole], (len(whole), whole.tobytes()))

    def _file(self, parts: list[ndarray], same: Any) -> str:
        """Write the concatenation of some arrays, without making it."""
        if same in self._names:
            return self._names[same]
        if parts[0].dtype.hasobject:
            raise TypeError("arrays of objects cannot be written")
        name = self._names[same] = f"{len(self._names)}.npy"
        shape = (sum(len(part) for part in parts), *parts[0].shape[1:])
        header = {
            "descr": np.lib.format.dtype_to_descr(parts[0].dtype),
            "fortran_order": False,
            "shape": shape,
        }
        with (self._folder / name).open("wb") as file:
            np.lib.format.write_array_header_1_0(file, header)
            for part in parts:
                file.write(np.ascontiguousarray(part).data)
        self.files[name] = _checksum(self._folder / name)
        return name


class Reading:
    """Maps the arrays that :class:`Writing` wrote."""

    def __init__(self, folder: Path, files: Mapping[str, int], steps: int) -> None:
        """Check the files.

        Args:
            folder: The folder.
            files: The checksum of each file.
            steps: The number of steps.
        """
        self._steps = steps
        self._arrays: dict[str, ndarray] = {}
        self._starts: dict[tuple[Any, Any], tuple[ndarray, ndarray]] = {}
        for name, check in files.items():
            path = folder / name
            if path.name != name or _checksum(path) != check:
                raise ValueError(f"{name} is not what was written")
            # pages that are written to are copied, so that arrays are as writable as any others
            mapped = np.load(path, mmap_mode="c", allow_pickle=False)
            self._arrays[name] = mapped.view(ndarray)

    def column(self, text: dict[str, Any], hint: Any, second: bool) -> Column:
        """Make one field of all steps.

        Args:
            text: The description that was written.
            hint: The type of the field; None where it says which values are of a dataclass.
            second: Whether rows are on the second axis.

        Raises:
            ValueError: If anything does not fit together.
        """
        forms, rows = [], []
        for one in text["forms"]:
            form = _form_of(one, hint)
            forms.append(form)
            rows.append(None if form.dtype is None else self._rows(form, one["file"]))
        which, counts = text["which"], text["counts"]
        if len(forms) <= 1 and isinstance(counts, int):
            if forms and rows[0] is not None and len(rows[0]) != counts * self._steps:
                raise ValueError("rows do not add up")
            return Column(tuple(forms), tuple(rows), None, counts, None, second)
        of_step, starts = self._placed(which, counts, len(forms))
        number = self._of_steps(counts)
        for index, own in enumerate(rows):
            if (0 if own is None else len(own)) != int(number[of_step == index].sum()):
                raise ValueError("rows do not add up")
        return Column(
            tuple(forms), tuple(rows), None if len(forms) == 1 else of_step, number, starts, second
        )

    def _rows(self, form: Form, file: str | None) -> ndarray:
        if file is None:
            return np.zeros((0, *form.shape), form.dtype)
        array = self._arrays[file]
        if array.dtype != form.dtype or array.shape[1:] != form.shape:
            raise ValueError(f"{file}: expected {form.dtype} of {form.shape}")
        return array

    def _placed(self, which: Any, counts: Any, forms: int) -> tuple[ndarray, ndarray]:
        """Form and first row of each step."""
        if (which, counts) not in self._starts:
            of_step, number = self._of_steps(which), self._of_steps(counts)
            if len(of_step) and not (0 <= of_step.min() and of_step.max() < forms):
                raise ValueError("a step has a form that is not there")
            smallest = np.int32 if number.sum() < np.iinfo(np.int32).max else np.int64
            self._starts[which, counts] = (
                of_step,
                starts_of(of_step, number, forms).astype(smallest),
            )
        return self._starts[which, counts]

    def _of_steps(self, numbers: str | int) -> ndarray:
        if isinstance(numbers, int):
            return np.full(self._steps, numbers, dtype=np.int32)
        found = self._arrays[numbers]
        if found.shape != (self._steps,) or found.min() < 0:
            raise ValueError("expected a number for each step")
        return found


def _checksum(path: Path) -> int:
    found = 0
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            found = zlib.crc32(chunk, found)
    return found


def _described(form: Form) -> dict[str, Any]:
    """A form for JSON."""
    if form.dtype is None:
        if form.value is ...:
            return {"here": True}
        return {"value": _plain(form.value)}
    kind = np.lib.format.dtype_to_descr(form.dtype)
    return {"dtype": kind, "shape": list(form.shape), "names": form.names}


def _form_of(text: dict[str, Any], hint: Any) -> Form:
    """The form that was described."""
    if "here" in text:
        return Form(None, value=...)
    if "value" in text:
        value = text["value"]
        # a field of a dataclass that is None has None in all columns, whatever their types
        return Form(None, value=value if value is None else _adapter(hint).validate_python(value))
    names = text["names"]
    return Form(
        np.dtype(text["dtype"]), tuple(text["shape"]), None if names is None else tuple(names)
    )


@lru_cache(maxsize=256)
def _adapter(hint: Any) -> TypeAdapter[Any]:
    return TypeAdapter(hint)


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
