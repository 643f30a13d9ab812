"""Tsai's camera as XML, as PETS 2009 and EPFL's recordings give it: millimetres.

A point (x, y, z) of the world falls on the sensor at f·x_c/z_c, f·y_c/z_c (millimetres),
and is drawn at X_d with X_u = X_d (1 + κ1 |X_d|²): from drawn to straight, the other way
round than OpenCV's model, which is fitted to it.

Source: Tsai, "A versatile camera calibration technique", IEEE J. Robotics and Automation
3(4), 1987, equations 4 to 8; Ferryman, Shahrokni, "PETS2009", 2009.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import focal_and_centre, image_size, number

NAME = "Tsai camera XML (PETS, EPFL)"
KIND: Kind = "calibration"
SERIES = False

LARGEST_ERROR = 1.0
"""Pixels that OpenCV's lens may differ from Tsai's anywhere in the picture."""

_CONVENTION = Convention(unit="mm", direction="world-to-camera", axes="opencv", up="z")


def recognise(file: SourceFile) -> Certainty:
    """XML with a Geometry that has dpx and an Intrinsic that has kappa1."""
    head = file.head_text
    is_it = "<" in head and "kappa1" in head and "dpx" in head and "Extrinsic" in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera of the file."""
    cameras = [e for e in file.xml.iter() if e.find("Geometry") is not None]
    if not cameras:
        raise file.error("expected a camera with Geometry, Intrinsic and Extrinsic, found none")
    yield CalibrationPiece(file.path, NAME, tuple(_camera(file, camera) for camera in cameras))


def _camera(file: SourceFile, element: ElementTree.Element) -> RawCamera:
    from scipy.spatial.transform import Rotation  # a server starts without it

    def value(tag: str, field: str) -> float:
        child = element.find(tag)
        text = None if child is None else child.get(field)
        return number(file, f"{tag} {field}", text)

    size = image_size(file, "Geometry", [value("Geometry", "width"), value("Geometry", "height")])
    focal, kappa = value("Intrinsic", "focal"), value("Intrinsic", "kappa1")
    fx = focal * value("Intrinsic", "sx") / value("Geometry", "dpx")
    fy = focal / value("Geometry", "dpy")
    k = focal_and_centre(fx, fy, value("Intrinsic", "cx"), value("Intrinsic", "cy"))
    angles = [value("Extrinsic", f"r{axis}") for axis in "xyz"]
    return RawCamera(
        name=element.get("name", ""),
        image_size=size,
        intrinsics=k,
        distortion=_distortion(file, size, k, kappa * focal * focal),
        # R = Rz Ry Rx
        rotation=np.asarray(Rotation.from_euler("xyz", angles).as_matrix()),
        translation=np.array([value("Extrinsic", f"t{axis}") for axis in "xyz"]),
        convention=_CONVENTION,
    )


def _distortion(
    file: SourceFile, size: tuple[int, int], k: Float[ndarray, "3 3"], kappa: float
) -> Float[ndarray, " 5"]:
    """k1, k2, k3 of OpenCV's model that draw what κ (in units of the focal length) draws."""
    corners = np.array([[x, y] for x in (0.0, size[0] - 1.0) for y in (0.0, size[1] - 1.0)])
    radii = np.linalg.norm((corners - k[:2, 2]) / [k[0, 0], k[1, 1]], axis=1)
    drawn = np.linspace(0.0, radii.max(), 200)[1:]
    straight = drawn * (1.0 + kappa * drawn**2)
    if (np.diff(straight) <= 0.0).any():
        raise file.error("draws the picture's corners twice; it is spoilt", "Intrinsic kappa1")
    powers = straight[:, None] ** [3, 5, 7]
    k1, k2, k3 = np.linalg.lstsq(powers, drawn - straight, rcond=None)[0]
    error = np.abs(straight + powers @ [k1, k2, k3] - drawn).max() * max(k[0, 0], k[1, 1])
    if error > LARGEST_ERROR:
        raise file.error(
            f"the lens is too strong for OpenCV's model (off by {error:.1f} px)",
            "Intrinsic kappa1",
        )
    return np.array([k1, k2, 0.0, 0.0, k3])
