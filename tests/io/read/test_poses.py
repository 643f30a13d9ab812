"""Boxes out of poses: the whole body's, by the joints that are seen."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.io.read.rig import boxes_of_one
from tracker.io.read.detections.body import NOSE_HEIGHT, boxes_of


def _stick_figure(stature: float) -> dict[str, list[float]]:
    """Joints of somebody who stands at x = 500 with the floor at y = 900; pixels."""
    shoulders, hips = 900 - 0.818 * stature, 900 - 0.53 * stature
    knees, ankles = 900 - 0.285 * stature, 900 - 0.039 * stature
    nose = 900 - NOSE_HEIGHT * stature
    half = 0.1 * stature
    return {
        "nose": [500, nose], "eyes": [495, nose - 3], "eyes2": [505, nose - 3],
        "ls": [500 + half, shoulders], "rs": [500 - half, shoulders],
        "le": [500 + half, shoulders + 90], "re": [500 - half, shoulders + 90],
        "lw": [500 + half, hips], "rw": [500 - half, hips],
        "lh": [500 + half / 2, hips], "rh": [500 - half / 2, hips],
        "lk": [500 + half / 2, knees], "rk": [500 - half / 2, knees],
        "la": [500 + half / 2, ankles], "ra": [500 - half / 2, ankles],
    }  # fmt: skip


COCO = ["nose", "eyes", "eyes2", "eyes", "eyes2", "ls", "rs", "le", "re", "lw", "rw", "lh", "rh",
        "lk", "rk", "la", "ra"]  # fmt: skip


def test_a_pose_gives_the_box_of_the_whole_body() -> None:
    joints = _stick_figure(600.0)
    pose = np.array([[*joints[name], 0.9] for name in COCO])
    (box,) = boxes_of(pose[None])
    np.testing.assert_allclose(box[1], 300.0, atol=3.0)  # the crown
    np.testing.assert_allclose(box[1] + box[3], 900.0, atol=1.0)  # the sole
    assert 120 < box[2] < 170


def test_of_two_layouts_with_25_joints_the_one_with_short_bones_is_taken() -> None:
    joints = _stick_figure(600.0)
    mean = {"neck": [500, joints["ls"][1]], "hip": [500, joints["lh"][1]], **joints}
    body_25 = ["nose", "neck", "rs", "re", "rw", "ls", "le", "lw", "hip", "rh", "rk", "ra", "lh",
               "lk", "la", "eyes", "eyes2", "eyes", "eyes2", *["la"] * 3, *["ra"] * 3]  # fmt: skip
    crown = {**mean, "crown": [500, 300.0]}
    body_25b = [*COCO, "neck", "crown", *["la"] * 3, *["ra"] * 3]
    for names in (body_25, body_25b):
        (box,) = boxes_of(np.array([[[*crown[name], 0.9] for name in names]]))
        np.testing.assert_allclose([box[1], box[1] + box[3]], [300.0, 900.0], atol=4.0)


def test_openpose_a_file_a_frame_with_nobody_in_the_first(tmp_path: Path) -> None:
    joints = _stick_figure(600.0)
    pose = [value for name in COCO for value in (*joints[name], 0.8)]
    files = [tmp_path / f"cam1_{n:012}_keypoints.json" for n in range(3)]
    for number, path in enumerate(files):
        people = [{"person_id": [-1], "pose_keypoints_2d": pose}] if number else []
        path.write_text(json.dumps({"version": 1.3, "people": people}))
    piece = boxes_of_one(files[1], *files)
    assert piece.frames.tolist() == [1, 2]
    assert (piece.first_index, piece.last_frame) == (0, 2)
    np.testing.assert_allclose(piece.scores, 0.8)


@pytest.mark.parametrize("missing", ["NaN", "null", "0"])
def test_a_joint_or_a_person_of_nan_was_not_seen(tmp_path: Path, missing: str) -> None:
    joints = _stick_figure(600.0)
    pose = [number for name in COCO for number in (*joints[name], 0.9)]
    gaps = [None if n // 3 in (7, 8) else number for n, number in enumerate(pose)]
    people = [{"pose_keypoints_2d": own} for own in (pose, gaps, [None] * len(pose))]
    path = tmp_path / "cam1_000000.json"
    path.write_text(json.dumps({"people": people}).replace("null", missing))
    piece = boxes_of_one(path)
    np.testing.assert_allclose(piece.boxes[0], piece.boxes[1])
    assert len(piece.boxes) == 2
    assert piece.keypoints is not None
    assert np.isnan(piece.keypoints[1, 7:9]).all()
    assert np.isfinite(piece.keypoints[1, 9:]).all()
    np.testing.assert_allclose(piece.scores, 0.9)


def test_alphapose(tmp_path: Path) -> None:
    joints = _stick_figure(600.0)
    pose = [value for name in COCO for value in (*joints[name], 0.8)]
    path = tmp_path / "alphapose-results.json"
    record = {"image_id": "12.jpg", "category_id": 1, "keypoints": pose, "score": 2.7,
              "box": [1, 2, 3, 4], "idx": 1}  # fmt: skip
    path.write_text(json.dumps([record]))
    piece = boxes_of_one(path)
    assert (piece.format, piece.frames.tolist()) == ("AlphaPose JSON", [12])
    np.testing.assert_allclose(piece.boxes[0, 1] + piece.boxes[0, 3], 900.0, atol=1.0)


@pytest.mark.parametrize(
    ("form", "people", "joints"),
    [("open", "people", "pose_keypoints_2d"), ("cmu", "bodies", "joints")],
)
def test_the_other_forms_of_alphapose(tmp_path: Path, form: str, people: str, joints: str) -> None:
    """All pictures in one file, by their names; or a file a picture."""
    figure = _stick_figure(600.0)
    figure["neck"] = [500, figure["ls"][1]]
    names = ["nose", "neck", "rs", "re", "rw", "ls", "le", "lw", "rh", "rk", "ra", "lh", "lk", "la",
             "eyes", "eyes2", "eyes", "eyes2"]  # fmt: skip
    pose = [value for name in names for value in (*figure[name], 0.8)]
    pictures = {
        f"{frame}.jpg": {"version": "AlphaPose v0.3", people: [{joints: pose}] * count}
        for frame, count in ((3, 1), (12, 2))
    }
    whole = tmp_path / f"{form}.json"
    whole.write_text(json.dumps(pictures))
    files = []
    for name, one in pictures.items():
        files.append(tmp_path / name.replace("jpg", "json"))
        files[-1].write_text(json.dumps(one))
    for piece in (boxes_of_one(whole), boxes_of_one(files[0], *files)):
        assert piece.frames.tolist() == [3, 12, 12]
        np.testing.assert_allclose(piece.boxes[:, 1] + piece.boxes[:, 3], 900.0, atol=1.0)
        np.testing.assert_allclose(piece.boxes[:, 1], 300.0, atol=4.0)


@pytest.mark.parametrize("count", [26, 136])
def test_alphapose_with_the_joints_of_halpe(tmp_path: Path, count: int) -> None:
    figure = _stick_figure(600.0)
    figure["crown"] = [500, 300.0]
    names = [*COCO, "crown", *["nose"] * (count - 18)]
    pose = [value for name in names for value in (*figure[name], 0.8)]
    path = tmp_path / "alphapose-results.json"
    path.write_text(json.dumps([{"image_id": "cam1_0007.jpg", "category_id": 1,
                                 "keypoints": pose, "score": 3.1, "box": [1, 2, 3, 4],
                                 "idx": [0.0]}]))  # fmt: skip
    piece = boxes_of_one(path)
    assert (piece.camera, piece.frames.tolist()) == ("cam1", [7])
    np.testing.assert_allclose(piece.boxes[0, 1] + piece.boxes[0, 3], 900.0, atol=1.0)
