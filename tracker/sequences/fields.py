"""The reading of a TOML table field by field; every error is a sentence that names the field."""

from __future__ import annotations

import difflib
import math
import sys
from collections.abc import Callable, Iterable
from typing import Any, ParamSpec, TypeVar

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.sequences.errors import SequenceError

LARGEST = 1e6
"""Largest number, metres or pixels; powers of larger ones could overflow."""
LARGEST_IN_MATRIX = 1e12
"""Largest number in a projection, whose scale is arbitrary."""
SMALLEST = 1e-4
"""Least value of a positive number, metres or pixels, so that its square is not too small."""

SLOWEST, FASTEST = 1e-3, 1000.0
"""Least and largest frame rate, 1/s."""

LONGEST_NAME = 255
"""Longest name of a file or folder that file systems accept, bytes."""

LARGEST_COUNT = 10_000_000
"""Largest number of steps, or of frames of a file: four days at 25 frames per second."""

LONGEST_TEXT = 1000
"""Longest name, path or description, characters."""

MISSING: Any = object()
"""The default of a required field."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean …?`` with the most similar known word, or an empty text."""
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.6)
    return f'; did you mean "{by_lower[near[0]]}"?' if near else ""


def listed(words: Iterable[str]) -> str:
    """Join words for a sentence: ``a, b and c``."""
    all_words = list(words)
    return " and ".join(
        [", ".join(all_words[:-1]), *all_words[-1:]] if all_words[1:] else all_words
    )


_P = ParamSpec("_P")
_T = TypeVar("_T")


