"""Formats of truth."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.io.read.rig import boxes_in, read
from tracker.io.read.pieces import DetectionPiece, TruthPiece, unit_named


def _truth(path: Path, *series: Path) -> TruthPiece:
    (piece,) = (p for p in read(path, *series)[1] if isinstance(p, TruthPiece))
    return piece


def test_wildtrack_has_places_on_its_grid_and_boxes_of_each_view(tmp_path: Path) -> None:
    files = []
    for frame in (0, 5, 10):
        views = [
            {"viewNum": 0, "xmin": 10, "ymin": 20, "xmax": 30, "ymax": 60 + frame},
            {"viewNum": 1, "xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1},
        ]
        person = {"personID": 7, "positionID": 480 * 40 + 120 + frame, "views": views}
        files.append(tmp_path / f"{frame:08}.json")
        files[-1].write_text(json.dumps([person]))
    truth = _truth(files[0], *files)
    assert (truth.frames.tolist(), truth.fps) == ([0, 1, 2], 2.0)
    np.testing.assert_allclose(truth.positions[0, :2], [0.0, -8.0], atol=1e-12)
    np.testing.assert_allclose(truth.positions[2, :2], [0.25, -8.0], atol=1e-12)
    first, second = boxes_in(files[0], *files)
    np.testing.assert_array_equal(first.boxes[:, 3], [60, 65, 70])
    assert (first.layout, len(second.boxes)) == ("xyxy", 0)


@pytest.mark.parametrize("number", ["1e9", "-1e9", "1e300", "9" * 400, "nan", "inf"])
def test_a_trc_s_frame_beyond_a_year_is_no_frame(tmp_path: Path, number: str) -> None:
    path = tmp_path / "person.trc"
    head = "PathFileType\t4\t(X/Y/Z)\tperson.trc\nDataRate\tUnits\n25\tm\n"
    rows = f"999999999\t0\t1\t2\t3\n{number}\t0.04\t1\t2\t3\n"
    path.write_text(f"{head}Frame#\tTime\tHip\n\t\tX1\tY1\tZ1\n{rows}")
    assert _truth(path).frames.tolist() == [999_999_999]


def test_trc_gives_the_mid_of_the_hips(tmp_path: Path) -> None:
    path = tmp_path / "person.trc"
    path.write_text(
        "PathFileType\t4\t(X/Y/Z)\tperson.trc\n"
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n"
        "60\t60\t2\t3\tmm\t60\n"
        "Frame#\tTime\tRHip\t\t\tLHip\t\t\tHead\t\t\n"
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\tX3\tY3\tZ3\n"
        "1\t0.0\t100\t900\t0\t300\t920\t0\t200\t1700\t0\n"
        "2\t0.016\t\t\t\t\t\t\t200\t1700\t0\n"
    )
    truth = _truth(path)
    assert (truth.unit, truth.up, truth.fps, truth.first_index) == ("mm", "y", 60.0, 1)
    np.testing.assert_array_equal(truth.positions, [[200, 910, 0]])


def test_skeletons_of_panoptic_studio(tmp_path: Path) -> None:
    joints = np.zeros((19, 4))
    joints[2] = [10.0, -90.0, 30.0, 1.0]
    path = tmp_path / "body3DScene_00000012.json"
    path.write_text(
        json.dumps({"version": 0.7, "bodies": [{"id": 3, "joints19": joints.ravel().tolist()}]})
    )
    truth = _truth(path)
    assert (truth.frames.tolist(), truth.ids.tolist(), truth.unit) == ([12], [3], "cm")
    np.testing.assert_array_equal(truth.positions, [[10.0, -90.0, 30.0]])


def test_csv_of_places_with_names_for_people(tmp_path: Path) -> None:
    path = tmp_path / "truth.csv"
    path.write_text("person,frame,x_mm,y_mm,z_mm\nanna,0,1,2,3\nben,0,4,5,6\nanna,1,7,8,9\n")
    truth = _truth(path)
    assert truth.ids.tolist() == [1, 2, 1]
    assert truth.unit == "mm"
    np.testing.assert_array_equal(truth.positions[2], [7, 8, 9])


TABLES: dict[str, str] = {
    "x1 y1 of two": "frame,x1,y1,x2,y2\n0,3,1,2,4\n2,3,5,2,6\n",
    "x1 y1 of three": "frame,x1,y1,x2,y2,x3,y3\n0,3,1,2,4,9,\n2,3,5,2,6,,9\n",
    "person1_x": "frame;person1_x;person1_y;person2_x;person2_y\n0;3;1;2;4\n2;3;5;2;6\n",
    "position": json.dumps([
        {"frame": f, "person_id": i, "position": p}
        for f, i, p in ((0, 1, [3, 1, 0]), (0, 2, [2, 4, 0]), (2, 1, [3, 5, 0]), (2, 2, [2, 6, 0]))
    ]),
    "x and y below position": json.dumps([
        {"frame": f, "person_id": i, "position": {"x": x, "y": y}}
        for f, i, x, y in ((0, 1, 3, 1), (0, 2, 2, 4), (2, 1, 3, 5), (2, 2, 2, 6))
    ]),
    "people of frames": json.dumps({"frames": [
        {"frame": 0, "people": [{"id": 1, "location": [3, 1]}, {"id": 2, "location": [2, 4]}]},
        {"frame": 2, "people": [{"id": 1, "location": [3, 5]}]},
        {"frame": 2, "people": [{"id": 2, "location": [2, 6]}]},
    ]}),
}  # fmt: skip


@pytest.mark.parametrize("form", TABLES)
def test_places_of_several_people_in_one_row_or_record(tmp_path: Path, form: str) -> None:
    path = tmp_path / "truth.txt"
    path.write_text(TABLES[form])
    truth = _truth(path)
    rows = sorted(zip(truth.frames.tolist(), truth.ids.tolist(), *truth.positions[:, :2].T.tolist(),
                      strict=True))  # fmt: skip
    assert rows == [(0, 1, 3, 1), (0, 2, 2, 4), (2, 1, 3, 5), (2, 2, 2, 6)]


def test_two_corners_are_no_people(tmp_path: Path) -> None:
    path = tmp_path / "cam1.csv"
    path.write_text("frame,x1,y1,x2,y2\n0,3,1,20,40\n2,3,5,20,60\n")
    assert isinstance(read(path)[1][0], DetectionPiece)


@pytest.mark.parametrize(
    ("word", "unit"),
    [("mm", "mm"), ("Millimeters", "mm"), ("centimetres", "cm"), ("meters", "m"), ("inches", None)],
)
def test_a_unit_is_known_by_its_sign_and_its_name(word: str, unit: str | None) -> None:
    assert unit_named(word) == unit
