"""Recordings as other programs and data sets leave them, imported without a flag but a rate."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray
from scipy.spatial.transform import Rotation

from tests.io.read.rig import HALF_EXTENTS, SIZE, boxes, cameras, raw_cameras, read, walks
from tracker.export.calibration import save_calibration
from tracker.geometry.camera import Camera
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan, settle
from tracker.io.read.pieces import FormatError

CAMERAS = cameras()
PLACES = walks()
SEEN = [boxes(camera, PLACES) for camera in CAMERAS]


def _plan(folder: Path) -> ImportPlan:
    return settle(gather([folder]), ImportOptions(fps=25.0))


def _assert_boxes(plan: ImportPlan, tolerance: float = 0.01) -> None:
    """Each camera has its boxes at its frames."""
    assert len(plan.views) == len(CAMERAS)
    assert plan.frames == len(PLACES)
    for view, (frames, rows) in zip(plan.views, SEEN, strict=True):
        assert view.detections is not None
        np.testing.assert_array_equal(view.detections.frames, frames)
        np.testing.assert_allclose(view.detections.boxes, rows, atol=tolerance)


def _assert_cameras(plan: ImportPlan) -> None:
    """The cameras draw the room where the original ones do."""
    points = np.random.default_rng(0).uniform([-2.0, -2.0, 0.0], [2.0, 2.0, 2.0], (50, 3))
    for view, camera in zip(plan.views, CAMERAS, strict=True):
        np.testing.assert_allclose(view.camera.project(points)[0], camera.project(points)[0])


def _assert_truth(plan: ImportPlan) -> None:
    assert plan.truth is not None
    np.testing.assert_array_equal(
        np.column_stack([plan.truth.frames, plan.truth.ids]),
        [(step, who) for step in range(len(PLACES)) for who in range(PLACES.shape[1])],
    )
    flat = PLACES.reshape(-1, 3)
    np.testing.assert_allclose(plan.truth.positions[:, :2], flat[:, :2], atol=1e-3)
    np.testing.assert_allclose(plan.truth.positions[:, 2], flat[:, 2], atol=0.1)


def _corners(box: ndarray) -> list[float]:
    left, top, width, height = box.tolist()
    return [left, top, left + width, top + height]


@pytest.mark.parametrize("ids", [False, True], ids=["detector", "tracker"])
@pytest.mark.parametrize("score", [True, False], ids=["score", "none"])
def test_deepstream_writes_a_file_a_frame_and_stream(
    tmp_path: Path, ids: bool, score: bool
) -> None:
    save_calibration(tmp_path / "cameras.toml", CAMERAS, "pose2sim")
    (tmp_path / "kitti").mkdir()
    for stream, (frames, rows) in enumerate(SEEN):
        for frame in range(len(PLACES)):
            lines = ["shopping cart 0.0 0 0.0 5.0 5.0 90.0 80.0" + 7 * " 0.0" + score * " 0.9"]
            lines[0] = lines[0].replace("cart", "cart 77") if ids else lines[0]
            for who, box in enumerate(rows[frames == frame]):
                corners = " ".join(f"{value:.6f}" for value in _corners(box))
                number = f" {who}" if ids else ""
                lines.append(f"person{number} 0.0 0 0.0 {corners}{7 * ' 0.0'}{score * ' 0.75'}")
            name = f"00_{stream:03}_{frame:06}.txt"
            (tmp_path / "kitti" / name).write_text("".join(f"{line}\n" for line in lines))
    plan = _plan(tmp_path)
    _assert_boxes(plan)
    _assert_cameras(plan)
    for view in plan.views:
        assert view.detections is not None
        np.testing.assert_array_equal(view.detections.scores, 0.75 if score else 1.0)


def _ai_city_rows(numbers: list[int]) -> str:
    lines = []
    for number, camera in zip(numbers, CAMERAS, strict=True):
        for frame, people in enumerate(PLACES):
            found, visible = camera.project_boxes(people, HALF_EXTENTS)
            for who in np.flatnonzero(visible):
                left, top, width, height = found[who]
                inside = left > 0 and top > 0 and left + width < SIZE[0] and top + height < SIZE[1]
                x, y, _ = people[who]
                if inside:
                    lines.append(
                        f"{number} {who} {frame} {left:.2f} {top:.2f} {width:.2f} {height:.2f} "
                        f"{x:.6f} {y:.6f}"
                    )
    return "\n".join(lines)


def test_a_scene_of_the_ai_city_challenge_2024(tmp_path: Path) -> None:
    numbers = [635, 636, 638, 640]
    for number, camera in zip(numbers, cameras(distortion=False), strict=True):
        folder = tmp_path / f"camera_{number:04}"
        folder.mkdir()
        pose = np.column_stack([camera.rotation, camera.translation])
        projection = camera.intrinsics @ pose
        ground = np.linalg.inv(projection[:, [0, 1, 3]])
        (folder / "calibration.json").write_text(
            json.dumps(
                {"camera projection matrix": projection.tolist(),
                 "homography matrix": (ground / ground[2, 2]).tolist()}
            )
        )  # fmt: skip
    (tmp_path / "ground_truth.txt").write_text(_ai_city_rows(numbers))
    plan = _plan(tmp_path)
    _assert_boxes(plan)
    _assert_truth(plan)


@pytest.mark.full
@pytest.mark.parametrize("sign", [" ", "_"])
@pytest.mark.parametrize("floor", [True, False])
def test_a_scene_of_nvidia_s_smart_spaces(tmp_path: Path, sign: str, floor: bool) -> None:
    sensors = [
        {"type": "camera", "id": f"Camera_{n:02}", "coordinates": {"x": 1.0, "y": 2.0},
         "scaleFactor": 31.7, "translationToGlobalCoordinates": {"x": 3.0, "y": 4.0},
         "attributes": [{"name": "fps", "value": "30"}, {"name": "frameWidth", "value": SIZE[0]},
                        {"name": "frameHeight", "value": str(SIZE[1])}],
         "intrinsicMatrix": np.where(camera.intrinsics == 0.0, 3e-14, camera.intrinsics).tolist(),
         "extrinsicMatrix": np.column_stack([camera.rotation, camera.translation]).tolist(),
         "cameraMatrix": (camera.intrinsics @ np.column_stack(
             [camera.rotation, camera.translation])).tolist(),
         "homography": np.eye(3).tolist()}
        for n, camera in enumerate(cameras(distortion=False))
    ]  # fmt: skip
    (tmp_path / "calibration.json").write_text(
        json.dumps({"calibrationType": "cartesian", "sensors": sensors})
    )
    truth: dict[str, list[dict[str, object]]] = {}
    for frame, people in enumerate(PLACES):
        cart = {"object type": "Forklift", "object id": 90, "3d location": [0, 0, 1],
                "2d bounding box visible": {"Camera_00": [5, 5, 90, 80]}}  # fmt: skip
        objects: list[dict[str, object]] = [cart]
        for who, place in enumerate(people):
            seen = {
                f"Camera_{n:02}": _corners(rows[at])
                for n, (frames, rows) in enumerate(SEEN)
                if (at := _row(frames, rows, n, frame, place)) is not None
            }
            objects.append(
                {"object type": "Person", "object id": who,
                 "3d location": [*place[:2], 0.01 if floor else place[2]],
                 "2d bounding box visible": seen}
            )  # fmt: skip
        truth[str(frame)] = [
            {key.replace(" ", sign): value for key, value in one.items()} for one in objects
        ]
    (tmp_path / "ground_truth.json").write_text(json.dumps(truth))
    plan = _plan(tmp_path)
    _assert_boxes(plan)
    _assert_truth(plan)
    assert [view.camera.image_size for view in plan.views] == [SIZE] * 4


def _row(frames: ndarray, rows: ndarray, number: int, frame: int, place: ndarray) -> int | None:
    """The row of somebody's box in a camera, by where it must be."""
    box = CAMERAS[number].project_boxes(place[None], HALF_EXTENTS)[0][0]
    found = np.flatnonzero((frames == frame) & (np.abs(rows - box).max(axis=1) < 1e-9))
    return int(found[0]) if len(found) else None


