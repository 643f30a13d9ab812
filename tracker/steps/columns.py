"""Fields of many values as long arrays: how they are packed, and how a value is made of them."""

from __future__ import annotations

import contextlib
import dataclasses
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import EllipsisType, NoneType
from typing import Any, NamedTuple, get_args, get_type_hints

import numpy as np
from jaxtyping import Int
from numpy import ndarray

ROWS_SECOND = {"rows": 1}
"""Metadata of a dataclass's field whose arrays have their rows on the second axis."""

_PLAIN = (NoneType, bool, int, float, str, bytes, EllipsisType)
"""Types whose values never change, and are the same where their text is."""


class Form(NamedTuple):
    """What values have in common whose rows are in one array."""

    dtype: np.dtype[Any] | None
    """Type of number of the rows; None where the value itself is stored."""
    shape: tuple[int, ...] = ()
    """Shape of one row."""
    names: tuple[str, ...] | None = None
    """Names of the numbers of a mapping, which is one row."""
    value: Any = None
    """The value where it is no array."""


class Node(NamedTuple):
    """A dataclass whose fields are stored, each as one column or as those of its dataclass."""

    kind: type[Any]
    """The dataclass."""
    names: tuple[str, ...]
    """Names of its fields."""
    whole: int
    """Index of the column that has ``...`` where a value is of this dataclass, else the value."""
    inner: tuple[Node | int, ...]
    """For each field its dataclass, or the index of its column."""


class Plan(NamedTuple):
    """The columns of a dataclass."""

    root: Node
    """The dataclass and those inside it."""
    names: tuple[str, ...]
    """The path of each column: the names of fields, joined by full stops."""
    seconds: tuple[bool, ...]
    """Whether the rows of a column's arrays are on the second axis."""
    hints: tuple[Any, ...]
    """The type of each column; None where it says which values are of a dataclass."""


@cache
def plan_of(kind: Any) -> Plan:
    """The columns of a dataclass, read off its fields."""
    names: list[str] = []
    seconds: list[bool] = []
    hints: list[Any] = []

    def column(name: str, hint: Any, second: bool = False) -> int:
        names.append(name)
        hints.append(hint)
        seconds.append(second)
        return len(names) - 1

    def node(one: type[Any], path: str) -> Node:
        whole = column(f"{path}?", None)
        types, inner = get_type_hints(one), []
        fields = dataclasses.fields(one)
        for each in fields:
            name, hint = f"{path}.{each.name}" if path else each.name, types[each.name]
            within = _dataclass_in(hint)
            second = each.metadata.get("rows") == 1
            inner.append(column(name, hint, second) if within is None else node(within, name))
        return Node(one, tuple(each.name for each in fields), whole, tuple(inner))

    return Plan(node(kind, ""), tuple(names), tuple(seconds), tuple(hints))


