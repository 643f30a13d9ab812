"""The kept fingerprints: a JSON file a recording, a line a row, and what differs, in words.

The columns of a row are named in :data:`tests.golden.fingerprint.COLUMNS`.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from tests.golden.fingerprint import COLUMNS, Fingerprint, Row

FOLDER = Path(__file__).parent / "expected"

TOLERANCE = 1e-6
"""Relative; what is nothing but rounding is a thousand million times smaller."""

LEAST = 1e-9
"""Absolute, for sums that are nothing."""

OF_DEVIATIONS = 0.05
"""Relative, for the deviations of tracks: the likelihood of the noise they follow from is flat
around its maximum, and which point of it the search ends at depends on the last bits."""

DEVIATIONS = "tracks", "deviation"
"""Stage and column of :data:`OF_DEVIATIONS`."""

Fingerprints = dict[str, Fingerprint]
"""By combination."""


def path_of(name: str) -> Path:
    """The file of one recording."""
    return FOLDER / f"{name}.json"


def read(name: str) -> Fingerprints:
    """What was found before; nothing where there is no file."""
    path = path_of(name)
    if not path.is_file():
        return {}
    found: Fingerprints = json.loads(path.read_text(encoding="utf-8"))["runs"]
    return found


def write(name: str, runs: Fingerprints) -> None:
    """Keep what was found."""
    FOLDER.mkdir(exist_ok=True)
    whole = {"recording": name, "runs": runs}
    path_of(name).write_text(_text(whole) + "\n", encoding="utf-8")


def _text(value: Any, indent: str = "") -> str:
    if not isinstance(value, dict) or list(value) == ["all"]:
        return json.dumps(value)
    inner = indent + " "
    lines = [f"{inner}{json.dumps(key)}: {_text(one, inner)}" for key, one in value.items()]
    return "{\n" + ",\n".join(lines) + f"\n{indent}}}"


def differences(name: str, expected: Fingerprints, found: Fingerprints) -> list[str]:
    """Every number that differs: recording, combination, stage, step, what, before and after."""
    told = []
    for run in _keys(expected, found):
        before, after = expected.get(run), found.get(run)
        if before is None or after is None:
            told.append(f"{name} / {run}: {'not expected' if before is None else 'not found'}")
            continue
        for stage in _keys(before, after):
            for step in _keys(before.get(stage, {}), after.get(stage, {})):
                place = f"{name} / {run} / {stage} / {step}"
                told += _of_row(
                    place,
                    stage.split()[0],
                    before.get(stage, {}).get(step),
                    after.get(stage, {}).get(step),
                )
    return told


def _keys(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    return list(dict.fromkeys([*before, *after]))


def _of_row(place: str, stage: str, before: Row | None, after: Row | None) -> list[str]:
    columns = COLUMNS[stage]
    if before is None or after is None or not len(columns) == len(before) == len(after):
        return [f"{place}: expected {before}, found {after}"]
    return [
        f"{place} / {column}: expected {old}, found {new}"
        for column, old, new in zip(columns, before, after, strict=True)
        if not same(old, new, OF_DEVIATIONS if (stage, column) == DEVIATIONS else TOLERANCE)
    ]


def same(old: float | None, new: float | None, tolerance: float = TOLERANCE) -> bool:
    """Whether two numbers agree within the tolerance."""
    if old is None or new is None:
        return old is new
    return math.isclose(old, new, rel_tol=tolerance, abs_tol=LEAST)
