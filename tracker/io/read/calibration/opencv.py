"""OpenCV's FileStorage: XML, YAML and JSON with the matrices of its calibration functions.

Also what follows it: WILDTRACK's pairs of a lens and a pose, EasyMocap's ``intri.yml`` and
``extri.yml``, stereo calibrations with M1 D1 M2 D2 R T. R and T lead from world to camera,
as `projectPoints` takes them; the unit is that of the board.

Source: OpenCV, "XML/YAML/JSON file storages" (core persistence) and the calib3d module.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from tracker.files.text import shown
from tracker.io.read.calibration.camera_fields import cameras, has_cameras
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import numbers

NAME = "OpenCV FileStorage"
KIND: Kind = "calibration"
SERIES = False

CONVENTION = Convention(direction="world-to-camera", axes="opencv")


def recognise(file: SourceFile) -> Certainty:
    """The root ``opencv_storage``, or matrices of the type ``opencv-matrix``, with a camera."""
    head = file.head_text
    if not re.search(r"<opencv_storage>|opencv-matrix|\A%YAML:1", head):
        return Certainty.NO
    return Certainty.SURE if has_cameras(_values(file)) else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera of the file."""
    yield CalibrationPiece(file.path, NAME, tuple(cameras(file, _values(file), CONVENTION)))


def _values(file: SourceFile) -> Any:
    start = file.head_text.lstrip()[:1]
    if start == "<":
        return _of_xml(file, file.xml)
    return _plain(file, file.json if start == "{" else file.yaml, "")


def _plain(file: SourceFile, value: Any, field: str) -> Any:
    """Matrices as nested lists in place of tables with rows, cols and data."""
    if isinstance(value, Mapping):
        if "rows" in value and "cols" in value and "data" in value:
            return _matrix(file, field, [value["rows"], value["cols"]], value["data"])
        if "sizes" in value and "data" in value:
            return _matrix(file, field, value["sizes"], value["data"])
        return {str(key): _plain(file, item, str(key)) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(file, item, field) for item in value]
    return value


def _of_xml(file: SourceFile, element: ElementTree.Element) -> Any:
    children = list(element)
    if element.get("type_id") in ("opencv-matrix", "opencv-nd-matrix"):
        parts = {child.tag: child.text or "" for child in children}
        if "sizes" in parts and "data" in parts:
            return _matrix(file, element.tag, parts["sizes"], parts["data"])
        if not {"rows", "cols", "data"} <= parts.keys():
            raise file.error("expected a matrix with rows, cols and data", element.tag)
        return _matrix(file, element.tag, [parts["rows"], parts["cols"]], parts["data"])
    if not children:
        text = (element.text or "").strip()
        try:
            return [float(word) for word in text.split()] if text else text
        except ValueError:
            return text.strip('"')
    if all(child.tag == "_" for child in children):
        return [_of_xml(file, child) for child in children]
    return {child.tag: _of_xml(file, child) for child in children}


def _matrix(file: SourceFile, field: str, sizes: Any, data: Any) -> list[float]:
    count = np.prod(numbers(file, field, sizes))
    found = numbers(file, field, data)
    if count < 1 or len(found) % count:  # several numbers an element, where it has channels
        raise file.error(f"expected {count:g} numbers, found {len(found)} ({shown(data)})", field)
    return [float(each) for each in found]
