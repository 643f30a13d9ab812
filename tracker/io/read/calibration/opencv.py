"""OpenCV's FileStorage: XML, YAML and JSON with the matrices of its calibration functions.

Also what follows it: WILDTRACK's pairs of a lens and a pose, EasyMocap's ``intri.yml`` and
``extri.yml``, stereo calibrations with M1 D1 M2 D2 R T. R and T lead from world to camera,
as `projectPoints` takes them; the unit is that of the board.

Source: OpenCV, "XML/YAML/JSON file storages" (core persistence) and the calib3d module.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from tracker.files.text import shown
from tracker.io.read.calibration.named_format import NamedFormat
from tracker.io.read.pieces import Convention
from tracker.io.read.protocol import Certainty
from tracker.io.read.source import SourceFile, listed
from tracker.io.read.values import numbers


def _may_be(file: SourceFile) -> bool:
    """The root ``opencv_storage``, or matrices of the type ``opencv-matrix``."""
    return re.search(r"<opencv_storage>|opencv-matrix|\A%YAML:1", file.head_text) is not None


def _values(file: SourceFile) -> Any:
    return _plain(file, file.tree, "")


def _plain(file: SourceFile, value: Any, field: str) -> Any:
    """Matrices as lists in place of tables with rows, cols and data; lists of XML as lists."""
    if isinstance(value, Mapping):
        if "data" in value and ("sizes" in value or {"rows", "cols"} <= value.keys()):
            sizes = value.get("sizes", [value.get("rows"), value.get("cols")])
            return _matrix(file, field, sizes, value["data"])
        if value.keys() == {"_"}:
            return _plain(file, listed(value["_"]), field)
        return {str(key): _plain(file, item, str(key)) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(file, item, field) for item in value]
    return value.strip().strip('"') if isinstance(value, str) else value


def _matrix(file: SourceFile, field: str, sizes: Any, data: Any) -> list[float]:
    count = np.prod(numbers(file, field, sizes))
    found = numbers(file, field, data)
    if count < 1 or len(found) % count:  # several numbers an element, where it has channels
        raise file.error(f"expected {count:g} numbers, found {len(found)} ({shown(data)})", field)
    return [float(each) for each in found]


OPENCV = NamedFormat(
    "OpenCV FileStorage",
    _values,
    _may_be,
    Certainty.SURE,
    Convention(direction="world-to-camera", axes="opencv"),
)
