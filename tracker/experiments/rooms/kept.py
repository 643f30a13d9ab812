"""What earlier starts measured: one line a room and case, taken up where it still holds."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from tracker.experiments.rooms.cases import Case, parameters_of
from tracker.parameters import method_of
from tracker.runs.numbers_version import method_version, numbers_version
from tracker.sequences.rendering.random_rooms import VERSION

FILE = "rooms.jsonl"


def key_of(case: Case, steps: int | None) -> str:
    """Of what a row depends on beside the room: code, numbers, and how much of it is tracked."""
    method = method_of("single_view", case.method)
    stages = ("single_view", "fusion", "tracks")
    code = [numbers_version(stage) for stage in stages]
    values = parameters_of(case).model_dump(mode="json")
    parts = [VERSION, code, method_version(method), values, case.templates, steps]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


class Kept:
    """The rows of a file, and the file, which grows by a line as soon as a row is there.

    Args:
        folder: Where the file is or will be; None to keep nothing.
    """

    def __init__(self, folder: Path | None) -> None:
        self._path = None if folder is None else folder / FILE
        self._rows: dict[tuple[int, str], dict[str, Any]] = {}
        if self._path is not None and self._path.is_file():
            for line in self._path.read_text(encoding="utf-8").splitlines():
                try:
                    row = json.loads(line)
                    self._rows[row["seed"], row["key"]] = row
                except (ValueError, KeyError, TypeError):
                    continue  # a line that was cut off where a start was ended

    def get(self, seed: int, key: str) -> dict[str, Any] | None:
        """A row that still holds."""
        return self._rows.get((seed, key))

    def add(self, row: dict[str, Any], key: str) -> None:
        """Keep a row, on disk as well."""
        row = {**row, "key": key}
        self._rows[row["seed"], key] = row
        if self._path is not None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row, ensure_ascii=False, allow_nan=False) + "\n")
