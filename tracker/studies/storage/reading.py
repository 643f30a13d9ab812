"""The validation of a study's stored JSON, field by field, when it is read again."""

from __future__ import annotations

from typing import TypeVar

from tracker.files.validated import InvalidJson, parse_json
from tracker.studies.errors import StudyError

T = TypeVar("T")


def read_as(kind: type[T], text: str | bytes, where: str) -> T:
    """Parse JSON into a value of a type.

    Args:
        kind: A dataclass, or any other type that pydantic validates.
        text: The JSON text.
        where: The file and the place in it, for messages.

    Raises:
        StudyError: If the text is not valid; the message names the field, and states what was
            expected and found.
    """
    try:
        return parse_json(kind, text)
    except InvalidJson as error:
        at = f", {error.field}" if error.field else ""
        raise StudyError(
            f"{where}{at}: {error.problem}; what the study wrote "
            "was changed since: take the file from a copy, or start a study of another name"
        ) from None
