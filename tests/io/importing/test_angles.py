"""Calibrations whose rotations are three angles: the boxes tell how these are composed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.conftest import short
from tests.io.read.recorded import PLACES, settled_of
from tests.io.read.rig import FLIP, boxes, cameras
from tracker.geometry.camera import Camera
from tracker.io.importing.options import ImportOptions
from tracker.io.read.pieces import FormatError

BODY = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From a camera that looks ahead to a body with x ahead and z up."""


def rolled() -> list[Camera]:
    """Cameras of which no angle is 0 in any order."""
    found = []
    for number, camera in enumerate(cameras(distortion=False)):
        roll = Rotation.from_euler("z", (-1) ** number * (0.1 + 0.04 * number)).as_matrix()
        found.append(
            replace(camera, rotation=roll @ camera.rotation, translation=roll @ camera.translation)
        )
    return found


def angles(rotation: np.ndarray, product: str) -> list[float]:
    """By x, y, z, radians, so that R is the product of the turns in this order."""
    found = dict(
        zip(product, Rotation.from_matrix(rotation).as_euler(product.upper()), strict=True)
    )
    return [float(found[axis]) for axis in "xyz"]


def degrees(rotation: np.ndarray, product: str) -> list[float]:
    return np.degrees(angles(rotation, product)).tolist()


def photogrammetry(camera: Camera) -> dict[str, Any]:
    three = degrees(camera.rotation.T @ FLIP, "xyz")
    return {
        **dict(zip(("omega", "phi", "kappa"), three, strict=True)),
        **dict(zip("xyz", camera.centre.tolist(), strict=True)),
    }


def blender(camera: Camera) -> dict[str, Any]:
    return {
        "rotation_euler": angles(camera.rotation.T @ FLIP, "zyx"),
        "location": camera.centre.tolist(),
    }


def body(camera: Camera) -> dict[str, Any]:
    roll, pitch, yaw = degrees(camera.rotation.T @ BODY.T, "zyx")
    place = dict(zip(("pos_x", "pos_y", "pos_z"), camera.centre.tolist(), strict=True))
    return {"yaw_deg": yaw, "pitch_deg": pitch, "roll_deg": roll, **place}


def of_the_view(camera: Camera) -> dict[str, Any]:
    pitch, yaw, roll = degrees(camera.rotation.T, "yxz")
    return {"orientation": {"yaw": yaw, "pitch": pitch, "roll": roll},
            "position": dict(zip("xyz", camera.centre.tolist(), strict=True))}  # fmt: skip


def into_the_camera(product: str) -> Callable[[Camera], dict[str, Any]]:
    def table(camera: Camera) -> dict[str, Any]:
        three = dict(zip(("rx", "ry", "rz"), degrees(camera.rotation, product), strict=True))
        return {**three, **dict(zip(("tx", "ty", "tz"), camera.translation.tolist(), strict=True))}

    return table


def with_a_place(camera: Camera) -> dict[str, Any]:
    return {"euler_angles": angles(camera.rotation, "xzy"), "position": camera.centre.tolist()}


FORMS: dict[str, tuple[Callable[[Camera], dict[str, Any]], str]] = {
    "omega, phi, kappa": (photogrammetry, "Rx Ry Rz in degrees"),
    "Blender": (blender, "Rz Ry Rx in radians"),
    "yaw, pitch, roll of a body": (body, "flu in degrees"),
    "yaw, pitch, roll of a view": (of_the_view, "ypr in degrees"),
    "x after y after z": (into_the_camera("xyz"), "Rx Ry Rz in degrees"),
    "y after z after x": (into_the_camera("yzx"), "Ry Rz Rx in degrees"),
    "into the camera": (with_a_place, "Rx Rz Ry, into the camera in radians"),
}


def lay_out(folder: Path, form: str, *, seen: bool = True) -> None:
    """Calibration and boxes; or too few boxes to tell anything."""
    tables = {}
    for camera in rolled():
        tables[camera.name] = {"K": camera.intrinsics.tolist(), **FORMS[form][0](camera)}
        frames, four = boxes(camera, PLACES)
        rows = [f"{f},{','.join(map(str, box))}" for f, box in zip(frames, four, strict=True)]
        text = "\n".join(["frame,left,top,width,height", *(rows if seen else ["0,5,5,20,40"])])
        (folder / f"{camera.name}.csv").write_text(text)
    (folder / "rig.json").write_text(json.dumps(tables))


@pytest.mark.parametrize("form", short(FORMS, 2))
def test_the_boxes_tell_how_angles_are_composed(tmp_path: Path, form: str) -> None:
    lay_out(tmp_path, form)
    settled = settled_of(tmp_path)
    for view, camera in zip(settled.views, rolled(), strict=True):
        np.testing.assert_allclose(view.camera.rotation, camera.rotation, atol=1e-6)
        np.testing.assert_allclose(view.camera.centre, camera.centre, atol=1e-6)
    assert dict(settled.found)["angles"].startswith(FORMS[form][1])


def test_an_order_that_is_stated_is_believed(tmp_path: Path) -> None:
    lay_out(tmp_path, "x after y after z")
    settled = settled_of(tmp_path, ImportOptions(turns="xyz"))
    assert dict(settled.found)["angles"].startswith("Rx Ry Rz")
    with pytest.raises(FormatError, match=r"expected --euler vector, zyx, .* found yes"):
        settled_of(tmp_path, ImportOptions(turns="yes"))


def test_without_boxes_the_order_is_asked_for(tmp_path: Path) -> None:
    lay_out(tmp_path, "into the camera", seen=False)
    with pytest.raises(FormatError, match=r"their order; --euler says it \(zyx, "):
        settled_of(tmp_path)
    settled = settled_of(tmp_path, ImportOptions(turns="xzy-inverse", unit="m"))
    np.testing.assert_allclose(settled.views[0].camera.rotation[2, 2], rolled()[0].rotation[2, 2])
