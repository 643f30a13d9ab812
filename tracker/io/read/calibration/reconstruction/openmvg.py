"""OpenMVG's ``sfm_data.json``: one posed picture a camera that stands still.

The rotation leads from world to camera in OpenCV's axes, the centre is the camera's place:
t = -R C. The lenses are OpenCV's with other names; unit and up are arbitrary.

Source: Moulon et al., "OpenMVG", RRPR 2016, and its "Cameras" and "sfm_data" pages.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.calibration.reconstruction.colmap import MOST_IMAGES
from tracker.io.read.pieces import CalibrationPiece, Convention, Lens, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import (
    focal_and_centre,
    image_size,
    is_list_of_tables,
    need,
    number,
    rotation,
    vector,
)

NAME = "OpenMVG sfm_data.json"
KIND: Kind = "calibration"
SERIES = False

_LENSES: dict[str, tuple[int, tuple[int, ...]]] = {
    "disto_k1": (1, (0,)),
    "disto_k3": (3, (0, 1, 4)),
    "disto_t2": (5, (0, 1, 4, 2, 3)),
}
"""How many numbers, and where each stands in OpenCV's order k1 k2 p1 p2 k3."""

_CONVENTION = Convention(direction="world-to-camera", axes="opencv")


def recognise(file: SourceFile) -> Certainty:
    """JSON that says its version."""
    head = file.head_text
    is_it = head.lstrip()[:1] == "{" and '"sfm_data_version"' in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every picture that has a pose."""
    need(file, file.json, ("views", "intrinsics", "extrinsics"))
    for part in ("views", "intrinsics", "extrinsics"):
        if not is_list_of_tables(file.json[part]):
            raise file.error("expected a list of tables with key and value", part)
    lenses = {one.get("key"): _data(one) for one in file.json["intrinsics"]}
    poses = {one.get("key"): one.get("value") for one in file.json["extrinsics"]}
    views = [_data(one) for one in file.json["views"]]
    posed = [view for view in views if view.get("id_pose") in poses]
    if not 1 <= len(posed) <= MOST_IMAGES:
        raise file.error(
            f"has {len(posed)} views with a pose, expected one picture a camera that stands "
            f"still, from 1 to {MOST_IMAGES}; reconstruct one moment",
            "extrinsics",
        )
    cameras = tuple(
        _camera(file, view, lenses.get(view.get("id_intrinsic")), poses[view.get("id_pose")])
        for view in posed
    )
    yield CalibrationPiece(file.path, NAME, cameras)


def _data(entry: Any) -> dict[str, Any]:
    """What an entry's pointer holds, the fields of its base class among its own."""
    value = entry.get("value")
    wrapper = value.get("ptr_wrapper") if isinstance(value, dict) else None
    data = wrapper.get("data") if isinstance(wrapper, dict) else None
    if not isinstance(data, dict):
        return {}
    base = data.get("value0")
    return {**base, **data} if isinstance(base, dict) else data


def _camera(file: SourceFile, view: dict[str, Any], lens: Any, pose: Any) -> RawCamera:
    name = PurePosixPath(str(view.get("filename", view.get("id_view")))).with_suffix("").as_posix()
    need(file, lens, ("width", "height", "focal_length", "principal_point"), f"lens of {name}")
    need(file, pose, ("rotation", "center"), f"pose of {name}")
    f = number(file, f"{name} focal_length", lens["focal_length"])
    cx, cy = vector(file, f"{name} principal_point", lens["principal_point"], 2, "x y")
    turned = rotation(file, f"{name} rotation", pose["rotation"])
    centre = vector(file, f"{name} center", pose["center"], 3, "x y z")
    distortion, kind = _lens(file, name, lens)
    return RawCamera(
        name=name,
        image_size=image_size(file, name, [lens["width"], lens["height"]]),
        intrinsics=focal_and_centre(f, f, cx, cy),
        distortion=distortion,
        lens=kind,
        rotation=turned,
        translation=-turned @ centre,
        convention=_CONVENTION,
    )


def _lens(file: SourceFile, name: str, lens: dict[str, Any]) -> tuple[Float[ndarray, " n"], Lens]:
    if "fisheye" in lens:
        return vector(file, f"{name} fisheye", lens["fisheye"], 4, "k1 k2 k3 k4"), "fisheye"
    found = np.zeros(5)
    for field, (count, places) in _LENSES.items():
        if field in lens:
            found[list(places)] = vector(file, f"{name} {field}", lens[field], count, "lens")
    return found, "pinhole"
