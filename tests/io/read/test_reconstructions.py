"""Cameras of structure from motion, and of data sets with tables of their own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from tests.io.read.rig import FLIP, SIZE, assert_cameras, assert_same, cameras, raw_cameras, read
from tracker.io.read.pieces import FormatError


def _metashape(path: Path, scale: str = "", lens: str = "") -> Path:
    sensors, pictures = [], []
    for number, camera in enumerate(cameras()):
        k, (k1, k2, p1, p2, k3) = camera.intrinsics, camera.distortion.tolist()
        values = {
            "f": k[1, 1], "b1": k[0, 0] - k[1, 1], "cx": k[0, 2] + 0.5 - SIZE[0] / 2,
            "cy": k[1, 2] + 0.5 - SIZE[1] / 2, "k1": k1, "k2": k2, "k3": k3, "p1": p2, "p2": p1,
        }  # fmt: skip
        parts = "".join(f"<{name}>{float(value)!r}</{name}>" for name, value in values.items())
        resolution = f'<resolution width="{SIZE[0]}" height="{SIZE[1]}"/>'
        sensors.append(
            f'<sensor id="{number}" type="frame">{resolution}<calibration type="frame" '
            f'class="initial">{resolution}<f>1</f></calibration><calibration type="frame" '
            f'class="adjusted">{resolution}{parts}{lens}</calibration></sensor>'
        )
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = camera.rotation.T, camera.centre
        pictures.append(
            f'<camera id="{number}" sensor_id="{number}" label="{camera.name}"><transform>'
            f"{' '.join(map(repr, pose.ravel().tolist()))}</transform></camera>"
        )
    path.write_text(
        f'<?xml version="1.0"?><document version="2.0.0"><chunk label="1"><sensors>'
        f"{''.join(sensors)}</sensors><cameras>{''.join(pictures)}"
        '<camera id="9" sensor_id="0" label="not aligned"/></cameras>'
        f"{scale}</chunk></document>"
    )
    return path


def _as_world_to_camera(path: Path, factor: float = 1.0) -> None:
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        assert raw.name == camera.name
        assert raw.rotation is not None
        assert raw.translation is not None
        np.testing.assert_allclose(raw.rotation.T, camera.rotation, atol=1e-12)
        np.testing.assert_allclose(raw.translation, factor * camera.centre, atol=1e-12)
        np.testing.assert_allclose(raw.intrinsics, camera.intrinsics, atol=1e-9)
        np.testing.assert_allclose(raw.distortion, camera.distortion, atol=1e-12)


def test_metashape(tmp_path: Path) -> None:
    path = _metashape(tmp_path / "cameras.xml")
    _as_world_to_camera(path)
    assert raw_cameras(path)[0].convention.unit is None


def test_the_scale_of_a_chunk_leads_to_metres(tmp_path: Path) -> None:
    path = _metashape(tmp_path / "c.xml", "<transform><scale locked='true'>2.5</scale></transform>")
    _as_world_to_camera(path, 2.5)
    assert raw_cameras(path)[0].convention.unit == "m"


def test_a_lens_of_metashape_that_opencv_has_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="k4; optimize"):
        raw_cameras(_metashape(tmp_path / "cameras.xml", lens="<k4>0.01</k4>"))


@pytest.mark.parametrize("nested", [True, False])
def test_openmvg(tmp_path: Path, nested: bool) -> None:
    views, lenses, poses = [], [], []
    for number, camera in enumerate(cameras()):
        k1, k2, p1, p2, k3 = camera.distortion.tolist()
        k = camera.intrinsics
        base = {"width": SIZE[0], "height": SIZE[1], "focal_length": k[0, 0],
                "principal_point": [k[0, 2], k[1, 2]]}  # fmt: skip
        own = {"disto_t2": [k1, k2, k3, p1, p2]}
        lens = {"value0": base, **own} if nested else {**base, **own}
        view = {"filename": f"{camera.name}.jpg", "id_view": number, "id_intrinsic": number,
                "id_pose": number}  # fmt: skip
        views.append({"key": number, "value": {"ptr_wrapper": {"id": 1, "data": view}}})
        lenses.append({"key": number, "value": {"ptr_wrapper": {"id": 2, "data": lens}}})
        pose = {"rotation": camera.rotation.tolist(), "center": camera.centre.tolist()}
        poses.append({"key": number, "value": pose})
    path = tmp_path / "sfm_data.json"
    content = {"sfm_data_version": "0.3", "views": views, "intrinsics": lenses}
    path.write_text(json.dumps({**content, "extrinsics": poses, "structure": []}))
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        assert (raw.name, raw.image_size) == (camera.name, SIZE)
        np.testing.assert_allclose(raw.rotation, camera.rotation, atol=1e-12)
        np.testing.assert_allclose(raw.translation, camera.translation, atol=1e-12)
        np.testing.assert_allclose(raw.distortion, camera.distortion)
        assert raw.intrinsics is not None
        assert raw.intrinsics[0, 0] == camera.intrinsics[0, 0]


def test_the_scene_of_a_renderer_has_its_lens_as_an_angle(tmp_path: Path) -> None:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = cameras()[0].rotation.T @ FLIP, cameras()[0].centre
    frame = {"file_path": "./cam1", "transform_matrix": pose.tolist()}
    content = {"camera_angle_x": 2.0 * np.arctan(0.64), "frames": [frame]}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FormatError, match="the fields w, h, which are missing"):
        raw_cameras(path)
    path.write_text(json.dumps({**content, "w": SIZE[0], "h": SIZE[1]}))
    (raw,) = raw_cameras(path)
    assert raw.intrinsics is not None
    np.testing.assert_allclose(np.diag(raw.intrinsics), [1000.0, 1000.0, 1.0])


def test_voxelpose_has_the_place_of_a_camera(tmp_path: Path) -> None:
    table = {}
    for number, camera in enumerate(cameras()):
        k, (k1, k2, p1, p2, k3) = camera.intrinsics, camera.distortion.tolist()
        table[str(number)] = {
            "R": camera.rotation.tolist(), "T": [[float(x)] for x in camera.centre],
            "fx": k[0, 0], "fy": k[1, 1], "cx": k[0, 2], "cy": k[1, 2],
            "k": [[k1], [k2], [k3]], "p": [[p1], [p2]],
        }  # fmt: skip
    path = tmp_path / "calibration_shelf.json"
    path.write_text(json.dumps(table))
    assert read(path)[0] == "VoxelPose calibration JSON"
    assert_cameras(raw_cameras(path), cameras(), named=False)


def test_lenses_and_poses_in_two_tables(tmp_path: Path) -> None:
    lenses = {
        c.name: {"calibration_matrix": c.intrinsics.tolist(), "distortion": c.distortion.tolist()}
        for c in cameras()
    }
    poses = {
        c.name: {"R": c.rotation.tolist(), "t": c.translation[:, None].tolist()} for c in cameras()
    }
    path = tmp_path / "camera-parameters.json"
    path.write_text(json.dumps({"intrinsics": lenses, "extrinsics": {"S1": poses}}))
    assert_cameras(raw_cameras(path), cameras())


def test_matrices_for_points_in_rows(tmp_path: Path) -> None:
    camera = cameras()[0]
    k1, k2, p1, p2, _ = camera.distortion
    path = tmp_path / "hires_cam1_params.mat"
    scipy.io.savemat(
        path,
        {"K": camera.intrinsics.T, "RDistort": [[k1, k2]], "TDistort": [[p1, p2]],
         "r": camera.rotation.T, "t": camera.translation[None]},
    )  # fmt: skip
    (raw,) = raw_cameras(path)
    flat = camera.distortion * [1.0, 1.0, 1.0, 1.0, 0.0]
    np.testing.assert_allclose(raw.distortion, flat)
    np.testing.assert_allclose(raw.intrinsics, camera.intrinsics)
    np.testing.assert_allclose(raw.rotation, camera.rotation, atol=1e-12)
    np.testing.assert_allclose(raw.translation, camera.translation)


def _mvsnet(pose: np.ndarray, k: np.ndarray, end: str) -> str:
    rows = "\n".join(" ".join(map(repr, row)) for row in pose.tolist())
    lens = "\n".join(" ".join(map(repr, row)) for row in k.tolist())
    return f"extrinsic\n{rows}\n\nintrinsic\n{lens}\n\n{end}\n"


@pytest.mark.parametrize("end", ["425.0 2.5", "425.0 2.5 192 935.0"])
def test_mvsnet(tmp_path: Path, end: str) -> None:
    for number, camera in enumerate(cameras(distortion=False)):
        pose = np.eye(4)
        pose[:3] = np.column_stack([camera.rotation, camera.translation])
        path = tmp_path / f"{number:08d}_cam.txt"
        path.write_text(_mvsnet(pose, camera.intrinsics, end))
        assert read(path)[0] == "MVSNet cam.txt"
        (raw,) = raw_cameras(path)
        assert_same(raw, camera)
    path.write_text(_mvsnet(pose[:3], camera.intrinsics, end))
    with pytest.raises(FormatError, match="extrinsic: expected 16 numbers"):
        read(path)


def test_middlebury(tmp_path: Path) -> None:
    rows = []
    for number, camera in enumerate(cameras(distortion=False), 1):
        parts = (camera.intrinsics, camera.rotation, camera.translation)
        values = np.concatenate([part.ravel() for part in parts]).tolist()
        rows.append(f"templeR{number:04d}.png {' '.join(map(repr, values))}")
    path = tmp_path / "templeR_par.txt"
    path.write_text(f"{len(rows)}\n" + "\n".join(rows) + "\n")
    assert read(path)[0] == "Middlebury _par.txt"
    found = raw_cameras(path)
    assert [raw.name for raw in found] == [f"templeR{number:04d}" for number in range(1, 5)]
    assert_cameras(found, cameras(distortion=False), named=False)
    path.write_text("47\n" + "\n".join(rows))
    with pytest.raises(FormatError, match="line 1: expected the count of rows below it, found 47"):
        read(path)