class Fields:
    """One table of a TOML file. Unknown fields are rejected at once, others are checked when read.

    Every method that reads a field raises :class:`SequenceError` if its value is not valid, with
    file, field, what was expected and what was found.
    """

    def __init__(self, where: str, values: Any, known: Iterable[str]) -> None:
        """Wrap one table.

        Args:
            where: File and table, for messages.
            values: The parsed table.
            known: The names of all possible fields.
        """
        self.where = where
        self._known = tuple(known)
        if not isinstance(values, dict):
            raise SequenceError(f"{where}: expected a table of fields, found {shown(values)}")
        self._values: dict[str, Any] = values
        for name in values:
            if name not in self._known:
                hint = did_you_mean(name, set(self._known) - set(values))
                hint = hint or f"; the fields here are {listed(self._known)}"
                raise SequenceError(f"{where}: unknown field {shown(name)}{hint}")

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def is_list(self, name: str) -> bool:
        """Whether the field exists and is a list."""
        return isinstance(self._values.get(name), list)

    def is_text(self, name: str) -> bool:
        """Whether the field exists and is text."""
        return isinstance(self._values.get(name), str)

    def shown(self, name: str) -> str:
        """Return the value of the field in the form of a message."""
        return shown(self._values.get(name))

    def error(self, name: str, message: str) -> SequenceError:
        """Return an error that names a field."""
        return SequenceError(f"{self.where}, {name}: {message}")

    def checked(
        self, name: str, check: Callable[_P, _T], *parts: _P.args, **options: _P.kwargs
    ) -> _T:
        """Return what a function makes of a field's value; its ``ValueError`` names the field."""
        try:
            return check(*parts, **options)
        except ValueError as error:
            raise self.error(name, str(error)) from None

    def _get(self, name: str, default: Any, expected: str) -> Any:
        if name in self._values:
            return self._values[name]
        if default is MISSING:
            raise SequenceError(f'{self.where}: field "{name}" is missing; it must be {expected}')
        return default

    def text(self, name: str, default: Any = MISSING) -> str:
        """Read text on one line, which may be empty only if that is the default."""
        value = self._get(name, default, "text in quotes")
        if not isinstance(value, str):
            raise self.error(name, f"expected text in quotes, found {shown(value)}")
        if not value.strip() and value != default:
            raise self.error(name, "expected some text, found none")
        if len(value) > LONGEST_TEXT:
            raise self.error(
                name, f"expected at most {LONGEST_TEXT} characters, found {len(value):,}"
            )
        words = " ".join(value.split())
        if not words.isprintable():
            odd = next(c for c in words if not c.isprintable())
            raise self.error(
                name,
                f"expected text that can be printed, found the character U+{ord(odd):04X}; "
                "write it without",
            )
        return words

    def rate(self, name: str) -> float:
        """Read a rate of frames or steps, 1/s."""
        return self.number(name, above=SLOWEST, at_most=FASTEST)

    def number(self, name: str, *, above: float, at_most: float) -> float:
        """Read a finite number in (above, at_most]."""
        expected = f"a number above {above:g} and at most {at_most:g}"
        value = self._get(name, MISSING, expected)
        if not is_number(value, LARGEST) or not above < value <= at_most:
            raise self.error(name, f"expected {expected}, found {shown(value)}")
        return float(value)

    def integer(
        self, name: str, default: Any = MISSING, *, minimum: int = 0, maximum: int | None = None
    ) -> int:
        """Read an integer in [minimum, maximum]; ``maximum`` None is :data:`LARGEST_COUNT`."""
        expected = f"a whole number of at least {minimum}"
        if maximum is not None:
            expected = f"a whole number from {minimum} to {maximum}"
        if minimum == maximum:
            expected = f"{minimum}"
        value = self._get(name, default, expected)
        good = isinstance(value, int) and not isinstance(value, bool) and value >= minimum
        if good and maximum is None and value > LARGEST_COUNT:
            maximum = LARGEST_COUNT
            expected = f"a whole number from {minimum} to {maximum}"
        if not good or (maximum is not None and value > maximum):
            raise self.error(name, f"expected {expected}, found {shown(value)}")
        return int(value)

    def vector(
        self, name: str, length: int, what: str, *, positive: bool = False
    ) -> Float[ndarray, " length"]:
        """Read ``length`` numbers of an absolute value of at most :data:`LARGEST`.

        Args:
            name: The field.
            length: The number of numbers.
            what: What they are, for the message.
            positive: Whether each must be at least :data:`SMALLEST`.
        """
        expected = f"{length} {'positive ' if positive else ''}numbers ({what})"
        value = self._get(name, MISSING, f"a list of {expected}")
        vector = self._numbers(name, value, expected)
        if len(vector) != length:
            raise self.error(name, f"expected {expected}, found {len(vector)}")
        if positive and not (vector > 0.0).all():
            raise self.error(name, f"expected {expected}, found {shown(value)}")
        if positive and not (vector >= SMALLEST).all():
            raise self.error(
                name, f"expected {expected} of at least {SMALLEST:g}, found {shown(value)}"
            )
        return vector

    def numbers(self, name: str) -> Float[ndarray, " length"]:
        """Read any number of numbers of at most :data:`LARGEST`; none if the field is missing."""
        return self._numbers(name, self._get(name, [], ""), "a list of numbers")

    def matrix(self, name: str, rows: int, columns: int) -> Float[ndarray, "rows columns"]:
        """Read ``rows`` lists of ``columns`` numbers of at most :data:`LARGEST_IN_MATRIX`."""
        expected = f"{rows} rows of {columns} numbers"
        value = self._get(name, MISSING, expected)
        if not isinstance(value, list) or not all(isinstance(row, list) for row in value):
            raise self.error(name, f"expected {expected}, found {shown(value)}")
        lengths = [len(row) for row in value]
        if lengths != [columns] * rows:
            found = f"{len(value)} rows of {listed(str(n) for n in dict.fromkeys(lengths))}"
            raise self.error(name, f"expected {expected}, found {found if value else 'none'}")
        return np.array([self._numbers(name, row, expected, LARGEST_IN_MATRIX) for row in value])

    def table(self, name: str, known: Iterable[str], *, needed: bool = True) -> Fields | None:
        """Read the table ``[name]``; None if it is missing and not needed."""
        expected = f"a table that begins with the line [{name}]"
        value = self._get(name, MISSING if needed else None, expected)
        return None if value is None else Fields(f"{self.where}, [{name}]", value, known)

    def tables(self, name: str, known: Iterable[str], header: str = "") -> list[Fields]:
        """Read the tables in the list ``name``; none if it is missing.

        Args:
            name: The field.
            known: The names of all possible fields of each table.
            header: The header of one table for messages, for instance ``[[camera]]``.
        """
        value = self._get(name, [], "")
        if not isinstance(value, list):
            how = f"tables that begin with the line {header}" if header else "a list of tables"
            raise self.error(name, f"expected {how}, found {shown(value)}")
        word = header or name
        known = tuple(known)
        return [
            Fields(f"{self.where}, {_called(word, number, item)}", item, known)
            for number, item in enumerate(value, 1)
        ]

    def _numbers(
        self, name: str, value: Any, expected: str, largest: float = LARGEST
    ) -> Float[ndarray, " length"]:
        if not isinstance(value, list):
            raise self.error(name, f"expected {expected}, found {shown(value)}")
        for item in value:
            if not is_number(item, math.inf):
                raise self.error(name, f"expected {expected}, found {shown(item)} among them")
            if not is_number(item, largest):
                raise self.error(
                    name, f"expected {expected} of at most {largest:g}, found {shown(item)}"
                )
        return np.array(value, dtype=float)


def _called(word: str, number: int, item: Any) -> str:
    """Name a table in a message, by its own name if it has one (``camera "cam2"``), else by its
    number (``camera 2``)."""
    name = item.get("name") if isinstance(item, dict) else None
    plain = word.strip("[]")
    return f"{plain} {shown(name)}" if isinstance(name, str) and name else f"{plain} {number}"


def is_number(value: Any, largest: float) -> bool:
    """Whether a value is a finite number whose absolute value is at most the largest."""
    is_one = isinstance(value, int | float) and not isinstance(value, bool)
    limit = min(largest, sys.float_info.max)
    # compared without conversion, since an integer may be too large for a float
    return is_one and -limit <= value <= limit
