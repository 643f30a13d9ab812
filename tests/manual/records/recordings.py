"""What `check` and `import` find in recordings, from the record of `python -m tests.io.checks`."""

from __future__ import annotations

import json
from typing import Any

from tests.manual.places import RECORDS

FILE = RECORDS / "checks.json"

FOUND_WITHIN = 1.0
"""Frames within which an offset counts as found."""

INTRODUCTION = """## Import and check

These tables show how often `check` names the usual mistakes and how accurately it estimates the
delay of a camera, on recordings in which each mistake was made on purpose, and how long the import
and tracking of foreign files takes, without a flag. `python3 -m tests.io.checks --record` makes
them again.
"""

MISTAKES = """Mistakes: translations in millimetres, camera-to-world poses, OpenGL's axes, y up,
corners for sizes, frames counted from 1, parts of the picture for pixels, and two calibrations
exchanged. A mistake counts as named if the right remedy is the only one. *False alarms* are
warnings about the unchanged recording.
"""

OFFSETS = f"""Offsets: the pictures of the second camera begin later by the stated number of frames.
An offset counts as found if the estimate from the motion in the pictures is within
{FOUND_WITHIN:g} frame.
"""

IMPORTS = """From the files to tracks: `import FOLDER -o SEQUENCE` and `track SEQUENCE -o
tracks.csv`, on two cores shared with other work, with an empty cache. The poses of pose2sim-multi
belong to another cut of its videos, so its figures show only that it can be imported and tracked.
"""


def section() -> str:
    """The part of the page of results; empty without a record."""
    if not FILE.is_file():
        return ""
    kept: dict[str, dict[str, dict[str, Any]]] = json.loads(FILE.read_text(encoding="utf-8"))
    parts = [INTRODUCTION, MISTAKES, _mistakes(kept["mistakes"]), "", OFFSETS]
    parts += [_offsets(kept["offsets"]), "", IMPORTS, _imports(kept["imports"]), ""]
    return "\n".join(parts)


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in (head, *rows)]
    return "\n".join([lines[0], f"|{'---|' * len(head)}", *lines[1:]])


def _mistakes(kept: dict[str, dict[str, Any]]) -> str:
    rows = []
    for name, one in kept.items():
        named = one["named"]
        missed = [mistake for mistake, found in named.items() if found != ["right"]]
        told = f"{len(named) - len(missed)} of {len(named)}" if named else "no boxes"
        rows.append([name, told, ", ".join(missed), str(len(one["false alarms"]))])
    asked = [len(one["named"]) for one in kept.values()]
    right = sum(found == ["right"] for one in kept.values() for found in one["named"].values())
    alarms = sum(len(one["false alarms"]) for one in kept.values())
    rows.append(["**all**", f"**{right} of {sum(asked)}**", "", f"**{alarms}**"])
    return _table(["recording", "named", "missed", "false alarms"], rows)


def _offsets(kept: dict[str, dict[str, float]]) -> str:
    cases = list(dict.fromkeys(late for one in kept.values() for late in one))
    rows = [
        [name, *(f"{one[late]:.1f}" if late in one else "" for late in cases)]
        for name, one in kept.items()
    ]
    errors = [abs(found - float(late)) for one in kept.values() for late, found in one.items()]
    good = sum(error <= FOUND_WITHIN for error in errors)
    rows.append([f"**found: {good} of {len(errors)}**", *("" for _ in cases)])
    return _table(["recording", *(f"late by {late}" for late in cases)], rows)


def _imports(kept: dict[str, dict[str, Any]]) -> str:
    def figure(one: dict[str, Any], key: str) -> str:
        return f"{one[key]:.3f}" if key in one else "–"

    rows = [
        [
            name, str(one["cameras"]), str(one["steps"]),
            f"{one['import seconds']:.0f}", f"{one['track seconds']:.0f}",
            figure(one, "mota"), figure(one, "idf1"),
        ]
        for name, one in kept.items()
    ]  # fmt: skip
    head = ["folder", "cameras", "steps", "import (s)", "track (s)", "MOTA", "IDF1"]
    return _table(head, rows)
