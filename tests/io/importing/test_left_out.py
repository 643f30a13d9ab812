"""What an import leaves out is summed up; where most of it would be, it ends with an error."""

from __future__ import annotations

import json
import random
import string
from pathlib import Path

import numpy as np
import pytest

from tests.conftest import short
from tests.io.folders import make_folder
from tests.io.read.recorded import PLACES, detections, settled_of, toml
from tests.io.read.rig import boxes, cameras, walks
from tracker.export.calibration import save_calibration
from tracker.io.importing.gathering import file_uses, gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan, settle
from tracker.io.read.pieces import DetectionPiece, FormatError
from tracker.io.read.source import SourceFile


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


CAMERA = """[cam_{n}]
name = "cam{n}"
size = [1280, 720]
matrix = [[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]]
distortions = [0.0, 0.0, 0.0, 0.0, 0.0]
rotation = [1.2, {turn}, 0.3]
translation = [0.0, 0.5, 6.0]
"""


def rows_of(people: str, flag: int) -> str:
    """MOTChallenge's ground truth of a few frames: of a class, counted or not."""
    return "".join(f"{k},1,{300 + 4 * k},200,60,180,{flag},{people},1\n" for k in range(1, 40))


def recording(folder: Path) -> Path:
    """Two cameras with annotations that name their classes, and files that nobody reads."""
    text = "".join(CAMERA.format(n=n, turn=turn) for n, turn in ((1, -0.8), (2, 0.8)))
    (folder / "calibration.toml").write_text(text)
    for n in (1, 2):
        place = folder / f"cam{n}" / "gt"
        place.mkdir(parents=True)
        (place / "gt.txt").write_text(rows_of("2", 1))
        (place / "labels.txt").write_text("car\nperson\n")
    (folder / "notes.txt").write_text("the door was open\n")
    stranger = folder / "hall" / "gt"
    stranger.mkdir(parents=True)
    (stranger / "gt.txt").write_text(rows_of("1", 1))
    return folder


def test_what_is_read_with_another_file_is_used_where_that_one_is(tmp_path: Path) -> None:
    taken = gather([recording(tmp_path)])
    settled = settle(taken, ImportOptions(fps=25.0, accept_best=True))
    uses = {one.files.label: one for one in file_uses(taken, settled.sources)}
    assert {label: one.used for label, one in uses.items()} == {
        "calibration.toml": 1,
        "cam1/gt/gt.txt": 1,
        "cam1/gt/labels.txt": 1,
        "cam2/gt/gt.txt": 1,
        "cam2/gt/labels.txt": 1,
        "hall/gt/gt.txt": 0,
        "notes.txt": 0,
    }
    assert uses["cam2/gt/labels.txt"].files.read_with == "cam2/gt/gt.txt"
    assert uses["notes.txt"].why == "no format that is read"
    assert any(told.startswith("hall/gt/gt: belongs to no camera") for told in settled.told)
    # before anything is settled, what was read counts
    assert sum(one.used for one in file_uses(taken, None)) == 6