def _dataclass_in(hint: Any) -> type[Any] | None:
    """Return the dataclass of a field whose type is a dataclass, optional or not; else None."""
    parts = [part for part in (get_args(hint) or (hint,)) if part is not NoneType]
    if len(parts) == 1 and isinstance(parts[0], type) and dataclasses.is_dataclass(parts[0]):
        return parts[0]
    return None


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One field of the steps of one block."""

    forms: tuple[Form, ...]
    rows: tuple[ndarray | None, ...]
    """The rows of the steps of each form."""
    which: ndarray | None
    """Form of each step; None where there is one form."""
    counts: int | ndarray
    """Number of rows of each step; a number where all have as many and one form."""
    starts: ndarray | None
    """Index of each step's first row among those of its form; None where ``counts`` is a number."""
    second: bool
    """Whether the rows of a step's array are on its second axis."""

    def at(self, k: int) -> Any:
        """The value of one step."""
        which = 0 if self.which is None else int(self.which[k])
        form, rows = self.forms[which], self.rows[which]
        if rows is None:
            return form.value
        part = rows[_span(self.counts, self.starts, k)]
        if form.names is not None:
            return dict(zip(form.names, part[0].tolist(), strict=True))
        return np.ascontiguousarray(part.swapaxes(0, 1)) if self.second else part

    def each_count(self, steps: int) -> Int[ndarray, " S"]:
        """Number of rows of each step."""
        if isinstance(self.counts, int):
            return np.full(steps, self.counts, dtype=np.int64)
        return self.counts.astype(np.int64)

    def joined(self, name: str) -> ndarray:
        """The rows of all steps.

        Raises:
            ValueError: If they differ in shape or type of number.
        """
        found = [rows for rows in self.rows if rows is not None]
        filled = [rows for rows in found if len(rows)]
        if len(filled) > 1:
            raise ValueError(f"{name}: arrays of one column must agree in shape and type")
        return (filled or found or [np.zeros(0)])[0]


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Some steps in a row: for each part of a value its columns. It never changes."""

    steps: int
    """The number of steps."""
    parts: tuple[tuple[Column, ...], ...]
    """The columns of each part."""
    readers: list[_Reader] = field(default_factory=list)
    """One for each part, once a step was read."""

    def arrays(self) -> Iterator[ndarray]:
        """All arrays; one that several columns share comes several times."""
        for part in self.parts:
            for column in part:
                for array in (*column.rows, column.which, column.counts, column.starts):
                    if isinstance(array, ndarray):
                        yield array

    def made(self, root: Node, k: int) -> list[Any]:
        """The parts of the value of one step."""
        if not self.readers:
            self.readers[:] = [_Reader(part) for part in self.parts]
        return [_made(root, reader.at(k)) for reader in self.readers]


class _Reader:
    """Reads the steps of one part of a block: what is the same for all of them is prepared."""

    def __init__(self, columns: Sequence[Column]) -> None:
        self._constants: list[Any] = [None] * len(columns)
        self._others: list[tuple[int, Column]] = []
        spans: dict[tuple[int, int], int] = {}
        sliced: dict[tuple[int, int], tuple[ndarray, list[int]]] = {}
        self._spans: list[tuple[int | ndarray, ndarray | None]] = []
        for index, one in enumerate(columns):
            rows = one.rows[0] if one.rows else None
            if one.which is not None or (rows is not None and one.forms[0].names is not None):
                self._others.append((index, one))
            elif rows is None:
                self._constants[index] = one.forms[0].value if one.forms else None
            elif one.second:
                self._others.append((index, one))
            elif not len(rows):
                self._constants[index] = rows
            else:
                place = id(one.counts), id(one.starts)
                if place not in spans:
                    spans[place] = len(self._spans)
                    self._spans.append((one.counts, one.starts))
                sliced.setdefault((id(rows), spans[place]), (rows, []))[1].append(index)
        self._sliced = [(rows, span, own) for (_, span), (rows, own) in sliced.items()]

    def at(self, k: int) -> list[Any]:
        """The value of each column at one step; columns with equal rows have the same view."""
        found = self._constants.copy()
        spans = [_span(counts, starts, k) for counts, starts in self._spans]
        for rows, span, own in self._sliced:
            part = rows[spans[span]]
            for index in own:
                found[index] = part
        for index, column in self._others:
            found[index] = column.at(k)
        return found


def _span(counts: int | ndarray, starts: ndarray | None, k: int) -> slice:
    """The rows of one step."""
    if starts is None or isinstance(counts, int):
        return slice(k * counts, (k + 1) * counts)
    start = int(starts[k])
    return slice(start, start + int(counts[k]))


def _made(node: Node, values: Sequence[Any]) -> Any:
    """The value of a dataclass, of the values of all columns."""
    whole = values[node.whole]
    if whole is not ...:
        return whole
    return node.kind(
        *[values[one] if isinstance(one, int) else _made(one, values) for one in node.inner]
    )


def flat(plan: Plan, values: list[Any]) -> list[list[Any]]:
    """The values of each column."""
    found: list[list[Any]] = [[] for _ in plan.names]

    def follow(node: Node, own: list[Any]) -> None:
        whole = [... if type(value) is node.kind else value for value in own]
        found[node.whole] = whole
        every = all(value is ... for value in whole)
        for name, inner in zip(node.names, node.inner, strict=True):
            get = operator.attrgetter(name)
            if every:
                inside = list(map(get, own))
            else:
                inside = [
                    get(value) if there is ... else None
                    for value, there in zip(own, whole, strict=True)
                ]
            if isinstance(inner, int):
                found[inner] = inside
            else:
                follow(inner, inside)

    follow(plan.root, values)
    return found


class Alike:
    """Columns of one block, of which equal ones share their arrays."""

    def __init__(self) -> None:
        self._columns: dict[tuple[Any, ...], Column] = {}
        self._arrays: dict[tuple[Any, ...], ndarray] = {}

    def column(self, values: list[Any], second: bool) -> Column:
        """Pack the values of one field."""
        same = (second, *map(id, values))
        found = self._columns.get(same)
        if found is None:
            found = self._columns[same] = self._packed(values, second)
        return found

    def _packed(self, values: list[Any], second: bool) -> Column:
        if len(set(map(id, values))) == 1:
            key, rows = _key(values[0], second)
            if rows is None:
                return Column((_form(key, values[0]),), (None,), None, 0, None, second)
        if set(map(type, values)) == {ndarray} and values[0].ndim > second:
            # by far the most columns have one form
            types = map(operator.attrgetter("dtype"), values)
            if len(set(map(id, types))) == 1:
                with contextlib.suppress(ValueError):  # shapes differ
                    own = [one.swapaxes(0, 1) for one in values] if second else values
                    form = _form(_key(values[0], second)[0], values[0])
                    return self._column((form,), [own], None, list(map(len, own)), second)
        forms: dict[Any, int] = {}
        kinds: list[Form] = []
        parts: list[list[ndarray]] = []
        which, counts = [], []
        for value in values:
            key, rows = _key(value, second)
            index = forms.get(key, -1)
            if index < 0:
                index = forms[key] = len(kinds)
                kinds.append(_form(key, value))
                parts.append([])
            which.append(index)
            if rows is None:
                counts.append(0)
            else:
                counts.append(len(rows))
                parts[index].append(rows)
        return self._column(tuple(kinds), parts, which, counts, second)

    def _column(
        self,
        forms: tuple[Form, ...],
        parts: list[list[ndarray]],
        which: list[int] | None,
        counts: list[int],
        second: bool,
    ) -> Column:
        rows = tuple(self._once(whole(part)) if part else None for part in parts)
        if len(forms) <= 1 and len(set(counts)) <= 1:
            return Column(forms, rows, None, counts[0] if counts else 0, None, second)
        number = np.array(counts, dtype=np.int32)
        of_step = np.zeros(len(number), np.uint16) if which is None else np.array(which, np.uint16)
        return Column(
            forms,
            rows,
            self._once(of_step) if len(forms) > 1 else None,
            self._once(number),
            self._once(starts_of(of_step, number, len(forms)).astype(np.int32)),
            second,
        )

    def _once(self, array: ndarray) -> ndarray:
        """The array, or one that was there before with the same content."""
        if array.dtype.hasobject:
            return array
        return self._arrays.setdefault((array.dtype, array.shape, array.tobytes()), array)


def whole(parts: Sequence[ndarray]) -> ndarray:
    """Concatenate arrays of one type: row by row in memory, whatever the order of each of them."""
    return np.ascontiguousarray(np.concatenate(parts, dtype=parts[0].dtype))


def starts_of(which: ndarray, counts: ndarray, forms: int) -> Int[ndarray, " S"]:
    """Index of each step's first row among the rows of the steps of its form."""
    starts = np.zeros(len(counts), dtype=np.int64)
    for form in range(forms):
        own = which == form
        starts[own] = np.cumsum(counts[own]) - counts[own]
    return starts


