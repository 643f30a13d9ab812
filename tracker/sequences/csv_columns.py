"""Number columns of a CSV file, read fast; what is wrong is said with its line and column."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.files.text import not_utf_8, shown
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LARGEST, did_you_mean, listed

_FORMULA = re.compile(r"(^|[,;\t]\s*)(?='*[=+\-@\t\r])")
_GUARDED = re.compile(r"(^|[,;\t]\s*)'(?='*[=+\-@\t\r])")


def guarded(text: str) -> str:
    """A name as a cell of a CSV file that no spreadsheet takes for a formula.

    An apostrophe stands before a beginning by ``=``, ``+``, ``-``, ``@`` or a tab, also behind a
    comma or semicolon, where a comment line becomes cells. :func:`unguarded` takes it away.
    Source: OWASP, "CSV Injection".
    """
    return _FORMULA.sub(r"\1'", text)


def unguarded(text: str) -> str:
    """What :func:`guarded` made a cell of."""
    return _GUARDED.sub(r"\1", text)


MOST_BYTES = 256 * 2**20
"""Of a file: some hours of a crowd."""

MOST_ROWS = 5_000_000

MOST_COLUMNS = 10_000
"""A track file has four a camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Named columns of finite numbers, N rows in the file's order.

    Every method that checks a column raises :class:`SequenceError` at the first bad row, with file,
    line and column, what was expected and what was found.
    """

    where: str
    """The file, as messages begin."""
    names: tuple[str, ...]
    """Every column of the file, also those that were not read."""
    values: Mapping[str, Float[ndarray, " N"]]
    lines: Int[ndarray, " N"]
    """The line of each row in the file, from 1."""

    def __len__(self) -> int:
        return len(self.lines)

    def stacked(self, *names: str) -> Float[ndarray, "N C"]:
        """Some columns side by side."""
        return np.column_stack([self.values[name] for name in names])

    def whole(
        self, name: str, minimum: int, maximum: int | None, meaning: str
    ) -> Int[ndarray, " N"]:
        """A column of whole numbers within bounds.

        Args:
            name: The column.
            minimum: Least value allowed.
            maximum: Greatest value allowed, None for no bound.
            meaning: What the numbers are, for the message.
        """
        values = self.values[name]
        bound = f"from {minimum} to {maximum}" if maximum is not None else f"of at least {minimum}"
        high = 2.0**53 if maximum is None else maximum
        good = (values == np.floor(values)) & (values >= minimum) & (values <= high)
        self.require(name, good, f"a whole number {bound} ({meaning})")
        return values.astype(np.int64)

    def require(self, name: str, good: Bool[ndarray, " N"], expected: str) -> None:
        """Refuse the first row whose value in column ``name`` is not as expected."""
        if not good.all():
            row = int(np.argmin(good))
            raise self.error(
                int(self.lines[row]),
                name,
                f"expected {expected}, found {float(self.values[name][row]):.12g}",
            )

    def one_row_each(
        self, frames: Int[ndarray, " N"], ids: Int[ndarray, " N"], what: str
    ) -> Int[ndarray, " N"]:
        """The order of the rows by step and id, after a check that no id is twice at a step.

        Args:
            frames: The step of each row.
            ids: The id of each row, in the column ``id``.
            what: What has an id, for the message: ``track`` or ``person``.
        """
        order = np.lexsort([ids, frames])
        same = (np.diff(frames[order]) == 0) & (np.diff(ids[order]) == 0)
        if same.any():
            first, second = order[np.argmax(same)], order[np.argmax(same) + 1]
            raise self.error(
                int(self.lines[second]),
                "id",
                f"{what} {ids[second]} is at step {frames[second]} already in line "
                f"{self.lines[first]}; expected one row a {what} a step",
            )
        return order

    def error(self, line: int, name: str, message: str) -> SequenceError:
        """An error about one cell."""
        return SequenceError(f'{self.where}, line {line}, column "{name}": {message}')


def read_columns(
    path: Path,
    where: str,
    *,
    needed: tuple[str, ...],
    optional: Mapping[str, float] | None = None,
    blank: tuple[str, ...] = (),
    largest: float = LARGEST,
    called: Callable[[str], str] = str,
) -> Columns:
    """Read a CSV file with a header.

    Lines that begin with ``#`` before the header, and empty lines, are passed over.

    Args:
        path: The file.
        where: What messages call it.
        needed: Columns that must be there.
        optional: Columns that may be there, and what stands for them where they are not.
        blank: Columns whose cells may be empty; empty is NaN.
        largest: No number lies beyond it, on either side.
        called: What a cell of the header calls its column.

    Raises:
        SequenceError: Naming line and column, what was expected and what was found.
    """
    optional = optional or {}
    lines, numbers = _lines(path, where)
    header = (lines[0] if lines else "").strip()
    first = numbers[0] if numbers else 1
    names = tuple(called(cell.strip()) for cell in _cells(header, where, first))
    _check_header(names, where, numbers[0] if numbers else 1, needed, optional)
    # a column may be needed although its cells may be empty
    wanted = [name for name in dict.fromkeys((*needed, *optional, *blank)) if name in names]
    places = [names.index(name) for name in wanted]
    table = _parse(lines[1:], len(names), places)
    if table is None or not (np.abs(table) <= largest).all():
        table = _parse_slowly(lines[1:], numbers[1:], where, names, wanted, set(blank), largest)
    rows = len(lines) - 1
    values = {name: table[:, column] for column, name in enumerate(wanted)}
    for name, default in optional.items():
        values.setdefault(name, np.full(rows, default))
    return Columns(where, names, values, np.array(numbers[1:], dtype=np.int64))


def _lines(path: Path, where: str) -> tuple[list[str], list[int]]:
    """The header and the rows, without line ends, and their line numbers."""
    try:
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise SequenceError(
                f"{where}: expected a table of at most {MOST_BYTES / 2**20:.0f} MB, found "
                f"{size / 2**20:,.0f} MB; split the recording"
            )
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SequenceError(f"{where}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise SequenceError(f"{where}, {not_utf_8(error)}") from None
    lines: list[str] = []
    numbers: list[int] = []
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip() and (lines or not line.startswith("#")):
            lines.append(line.rstrip("\r"))
            numbers.append(number)
    if len(lines) > MOST_ROWS + 1:
        raise SequenceError(
            f"{where}, line {numbers[-1]}: expected at most {MOST_ROWS:,} rows, found "
            f"{len(lines) - 1:,}; split the recording"
        )
    return lines, numbers


def _cells(line: str, where: str, number: int) -> list[str]:
    try:
        return next(csv.reader([line]), [])
    except csv.Error as error:  # a cell of hundreds of kilobytes
        raise SequenceError(
            f"{where}, line {number}: expected numbers between commas, found what is none ({error})"
        ) from None


def _check_header(
    names: tuple[str, ...],
    where: str,
    line: int,
    needed: tuple[str, ...],
    optional: Mapping[str, float],
) -> None:
    if len(names) > MOST_COLUMNS:
        raise SequenceError(
            f"{where}, line {line}: expected at most {MOST_COLUMNS:,} columns, found {len(names):,}"
        )
    missing = [name for name in needed if name not in names]
    if missing:
        expected = ",".join((*needed, *(f"[{name}]" for name in optional)))
        raise SequenceError(
            f"{where}, line {line}: expected a header with the columns {expected}, but "
            f"{listed(missing)} {'is' if len(missing) == 1 else 'are'} missing; "
            f"found {shown(','.join(names))}"
        )
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise SequenceError(f"{where}, line {line}: column {min(twice)} is there twice; rename one")
    for name in names:
        hint = did_you_mean(name, set(optional) - set(names))
        if hint and name not in (*needed, *optional):
            raise SequenceError(f'{where}, line {line}: unknown column "{name}"{hint}')


def _parse(lines: list[str], width: int, places: list[int]) -> Float[ndarray, "N C"] | None:
    """All rows at once; None where something is not as it should be."""
    if not lines:
        return np.zeros((0, len(places)))
    if any(line.count(",") != width - 1 for line in lines):
        return None
    try:
        return np.loadtxt(lines, delimiter=",", usecols=places, ndmin=2, comments=None)
    except ValueError:
        return None


def _parse_slowly(
    lines: list[str],
    numbers: list[int],
    where: str,
    names: tuple[str, ...],
    wanted: list[str],
    blank: set[str],
    largest: float,
) -> Float[ndarray, "N C"]:
    """Row by row: cells in quotes, empty cells, and the sentence about what is wrong."""
    table = np.empty((len(lines), len(wanted)))
    places = [names.index(name) for name in wanted]
    for row, (line, number) in enumerate(zip(lines, numbers, strict=True)):
        cells = _cells(line, where, number)
        if len(cells) != len(names):
            raise SequenceError(
                f"{where}, line {number}: expected {len(names)} columns as in the header, "
                f"found {len(cells)}"
            )
        for column, (name, place) in enumerate(zip(wanted, places, strict=True)):
            cell = cells[place].strip()
            if not cell and name in blank:
                table[row, column] = math.nan
                continue
            try:
                value = float(cell)
            except ValueError:
                value = math.nan
            if not math.isfinite(value):
                found = shown(cell) if cell else "an empty cell"
                raise SequenceError(
                    f'{where}, line {number}, column "{name}": expected a number, found {found}'
                )
            if abs(value) > largest:
                raise SequenceError(
                    f'{where}, line {number}, column "{name}": expected a number of at most '
                    f"{largest:g}, found {shown(cell)}"
                )
            table[row, column] = value
    return table