@pytest.mark.parametrize("model", ["OpenCVModel5", "KannalaBrandt4"])
def test_poses_and_lenses_of_camera_intrinsic_calibration(tmp_path: Path, model: str) -> None:
    fisheye = model == "KannalaBrandt4"
    names = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
    first = CAMERAS[0]
    rows = []
    for number, camera in enumerate(CAMERAS):
        k = camera.intrinsics
        numbers = dict(zip(names, camera.distortion.tolist(), strict=False))
        lens = {"fx": k[0, 0], "fy": k[1, 1], "cx": k[0, 2], "cy": k[1, 2], **numbers,
                "width": SIZE[0], "height": SIZE[1]}  # fmt: skip
        (tmp_path / f"cam{number}.json").write_text(json.dumps({model: lens}, indent=2))
        turned = camera.rotation @ first.rotation.T
        rows.append(
            {"rvec": Rotation.from_matrix(turned).as_rotvec().tolist(),
             "tvec": (camera.translation - turned @ first.translation).tolist()}
        )  # fmt: skip
    (tmp_path / "extrinsics.json").write_text(json.dumps({"rtvecs": rows}, indent=2))
    for number, camera in enumerate(CAMERAS):
        (raw,) = raw_cameras(tmp_path / f"cam{number}.json")
        assert (raw.lens, raw.image_size) == ("fisheye" if fisheye else "pinhole", SIZE)
        np.testing.assert_array_equal(raw.intrinsics, camera.intrinsics)
        np.testing.assert_array_equal(raw.distortion, camera.distortion[: len(names)])
        own, moved = (SEEN[number][0], SEEN[number][1])
        table = [
            f"{frame},{','.join(map(repr, box))}"
            for frame, box in zip(own, moved.tolist(), strict=True)
        ]
        text = "\n".join(["frame,left,top,width,height", *table])
        (tmp_path / f"cam{number}.csv").write_text(text)
    if fisheye:
        return
    plan = _plan(tmp_path)
    _assert_boxes(plan)
    one, *others = (view.camera for view in plan.views)
    for found, camera in zip(others, CAMERAS[1:], strict=True):
        np.testing.assert_allclose(_between(one, found), _between(first, camera), atol=1e-9)


