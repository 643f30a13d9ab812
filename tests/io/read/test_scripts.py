"""Calibrations as people's own scripts, data sets and less usual programs write them."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from scipy.spatial.transform import Rotation

from tests.io.read.rig import SIZE, assert_cameras, assert_same, cameras, raw_cameras, read
from tracker.geometry.camera import Camera
from tracker.io.importing.finding.calibrations import camera_sets
from tracker.io.importing.gathering import gather
from tracker.io.read.pieces import FormatError
from tracker.io.read.registry import recognise
from tracker.io.read.source import SourceFile

WIDTH, HEIGHT = SIZE


def pose_of(camera: Camera, *, inverse: bool = False) -> ndarray:
    """World to camera, 4×4; or the inverse."""
    pose = np.eye(4)
    pose[:3] = np.column_stack([camera.rotation, camera.translation])
    return np.linalg.inv(pose) if inverse else pose


def rotation_vector(camera: Camera) -> ndarray:
    return np.asarray(Rotation.from_matrix(camera.rotation).as_rotvec())


def quaternion(rotation: ndarray) -> list[float]:
    """x y z w."""
    found: list[float] = Rotation.from_matrix(rotation).as_quat().tolist()
    return found


def lens_by_name(camera: Camera) -> dict[str, float]:
    return dict(zip(("k1", "k2", "p1", "p2", "k3"), camera.distortion.tolist(), strict=True))


def by_numbers(camera: Camera) -> dict[str, Any]:
    k = camera.intrinsics
    return {
        "intrinsics": {"fx": k[0, 0], "fy": k[1, 1], "cx": k[0, 2], "cy": k[1, 2]},
        "distortion": lens_by_name(camera),
        "extrinsics": {
            "rotation": camera.rotation.tolist(),
            "translation": dict(zip("xyz", camera.translation.tolist(), strict=True)),
        },
    }


def by_numbers_flat(camera: Camera) -> dict[str, Any]:
    nested = by_numbers(camera)
    q = dict(zip(("qx", "qy", "qz", "qw"), quaternion(camera.rotation), strict=True))
    t = dict(zip(("tx", "ty", "tz"), camera.translation.tolist(), strict=True))
    return {**nested["intrinsics"], **nested["distortion"], **q, **t}


def openxrlab(camera: Camera) -> dict[str, Any]:
    k1, k2, p1, p2, k3 = camera.distortion.tolist()
    k = np.eye(4)
    k[:3, :3] = camera.intrinsics
    return {
        "class_name": "FisheyeCameraParameter", "convention": "opencv", "world2cam": True,
        "extrinsic_r": camera.rotation.tolist(), "extrinsic_t": camera.translation.tolist(),
        "intrinsic": k.tolist(), "k": [k1, k2, k3, 0.0, 0.0, 0.0], "p": [p1, p2],
        "width": WIDTH, "height": HEIGHT,
    }  # fmt: skip


def with_matrix(camera: Camera, name: str, matrix: ndarray) -> dict[str, Any]:
    return {
        "camera_matrix": camera.intrinsics.tolist(), "distCoef": camera.distortion.tolist(),
        name: matrix.tolist(),
    }  # fmt: skip


def with_quaternion(camera: Camera) -> dict[str, Any]:
    q = quaternion(camera.rotation)
    return {
        "K": camera.intrinsics.tolist(), "D": camera.distortion.tolist(),
        "rotation": dict(zip("xyzw", q, strict=True)),
        "translation": camera.translation.tolist(),
    }  # fmt: skip


def with_place(camera: Camera) -> dict[str, Any]:
    x, y, z, w = quaternion(camera.rotation.T)
    return {
        "K": camera.intrinsics.tolist(), "dist": camera.distortion.tolist(),
        "quaternion_wxyz": [w, x, y, z], "position": camera.centre.tolist(),
    }  # fmt: skip


def in_degrees(camera: Camera) -> dict[str, Any]:
    return {
        "mtx": camera.intrinsics.tolist(), "discCoef": [camera.distortion.tolist()],
        "rvec": np.degrees(rotation_vector(camera)).tolist(),
        "tvec": camera.translation[:, None].tolist(), "w": WIDTH, "h": HEIGHT,
    }  # fmt: skip


FORMS: dict[str, Callable[[Camera], dict[str, Any]]] = {
    "numbers in tables": by_numbers,
    "numbers": by_numbers_flat,
    "OpenXRLab": openxrlab,
    "camera to world": lambda c: with_matrix(c, "cam2world", pose_of(c, inverse=True)),
    "T_world_cam": lambda c: with_matrix(c, "T_world_cam", pose_of(c, inverse=True)),
    "world to camera": lambda c: with_matrix(c, "extrinsic_matrix", pose_of(c)),
    "Blender": lambda c: with_matrix(
        c, "matrix_world", pose_of(c, inverse=True) @ np.diag([1.0, -1.0, -1.0, 1.0])
    ),
    "quaternion": with_quaternion,
    "place": with_place,
    "centre": lambda c: {**with_quaternion(c), "translation": None, "center": c.centre.tolist()},
    "degrees": in_degrees,
}


@pytest.mark.parametrize("form", FORMS)
def test_cameras_in_one_json(tmp_path: Path, form: str) -> None:
    path = tmp_path / "rig.json"
    path.write_text(json.dumps({c.name: FORMS[form](c) for c in cameras()}))
    assert_cameras(raw_cameras(path), cameras())


def test_a_quaternion_of_zeros_is_refused(tmp_path: Path) -> None:
    camera = cameras()[0]
    table = {"K": camera.intrinsics.tolist(), "t": [0, 0, 1], "quaternion": [0.0] * 4}
    (tmp_path / "rig.json").write_text(json.dumps({"a": table}))
    with pytest.raises(FormatError, match=r"expected a quaternion, found one of zeros"):
        raw_cameras(tmp_path / "rig.json")


def test_focal_lengths_alone_look_through_the_middle(tmp_path: Path) -> None:
    """As the viewers of Gaussian splats have their cameras."""
    camera = cameras()[0]
    table = {
        "id": 0, "img_name": "a", "width": WIDTH, "height": HEIGHT, "fx": 900.0, "fy": 905.0,
        "position": camera.centre.tolist(), "rotation": camera.rotation.T.tolist(),
    }  # fmt: skip
    (tmp_path / "cameras.json").write_text(json.dumps([table]))
    (raw,) = raw_cameras(tmp_path / "cameras.json")
    middle = [[900.0, 0.0, 639.5], [0.0, 905.0, 359.5], [0.0, 0.0, 1.0]]
    pose = (camera.rotation, camera.translation)
    assert_same(raw, Camera("a", SIZE, np.array(middle), *pose, np.zeros(5)))


@pytest.mark.parametrize(
    "lens",
    [
        {"focal_length_mm": 4.5, "sensor_width_mm": 6.4},
        {"focal": 4.5, "sensor_height": 3.6},
        {"focal": 900.0},
        {"fov_x_deg": 2.0 * np.degrees(np.arctan(WIDTH / 1800.0))},
        {"vfov": 2.0 * np.arctan(HEIGHT / 1800.0)},
        {"hfov": 2.0 * np.degrees(np.arctan(WIDTH / 1800.0)),
         "vfov": 2.0 * np.degrees(np.arctan(HEIGHT / 1800.0))},
    ],
)  # fmt: skip
def test_a_focal_length_told_in_another_way(tmp_path: Path, lens: dict[str, float]) -> None:
    """The focal length is 900 pixels in a picture of 1280 × 720."""
    table = {"width": WIDTH, "height": HEIGHT, "c2w": np.eye(4).tolist(), **lens}
    (tmp_path / "cameras.json").write_text(json.dumps({"a": table}))
    (raw,) = raw_cameras(tmp_path / "cameras.json")
    assert raw.intrinsics is not None
    middle = [[900.0, 0.0, 639.5], [0.0, 900.0, 359.5], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(raw.intrinsics, middle)


def test_millimetres_without_a_sensor_are_no_focal_length(tmp_path: Path) -> None:
    table = {"width": WIDTH, "height": HEIGHT, "c2w": np.eye(4).tolist(), "focal": 4.5}
    (tmp_path / "cameras.json").write_text(json.dumps({"a": table}))
    (raw,) = raw_cameras(tmp_path / "cameras.json")
    assert raw.intrinsics is None


def test_sensors_of_a_smart_city(tmp_path: Path) -> None:
    """A ``cameraMatrix`` of 3×4 numbers beside ``intrinsicMatrix`` is no lens."""
    sensors = [
        {"type": "camera", "id": c.name, "intrinsicMatrix": c.intrinsics.tolist(),
         "extrinsicMatrix": pose_of(c)[:3].tolist(),
         "cameraMatrix": (c.intrinsics @ pose_of(c)[:3]).tolist()}
        for c in cameras(distortion=False)
    ]  # fmt: skip
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"calibrationType": "cartesian", "sensors": sensors}))
    assert_cameras(raw_cameras(path), cameras(distortion=False))


def test_cameras_of_openpose(tmp_path: Path) -> None:
    camera = cameras()[0]

    def matrix(name: str, values: ndarray) -> str:
        rows, columns = values.shape
        data = " ".join(map(repr, values.ravel().tolist()))
        return (
            f'<{name} type_id="opencv-matrix"><rows>{rows}</rows><cols>{columns}</cols><dt>d</dt>'
            f"<data>{data}</data></{name}>"
        )

    parts = {
        "CameraMatrix": pose_of(camera)[:3], "Intrinsics": camera.intrinsics,
        "Distortion": np.pad(camera.distortion, (0, 3))[:, None],
    }  # fmt: skip
    text = "\n".join(matrix(*part) for part in parts.items())
    (tmp_path / "1.xml").write_text(f'<?xml version="1.0"?><opencv_storage>{text}</opencv_storage>')
    (raw,) = raw_cameras(tmp_path / "1.xml")
    assert_same(raw, camera)


def opencv_matrix(name: str, values: ndarray) -> str:
    rows, columns = np.atleast_2d(values).shape
    return (
        f"   {name}: !!opencv-matrix\n      rows: {rows}\n      cols: {columns}\n      dt: d\n"
        f"      data: {np.ravel(values).tolist()}\n"
    )


def test_mc_calib(tmp_path: Path) -> None:
    text = "%YAML:1.0\n---\nnb_camera: 4\n"
    for number, camera in enumerate(cameras()):
        text += f"camera_{number}:\n" + opencv_matrix("camera_matrix", camera.intrinsics)
        text += opencv_matrix("distortion_vector", camera.distortion)
        text += f"   distortion_type: 0\n   camera_group: 0\n   img_width: {WIDTH}\n"
        text += f"   img_height: {HEIGHT}\n" + opencv_matrix("camera_pose_matrix", pose_of(camera))
    path = tmp_path / "calibrated_cameras_data.yml"
    path.write_text(text)
    found = raw_cameras(path)
    assert [raw.name for raw in found] == [f"camera_{number}" for number in range(4)]
    for raw, camera in zip(found, cameras(), strict=True):
        assert raw.convention.direction is None  # its papers do not say which way it leads
        assert_same(raw, camera)


def test_multical(tmp_path: Path) -> None:
    own = cameras()
    lenses = {
        c.name: {"model": "standard", "image_size": SIZE, "K": c.intrinsics.tolist(),
                 "dist": [c.distortion.tolist()]}
        for c in own
    }  # fmt: skip
    poses = {
        c.name if not n else f"{c.name}_to_cam1": {"R": c.rotation.tolist(),
                                                   "T": c.translation.tolist()}
        for n, c in enumerate(own)
    }  # fmt: skip
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"cameras": lenses, "camera_poses": poses}))
    assert_cameras(raw_cameras(path), own)


@pytest.mark.parametrize("form", ["names above", "printed", "one after the other"])
def test_matrices_in_a_text_by_name(tmp_path: Path, form: str) -> None:
    def lines(values: ndarray) -> str:
        return "\n".join(" ".join(map(repr, row)) for row in np.atleast_2d(values).tolist())

    text = "# of the lab, 12 March\n"
    np.set_printoptions(precision=17, floatmode="unique")
    for number, c in enumerate(cameras(), 1):
        parts = {"K": c.intrinsics, "dist": c.distortion, "R": c.rotation, "T": c.translation}
        if form == "printed":
            text += "".join(f"{name}{number} = {value!r}\n" for name, value in parts.items())
        elif form == "one after the other":
            parts = {"intrinsic": np.pad(c.intrinsics, (0, 1)) + np.diag([0, 0, 0, 1.0]),
                     "extrinsic": pose_of(c), "distortion": c.distortion}  # fmt: skip
            rows = (f"  {name} {lines(np.ravel(value))}\n" for name, value in parts.items())
            text += f"name {number}\n  size {WIDTH} {HEIGHT}\n" + "".join(rows)
    if form == "names above":
        c = cameras()[0]
        parts = {"K": c.intrinsics, "dist": c.distortion, "R": c.rotation, "T": c.translation}
        text += "".join(f"{name}\n{lines(value)}\n" for name, value in parts.items())
    np.set_printoptions()
    path = tmp_path / "calib.txt"
    path.write_text(text)
    assert read(path)[0] == "text with K, R, T by name"
    found = raw_cameras(path)
    assert len(found) == (1 if form == "names above" else 4)
    for raw, camera in zip(found, cameras(), strict=False):
        assert_same(raw, camera)


def test_a_row_a_camera(tmp_path: Path) -> None:
    rows = []
    for c in cameras():
        k = c.intrinsics
        values = [k[0, 0], k[1, 1], k[0, 2], k[1, 2], *c.distortion, *rotation_vector(c)]
        values = [WIDTH, HEIGHT, *values, *c.translation]
        rows.append(";".join([c.name, *(repr(float(v)) for v in values)]))
    head = "camera;width;height;fx;fy;cx;cy;k1;k2;p1;p2;k3;rx;ry;rz;tx;ty;tz"
    path = tmp_path / "cameras.csv"
    path.write_text("\r\n".join([head, *rows]), encoding="utf-8-sig")
    assert_cameras(raw_cameras(path), cameras())


def without_k3() -> list[Camera]:
    return [replace(c, distortion=c.distortion * [1, 1, 1, 1, 0]) for c in cameras()]


def colmap_binary(folder: Path) -> None:
    """A model as COLMAP keeps it."""
    own = without_k3()
    lenses, images = struct.pack("<Q", len(own)), struct.pack("<Q", len(own))
    for number, c in enumerate(own, 1):
        k = c.intrinsics
        x, y, z, w = quaternion(c.rotation)
        lenses += struct.pack("<IIQQ", number, 4, WIDTH, HEIGHT)
        values = (k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5, *c.distortion[:4])
        lenses += struct.pack("<8d", *values)
        images += struct.pack("<I7dI", number, w, x, y, z, *c.translation, number)
        images += f"{c.name}.png".encode() + b"\0" + struct.pack("<Q", 2)
        images += struct.pack("<ddq", 1.0, 2.0, -1) * 2
    (folder / "cameras.bin").write_bytes(lenses)
    (folder / "images.bin").write_bytes(images)


def test_the_binary_model_of_colmap(tmp_path: Path) -> None:
    colmap_binary(tmp_path)
    assert_cameras(raw_cameras(tmp_path / "images.bin"), without_k3())
    assert raw_cameras(tmp_path / "cameras.bin") == ()
    images = tmp_path / "images.bin"
    images.write_bytes(images.read_bytes()[:-100])
    with pytest.raises(FormatError, match="cut short"):
        raw_cameras(images)
    (tmp_path / "cameras.bin").unlink()
    with pytest.raises(FormatError, match=r"cameras\.bin with the lenses is not beside it"):
        raw_cameras(images)


def test_a_folder_a_camera(tmp_path: Path) -> None:
    """Of each a file for the lens and one for the pose, called alike in all folders."""
    for c in cameras():
        folder = tmp_path / "calib" / c.name
        folder.mkdir(parents=True)
        lens = {"camera_matrix": c.intrinsics.tolist(), "dist_coeffs": c.distortion.tolist()}
        (folder / "intrinsics.json").write_text(json.dumps(lens))
        pose = {"R": c.rotation.tolist(), "t": c.translation.tolist()}
        (folder / "extrinsics.json").write_text(json.dumps(pose))
    (found,), told = camera_sets(gather([tmp_path]))
    assert told == []
    assert len(found.cameras) == 4
    assert_cameras(found.cameras, cameras(), named=False)


def test_poses_of_several_recordings_are_told(tmp_path: Path) -> None:
    own = cameras()
    lenses = {c.name: {"calibration_matrix": c.intrinsics.tolist()} for c in own}
    poses = {c.name: {"R": c.rotation.tolist(), "t": c.translation.tolist()} for c in own}
    path = tmp_path / "camera-parameters.json"
    path.write_text(json.dumps({"extrinsics": {"S1": poses, "S5": poses}, "intrinsics": lenses}))
    found, (told,) = camera_sets(gather([tmp_path]))
    assert found == []
    assert 'has 2 poses of "cam1", expected one of each camera' in told


def test_angles_of_boards_are_no_pose(tmp_path: Path) -> None:
    """OpenCV's sample writes six numbers for every picture of the board."""
    table = {
        "camera_matrix": cameras()[0].intrinsics.tolist(),
        "extrinsic_parameters": [[0.1, 0.2, 0.3, 4.0, 5.0, 6.0]] * 2,
    }
    (tmp_path / "a.json").write_text(json.dumps(table))
    (raw,) = raw_cameras(tmp_path / "a.json")
    assert raw.rotation is None


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", "scorer,net,net\nindividuals,a,a\nbodyparts,nose,nose\n", "DeepLabCut"),
        ("a.csv", "track,frame_idx,instance.score,nose.x\n,0,1,2\n", "SLEAP"),
        ("a.csv", "\n".join(["1.5,-2e3,0.25"] * 11), "DLT"),
    ],
)
def test_tables_of_other_things_are_called_by_their_names(
    tmp_path: Path, name: str, content: str, words: str
) -> None:
    (tmp_path / name).write_text(content)
    found, _, complaint = recognise(SourceFile(tmp_path / name))
    assert found is None
    assert words in str(complaint)