def _key(value: Any, second: bool) -> tuple[tuple[Any, ...], ndarray | None]:
    """What two values have in common whose rows can be concatenated, and the rows of this one."""
    if isinstance(value, ndarray) and value.ndim > second:
        rows = np.asarray(value)
        if second:
            rows = rows.swapaxes(0, 1)
        return ("rows", rows.dtype, rows.shape[1:]), rows
    if type(value) is dict and all(
        type(name) is str and type(number) is float for name, number in value.items()
    ):
        return ("names", *value), np.array([list(value.values())], dtype=float)
    if _is_plain(value):
        return ("plain", type(value), repr(value)), None
    return ("object", id(value)), None


def _is_plain(value: Any) -> bool:
    """Whether a value never changes and is the same as another one with the same text."""
    if type(value) in _PLAIN:
        return True
    if type(value) is tuple:
        return all(map(_is_plain, value))
    how: Any = getattr(type(value), "__dataclass_params__", None)
    return (
        how is not None
        and how.frozen
        and how.repr
        and all(
            one.repr and _is_plain(getattr(value, one.name)) for one in dataclasses.fields(value)
        )
    )


def _form(key: tuple[Any, ...], value: Any) -> Form:
    """The form of the values that have a key in common, of which this is one."""
    match key:
        case ("rows", dtype, shape):
            return Form(dtype, shape)
        case ("names", *names):
            return Form(np.dtype(float), (len(names),), tuple(names))
    return Form(None, value=value)
