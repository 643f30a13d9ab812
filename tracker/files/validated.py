"""JSON that the program wrote: its checksum and its fields are validated when it is read again.

A file holds ``{"sha256": …, "value": …}``, so that a byte that a disk changed is recognised. A file
that a person edited by hand lacks the line ``sha256``; files of earlier versions hold the value
alone. All three are read.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from tracker.files.atomic import size_of, write_whole
from tracker.files.text import shown, visible

logger = logging.getLogger(__name__)

T = TypeVar("T")

MOST_BYTES = 64 * 2**20
"""Largest size of a file that is read, bytes; the program writes none of this size."""

_KEYS = {"sha256", "value"}

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


def write_json(path: Path, value: Any) -> None:
    """Write a value with its checksum to a file, atomically; a missing folder is created.

    Raises:
        OSError: If the file cannot be written; an existing one is unchanged.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    document = {"sha256": _checksum(value), "value": value}
    write_whole(path, json.dumps(document, indent=2, ensure_ascii=False).encode("utf-8"))


def read_json(path: Path) -> Any:
    """Return the value of a file whose checksum is right.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is too large, no JSON, or has another checksum.
    """
    if size_of(path) > MOST_BYTES:
        raise ValueError(f"expected at most {MOST_BYTES >> 20} MB, found a larger file")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found, dict) or not _KEYS >= set(found) or "value" not in found:
            return found
        value = found["value"]
        same = "sha256" not in found or found["sha256"] == _checksum(value)
    except (UnicodeDecodeError, RecursionError):
        raise ValueError("expected JSON, found something else") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"expected JSON, found something else ({error})") from None
    if not same:
        raise ValueError(
            "it was changed since it was written; where that was you, take the line sha256 out"
        )
    return value


def read_as(path: Path, kind: type[T]) -> T:
    """Return the value of a file as a value of a type.

    Args:
        path: The file.
        kind: A dataclass, or any other type that pydantic validates.

    Raises:
        OSError: If the file cannot be read.
        ValueError: If it is invalid; the message has the field, what was expected and what was
            found.
    """
    return parse_json(kind, json.dumps(read_json(path)))


def set_aside(path: Path) -> Path | None:
    """Rename an invalid file, so that its content is not lost; return None if that fails."""
    number = 0
    while True:
        aside = path.with_suffix(f".unreadable{number or ''}.json")
        number += 1
        if not os.path.lexists(aside):
            break
    try:
        path.rename(aside)
    except OSError as error:
        logger.warning("%s cannot be read and not be set aside: %s", path, error)
        return None
    return aside


def _checksum(value: Any) -> str:
    """Return the SHA-256 of a value, which does not depend on the order of keys or on spaces."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
