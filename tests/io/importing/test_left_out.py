"""What an import leaves out is summed up; where most of it would be, it ends with an error."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.conftest import short
from tests.io.read.recorded import PLACES, detections, settled_of, toml
from tests.io.read.rig import boxes, cameras, walks
from tracker.export.calibration import save_calibration
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan, settle
from tracker.io.read.pieces import DetectionPiece, FormatError


def _coco(folder: Path, *, people: bool) -> ImportPlan:
    """Import COCO files in which every frame of a camera also has two cars and a dog."""
    save_calibration(folder / "cameras.toml", cameras(), "pose2sim")
    kinds = {1: "person", 2: "car", 3: "dog"}
    for camera in cameras():
        frames, rows = boxes(camera, walks())
        found = [(frame, 1, box) for frame, box in zip(frames.tolist(), rows.tolist(), strict=True)]
        others = [(frame, kind, [5, 5, 9, 9]) for frame in range(60) for kind in (2, 2, 3)]
        images = [{"id": n, "file_name": f"{n:04}.jpg"} for n in range(60)]
        annotations = [
            {"id": n, "image_id": frame, "category_id": kind, "bbox": box}
            for n, (frame, kind, box) in enumerate([*(found if people else []), *others])
        ]
        categories = [{"id": number, "name": name} for number, name in kinds.items()]
        values = {"images": images, "annotations": annotations, "categories": categories}
        (folder / f"{camera.name}.json").write_text(json.dumps(values))
    return settle(gather([folder]), ImportOptions(fps=25.0))


def test_boxes_of_other_classes_are_summed_up_camera_by_camera(tmp_path: Path) -> None:
    plan = _coco(tmp_path, people=True)
    for view in plan.views:
        assert view.detections is not None
        count = len(view.detections.frames)
        (words,) = (text for text in plan.told if f"180 of {count + 180} rows" in text)
        assert "(120 car, 60 dog)" in words


@pytest.mark.parametrize("named", [True, False])
def test_rows_of_other_classes_are_named_as_the_labels_beside_name_them(
    tmp_path: Path, named: bool
) -> None:
    save_calibration(tmp_path / "cameras.toml", cameras(), "pose2sim")
    car, person = (1, 2) if named else (3, 1)
    for camera in cameras():
        folder = tmp_path / camera.name / "gt"
        folder.mkdir(parents=True)
        frames, rows = boxes(camera, walks())
        own = [(frame, person, 1, box) for frame, box in zip(frames, rows, strict=True)]
        own += [(frame, car, 1, [5, 5, 9, 9]) for frame in range(60)]
        own += [(frame, person, 0, [5, 5, 9, 9]) for frame in range(10)]
        (folder / "gt.txt").write_text(
            "".join(
                f"{frame + 1},{n},{','.join(f'{side:.2f}' for side in box)},{counts},{kind},1\n"
                for n, (frame, kind, counts, box) in enumerate(own, 1)
            )
        )
        if named:
            (folder / "labels.txt").write_text("car\nperson\n")
    plan = settle(gather([tmp_path]), ImportOptions(fps=25.0))
    car_words = "60 car" if named else "60 of class 3"
    told = [text for text in plan.told if "/gt/gt.txt: 70 of" in text]
    assert told
    for words in told:
        assert words.endswith(f"({car_words}, 10 with 0 in column 7, not to count)")


def test_what_is_the_same_of_several_files_is_said_once(tmp_path: Path) -> None:
    save_calibration(tmp_path / "cameras.toml", cameras(), "pose2sim")
    frames, rows = boxes(cameras()[0], walks())
    for camera in cameras():
        lines = [
            f"{n},{','.join(map(str, box))},person" for n, box in zip(frames, rows, strict=True)
        ]
        lines += [f"{n},5,5,9,9,car" for n in range(60)]
        text = "\n".join(["frame,left,top,width,height,class", *lines]) + "\n"
        (tmp_path / f"{camera.name}.csv").write_text(text)
    plan = settle(gather([tmp_path]), ImportOptions(fps=25.0, accept_best=True))
    (words,) = (one for one in plan.told if "left out" in one)
    assert words.startswith("cam1.csv, cam2.csv, cam3.csv")
    assert words.endswith("(60 car)")


def test_a_recording_of_no_people_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        FormatError, match=r"no box of a person.*180 of 180 rows \(100 %\).*120 car"
    ):
        _coco(tmp_path, people=False)


@pytest.mark.parametrize(("spoilt", "used"), [(5, True), (45, False)])
def test_a_series_of_which_most_is_spoilt_is_not_used(
    tmp_path: Path, spoilt: int, used: bool
) -> None:
    joints = [100.0, 100.0, 0.9, 110.0, 200.0, 0.9, 105.0, 150.0, 0.9] * 6
    for frame in range(60):
        own = (
            [{"pose_keypoints_2d": joints[:54]}]
            if frame >= spoilt
            else [{"pose_keypoints_2d": "x"}]
        )
        (tmp_path / f"cam1_{frame:06}.json").write_text(json.dumps({"people": own}))
    taken = gather([tmp_path])
    assert any(one.pieces for one in taken) == used
    complaints = [one.complaint for one in taken if one.complaint]
    if used:
        assert len(complaints) == spoilt
    else:
        assert "45 of 60 files cannot be read, so the others are not used" in complaints[0]
        assert "keypoints: expected numbers" in complaints[0]


@pytest.mark.parametrize("spoilt", range(4))
def test_the_others_of_a_spoilt_file_keep_their_numbers(tmp_path: Path, spoilt: int) -> None:
    """Cameras count from 1, files from 0: without one of these no number is moved."""
    toml(tmp_path)
    detections(tmp_path)
    for number in range(4):
        (tmp_path / f"cam{number + 1}.csv").rename(tmp_path / f"{number}.csv")
    path = tmp_path / f"{spoilt}.csv"
    path.write_bytes(path.read_bytes()[:500] + b"\xff\x00,nan,{{" * 3)
    pairs = {
        view.camera.name: view.matched.detections.source.stem
        for view in settled_of(tmp_path, ImportOptions(fps=25.0)).views
        if view.matched.detections is not None
    }
    assert pairs == {f"cam{n + 1}": str(n) for n in range(4) if n != spoilt}


SPOILT = {
    "a word": lambda row: ",".join([row.split(",")[0], "abc", *row.split(",")[2:]]),
    "a cell too few": lambda row: row.rpartition(",")[0],
    "a cell too many": lambda row: f"{row},7",
    "not a number": lambda row: ",".join([row.split(",")[0], "nan", *row.split(",")[2:]]),
    "infinite": lambda row: ",".join([row.split(",")[0], "1e400", *row.split(",")[2:]]),
    "cut": lambda row: row[:3],
}


def _spoil(path: Path, rows: list[int], how: str) -> int:
    """Spoil some rows below the header of a CSV file; returns how many rows there are."""
    lines = path.read_text().splitlines()
    for row in rows:
        lines[row + 1] = SPOILT[how](lines[row + 1])
    path.write_text("\n".join(lines) + "\n")
    return len(lines) - 1


@pytest.mark.parametrize("how", short(SPOILT, 2))
def test_a_row_that_cannot_be_read_costs_no_camera_its_boxes(tmp_path: Path, how: str) -> None:
    toml(tmp_path)
    detections(tmp_path)
    good = {view.camera.name: view for view in settled_of(tmp_path, ImportOptions(fps=25.0)).views}
    count = _spoil(tmp_path / "cam2.csv", [30], how)
    plan = settled_of(tmp_path, ImportOptions(fps=25.0))
    for view in plan.views:
        before, now = good[view.camera.name].detections, view.detections
        assert before is not None
        assert now is not None
        assert len(before.frames) - len(now.frames) == (view.camera.name == "cam2")
    (words,) = (text for text in plan.told if "left out" in text)
    assert words.startswith(f"cam2.csv: 1 of {count} rows (")
    if how not in ("not a number", "infinite"):  # these are rows without a box
        assert "cannot be read and are left out, the first in line 32: " in words


def test_rows_without_the_number_of_a_frame_cost_no_others(tmp_path: Path) -> None:
    """The file of one camera is JSON, which has no lines that could be left out."""
    toml(tmp_path)
    detections(tmp_path)
    frames, found = boxes(cameras()[1], PLACES)
    numbers = [*frames[:30].tolist(), 3.7, None, *frames[32:].tolist()]
    records = [
        {"frame": n, "bbox": [x, y, x + w, y + h]}
        for n, (x, y, w, h) in zip(numbers, found.tolist(), strict=True)
    ]
    (tmp_path / "cam2.csv").unlink()
    (tmp_path / "cam2.json").write_text(json.dumps(records))
    (piece,) = (p for one in gather([tmp_path]) if one.label == "cam2.json" for p in one.pieces)
    assert isinstance(piece, DetectionPiece)
    assert len(piece.frames) == len(frames) - 2
    assert f"frame: 2 of {len(frames)} rows" in piece.left_out
    assert "in row 31: expected the whole number of a frame, found 3.7" in piece.left_out


def test_a_table_of_which_most_rows_cannot_be_read_is_not_used(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    path = tmp_path / "cam2.csv"
    _spoil(path, [*range(0, len(path.read_text().splitlines()) - 2, 2), 1, 3, 5], "a word")
    (taken,) = (one for one in gather([tmp_path]) if one.label == "cam2.csv")
    assert not taken.pieces
    assert "cam2.csv" in taken.complaint
    with pytest.raises(FormatError, match=r"cam2\.csv.*most of what cam2 saw would be left out"):
        settled_of(tmp_path)
    plan = settled_of(tmp_path, ImportOptions(accept_best=True))
    assert [view.camera.name for view in plan.views] == ["cam1", "cam3", "cam4"]
