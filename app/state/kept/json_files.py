"""Small files that a person would miss: written wholly or not at all, and checked when read.

A file holds ``{"sha256": …, "value": …}``: a byte that a disk changed is found out. Whoever edits
one by hand leaves the line ``sha256`` out. Files of before, with the value alone, are read too.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import stat
from pathlib import Path
from typing import Any, TypeVar

from tracker.files.atomic import write_whole
from tracker.files.validated import parse_json

logger = logging.getLogger("app")

T = TypeVar("T")

_KEYS = {"sha256", "value"}

MOST_BYTES = 64 * 2**20


def write_json(path: Path, value: Any) -> None:
    """Write a value wholly or not at all, whatever interrupts it.

    Raises:
        OSError: If the place cannot be written to; what was there still is.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    document = {"sha256": _sum(value), "value": value}
    write_whole(path, json.dumps(document, indent=2, ensure_ascii=False).encode("utf-8"))


def read_json(path: Path) -> Any:
    """The value of a file.

    Raises:
        OSError: If it cannot be read.
        ValueError: If it is spoilt, in words.
    """
    there = path.stat()
    if not stat.S_ISREG(there.st_mode):  # whoever reads a pipe waits
        raise ValueError("expected a file, found a folder, pipe or device")
    if there.st_size > MOST_BYTES:
        raise ValueError(f"expected at most {MOST_BYTES >> 20} MB, found a larger file")
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(found, dict) or not _KEYS >= set(found) or "value" not in found:
            return found
        value = found["value"]
        same = "sha256" not in found or found["sha256"] == _sum(value)
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
    """The value of a file, checked field by field.

    Raises:
        OSError: If it cannot be read.
        ValueError: With the field, what was expected and what was found.
    """
    return parse_json(kind, json.dumps(read_json(path)))


def set_aside(path: Path) -> Path | None:
    """Give a spoilt file another name, so that nothing of it is lost; None where that fails."""
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


def _sum(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
