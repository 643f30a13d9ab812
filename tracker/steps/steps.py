"""One value a step, stored as a few long arrays."""

from __future__ import annotations

import json
import operator
import zlib
from bisect import bisect_right
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast, overload

import numpy as np
from jaxtyping import Float, Int, Shaped
from numpy import ndarray

from tracker.steps.columns import Alike, Block, Column, flat, plan_of, whole
from tracker.steps.files import Reading, Writing

T = TypeVar("T")

BLOCK = 256
"""Number of steps that are packed at once; so many of the newest steps at most are objects."""

FORMAT = 2
"""Version of the files; those of other versions are not read."""

_HEAD = "head.json"


@dataclass(frozen=True, slots=True, eq=False)
class Ragged:
    """One field of S steps: N rows, some for each step."""

    values: Shaped[ndarray, "N ..."]
    """The rows, step after step."""
    starts: Int[ndarray, " S1"]
    """Index of the first row of each step, and N at the end."""

    def __len__(self) -> int:
        return len(self.starts) - 1

    def __getitem__(self, step: int) -> ndarray:
        """The rows of one step."""
        rows: ndarray = self.values[self.starts[step] : self.starts[step + 1]]
        return rows

    @property
    def counts(self) -> Int[ndarray, " S"]:
        """Number of rows of each step."""
        return np.asarray(np.diff(self.starts))

    @property
    def steps(self) -> Int[ndarray, " N"]:
        """Step of each row."""
        return np.asarray(np.repeat(np.arange(len(self)), self.counts))


class _Now(NamedTuple):
    """The content of a column of steps, replaced as a whole, so that readers see one or another."""

    firsts: tuple[int, ...]
    """Index of the first step of each block, and their number of steps at the end."""
    blocks: tuple[Block, ...]
    newest: list[Any]


class _NewestColumns(NamedTuple):
    """The columns of the newest steps that were read, valid until a step is added."""

    values: list[Any]
    steps: int
    fields: dict[int, list[list[Any]]]
    """For a part the values of each field."""
    columns: dict[tuple[int, int], Column]
    """The columns by part and index."""


