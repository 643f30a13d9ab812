"""Calibration formats whose fields have their usual names, wherever they lie in the file.

Source of OpenCV's: "XML/YAML/JSON file storages" (core persistence) and the calib3d module.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from tracker.files.text import shown
from tracker.io.read.calibration.camera_fields import cameras, has_cameras
from tracker.io.read.calibration.camera_words import split
from tracker.io.read.pieces import CalibrationPiece, Convention, FormatError, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import ZIP, SourceFile, listed, read_npz
from tracker.io.read.values import NUMBER, numbers


@dataclass(frozen=True, slots=True)
class NamedFormat:
    """Cameras told by the names of their fields, recognised where there is a camera."""

    KIND: ClassVar[Kind] = "calibration"
    SERIES: ClassVar[bool] = False

    NAME: str
    values: Callable[[SourceFile], Any]
    """The function that makes tables and lists of a file."""
    may_be: Callable[[SourceFile], bool]
    """Whether the beginning of a file may be of the format, so that it is worth parsing."""
    certainty: Certainty = Certainty.POSSIBLE
    convention: Convention = field(default_factory=Convention)

    def recognise(self, file: SourceFile) -> Certainty:
        """The beginning, and a table with a camera's fields."""
        known = self.may_be(file) and has_cameras(self.values(file))
        return self.certainty if known else Certainty.NO

    def read(self, file: SourceFile) -> Iterator[Piece]:
        """One piece with every camera of the file."""
        found = cameras(file, self.values(file), self.convention)
        yield CalibrationPiece(file.path, self.NAME, tuple(found))


MOST_BYTES = 16 * 2**20
"""Of an archive of arrays, packed and unpacked: a few bytes may stand for gigabytes."""


def _may_be_plain(file: SourceFile) -> bool:
    """An archive of arrays, or the beginning of JSON or YAML that can be parsed."""
    head = file.head_text.lstrip()
    if file.head.startswith(ZIP) or head[:1] in ("{", "["):
        return True
    try:
        return ":" in head and "\n" in head and head[:1] != "<" and file.yaml is not None
    except FormatError:  # some other text
        return False


def _values_of_plain(file: SourceFile) -> Any:
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


PLAIN = NamedFormat("JSON, YAML or .npz with K, R, t", _values_of_plain, _may_be_plain)
"""JSON, YAML or ``.npz`` of one's own script: K, R and t by their usual names.

Arrays of an ``.npz`` may have the cameras as their first axis: K (C, 3, 3), t (C, 3).
"""


_MOST_OF_TEXT = 2**20

_TOKEN = re.compile(rf"(?P<name>[A-Za-z_][\w.]*)|(?P<number>{NUMBER})")
_COMMENT = re.compile(r"(?m)(#|//|%).*$")
_WRAPPING = ("array", "matrix", "np", "np.array", "numpy.array", "dtype", "float32", "float64")
"""Words that stand around numbers and name nothing."""


def _may_be_labelled(file: SourceFile) -> bool:
    """A short text in which a camera's parts are called so at the beginning of a line."""
    head = file.head_text
    if not head or file.size > _MOST_OF_TEXT or head.lstrip()[:1] in ("{", "<") or "%YAML" in head:
        return False
    return any(map(_means_a_camera, head.splitlines()[:200]))


def _means_a_camera(line: str) -> bool:
    word = re.match(r"\s*([A-Za-z_][\w.]*)", line)
    meaning = None if word is None else split(word[1])
    return meaning is not None and meaning[0] not in ("name", "size", "width", "height")


def _values_of_labelled(file: SourceFile) -> Any:
    """A table of the names, or one a camera where they come again."""
    tables: list[dict[str, Any]] = [{}]
    numbers: list[float] | None = None
    for token in _TOKEN.finditer(_COMMENT.sub("", file.text(_MOST_OF_TEXT))):
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


LABELLED = NamedFormat("text with K, R, T by name", _values_of_labelled, _may_be_labelled)
"""Text in which a name stands before its numbers: ``K``, ``R``, ``T`` and their kin.

As scripts print matrices (``K1 = [[…], […]]``), and as the files of some data sets are: a name on
a line of its own, or before the numbers, which may go on over several lines. A name that comes
again begins the next camera.
"""


def _may_be_opencv(file: SourceFile) -> bool:
    """The root ``opencv_storage``, or matrices of the type ``opencv-matrix``."""
    return re.search(r"<opencv_storage>|opencv-matrix|\A%YAML:1", file.head_text) is not None


def _values_of_opencv(file: SourceFile) -> Any:
    return _as_lists(file, file.tree, "")


def _as_lists(file: SourceFile, value: Any, field: str) -> Any:
    """Matrices as lists in place of tables with rows, cols and data; lists of XML as lists."""
    if isinstance(value, Mapping):
        if "data" in value and ("sizes" in value or {"rows", "cols"} <= value.keys()):
            sizes = value.get("sizes", [value.get("rows"), value.get("cols")])
            return _matrix(file, field, sizes, value["data"])
        if value.keys() == {"_"}:
            return _as_lists(file, listed(value["_"]), field)
        return {str(key): _as_lists(file, item, str(key)) for key, item in value.items()}
    if isinstance(value, list):
        return [_as_lists(file, item, field) for item in value]
    return value.strip().strip('"') if isinstance(value, str) else value


def _matrix(file: SourceFile, field: str, sizes: Any, data: Any) -> list[float]:
    count = np.prod(numbers(file, field, sizes))
    found = numbers(file, field, data)
    if count < 1 or len(found) % count:  # several numbers an element, where it has channels
        raise file.error(f"expected {count:g} numbers, found {len(found)} ({shown(data)})", field)
    return [float(each) for each in found]


OPENCV = NamedFormat(
    "OpenCV FileStorage",
    _values_of_opencv,
    _may_be_opencv,
    Certainty.SURE,
    Convention(direction="world-to-camera", axes="opencv"),
)
"""OpenCV's FileStorage: XML, YAML and JSON with the matrices of its calibration functions.

Also what follows it: WILDTRACK's pairs of a lens and a pose, EasyMocap's ``intri.yml`` and
``extri.yml``, stereo calibrations with M1 D1 M2 D2 R T. R and T lead from world to camera,
as `projectPoints` takes them; the unit is that of the board.
"""
