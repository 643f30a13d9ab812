"""Qualisys Track Manager's exported calibration: ``.qca.txt``, an XML text.

The transform holds the camera's axes in world coordinates (camera to world) and its place
in millimetres, z up; the camera looks along −z with y up. Lengths in the picture are in
1/64 pixel from the sensor's corner, of which the recorded part begins at ``fov_video``.
Radial and tangential coefficients are OpenCV's k1 k2 p1 p2 [k3].

Source: Qualisys, "QTM Real-time Server Protocol", calibration packet.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np

from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import focal_and_centre, rotation, shown

NAME = "Qualisys .qca.txt"
KIND: Kind = "calibration"
SERIES = False

SUBPIXELS = 64.0
"""Units of the file in a pixel."""

_CONVENTION = Convention(unit="mm", direction="camera-to-world", axes="opengl", up="z")


def recognise(file: SourceFile) -> Certainty:
    """XML with cameras whose intrinsics have a focalLengthU."""
    head = file.head_text
    return Certainty.SURE if "<calibration" in head and "focalLengthU" in head else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera that records video; all, where none says so."""
    elements = file.xml.findall("cameras/camera")
    films = [e for e in elements if e.get("model", "none").startswith(("Miqus Video", "none"))]
    cameras = tuple(_camera(file, element) for element in films or elements)
    yield CalibrationPiece(file.path, NAME, cameras)


def _camera(file: SourceFile, element: ElementTree.Element) -> RawCamera:
    name = element.get("serial", "")

    def value(tag: str, field: str) -> float:
        child = element.find(tag)
        text = None if child is None else child.get(field)
        try:
            found = float("nan" if text is None else text)
        except ValueError:
            found = float("nan")
        if not np.isfinite(found):
            raise file.error(
                f"expected a number, found {'none' if text is None else shown(text)}",
                f"camera {name}, {tag} {field}",
            )
        return found

    left, top, right, bottom = (
        value("fov_video", side) for side in ("left", "top", "right", "bottom")
    )
    fu, fv, cu, cv = (
        value("intrinsic", field) / SUBPIXELS
        for field in ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV")
    )
    k1, k2, k3 = (value("intrinsic", f"radialDistortion{n}") for n in (1, 2, 3))
    p1, p2 = (value("intrinsic", f"tangentalDistortion{n}") for n in (1, 2))
    # r11 r12 r13 is the first column of the rotation from camera to world
    turned = [[value("transform", f"r{row}{column}") for row in "123"] for column in "123"]
    return RawCamera(
        name=name,
        image_size=(round(right - left) + 1, round(bottom - top) + 1),
        intrinsics=focal_and_centre(fu, fv, cu - left, cv - top),
        distortion=np.array([k1, k2, p1, p2, k3]),
        rotation=rotation(file, f"camera {name}, transform", turned),
        translation=np.array([value("transform", axis) for axis in "xyz"]),
        convention=_CONVENTION,
    )
