"""Tsai's camera as XML, as PETS 2009 and EPFL's recordings give it: millimetres.

A point (x, y, z) of the world falls on the sensor at f·x_c/z_c, f·y_c/z_c (millimetres),
and is drawn at X_d with X_u = X_d (1 + κ1 |X_d|²): from drawn to straight, the other way
round than OpenCV's model, which is fitted to it.

Source: Tsai, "A versatile camera calibration technique", IEEE J. Robotics and Automation
3(4), 1987, equations 4 to 8; Ferryman, Shahrokni, "PETS2009", 2009.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read import values
from tracker.io.read.pieces import Convention
from tracker.io.read.source import SourceFile
from tracker.io.read.tree_format import Node, TreeFormat, name, number

LARGEST_ERROR = 1.0
"""Pixels that OpenCV's lens may differ from Tsai's anywhere in the picture."""


def _lens(node: Node) -> Mapping[str, Any]:
    sides = [number(node, f"Geometry/{side}") for side in ("width", "height")]
    size = values.image_size(node.file, node.where("Geometry"), sides)
    focal, kappa = number(node, "Intrinsic/focal"), number(node, "Intrinsic/kappa1")
    fx = focal * number(node, "Intrinsic/sx") / number(node, "Geometry/dpx")
    fy = focal / number(node, "Geometry/dpy")
    cx, cy = (number(node, f"Intrinsic/{part}") for part in ("cx", "cy"))
    k = values.focal_and_centre(fx, fy, cx, cy)
    distortion = _distortion(node.file, size, k, kappa * focal * focal)
    return {"image_size": size, "intrinsics": k, "distortion": distortion}


def _pose(node: Node) -> Mapping[str, Any]:
    """R = Rz Ry Rx, and t."""
    from scipy.spatial.transform import Rotation  # a server starts without it

    angles = [number(node, f"Extrinsic/r{axis}") for axis in "xyz"]
    return {
        "rotation": np.asarray(Rotation.from_euler("xyz", angles).as_matrix()),
        "translation": np.array([number(node, f"Extrinsic/t{axis}") for axis in "xyz"]),
    }


TSAI = TreeFormat(
    "Tsai camera XML (PETS, EPFL)",
    "xml",
    cameras=".|*|*/*",
    required=("Geometry/dpx", "Intrinsic/kappa1", "Extrinsic/rx"),
    parts=(name("name"), _lens, _pose),
    convention=Convention(unit="mm", direction="world-to-camera", axes="opencv", up="z"),
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
