"""Every calibration format, in its original form: what is read sees what was written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import scipy.io
import yaml
from scipy.spatial.transform import Rotation

from tests.io.read.rig import FLIP, SIZE, assert_cameras, assert_same, cameras, raw_cameras, read
from tracker.export.calibration import Form, save_calibration
from tracker.geometry.camera import Camera
from tracker.io.conventions.reading import Reading, to_camera
from tracker.io.read.pieces import FormatError
from tracker.io.read.registry import recognise
from tracker.io.read.source import SourceFile


def _storage(path: Path, values: dict[str, np.ndarray]) -> None:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()


@pytest.mark.parametrize("suffix", ["xml", "yml", "json"])
@pytest.mark.parametrize("as_vector", [False, True])
def test_a_file_of_opencv_a_camera(tmp_path: Path, suffix: str, as_vector: bool) -> None:
    camera = cameras()[0]
    path = tmp_path / f"calibration.{suffix}"
    turned = cv2.Rodrigues(camera.rotation)[0] if as_vector else camera.rotation
    _storage(
        path,
        {
            "camera_matrix": camera.intrinsics,
            "distortion_coefficients": camera.distortion[:, None],
            "rvec" if as_vector else "R": turned,
            "tvec" if as_vector else "T": camera.translation[:, None],
        },
    )
    (raw,) = raw_cameras(path)
    assert read(path)[0] == "OpenCV FileStorage"
    assert_same(raw, camera)


def test_stereo_cameras_of_opencv(tmp_path: Path) -> None:
    first, second = cameras()[:2]
    turned = second.rotation @ first.rotation.T
    moved = second.translation - turned @ first.translation
    values = {"M1": first.intrinsics, "D1": first.distortion, "M2": second.intrinsics,
              "D2": second.distortion, "R": turned, "T": moved, "R1": np.eye(3),
              "P1": np.eye(3, 4), "R2": np.eye(3), "P2": np.eye(3, 4)}  # fmt: skip
    _storage(tmp_path / "stereo.yml", values)
    left, right = raw_cameras(tmp_path / "stereo.yml")
    zero = Camera("1", SIZE, first.intrinsics, np.eye(3), np.zeros(3), first.distortion)
    assert_same(left, zero)
    assert_same(right, Camera("2", SIZE, second.intrinsics, turned, moved, second.distortion))


@pytest.mark.parametrize(
    ("form", "suffix"),
    [("opencv", ".yml"), ("opencv", ".xml"), ("opencv", ".json"), ("pose2sim", ".toml")],
)
def test_what_is_written_is_read_again(tmp_path: Path, form: Form, suffix: str) -> None:
    path = tmp_path / f"cameras{suffix}"
    save_calibration(path, cameras(), form)
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        assert raw.name == camera.name
        assert raw.image_size == SIZE
        assert_same(raw, camera, 1e-9)


@pytest.mark.parametrize("program", ["Anipose", "Caliscope"])
def test_tables_of_toml(tmp_path: Path, program: str) -> None:
    lines = []
    for number, camera in enumerate(cameras()):
        vector = Rotation.from_matrix(camera.rotation).as_rotvec().tolist()
        is_caliscope = program == "Caliscope"
        lines += [
            f"[cameras.{number}]" if is_caliscope else f"[cam_{number}]",
            "rotation_count = 0\ncam_id = 0" if is_caliscope else f'name = "{camera.name}"',
            f"size = {list(SIZE)}",
            f"matrix = {camera.intrinsics.tolist()}",
            f"distortions = {camera.distortion.tolist()}",
            f"rotation = {camera.rotation.tolist() if is_caliscope else vector}",
            f"translation = {camera.translation.tolist()}",
        ]
    path = tmp_path / "calibration.toml"
    path.write_text("\n".join(lines))
    raws = raw_cameras(path)
    assert raws[0].convention.unit == ("m" if program == "Caliscope" else None)
    assert_cameras(raws, cameras(), named=False)


def test_qualisys(tmp_path: Path) -> None:
    rows = []
    for camera in cameras():
        turned = camera.rotation.T @ FLIP  # camera to world, y up and z back
        place = {axis: 1000.0 * value for axis, value in zip("xyz", camera.centre, strict=True)}
        entries = {f"r{c + 1}{r + 1}": turned[r, c] for r in range(3) for c in range(3)}
        k, lens = camera.intrinsics * 64.0, camera.distortion
        transform = " ".join(f'{n}="{float(v)!r}"' for n, v in {**entries, **place}.items())
        rows.append(
            f'<camera serial="{camera.name}" model="Miqus Video">'
            f'<fov_video left="0" top="0" right="{SIZE[0] - 1}" bottom="{SIZE[1] - 1}"/>'
            f"<transform {transform}/>"
            f'<intrinsic focalLengthU="{k[0, 0]!r}" focalLengthV="{k[1, 1]!r}" '
            f'centerPointU="{k[0, 2]!r}" centerPointV="{k[1, 2]!r}" '
            f'radialDistortion1="{lens[0]}" radialDistortion2="{lens[1]}" '
            f'radialDistortion3="{lens[4]}" tangentalDistortion1="{lens[2]}" '
            f'tangentalDistortion2="{lens[3]}"/></camera>'
        )
    path = tmp_path / "any.txt"
    text = f"<calibration><cameras>{''.join(rows)}</cameras></calibration>"
    path.write_text(text.replace("np.float64(", "").replace(")", ""))
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        assert raw.image_size == SIZE
        assert_same(raw, camera)


def test_colmap(tmp_path: Path) -> None:
    lenses, poses = ["# Camera list"], ["# Image list with two lines of data per image"]
    for number, camera in enumerate(cameras(), 1):
        k, lens = camera.intrinsics, camera.distortion
        numbers = [k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5, *lens[:4], lens[4], 0, 0, 0]
        lenses.append(f"{number} FULL_OPENCV {SIZE[0]} {SIZE[1]} {' '.join(map(str, numbers))}")
        x, y, z, w = Rotation.from_matrix(camera.rotation).as_quat()
        pose = " ".join(str(value) for value in (w, x, y, z, *camera.translation))
        poses += [f"{number} {pose} {number} {camera.name}.jpg", "10.5 20.5 -1 30.0 40.0 7"]
    (tmp_path / "cameras.txt").write_text("\n".join(lenses))
    (tmp_path / "images.txt").write_text("\n".join(poses))
    assert read(tmp_path / "cameras.txt") == ("COLMAP text model", [])
    raws = raw_cameras(tmp_path / "images.txt")
    assert [raw.name for raw in raws] == [camera.name for camera in cameras()]
    for raw, camera in zip(raws, cameras(), strict=True):
        np.testing.assert_allclose(raw.intrinsics, camera.intrinsics, atol=1e-9)
        np.testing.assert_allclose(raw.rotation, camera.rotation, atol=1e-9)
        np.testing.assert_allclose(raw.translation, camera.translation, atol=1e-9)


def test_nerfstudio(tmp_path: Path) -> None:
    frames = []
    for camera in cameras():
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = camera.rotation.T @ FLIP, camera.centre
        k, lens = camera.intrinsics, camera.distortion
        frames.append(
            {"file_path": f"{camera.name}.png", "transform_matrix": pose.tolist(),
             "fl_x": k[0, 0], "fl_y": k[1, 1], "cx": k[0, 2] + 0.5, "cy": k[1, 2] + 0.5,
             "k1": lens[0], "k2": lens[1], "p1": lens[2], "p2": lens[3]}
        )  # fmt: skip
    path = tmp_path / "transforms.json"
    path.write_text(
        json.dumps({"w": SIZE[0], "h": SIZE[1], "camera_model": "OPENCV", "frames": frames})
    )
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        plain = np.array([*camera.distortion[:4], 0.0])
        assert_same(
            raw,
            Camera(
                camera.name, SIZE, camera.intrinsics, camera.rotation, camera.translation, plain
            ),
        )


def test_kalibr(tmp_path: Path) -> None:
    tables, before = {}, np.eye(4)
    first = cameras()[0]
    for number, camera in enumerate(cameras()):
        pose = np.eye(4)
        pose[:3, :3] = camera.rotation @ first.rotation.T
        pose[:3, 3] = camera.translation - pose[:3, :3] @ first.translation
        k = camera.intrinsics
        tables[f"cam{number}"] = {
            "camera_model": "pinhole", "distortion_model": "radtan", "resolution": list(SIZE),
            "intrinsics": [float(v) for v in (k[0, 0], k[1, 1], k[0, 2], k[1, 2])],
            "distortion_coeffs": camera.distortion[:4].tolist(),
            "T_cn_cnm1": (pose @ np.linalg.inv(before)).tolist(),
        }  # fmt: skip
        before = pose
    path = tmp_path / "camchain.yaml"
    path.write_text(yaml.safe_dump(tables))
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        turned = camera.rotation @ first.rotation.T
        np.testing.assert_allclose(raw.rotation, turned, atol=1e-9)
        moved = camera.translation - turned @ first.translation
        np.testing.assert_allclose(raw.translation, moved, atol=1e-9)
        assert raw.convention.unit == "m"


def test_ros_has_a_lens_and_no_pose(tmp_path: Path) -> None:
    camera = cameras()[0]

    def table(values: np.ndarray) -> dict[str, object]:
        return {"rows": len(values), "cols": values.size // len(values),
                "data": values.ravel().tolist()}  # fmt: skip

    path = tmp_path / "head.yaml"
    path.write_text(
        yaml.safe_dump(
            {"image_width": SIZE[0], "image_height": SIZE[1], "camera_name": "head",
             "camera_matrix": table(camera.intrinsics), "distortion_model": "plumb_bob",
             "distortion_coefficients": table(camera.distortion[None]),
             "projection_matrix": table(np.eye(3, 4))}
        )
    )  # fmt: skip
    (raw,) = raw_cameras(path)
    np.testing.assert_array_equal(raw.intrinsics, camera.intrinsics)
    assert raw.rotation is None
    assert raw.name == "head"


def test_panoptic_studio(tmp_path: Path) -> None:
    # its world is in centimetres with y down
    to_z_up = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    tables = [
        {"name": camera.name, "type": "hd", "panel": 0, "node": 1, "resolution": list(SIZE),
         "K": camera.intrinsics.tolist(), "distCoef": camera.distortion.tolist(),
         "R": (camera.rotation @ to_z_up).tolist(),
         "t": (100.0 * camera.translation)[:, None].tolist()}
        for camera in cameras()
    ]  # fmt: skip
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"calibDataSource": "somewhere", "cameras": tables}))
    assert_cameras(raw_cameras(path), cameras(), named=False)


def test_tsai_draws_what_its_equations_draw(tmp_path: Path) -> None:
    angles, moved = (1.9007833770, 0.49730769727, 0.18415452559), (-4844.19, 551.09, 4966.74)
    focal, kappa, cx, cy, sx, dpx, dpy = 5.55, 5.1e-3, 324.2, 282.6, 1.0938, 5.127e-3, 4.65e-3
    path = tmp_path / "View_001.xml"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?><Camera name="View_001">'
        f'<Geometry width="768" height="576" ncx="795" nfx="752" dx="{dpx}" dy="{dpy}" '
        f'dpx="{dpx}" dpy="{dpy}"/>'
        f'<Intrinsic focal="{focal}" kappa1="{kappa}" cx="{cx}" cy="{cy}" sx="{sx}"/>'
        f'<Extrinsic tx="{moved[0]}" ty="{moved[1]}" tz="{moved[2]}" rx="{angles[0]}" '
        f'ry="{angles[1]}" rz="{angles[2]}"/></Camera>'
    )
    (raw,) = raw_cameras(path)
    a, b, c = angles
    turned = (
        np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
        @ np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
        @ np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    )
    np.testing.assert_allclose(raw.rotation, turned, atol=1e-12)
    # a drawn point → straight, by equation 5, must be where OpenCV's lens leads back to
    pixel = np.array([100.0, 80.0])
    drawn = (pixel - [cx, cy]) * [dpx / sx, dpy]
    straight = drawn * (1.0 + kappa * drawn @ drawn) / focal
    found = cv2.projectPoints(
        np.array([[*straight, 1.0]]), np.zeros(3), np.zeros(3), raw.intrinsics, raw.distortion
    )[0][0, 0]
    np.testing.assert_allclose(found, pixel, atol=0.1)


@pytest.mark.parametrize("form", ["lines", "one line", "npy", "npy of all"])
def test_projection_matrices(tmp_path: Path, form: str) -> None:
    plain = cameras(distortion=False)
    matrices = [c.intrinsics @ np.column_stack([c.rotation, c.translation]) for c in plain]
    if form == "npy of all":
        np.save(tmp_path / "P.npy", np.array(matrices))
        raws = raw_cameras(tmp_path / "P.npy")
    else:
        raws = ()
        for camera, matrix in zip(plain, matrices, strict=True):
            path = tmp_path / f"{camera.name}.{'npy' if form == 'npy' else 'txt'}"
            if form == "npy":
                np.save(path, matrix)
            elif form == "lines":
                path.write_text("\n".join(" ".join(map(repr, row)) for row in matrix.tolist()))
            else:
                path.write_text("P0: " + " ".join(map(repr, matrix.ravel().tolist())))
            raws += raw_cameras(path)
    assert_cameras(raws, plain, 1e-8, named=False)


def test_a_pose_is_no_projection(tmp_path: Path) -> None:
    camera = cameras()[0]
    pose = np.column_stack([camera.rotation, camera.translation])
    np.save(tmp_path / "pose.npy", pose)
    (raw,) = raw_cameras(tmp_path / "pose.npy")
    np.testing.assert_array_equal(raw.rotation, camera.rotation)
    assert raw.projection is None


def test_stereo_parameters_of_matlab(tmp_path: Path) -> None:
    first, second = cameras()[:2]
    turned = second.rotation @ first.rotation.T
    moved = second.translation - turned @ first.translation
    one_based = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])

    def parameters(camera: Camera) -> dict[str, object]:
        k1, k2, p1, p2, k3 = camera.distortion
        return {
            "RadialDistortion": [k1, k2, k3],
            "TangentialDistortion": [p1, p2],
            "IntrinsicMatrix": (camera.intrinsics + one_based).T,
            "ImageSize": [SIZE[1], SIZE[0]],
            "WorldUnits": "millimeters",
        }

    scipy.io.savemat(
        tmp_path / "stereo.mat",
        {
            "stereoParams": {
                "CameraParameters1": parameters(first),
                "CameraParameters2": parameters(second),
                "RotationOfCamera2": turned.T,
                "TranslationOfCamera2": 1000.0 * moved,
            }
        },
        do_compression=True,
    )
    _, raw = raw_cameras(tmp_path / "stereo.mat")
    assert_same(raw, Camera("2", SIZE, second.intrinsics, turned, moved, second.distortion))


def test_a_script_of_ones_own(tmp_path: Path) -> None:
    tables = {
        c.name: {"K": c.intrinsics.tolist(), "dist": c.distortion.tolist(),
                 "R": c.rotation.tolist(), "t": c.translation.tolist()}
        for c in cameras()
    }  # fmt: skip
    path = tmp_path / "cams.json"
    path.write_text(json.dumps(tables))
    name, _ = read(path)
    assert name == "JSON, YAML or .npz with K, R, t"
    for raw, camera in zip(raw_cameras(path), cameras(), strict=True):
        assert raw.name == camera.name
        assert raw.convention.direction is None
        assert_same(raw, camera)


def test_rows_before_columns(tmp_path: Path) -> None:
    """As MATLAB and NumPy tell a picture's size; the principal point gives it away."""
    camera = cameras()[0]
    table = {"name": "a", "K": camera.intrinsics, "R": camera.rotation, "t": camera.translation}
    for name, size in (("rows", SIZE[::-1]), ("columns", SIZE)):
        scipy.io.savemat(
            tmp_path / f"{name}.mat", {"cameras": {**table, "ImageSize": np.array(size)}}
        )
        (raw,) = raw_cameras(tmp_path / f"{name}.mat")
        assert raw.image_size == SIZE


