"""JSON that was written by the program, checked field by field when it is read again."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from tracker.files.text import shown, visible

T = TypeVar("T")

MOST_LETTERS = 80
"""Of the place of a field."""

_adapter: Any = cache(TypeAdapter)


class Spoilt(ValueError):
    """What was read is not what was written."""

    def __init__(self, place: str, words: str) -> None:
        """Tell a field and what is wrong with it.

        Args:
            place: Its names, joined by full stops; empty for the whole.
            words: What was expected and what was found.
        """
        super().__init__(f"{place}: {words}" if place else words)
        self.place = place
        self.words = words


def value_of(kind: type[T], text: str | bytes) -> T:
    """A value of a kind, from its JSON.

    Args:
        kind: A dataclass, or what its fields are made of.
        text: As it was written.

    Raises:
        Spoilt: With the first field that is not of its kind.
    """
    try:
        value: T = _adapter(kind).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = visible(".".join(str(part) for part in first["loc"]))[:MOST_LETTERS]
        words = first["msg"].replace("Input should be", "expected")
        if first["type"] == "missing":
            words = "expected a value, found none"
        elif first["type"] == "json_invalid":  # as half a letter in a name
            words = f"expected JSON, found something else ({words})"
        else:
            words += f", found {visible(shown(first['input']))}"
        raise Spoilt(place, words) from None
    return value