def test_the_lenses_of_a_model_are_used_with_its_poses(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 640 480 500 500 320 240\n")
    (tmp_path / "images.txt").write_text(
        "1 1 0 0 0 0 0 3 1 cam1.jpg\n\n2 0.9 0.1 0.3 0.3 0 0 4 1 cam2.jpg\n\n"
    )
    (tmp_path / "points3D.txt").write_text("# nothing\n")
    uses = {one.files.label: one.used for one in file_uses(gather([tmp_path]), None)}
    assert uses == {"cameras.txt": 1, "images.txt": 1, "points3D.txt": 0}


def test_files_are_counted_not_their_series(tmp_path: Path) -> None:
    known = make_folder(tmp_path, np.random.default_rng([9, 1]), "none", 40)
    taken = gather([tmp_path])
    there = sum(path.is_file() for path in tmp_path.rglob("*"))
    assert sum(one.count for one in taken) == there
    options = known.options.model_copy(update={"accept_best": True})
    uses = file_uses(taken, settle(taken, options).sources)
    assert sum(one.used for one in uses) == there, [(one.files.label, one.used) for one in uses]


BOXES = "frame,left,top,width,height\n" + "".join(f"{k},{300 + k},200,60,180\n" for k in range(40))
OPTIONS = ImportOptions(fps=25.0, accept_best=True)


def calibrated(folder: Path, texts: dict[int, str]) -> Path:
    """Cameras and their boxes; the text is what a camera has besides its name and size."""
    text = ""
    for n, own in texts.items():
        text += f'[cam_{n}]\nname = "cam{n}"\nsize = [1280, 720]\n{own}'
        (folder / f"cam{n}.csv").write_text(BOXES)
    (folder / "calibration.toml").write_text(text)
    return folder


def test_all_files_that_belong_to_no_camera_are_named(tmp_path: Path) -> None:
    text = "".join(CAMERA.format(n=n, turn=n) for n in (1, 2, 3))
    (tmp_path / "calibration.toml").write_text(text)
    for name in ("x", "y"):
        (tmp_path / f"{name}.csv").write_text(BOXES)
    with pytest.raises(FormatError) as refusal:
        settle(gather([tmp_path]), OPTIONS)
    words = "x, y: belong to no camera of the calibration (cam1, cam2, cam3); --camera NAME=FILE"
    assert words in str(refusal.value)


def test_a_camera_that_is_calibrated_in_part_lacks_what_it_lacks(tmp_path: Path) -> None:
    lens = "".join(CAMERA.format(n=0, turn=1).splitlines(keepends=True)[3:5])
    pose = "rotation = [1.2, {turn}, 0.3]\ntranslation = [0.0, 0.5, 6.0]\n"
    whole = {n: lens + pose.format(turn=turn) for n, turn in ((1, -0.8), (2, 0.8))}
    plan = settle(gather([calibrated(tmp_path, {**whole, 3: lens, 4: lens})]), OPTIONS)
    (words,) = (told for told in plan.told if "unlike the others" in told)
    assert "cam3, cam4: no pose, unlike the others" in words
    assert "lens" not in words


def _strange(folder: Path, count: int, ending: str) -> None:
    folder.mkdir(exist_ok=True)
    some = random.Random(7)
    for _ in range(count):
        name = "".join(some.choices(string.ascii_lowercase, k=10))
        (folder / f"{name}{ending}").write_text("nobody knows what this is, or means\n")


def test_of_a_crowd_that_nobody_knows_most_are_not_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _strange(tmp_path / "notes", 700, ".txt")
    toml(tmp_path)
    detections(tmp_path)
    # between them in the order of names, but of another size
    (tmp_path / "notes" / "mm.txt").write_text("frame,left,top,width,height\n" + "1,2,3,4,5\n" * 9)
    opened: list[str] = []
    head = SourceFile.head.func
    monkeypatch.setattr(
        SourceFile, "head", property(lambda own: opened.append(own.where) or head(own))
    )
    taken = gather([tmp_path])
    known = [one.label for one in taken if one.pieces]
    assert "notes/mm.txt" in known
    assert len(known) == len({*known}) >= 3
    assert len({name for name in opened if name.startswith("notes/")}) == 201
    (told,) = (one for one in taken if "not opened" in one.complaint)
    assert told.label == "notes/….txt (500)"
    assert told.complaint.endswith(
        "200 of these files are of no format that is read, so 500 more of like size were not "
        "opened; name those that are wanted"
    )


def test_where_one_of_them_is_known_all_are_opened(tmp_path: Path) -> None:
    _strange(tmp_path / "notes", 300, ".txt")
    (tmp_path / "notes" / "aa.txt").write_text(
        "frame,left,top,width,height\n0,2,3,4,5\n1,2,3,4,5\n"
    )
    taken = gather([tmp_path])
    assert len(taken) == 301
