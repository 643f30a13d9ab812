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


class InvalidJson(ValueError):
    """Stored JSON does not have the expected structure: it was changed or damaged."""

    def __init__(self, field: str, problem: str) -> None:
        """Name the field and the problem.

        Args:
            field: The field's path, joined by full stops; empty for the whole document.
            problem: What was expected and what was found.
        """
        super().__init__(f"{field}: {problem}" if field else problem)
        self.field = field
        self.problem = problem


def parse_json(kind: type[T], text: str | bytes) -> T:
    """Parse JSON into a value of a type.

    Args:
        kind: A dataclass, or any other type that pydantic validates.
        text: The JSON text.

    Raises:
        InvalidJson: If the text is no JSON, or a field does not have its type; it names the first.
    """
    try:
        value: T = _adapter(kind).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        field = visible(".".join(str(part) for part in first["loc"]))[:MOST_LETTERS]
        problem = first["msg"].replace("Input should be", "expected")
        if first["type"] == "missing":
            problem = "expected a value, found none"
        elif first["type"] == "json_invalid":  # for instance an unpaired surrogate in a string
            problem = f"expected JSON, found something else ({problem})"
        else:
            problem += f", found {visible(shown(first['input']))}"
        raise InvalidJson(field, problem) from None
    return value
