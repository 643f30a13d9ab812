"""What earlier starts measured: one line a room and case, taken up where it still holds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FILE = "rooms.jsonl"

Rows = dict[tuple[int | str, str], dict[str, Any]]
"""By the room's seed, or the recording's name, and the key of the case."""


def read_rows(folder: Path | None) -> Rows:
    """All rows in a folder; none where there is no file, or no folder."""
    rows: Rows = {}
    if folder is None or not (folder / FILE).is_file():
        return rows
    for line in (folder / FILE).read_text(encoding="utf-8").splitlines():
        try:
            row = json.loads(line)
            rows[row["seed"], row["key"]] = row
        except (ValueError, KeyError, TypeError):
            continue  # a line that was cut off where a start was ended
    return rows


def keep_row(folder: Path | None, row: dict[str, Any]) -> None:
    """Append a row; a line is written at once, so that processes do not mix theirs."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / FILE).open("ab", buffering=0) as file:
        file.write((json.dumps(row, ensure_ascii=False, allow_nan=False) + "\n").encode())
