"""Agisoft Metashape's ``cameras.xml``: one aligned picture a camera that stands still.

Poses lead from camera to chunk in OpenCV's axes. With x, y straight in front of the lens and
r² = x² + y², a point is drawn at

    u = w/2 + cx + x' f + x' b1 + y' b2,   x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶)
                                                + p1 (r² + 2 x²) + 2 p2 x y
    v = h/2 + cy + y' f,                   y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶)
                                                + p2 (r² + 2 y²) + 2 p1 x y

from the corner of the top-left pixel: p1 and p2 are OpenCV's p2 and p1. A chunk's scale leads
to metres; without one the unit is arbitrary, as up always is.

Source: Agisoft, "Metashape user manual", appendix D, "Camera models".
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np

from tracker.io.read.calibration.reconstruction.colmap import CORNER, MOST_IMAGES
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import image_size, matrix, number, rotation

NAME = "Metashape cameras XML"
KIND: Kind = "calibration"
SERIES = False

_KNOWN = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "p1", "p2")
_UNKNOWN = ("k4", "p3", "p4")
"""Of the lens, what OpenCV's has not."""


def recognise(file: SourceFile) -> Certainty:
    """XML with a chunk of sensors and cameras."""
    head = file.head_text
    is_it = "<chunk" in head and "<sensors" in head and "<document" in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every picture that is aligned."""
    root = file.xml
    sensors = {one.get("id", ""): one for one in root.iter("sensor")}
    aligned = [one for one in root.iter("camera") if one.findtext("transform")]
    if not 1 <= len(aligned) <= MOST_IMAGES:
        raise file.error(
            f"has {len(aligned)} aligned pictures, expected one picture a camera that stands "
            f"still, from 1 to {MOST_IMAGES}; export a chunk of one moment"
        )
    text = root.findtext(".//transform/scale")
    scale = None if text is None else number(file, "transform scale", text)
    cameras = tuple(_camera(file, one, sensors, scale) for one in aligned)
    yield CalibrationPiece(file.path, NAME, cameras)


def _camera(
    file: SourceFile,
    element: ElementTree.Element,
    sensors: dict[str, ElementTree.Element],
    scale: float | None,
) -> RawCamera:
    name = element.get("label", element.get("id", ""))
    sensor = sensors.get(element.get("sensor_id", ""))
    lens = None if sensor is None else sensor.find("calibration[@class='adjusted']")
    if sensor is None or lens is None:
        raise file.error("has no adjusted calibration of its sensor; align the pictures", name)
    kind = lens.get("type", sensor.get("type", "frame"))
    values = {
        part.tag: number(file, f"{name} {part.tag}", part.text)
        for part in lens
        if part.tag in (*_KNOWN, *_UNKNOWN)
    }
    odd = [part for part in _UNKNOWN if values.get(part)]
    if kind != "frame" or odd or "f" not in values:
        raise file.error(
            f'expected a lens of type "frame" with f and at most k1 k2 k3 p1 p2, found '
            f'"{kind}"{" with " + ", ".join(odd) if odd else ""}; optimize the cameras with '
            "those alone",
            name,
        )
    size = lens.find("resolution")
    if size is None:
        raise file.error("expected the resolution of its calibration", name)
    width, height = image_size(file, f"{name} resolution", [size.get("width"), size.get("height")])
    f, b1, b2 = values["f"], values.get("b1", 0.0), values.get("b2", 0.0)
    centre = np.array([width, height]) / 2.0 + [values.get("cx", 0.0), values.get("cy", 0.0)]
    k = np.array([[f + b1, b2, centre[0] - CORNER], [0.0, f, centre[1] - CORNER], [0.0, 0.0, 1.0]])
    parts = ("k1", "k2", "p2", "p1", "k3")
    pose = matrix(file, f"{name} transform", element.findtext("transform"), 4, 4)
    return RawCamera(
        name=name,
        image_size=(width, height),
        intrinsics=k,
        distortion=np.array([values.get(part, 0.0) for part in parts]),
        rotation=rotation(file, f"{name} transform", pose[:3, :3]),
        translation=pose[:3, 3] * (1.0 if scale is None else scale),
        convention=Convention(
            unit=None if scale is None else "m", direction="camera-to-world", axes="opencv"
        ),
    )
