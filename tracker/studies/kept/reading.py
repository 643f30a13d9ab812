"""What was written down of a study, checked field by field when it is read again."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from tracker.sequences.fields import shown
from tracker.studies.errors import StudyError

T = TypeVar("T")

_adapter: Any = cache(TypeAdapter)


def read_as(kind: type[T], text: str | bytes, where: str) -> T:
    """A value of a kind, from its JSON.

    Args:
        kind: A dataclass, or what its fields are made of.
        text: As it was written.
        where: Named in what is raised: a file, and the place in it.

    Raises:
        StudyError: With the field, what was expected and what was found.
    """
    try:
        value: T = _adapter(kind).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        words = first["msg"].replace("Input should be", "expected")
        if first["type"] == "missing":
            words = "expected a value, found none"
        elif first["type"] == "json_invalid":
            words = f"expected JSON, found something else ({words})"
        else:
            words += f", found {shown(first['input'])}"
        raise StudyError(
            f"{where}{f', {place[:80]}' if place else ''}: {words}; what the study wrote "
            "was changed since: take the file from a copy, or start a study of another name"
        ) from None
    return value