class Steps(Sequence[T]):
    """What one stage made, one value a step, stored as a few long arrays.

    The newest steps, at most 256, are objects; older ones lie in blocks, one array a field with
    the number of rows of each step. A block never changes, so that runs share it. Reading a step
    makes its object anew, of views. One thread appends; any thread reads what lies below ``len``.
    """

    def __init__(self, kind: type[Any], width: int | None = None) -> None:
        """Start without steps.

        Args:
            kind: The dataclass of a value, or of the parts of a value.
            width: The number of parts where a value is a tuple of them, one for each camera.
        """
        self._kind, self._width = kind, width
        self._plan = plan_of(cast("Hashable", kind))
        self._now = _Now((0,), (), [])
        self._newest_columns = _NewestColumns([], 0, {}, {})

    @staticmethod
    def of(values: Iterable[T], kind: type[Any], width: int | None = None) -> Steps[T]:
        """Store some values; what is stored so already is returned as it is."""
        if isinstance(values, Steps):
            return cast("Steps[T]", values)
        found: Steps[T] = Steps(kind, width)
        for value in values:
            found.append(value)
        return found

    def alike(self, values: Iterable[T]) -> Steps[T]:
        """Store other values of the same kind."""
        return Steps.of(list(values), self._kind, self._width)

    def append(self, value: T) -> None:
        """Add the value of the next step."""
        firsts, blocks, newest = self._now
        newest.append(value)
        if len(newest) >= BLOCK:
            block = self._packed(newest)
            self._now = _Now((*firsts, firsts[-1] + block.steps), (*blocks, block), [])
            self._newest_columns = _NewestColumns([], 0, {}, {})  # else it holds these steps

    def shared(self) -> Steps[T]:
        """Return a copy to go on from; only the newest steps are copied."""
        return self._with(self._now._replace(newest=list(self._now.newest)))

    def before(self, stop: int) -> Steps[T]:
        """Return the steps before one, which share their blocks."""
        now = self._now
        stop = min(stop, now.firsts[-1] + len(now.newest))
        blocks = max(0, bisect_right(now.firsts, stop) - 1)
        found = self._with(_Now(now.firsts[: blocks + 1], now.blocks[:blocks], []))
        for k in range(now.firsts[blocks], stop):
            found.append(self._at(now, k))
        return found

    def parts(self, chosen: Sequence[int]) -> Steps[Any]:
        """Return some parts of each value, by index, in that order."""
        firsts, blocks, newest = self._now
        own = [Block(one.steps, tuple(one.parts[c] for c in chosen)) for one in blocks]
        rest = [tuple(value[c] for c in chosen) for value in newest]
        return Steps(self._kind, len(chosen))._with(_Now(firsts, tuple(own), rest))

    @property
    def width(self) -> int | None:
        """The number of parts of each value; None where a value has no parts."""
        return self._width

    @property
    def nbytes(self) -> int:
        """The memory of all arrays, bytes; those of the newest steps as they will be packed."""
        blocks = [*self._now.blocks, self._packed(list(self._now.newest))]
        return sum({id(one): one.nbytes for block in blocks for one in block.arrays()}.values())

    def __len__(self) -> int:
        now = self._now
        return now.firsts[-1] + len(now.newest)

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> list[T]: ...
    def __getitem__(self, index: int | slice) -> T | list[T]:
        now = self._now
        steps = now.firsts[-1] + len(now.newest)
        if isinstance(index, slice):
            return [self._at(now, k) for k in range(*index.indices(steps))]
        k = operator.index(index)
        k += steps if k < 0 else 0
        if not 0 <= k < steps:
            raise IndexError(f"step {index} of {steps}")
        return self._at(now, k)

    def __iter__(self) -> Iterator[T]:
        now = self._now
        for block in now.blocks:
            for k in range(block.steps):
                yield self._made(block, k)
        yield from now.newest

    def column(
        self, name: str, part: int = 0, *, first: int = 0, last: int | None = None
    ) -> Ragged:
        """Return the rows of one field of arrays.

        Args:
            name: The field; the fields that lead to it, joined by full stops.
            part: Index of the part of each value.
            first: The first step.
            last: The step after the last one; None for all.

        Raises:
            ValueError: If the arrays differ in shape or type of number.
        """
        found, counts = [], [np.zeros(0, dtype=np.int64)]
        for low, high, steps, column in self._columns(name, part, first, last):
            rows, own = column.joined(name), column.each_count(steps)
            begin = int(own[:low].sum())
            own = own[low:high]
            found.append(rows[begin : begin + int(own.sum())])
            counts.append(own)
        filled = [rows for rows in found if len(rows)] or found[:1]
        if len({(rows.dtype, rows.shape[1:]) for rows in filled}) > 1:
            raise ValueError(f"{name}: arrays of one column must agree in shape and type")
        values = whole(filled) if filled else np.zeros(0)
        starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
        return Ragged(values, starts)

    def take(
        self, name: str, steps: Int[ndarray, " K"], rows: Int[ndarray, " K"], part: int = 0
    ) -> Shaped[ndarray, "K ..."]:
        """Return single rows of one field of arrays, without those of all steps at once.

        Args:
            name: The field, as for :meth:`column`.
            steps: Step of each of K rows, in any order.
            rows: Index of the row among those of its step.
            part: Index of the part of each value.

        Raises:
            ValueError: If the arrays differ in shape or type of number.
        """
        order = np.argsort(steps, kind="stable")
        firsts = [*self._now.firsts, len(self)]
        bounds = np.searchsorted(steps[order], firsts).tolist()
        found = []
        for first, last, low, high in zip(firsts, firsts[1:], bounds, bounds[1:], strict=False):
            if low < high:
                own = order[low:high]
                column = self.column(name, part, first=first, last=last)
                found.append(column.values[column.starts[steps[own] - first] + rows[own]])
        rows_found = whole(found or [self.column(name, part, last=0).values])
        result = np.empty_like(rows_found)
        result[order] = rows_found
        return result

    def shapes(self, name: str, part: int = 0) -> set[tuple[int, ...]]:
        """Return the shapes that rows of one field of arrays have, with the arguments of
        :meth:`column`."""
        return {
            form.shape
            for _, _, _, column in self._columns(name, part, 0, None)
            for form in column.forms
            if form.dtype is not None
        }

    def values(
        self, name: str, part: int = 0, *, first: int = 0, last: int | None = None
    ) -> Iterator[Any]:
        """Iterate over the values of one field, with the arguments of :meth:`column`."""
        for low, high, _, column in self._columns(name, part, first, last):
            for k in range(low, high):
                yield column.at(k)

    def numbers(self, name: str, part: int = 0) -> dict[str, Float[ndarray, " S"]]:
        """Return the numbers of a field of mappings, by name; nan at steps that lack the name.

        Args:
            name: The field, as for :meth:`column`.
            part: Index of the part of each value.
        """
        found: dict[str, ndarray] = {}
        begin, count = 0, len(self)
        for _, high, _, column in self._columns(name, part, 0, count):
            for index, (form, rows) in enumerate(zip(column.forms, column.rows, strict=True)):
                own = np.arange(high)
                if column.which is not None:
                    own = np.flatnonzero(column.which[:high] == index)
                for k, each in enumerate(form.names or form.value or ()):
                    numbers = found.setdefault(each, np.full(count, np.nan))
                    numbers[begin + own] = form.value[each] if rows is None else rows[: len(own), k]
            begin += high
        return found

    def write(self, folder: Path, key: str = "") -> None:
        """Write all steps into an existing empty folder: ``head.json``, and arrays as ``.npy``.

        Args:
            folder: The folder.
            key: A text that is written with them, and that :meth:`read` must be given.

        Raises:
            OSError: If a file cannot be written.
            TypeError: If a value can be written neither as array nor as JSON.
        """
        now = self._now
        blocks = [*now.blocks, *([self._packed(list(now.newest))] if now.newest else [])]
        writing = Writing(folder)
        parts = [
            [
                writing.column([block.parts[part][c] for block in blocks], blocks)
                for c in range(len(self._plan.names))
            ]
            for part in range(1 if self._width is None else self._width)
        ]
        content = {
            "format": FORMAT, "key": key, "steps": sum(block.steps for block in blocks),
            "width": self._width, "names": self._plan.names, "parts": parts,
            "files": writing.files,
        }  # fmt: skip
        text = json.dumps(content)
        check = zlib.crc32(text.encode())
        (folder / _HEAD).write_text(f"{check}\n{text}", encoding="utf-8")

    @staticmethod
    def read(
        folder: Path, kind: type[Any], *, frames: int, width: int | None = None, key: str = ""
    ) -> Steps[Any]:
        """Map the steps that :meth:`write` wrote, after the checksums of all files are checked.

        Args:
            folder: The folder.
            kind: The dataclass of a value, or of its parts.
            frames: The number of steps that must be there.
            width: The number of parts of each value.
            key: The text that must be there.

        Raises:
            OSError: If a file cannot be read.
            ValueError: If anything is not as it was written, or of something else.
        """
        found: Steps[Any] = Steps(kind, width)
        check, _, text = (folder / _HEAD).read_text(encoding="utf-8").partition("\n")
        if check != str(zlib.crc32(text.encode())):
            raise ValueError(f"{_HEAD} is not what was written")
        head = json.loads(text)
        wanted = {"format": FORMAT, "key": key, "steps": frames, "width": width}
        there = {name: head.get(name) for name in wanted}
        if there != wanted:
            raise ValueError(f"expected {wanted}, found {there}")
        if tuple(head["names"]) != found._plan.names:
            raise ValueError(f"these are not columns of {kind.__name__}: {head['names']}")
        reading = Reading(folder, head["files"], frames)
        parts = tuple(
            tuple(
                reading.column(column, found._plan.hints[c], found._plan.seconds[c])
                for c, column in enumerate(part)
            )
            for part in head["parts"]
        )
        return found._with(_Now((0, frames), (Block(frames, parts),), []))

    def __reduce__(self) -> Any:
        blocks = tuple(Block(one.steps, one.parts) for one in self._now.blocks)
        return _restored, (self._kind, self._width, self._now._replace(blocks=blocks))

    def _with(self, now: _Now) -> Steps[T]:
        found: Steps[T] = Steps(self._kind, self._width)
        found._now = now
        return found

    def _at(self, now: _Now, k: int) -> T:
        if k >= now.firsts[-1]:
            return cast("T", now.newest[k - now.firsts[-1]])
        index = bisect_right(now.firsts, k) - 1
        return self._made(now.blocks[index], k - now.firsts[index])

    def _made(self, block: Block, k: int) -> T:
        made = block.made(self._plan.root, k)
        return cast("T", made[0] if self._width is None else tuple(made))

    def _packed(self, values: list[Any]) -> Block:
        alike = Alike()
        if self._width is None:
            by_part = [values]
        else:
            by_part = [[value[part] for value in values] for part in range(self._width)]
        return Block(
            len(values),
            tuple(
                tuple(
                    alike.column(column, second)
                    for column, second in zip(
                        flat(self._plan, part), self._plan.seconds, strict=True
                    )
                )
                for part in by_part
            ),
        )

    def _columns(
        self, name: str, part: int, first: int, last: int | None
    ) -> Iterator[tuple[int, int, int, Column]]:
        """For each block the range of its steps, their number, and one of its columns."""
        now = self._now
        index = self._plan.names.index(name)
        stop = now.firsts[-1] + len(now.newest)
        last = stop if last is None else min(last, stop)
        for begin, block in zip(now.firsts, now.blocks, strict=False):
            low, high = max(first - begin, 0), min(last - begin, block.steps)
            if low < high:
                yield low, high, block.steps, block.parts[part][index]
        begin = now.firsts[-1]
        low, high = max(first - begin, 0), last - begin
        if low < high:
            steps = stop - begin
            yield low, high, steps, self._newest_column(now.newest, steps, part, index)

    def _newest_column(self, values: list[Any], steps: int, part: int, index: int) -> Column:
        read = self._newest_columns
        if read.values is not values or read.steps != steps:
            read = self._newest_columns = _NewestColumns(values, steps, {}, {})
        if (part, index) not in read.columns:
            if part not in read.fields:
                own = values[:steps]
                own = own if self._width is None else [value[part] for value in own]
                read.fields[part] = flat(self._plan, own)
            fields = read.fields[part][index]
            read.columns[part, index] = Alike().column(fields, self._plan.seconds[index])
        return read.columns[part, index]


def _restored(kind: type[Any], width: int | None, now: _Now) -> Steps[Any]:
    return Steps(kind, width)._with(now)