def _between(one: Camera, other: Camera) -> ndarray:
    turned = other.rotation @ one.rotation.T
    return np.column_stack([turned, other.translation - turned @ one.translation])


@pytest.mark.parametrize("model", ["EUCM", "UCM", "EUCMT", "Ftheta"])
def test_a_lens_that_opencv_has_not_is_refused(tmp_path: Path, model: str) -> None:
    path = tmp_path / "cam0.json"
    lens = {"fx": 190.0, "fy": 190.0, "cx": 255.0, "cy": 257.0, "alpha": 0.6, "beta": 1.0,
            "width": 512, "height": 512}  # fmt: skip
    path.write_text(json.dumps({model: lens}))
    with pytest.raises(FormatError, match=rf"lens of the model {model}.*--model opencv5"):
        read(path)


def test_a_scene_of_scenescape(tmp_path: Path) -> None:
    floor = np.array([[-1.5, -1.5, 0.0], [1.5, -1.5, 0.0], [1.5, 1.5, 0.0], [-1.5, 1.5, 0.0]])
    sensors = {}
    for camera, (frames, rows) in zip(cameras(distortion=False), SEEN, strict=True):
        k = camera.intrinsics
        sensors[camera.name] = {
            "camera points": camera.project(floor)[0].tolist(), "map points": floor.tolist(),
            "intrinsics": [k[0, 0], k[1, 1], k[0, 2], k[1, 2]],
            "width": float(SIZE[0]), "height": float(SIZE[1]),
        }  # fmt: skip
        lines = []
        for frame in range(len(PLACES)):
            cart = {
                "id": 9,
                "category": "FW190D",
                "confidence": 1.0,
                "bounding_box_px": {"x": 5.0, "y": 5.0, "height": 80.0, "width": 90.0},
            }
            people = [
                {"id": who, "category": "person", "confidence": 1.0,
                 "bounding_box_px": dict(zip(("x", "y", "width", "height"), box, strict=True)),
                 "bounding_box": {"x": -0.1, "y": -0.2, "height": 0.1, "width": 0.03}}
                for who, box in enumerate(rows[frames == frame].tolist())
            ]  # fmt: skip
            stamp = f"2014-09-08T04:00:{frame / 25.0:06.3f}Z"
            objects = {"person": people, "FW190D": [cart]} if people else {"FW190D": [cart]}
            lines.append(json.dumps({"timestamp": stamp, "id": camera.name, "frame": frame,
                                     "objects": objects}))  # fmt: skip
        (tmp_path / f"{camera.name}.json").write_text("\n".join(lines))
    (tmp_path / "config.json").write_text(json.dumps({"name": "Shop", "sensors": sensors}))
    lines = []
    for frame, places in enumerate(PLACES):
        rows_ = [{"category": "person", "id": who, "translation": [*place[:2], 0.0]}
                 for who, place in enumerate(places)]  # fmt: skip
        stamp = f"2014-09-08T04:00:{frame / 25.0:06.3f}Z"
        lines.append(json.dumps({"timestamp": stamp, "objects": {"person": rows_}}))
    (tmp_path / "gtLoc.json").write_text("\n".join(lines))
    plan = _plan(tmp_path)
    _assert_boxes(plan)
    _assert_truth(plan)


