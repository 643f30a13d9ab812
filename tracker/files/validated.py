"""JSON that the program wrote, validated field by field when it is read again."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from tracker.files.text import shown, visible

T = TypeVar("T")

MOST_LETTERS = 80
"""Most characters of a field's path that a message shows."""

_adapter: Any = cache(TypeAdapter)


class Spoilt(ValueError):
    """Stored JSON does not have the expected structure: it was changed or damaged."""

    def __init__(self, place: str, words: str) -> None:
        """Name the field and the problem.

        Args:
            place: The field's path, joined by full stops; empty for the whole document.
            words: What was expected and what was found.
        """
        super().__init__(f"{place}: {words}" if place else words)
        self.place = place
        self.words = words


def value_of(kind: type[T], text: str | bytes) -> T:
    """Parse JSON into a value of a type.

    Args:
        kind: A dataclass, or any other type that pydantic validates.
        text: The JSON text.

    Raises:
        Spoilt: With the first field that does not have its type.
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