def test_a_lens_that_cameras_do_not_have_is_refused_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("1 THIN_PRISM_FISHEYE 10 10 1 1 1 1 0 0 0 0 0 0 0 0\n")
    (tmp_path / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a.jpg\n\n")
    with pytest.raises(FormatError, match=r"cameras\.txt.*THIN_PRISM_FISHEYE"):
        raw_cameras(tmp_path / "images.txt")


def test_arrays_of_all_cameras(tmp_path: Path) -> None:
    own = cameras()
    np.savez(
        tmp_path / "rig.npz",
        K=[c.intrinsics for c in own],
        R=[c.rotation for c in own],
        t=[c.translation[:, None] for c in own],
        dist=[c.distortion for c in own],
        made_with=np.array(["a program"]),
    )
    assert_cameras(raw_cameras(tmp_path / "rig.npz"), own, named=False)


def test_an_archive_that_unpacks_to_gigabytes(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "rig.npz", K=np.zeros((2000, 1500)))
    found, _, complaint = recognise(SourceFile(tmp_path / "rig.npz"))
    assert found is None
    assert "rig.npz: unpacks to more than 16 MB" in str(complaint)


def test_a_lens_and_a_pose_in_a_text_each(tmp_path: Path) -> None:
    camera = cameras(distortion=False)[0]
    np.savetxt(tmp_path / "K.txt", camera.intrinsics)
    pose = np.eye(4)
    pose[:3] = np.column_stack([camera.rotation, camera.translation])
    np.savetxt(tmp_path / "pose.txt", pose)
    (lens,), (stands,) = raw_cameras(tmp_path / "K.txt"), raw_cameras(tmp_path / "pose.txt")
    assert lens.rotation is None
    assert stands.intrinsics is None
    assert_same(replace(lens, rotation=stands.rotation, translation=stands.translation), camera)


def test_a_size_by_its_sides(tmp_path: Path) -> None:
    c = cameras()[0]
    table = {"K": c.intrinsics.tolist(), "R": c.rotation.tolist(), "t": c.translation.tolist()}
    size = {"width": SIZE[0], "height": SIZE[1]}
    (tmp_path / "cams.json").write_text(json.dumps({"a": {**table, "resolution": size}}))
    (raw,) = raw_cameras(tmp_path / "cams.json")
    assert raw.image_size == SIZE


@pytest.mark.parametrize("form", ["opencv", "pose2sim"])
def test_a_fisheye_is_written_and_read_again(tmp_path: Path, form: Form) -> None:
    lens = np.array([-0.02, 0.01, -0.004, 0.0008])
    camera = replace(cameras()[0], distortion=lens, fisheye=True)
    path = tmp_path / ("cameras.yml" if form == "opencv" else "cameras.toml")
    save_calibration(path, [camera], form)
    (raw,) = raw_cameras(path)
    found = to_camera(raw, Reading(), SIZE)
    assert found.fisheye
    for name in ("intrinsics", "rotation", "translation", "distortion"):
        np.testing.assert_allclose(getattr(found, name), getattr(camera, name), atol=1e-9)
