"""Values of one kind, one a step, as a few long arrays and back: how a column is kept on disk.

Works from the fields of the dataclass alone, so that a new field needs nothing here.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from jaxtyping import AbstractArray
from numpy import ndarray
from pydantic import TypeAdapter

Value = TypeVar("Value")


def pack(items: Sequence[Value], kind: type[Value]) -> dict[str, ndarray]:
    """All items as arrays by name.

    A field of arrays becomes the arrays one after the other, and their lengths, -1 for
    None; a field of dataclasses is packed in turn; everything else is written as JSON.

    Args:
        items: Instances of one dataclass.
        kind: Which.

    Raises:
        TypeError: If a field holds what has no place in JSON, or arrays of several shapes.
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
    """The items that :func:`pack` was given.

    Raises:
        ValueError: If the arrays are not of this dataclass as it is now.
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
    """The dataclass of a field that holds one, or one or None."""
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
    """As JSON has it: dataclasses as their fields, NumPy's numbers as Python's."""
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
