"""What was written down of a study, checked field by field when it is read again."""

from __future__ import annotations

from typing import TypeVar

from tracker.files.validated import Spoilt, value_of
from tracker.studies.errors import StudyError

T = TypeVar("T")


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
        return value_of(kind, text)
    except Spoilt as spoilt:
        at = f", {spoilt.place}" if spoilt.place else ""
        raise StudyError(
            f"{where}{at}: {spoilt.words}; what the study wrote "
            "was changed since: take the file from a copy, or start a study of another name"
        ) from None
