"""Text in which a name stands before its numbers: ``K``, ``R``, ``T`` and their kin.

As scripts print matrices (``K1 = [[…], […]]``), and as the files of some data sets are: a name on
a line of its own, or before the numbers, which may go on over several lines. A name that comes
again begins the next camera.
"""

from __future__ import annotations

import re
from typing import Any

from tracker.io.read.calibration.camera_words import split
from tracker.io.read.calibration.named_format import NamedFormat
from tracker.io.read.source import SourceFile
from tracker.io.read.values import NUMBER

MOST_BYTES = 2**20

_TOKEN = re.compile(rf"(?P<name>[A-Za-z_][\w.]*)|(?P<number>{NUMBER})")
_COMMENT = re.compile(r"(?m)(#|//|%).*$")
_WRAPPING = ("array", "matrix", "np", "np.array", "numpy.array", "dtype", "float32", "float64")
"""Words that stand around numbers and name nothing."""


def _may_be(file: SourceFile) -> bool:
    """A short text in which a camera's parts are called so at the beginning of a line."""
    head = file.head_text
    if not head or file.size > MOST_BYTES or head.lstrip()[:1] in ("{", "<") or "%YAML" in head:
        return False
    return any(map(_means_a_camera, head.splitlines()[:200]))


def _means_a_camera(line: str) -> bool:
    word = re.match(r"\s*([A-Za-z_][\w.]*)", line)
    meaning = None if word is None else split(word[1])
    return meaning is not None and meaning[0] not in ("name", "size", "width", "height")


def _values(file: SourceFile) -> Any:
    """A table of the names, or one a camera where they come again."""
    tables: list[dict[str, Any]] = [{}]
    numbers: list[float] | None = None
    for token in _TOKEN.finditer(_COMMENT.sub("", file.text(MOST_BYTES))):
        name = token["name"]
        if name is None:
            if numbers is not None:
                numbers.append(float(token["number"]))
            continue
        if name in _WRAPPING:
            continue
        if name in tables[-1]:
            tables.append({})
        numbers = tables[-1][name] = []
    found = [
        {name: own[0] if len(own) == 1 else own for name, own in table.items() if own}
        for table in tables
    ]
    # what stands before the names that come again is of none of the cameras
    return found[0] if len(found) == 1 else {str(n): table for n, table in enumerate(found)}


LABELLED = NamedFormat("text with K, R, T by name", _values, _may_be)
