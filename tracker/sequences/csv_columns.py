"""The fast reading of number columns of a CSV file; errors name the line and the column."""

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
    """Guard a name in a CSV file, so that no spreadsheet reads it as a formula.

    An apostrophe is put before ``=``, ``+``, ``-``, ``@`` or a tab at the beginning, and after a
    comma or semicolon, at which a spreadsheet splits a comment line into cells. :func:`unguarded`
    removes it. Source: OWASP, "CSV Injection".
    """
    return _FORMULA.sub(r"\1'", text)


def unguarded(text: str) -> str:
    """Remove the apostrophes that :func:`guarded` inserted."""
    return _GUARDED.sub(r"\1", text)


MOST_BYTES = 256 * 2**20
"""Largest size of a file, which is enough for some hours of a crowd, bytes."""

MOST_ROWS = 5_000_000
"""Most rows of a file."""

MOST_COLUMNS = 10_000
"""Most columns of a file; a track file has four for each camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Named columns of numbers, with N rows in the file's order.

    Every method that checks a column raises :class:`SequenceError` at the first invalid row, with
    file, line and column, what was expected and what was found.
    """

    where: str
    """The name of the file, for messages."""
    names: tuple[str, ...]
    """The names of all columns of the file, including those that were not read."""
    values: Mapping[str, Float[ndarray, " N"]]
    lines: Int[ndarray, " N"]
    """The line of each row in the file, from 1."""

    def __len__(self) -> int:
        return len(self.lines)

    def stacked(self, *names: str) -> Float[ndarray, "N C"]:
        """Return some columns side by side."""
        return np.column_stack([self.values[name] for name in names])

    def whole(
        self, name: str, minimum: int, maximum: int | None, meaning: str
    ) -> Int[ndarray, " N"]:
        """Return a column of integers within bounds.

        Args:
            name: The column.
            minimum: The least value that is valid.
            maximum: The largest value that is valid; None for no bound.
            meaning: What the numbers mean, for the message.
        """
        values = self.values[name]
        bound = f"from {minimum} to {maximum}" if maximum is not None else f"of at least {minimum}"
        high = 2.0**53 if maximum is None else maximum
        good = (values == np.floor(values)) & (values >= minimum) & (values <= high)
        self.require(name, good, f"a whole number {bound} ({meaning})")
        return values.astype(np.int64)

    def require(self, name: str, good: Bool[ndarray, " N"], expected: str) -> None:
        """Raise an error for the first row whose value is not valid.

        Args:
            name: The column.
            good: Whether the value of each row is valid.
            expected: What is expected, for the message.
        """
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
        """Return the order of the rows by step and id, and check that ids are unique at a step.

        Args:
            frames: The step of each row.
            ids: The id of each row, in the column ``id``.
            what: What the ids are of, for the message: ``track`` or ``person``.
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
        """Return an error that names a line and a column."""
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

    Lines that begin with ``#`` before the header, and empty lines, are skipped.

    Args:
        path: The file.
        where: The file's name, for messages.
        needed: Columns that the file must have.
        optional: Columns that the file may have, each with its default value.
        blank: Columns whose cells may be empty; an empty cell is NaN.
        largest: Largest absolute value of a number.
        called: A function that returns a column's name from its cell in the header.

    Raises:
        SequenceError: With line and column, what was expected and what was found.
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
    """Return the header and the rows, without line ends, and their line numbers."""
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
    """Check the names of the columns.

    Raises:
        SequenceError: If a column is missing, occurs twice or is unknown, or there are too many.
    """
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
    """Parse all rows at once; None if a row is not valid, or has quoted or empty cells."""
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
    """Parse row by row, with quoted and empty cells, and with an error that names the cell."""
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
