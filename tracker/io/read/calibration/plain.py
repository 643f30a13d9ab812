"""JSON, YAML or ``.npz`` of one's own script: K, R and t by their usual names.

Arrays of an ``.npz`` may have the cameras as their first axis: K (C, 3, 3), t (C, 3).
"""

from __future__ import annotations

from typing import Any

from tracker.io.read.calibration.named_format import NamedFormat
from tracker.io.read.pieces import FormatError
from tracker.io.read.source import ZIP, SourceFile, read_npz

MOST_BYTES = 16 * 2**20
"""Of an archive of arrays, packed and unpacked: a few bytes may stand for gigabytes."""


def _may_be(file: SourceFile) -> bool:
    """An archive of arrays, or the beginning of JSON or YAML that can be parsed."""
    head = file.head_text.lstrip()
    if file.head.startswith(ZIP) or head[:1] in ("{", "["):
        return True
    try:
        return ":" in head and "\n" in head and head[:1] != "<" and file.yaml is not None
    except FormatError:  # some other text
        return False


def _values(file: SourceFile) -> Any:
    return _arrays(file) if file.head.startswith(ZIP) else file.tree


def _arrays(file: SourceFile) -> dict[str, Any]:
    """The arrays of an archive by their names, or a table of them a camera."""
    data = file.bytes(MOST_BYTES)
    try:
        arrays = read_npz(data, MOST_BYTES)
    except ValueError:
        return {}  # some other archive
    if arrays is None:
        raise file.error(
            f"unpacks to more than {MOST_BYTES / 2**20:.0f} MB, expected a calibration"
        )
    lenses = [own for own in arrays.values() if own.ndim == 3 and own.shape[1:] == (3, 3)]
    if not lenses:
        return {name: own.tolist() for name, own in arrays.items()}
    count = len(lenses[0])
    return {
        str(camera): {
            name: own[camera].tolist()
            for name, own in arrays.items()
            if own.ndim > 1 and len(own) == count
        }
        for camera in range(count)
    }


PLAIN = NamedFormat("JSON, YAML or .npz with K, R, t", _values, _may_be)