@pytest.mark.parametrize("named", ["R.txt", "cam_rvec.txt"])
def test_rotation_and_translation_in_files_of_their_own(tmp_path: Path, named: str) -> None:
    """NumPy saves K, R and t of a camera as texts in a folder of its own."""
    prefix = "" if named == "R.txt" else "cam_"
    for camera in cameras():
        folder = tmp_path / camera.name
        folder.mkdir()
        turned = (
            camera.rotation
            if named == "R.txt"
            else Rotation.from_matrix(camera.rotation).as_rotvec()
        )
        np.savetxt(folder / f"{prefix}K.txt", camera.intrinsics)
        np.savetxt(folder / named, turned)
        np.savetxt(folder / (named.replace("R", "t").replace("rvec", "tvec")), camera.translation)
    (found,), _ = camera_sets(gather([tmp_path]))
    for raw, camera in zip(found.cameras, cameras(), strict=True):
        assert raw.name == camera.name
        np.testing.assert_allclose(raw.intrinsics, camera.intrinsics)
        np.testing.assert_allclose(raw.rotation, camera.rotation, atol=1e-9)
        np.testing.assert_allclose(raw.translation, camera.translation)


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_a_quaternion_whose_order_no_name_says_may_be_either(tmp_path: Path, order: str) -> None:
    """nuScenes has four numbers under ``rotation``."""
    path = tmp_path / "calibrated_sensor.json"
    records = []
    for camera in cameras():
        x, y, z, w = quaternion(camera.rotation)
        four = [w, x, y, z] if order == "wxyz" else [x, y, z, w]
        records.append(
            {
                "name": camera.name,
                "rotation": four,
                "camera_intrinsic": camera.intrinsics.tolist(),
                "translation": camera.translation.tolist(),
            }
        )
    path.write_text(json.dumps(records))
    (found,), _ = camera_sets(gather([path]))
    for raw, camera in zip(found.cameras, cameras(), strict=True):
        assert list(raw.turns) == ["wxyz", "xyzw"]
        np.testing.assert_allclose(raw.turns[order], camera.rotation, atol=1e-9)