@pytest.mark.parametrize("columns", [1000, 640], ids=["MultiviewX", "another grid"])
def test_multiviewx_has_a_grid_and_calibrations_of_its_own(tmp_path: Path, columns: int) -> None:
    shift = np.array([4.0, 4.0, 0.0])  # its places are positive
    for folder in ("calibrations/intrinsic", "calibrations/extrinsic", "annotations_positions"):
        (tmp_path / folder).mkdir(parents=True)
    for number, camera in enumerate(cameras(distortion=False), 1):
        parts = {"camera_matrix": camera.intrinsics, "distortion_coefficients": np.zeros((1, 5))}
        _storage(tmp_path / f"calibrations/intrinsic/intr_Camera{number}.xml", parts)
        moved = camera.translation - camera.rotation @ shift
        pose = {"rvec": Rotation.from_matrix(camera.rotation).as_rotvec()[:, None],
                "tvec": moved[:, None]}  # fmt: skip
        _storage(tmp_path / f"calibrations/extrinsic/extr_Camera{number}.xml", pose)
    for frame, people in enumerate(PLACES):
        cells = np.round((people + shift)[:, :2] / 0.025).astype(int)
        rows: list[dict[str, object]] = []
        for who, (place, cell) in enumerate(zip(people, cells, strict=True)):
            views = []
            for number, (frames, boxes_) in enumerate(SEEN):
                at = _row(frames, boxes_, number, frame, place)
                box = [-1.0] * 4 if at is None else _corners(boxes_[at])
                sides = dict(zip(("xmin", "ymin", "xmax", "ymax"), box, strict=True))
                views.append({"viewNum": number, **sides})
            rows.append({"personID": who, "positionID": int(cell[0] + columns * cell[1]),
                         "views": views})  # fmt: skip
        (tmp_path / f"annotations_positions/{frame:05}.json").write_text(json.dumps(rows))
    plan = _plan(tmp_path)
    _assert_boxes(plan)
    assert plan.truth is not None
    expected = (PLACES + shift).reshape(-1, 3)[:, :2]
    off = plan.truth.positions[:, :2] - expected
    tolerance = 0.0126 if columns == 1000 else 0.1
    assert np.abs(off).max() < tolerance
    words = " ".join(text for name, text in plan.found if name == "truth")
    assert ("MultiviewX" if columns == 1000 else "640 columns of 2.5 cm") in words


def _storage(path: Path, values: dict[str, ndarray]) -> None:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in values.items():
        storage.write(key, value)
    storage.release()
