"""From files as people have them to a sequence folder: matched, found out, written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy import ndarray

from app.command.main import main
from tests.io.read.recorded import (
    HEAD,
    PLACES,
    assert_boxes,
    detections,
    settled_of,
    table,
    toml,
    videos,
)
from tests.io.read.rig import FLIP, HALF_EXTENTS, SIZE, boxes, cameras
from tracker.io.conventions.questions import PARTS
from tracker.io.importing.finding.names import match, short_names
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import ImportPlan
from tracker.io.importing.writing import write
from tracker.io.read.pieces import FormatError
from tracker.sequences.reader import read_sequence

SIDES = np.array([*SIZE, *SIZE])
HALF = np.array([0.5, 0.5, 0.0, 0.0])
"""Of a pixel: parts of the picture count from the corner of its first."""


def _middles(ltwh: ndarray) -> ndarray:
    """The middle and the size of boxes."""
    return np.hstack([ltwh[:, :2] + ltwh[:, 2:] / 2.0, ltwh[:, 2:]])


def _assert_cameras(settled: ImportPlan, tolerance: float = 1e-6) -> None:
    for view, camera in zip(settled.views, cameras(), strict=True):
        np.testing.assert_allclose(view.camera.centre, camera.centre, atol=tolerance)
        np.testing.assert_allclose(view.camera.rotation, camera.rotation, atol=tolerance)


@pytest.mark.full
@pytest.mark.parametrize(("unit", "scale"), [("m", 1.0), ("cm", 100.0), ("mm", 1000.0)])
def test_the_unit_follows_from_the_height_of_people(
    tmp_path: Path, unit: str, scale: float
) -> None:
    toml(tmp_path, scale=scale)
    detections(tmp_path)
    settled = settled_of(tmp_path)
    assert settled.reading.unit == unit
    _assert_cameras(settled)
    assert settled.room.minimum[2] == pytest.approx(0.0, abs=0.25)
    assert 2.0 * settled.room.half_extents[2] == pytest.approx(1.7, abs=0.1)
    assert settled.frames == len(PLACES)


@pytest.mark.full
def test_poses_of_ones_own_the_other_way_round(tmp_path: Path) -> None:
    tables = {
        c.name: {"K": c.intrinsics.tolist(), "dist": c.distortion.tolist(),
                 "R": (c.rotation.T @ FLIP).tolist(), "t": c.centre.tolist(),
                 "size": list(SIZE)}
        for c in cameras()
    }  # fmt: skip
    (tmp_path / "cameras.json").write_text(json.dumps(tables))
    detections(tmp_path)
    settled = settled_of(tmp_path)
    assert (settled.reading.direction, settled.reading.axes) == ("camera-to-world", "opengl")
    _assert_cameras(settled)
    with pytest.raises(AssertionError):  # a flag is believed
        _assert_cameras(
            settled_of(
                tmp_path, ImportOptions(pose="world-to-camera", axes="opencv", accept_best=True)
            )
        )


@pytest.mark.full
def test_a_calibration_of_another_resolution_is_scaled(tmp_path: Path) -> None:
    toml(tmp_path, size=(2560, 1440))
    videos(tmp_path)
    settled = settled_of(tmp_path, ImportOptions(unit="m"))
    found = settled.views[0].camera
    assert found.image_size == SIZE
    np.testing.assert_allclose(found.intrinsics[0, 0], cameras()[0].intrinsics[0, 0])
    assert (settled.fps, settled.frames) == (20.0, 60)
    _assert_cameras(settled)


def test_a_camera_beyond_the_earth_is_refused_with_its_flag(tmp_path: Path) -> None:
    toml(tmp_path, scale=1e8)
    detections(tmp_path)
    with pytest.raises(FormatError, match=r"cam1: expected a camera within 1e\+06 m .* --unit"):
        settled_of(tmp_path, ImportOptions(unit="m"))


def test_of_files_that_nobody_knows_the_first_are_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "source"
    source.mkdir()
    toml(source)
    detections(source)
    (source / f"{'long' * 50}.dat").write_bytes(b"x")
    for number in range(40):
        (source / f"{chr(97 + number % 26)}{'x' * number}.dat").write_bytes(b"x")
    main(["import", str(source), "--dry-run", "--unit", "m"])
    told = capsys.readouterr().out
    assert told.count("no format that is read; it is not used") == 30
    assert "… 11 more" in told
    assert max(map(len, told.splitlines())) < 200


def test_a_calibration_of_another_shape_is_refused(tmp_path: Path) -> None:
    toml(tmp_path, size=(720, 1280))
    videos(tmp_path, frames=3)
    with pytest.raises(FormatError, match="they are turned"):
        settled_of(tmp_path)


def test_what_is_written_opens_and_is_whole(tmp_path: Path) -> None:
    source, target = tmp_path / "source", tmp_path / "target"
    source.mkdir()
    toml(source)
    videos(source)
    (source / "boxes").mkdir()
    detections(source / "boxes", first=1)
    rows = [
        f"{step},{who},{x},{y},{z}"
        for step, people in enumerate(PLACES)
        for who, (x, y, z) in enumerate(people)
    ]
    (source / "truth.csv").write_text("\n".join(["frame,id,x,y,z", *rows]))
    settled = settled_of(source)
    told = write(settled, target, "a room")
    sequence = read_sequence(target)
    assert told == []
    assert not sequence.warnings
    assert sequence.views[0].has_pictures
    assert sequence.ground_truth is not None
    np.testing.assert_allclose(
        sequence.ground_truth.positions.reshape(PLACES.shape), PLACES, atol=1e-4
    )
    for view, camera in zip(sequence.views, cameras(), strict=True):
        frames, found = boxes(camera, PLACES)
        assert view.detections is not None
        np.testing.assert_array_equal(view.detections.frames, frames)
        np.testing.assert_allclose(view.detections.boxes, found, atol=1e-3)
        assert (target / f"{camera.name}.avi").stat().st_nlink == 2  # linked, not copied
    with pytest.raises(FormatError, match="already"):
        write(settled, target, "again")


def test_truth_with_y_up_finds_its_way_into_the_boxes(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    head = (
        "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tUnits\n25\tm\nFrame#\tTime\tHip\t\t\n"
        "\t\tX1\tY1\tZ1\n"
    )
    for person in range(2):
        # as Pose2Sim turns its z up to y up: (x, y, z) → (y, z, x)
        rows = [
            f"{n + 1}\t{n / 25}\t{y}\t{z}\t{x}"
            for n, (x, y, z) in enumerate(PLACES[:, person].tolist())
        ]
        (tmp_path / f"P{person}.trc").write_text(head + "\n".join(rows))
    truth = settled_of(tmp_path).truth
    assert truth is not None
    assert set(truth.ids.tolist()) == {1, 2}
    np.testing.assert_allclose(truth.positions[truth.ids == 2], PLACES[:, 1], atol=1e-9)


def test_poses_alone_tell_direction_and_unit(tmp_path: Path) -> None:
    tables = [
        {"name": c.name, "K": c.intrinsics.tolist(), "R": c.rotation.T.tolist(),
         "t": (1000.0 * c.centre).tolist(), "size": list(SIZE)}
        for c in cameras()
    ]  # fmt: skip
    (tmp_path / "cameras.json").write_text(json.dumps({"cameras": tables}))
    videos(tmp_path, frames=3)
    settled = settled_of(tmp_path)
    assert settled.reading.direction == "camera-to-world"
    assert settled.reading.unit == "mm"
    for view, camera in zip(settled.views, cameras(), strict=True):
        np.testing.assert_allclose(view.camera.centre, camera.centre, atol=1e-6)


def test_nothing_to_import_says_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(FormatError, match="no calibration"):
        settled_of(tmp_path)


@pytest.mark.parametrize(
    ("names", "labels", "how", "expected"),
    [
        (["cam1", "cam2"], ["b/cam2_json/cam2", "b/cam1_json/cam1"], "name", {0: 1, 1: 0}),
        (["cam_01", "cam_02"], ["videos/Cam 2", "videos/Cam 1"], "name", {0: 1, 1: 0}),
        (["0", "1", "2"], ["cam1", "cam2", "cam3"], "number", {0: 0, 1: 1, 2: 2}),
        (["north", "east"], ["a1", "a2"], "order", {0: 1, 1: 0}),
        (["A", "B", "C"], ["rec_A_x", "rec_C_x"], "name", {0: 0, 1: 2}),
        (["LeftSide", "Front"], ["front", "left_side"], "name", {0: 1, 1: 0}),
        (["a", "b"], ["x", "y", "z"], None, None),
    ],
)
def test_files_belong_to_cameras(
    names: list[str], labels: list[str], how: str | None, expected: dict[int, int] | None
) -> None:
    found = match(names, labels)
    assert found == (None if expected is None else (expected, how))


def test_short_names_keep_what_tells_files_apart() -> None:
    assert short_names(["c/extr_A1", "c/extr_B2"]) == ["A1", "B2"]
    assert short_names(["v/cam01/x", "v/cam02/x"]) == ["cam01", "cam02"]


@pytest.mark.full
def test_the_command_prints_what_it_takes_files_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "source"
    source.mkdir()
    toml(source, scale=1000.0)
    detections(source)
    (source / "notes.txt").write_text("nothing")
    assert main(["import", str(source), "--dry-run"]) == 0
    said = capsys.readouterr()
    assert "Anipose, Pose2Sim or Caliscope TOML" in said.out
    assert "notes.txt" in said.out
    assert "mm, by the height of people; --unit" in said.out
    assert "nothing was written" in said.err
    wrong = f"cam9={source / 'cam1.csv'}"
    assert main(["import", str(source), "-o", str(tmp_path / "out"), "--camera", wrong]) == 1
    assert "cam9" in capsys.readouterr().err
    assert main(["import", str(source)]) == 2
    assert main(["import", str(source), "-o", str(tmp_path / "out"), "--unit", "mm"]) == 0
    assert main(["check", str(tmp_path / "out")]) == 0
    assert main(["formats"]) == 0
    assert "WILDTRACK annotations" in capsys.readouterr().out
    capsys.readouterr()
    again = str(tmp_path / "out")
    assert main(["import", again, "--dry-run"]) == 1
    assert f"{again}: has a sequence.toml, so that every" in capsys.readouterr().err
    exported = tmp_path / "again.toml"
    line = ["export-calibration", str(tmp_path / "out"), "-o", str(exported), "--form", "pose2sim"]
    assert main(line) == 0
    assert exported.read_text().count("rotation") == 4


def test_names_with_slashes_stay_in_the_folder(tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    toml(source)
    detections(source)
    settled = settled_of(source)
    evil = [
        replace(view, camera=replace(view.camera, name=f'../../{view.camera.name}, "#\n'))
        for view in settled.views
    ]
    write(replace(settled, views=tuple(evil)), tmp_path / "in" / "target", 'a "name"\n')
    sequence = read_sequence(tmp_path / "in" / "target")
    assert len(sequence.views) == 4
    assert sorted(path.name for path in (tmp_path / "in").iterdir()) == ["target"]


@pytest.mark.data
@pytest.mark.parametrize("name", ["pose2sim-multi", "wildtrack-60"])
def test_foreign_recordings_open_without_a_flag(foreign: Path, tmp_path: Path, name: str) -> None:
    settled = settled_of(foreign / name)
    write(settled, tmp_path / name, name)
    sequence = read_sequence(tmp_path / name)
    assert sequence.has_detections
    truth = sequence.ground_truth
    assert truth is not None
    inside = sequence.room.contains(truth.positions)
    assert inside.mean() > 0.95
    assert HALF_EXTENTS[2] == pytest.approx(float(sequence.target_half_extents[2]), abs=0.06)


@pytest.mark.full
def test_a_video_of_another_rate_keeps_its_own(tmp_path: Path) -> None:
    toml(tmp_path)
    videos(tmp_path)
    slow = str(tmp_path / "cam2.avi")
    writer = cv2.VideoWriter(slow, cv2.VideoWriter.fourcc(*"MJPG"), 10.0, SIZE)
    for _ in range(30):
        writer.write(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
    writer.release()
    settled = settled_of(tmp_path, ImportOptions(unit="m"))
    assert (settled.fps, settled.frames) == (20.0, 60)
    write(settled, tmp_path / "out", "two rates")
    text = (tmp_path / "out" / "sequence.toml").read_text()
    assert text.count("fps = 20.0") == 1
    assert text.count("fps = 10.0") == 1
    assert not read_sequence(tmp_path / "out").warnings


def test_the_world_of_a_first_camera_is_levelled(tmp_path: Path) -> None:
    """As stereo calibrations have it: the origin is a camera, and z is where it looks."""
    first = cameras()[0]
    tables = {
        c.name: {
            "K": c.intrinsics.tolist(),
            "dist": c.distortion.tolist(),
            "R": (c.rotation @ first.rotation.T).tolist(),
            "t": (c.translation - c.rotation @ first.rotation.T @ first.translation).tolist(),
        }
        for c in cameras()
    }
    (tmp_path / "cams.json").write_text(json.dumps(tables))
    detections(tmp_path)
    at = np.stack(np.broadcast_arrays(np.arange(len(PLACES))[:, None], np.arange(4)), axis=-1)
    own = PLACES @ first.rotation.T + first.translation
    rows = np.concatenate([at, own], axis=-1).reshape(-1, 5).tolist()
    lines = [f"{f:.0f},{i:.0f},{x},{y},{z}" for f, i, x, y, z in rows]
    (tmp_path / "truth.csv").write_text("\n".join(["frame,id,x,y,z", *lines]))
    settled = settled_of(tmp_path)
    assert "turned by" in dict(settled.found)["level"]
    turn = settled.views[0].camera.rotation.T @ first.rotation
    assert np.degrees(np.arccos(turn[2, 2])) < 1.0
    for view, camera in zip(settled.views, cameras(), strict=True):
        np.testing.assert_allclose(view.camera.rotation, camera.rotation @ turn.T, atol=1e-9)
    assert settled.truth is not None
    heights = settled.truth.positions[:, 2]
    assert np.ptp(heights) < 0.1
    assert heights.mean() == pytest.approx(settled.room.floor + HALF_EXTENTS[2], abs=0.15)


def test_cameras_tell_what_is_level_where_no_boxes_do(tmp_path: Path) -> None:
    first = cameras()[1]
    tables = {
        c.name: {
            "K": c.intrinsics.tolist(),
            "R": (c.rotation @ first.rotation.T).tolist(),
            "t": (c.translation - c.rotation @ first.rotation.T @ first.translation).tolist(),
        }
        for c in cameras()
    }
    (tmp_path / "cams.json").write_text(json.dumps(tables))
    videos(tmp_path, frames=3)
    settled = settled_of(tmp_path)
    turn = settled.views[1].camera.rotation.T @ first.rotation
    assert np.degrees(np.arccos(turn[2, 2])) < 1e-3


def test_a_level_world_is_left_as_it_is(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    settled = settled_of(tmp_path)
    assert settled.reading.lean == (0.0, 0.0)
    assert "level" not in dict(settled.found)


def test_boxes_in_one_json_settle_as_others(
    tmp_path: Path,
) -> None:
    toml(tmp_path)
    content: dict[str, dict[str, list[list[float]]]] = {}
    for camera in cameras():
        frames, found = boxes(camera, PLACES)
        own = content.setdefault(camera.name, {str(f): [] for f in range(len(PLACES))})
        for frame, (x, y, w, h) in zip(frames.tolist(), found.tolist(), strict=True):
            own[str(frame)].append([x, y, x + w, y + h, 0.9])
    (tmp_path / "boxes.json").write_text(json.dumps(content))
    settled = settled_of(tmp_path)
    _assert_cameras(settled)
    assert settled.frames == len(PLACES)
    assert settled.room.people > 50
    assert all(view.detections is not None for view in settled.views)


def test_corners_with_y_before_x_are_found_out(tmp_path: Path) -> None:
    """TensorFlow's object detection writes parts of the picture, beside scores and classes."""
    toml(tmp_path)
    width, height = SIZE
    for camera in cameras():
        frames, found = boxes(camera, PLACES)
        records = []
        for frame in sorted(set(frames.tolist())):
            own = found[frames == frame]
            left, top, right, bottom = *own[:, :2].T + 0.5, *(own[:, :2] + own[:, 2:]).T + 0.5
            corners = np.column_stack([top / height, left / width, bottom / height, right / width])
            records.append({
                "frame": frame, "detection_boxes": corners.tolist(),
                "detection_scores": [0.5] * len(own), "detection_classes": [1] * len(own),
            })  # fmt: skip
        (tmp_path / f"{camera.name}.json").write_text(json.dumps(records))
    settled = settled_of(tmp_path)
    _assert_cameras(settled)
    assert dict(settled.found)["boxes"].startswith("yxyx, since")
    assert_boxes(settled)
    for view in settled.views:
        assert view.detections is not None
        np.testing.assert_array_equal(view.detections.scores, 0.5)


def test_a_camera_that_saw_nobody_does_not_contradict_parts_of_the_picture(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path, head="frame,x,y,w,h", written=lambda ltwh: (_middles(ltwh) + HALF) / SIDES)
    (tmp_path / "cam1.csv").write_text("frame,x,y,w,h")
    settled = settled_of(tmp_path)
    assert dict(settled.found)["boxes"].startswith("cxcywh, since")
    own = settled.views[1].detections
    assert own is not None
    np.testing.assert_allclose(own.boxes, boxes(cameras()[1], PLACES)[1], atol=1e-6)


@pytest.mark.parametrize("parts", [100, 1000])
def test_boxes_in_finer_parts_of_the_picture_are_found_out(tmp_path: Path, parts: int) -> None:
    toml(tmp_path)
    detections(tmp_path, written=lambda ltwh: (ltwh + HALF) * parts / SIDES)
    settled = settled_of(tmp_path)
    assert dict(settled.found)["boxes"].startswith(PARTS[parts])
    assert_boxes(settled)


def test_boxes_by_their_middle_are_found_out(tmp_path: Path) -> None:
    """``x, y, w, h`` are Ultralytics' and Roboflow's names for middle and size."""
    toml(tmp_path)
    detections(tmp_path, head="frame,x,y,w,h", written=_middles)
    settled = settled_of(tmp_path)
    _assert_cameras(settled)
    assert dict(settled.found)["boxes"].startswith("cxcywh, since")
    assert_boxes(settled)


def test_parts_of_one_camera_s_video_are_told(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    videos(tmp_path, size=(64, 36), frames=2)
    for name in ("GX010012", "GX020012"):
        (tmp_path / "cam1").mkdir(exist_ok=True)
        (tmp_path / "cam2.avi").replace(tmp_path / "cam1" / f"{name}.avi")
        videos(tmp_path, size=(64, 36), frames=2)
    for camera in cameras():
        (tmp_path / f"{camera.name}.avi").unlink()
    (told,) = settled_of(tmp_path).told
    assert told.startswith("cam1: has 2 videos or folders of pictures (cam1/GX010012, cam1/GX02")
    assert told.endswith("or say which by --camera cam1=FILE")


def test_what_is_missing_is_told(tmp_path: Path) -> None:
    toml(tmp_path)
    words = r"a calibration alone has no steps; add them \(the cameras are cam1, cam2, cam3"
    with pytest.raises(FormatError, match=words):
        settled_of(tmp_path)
    (tmp_path / "cam1.csv").write_text("scorer,net\nbodyparts,nose\n")
    with pytest.raises(FormatError, match=r"add them \(cam1\.csv: is a table of joints of Deep"):
        settled_of(tmp_path)
    (tmp_path / "calibration.toml").unlink()
    detections(tmp_path)
    (tmp_path / "calibration.pickle").write_bytes(b"\x80\x04K\x01.")
    with pytest.raises(FormatError, match=r"no calibration was found: .*is a Python pickle"):
        settled_of(tmp_path)


def test_boxes_beyond_any_picture_are_left_out_and_told(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    path = tmp_path / "cam1.csv"
    path.write_text(path.read_text() + "\n3,1e300,-1e300,1e299,1e300")
    settled = settled_of(tmp_path)
    _assert_cameras(settled)
    own = settled.views[0].detections
    assert own is not None
    assert np.abs(own.boxes).max() < 1e4
    assert [told for told in settled.told if "1 of " in told and "1,000,000 pixels" in told]


def test_more_cameras_than_anybody_has_are_refused_at_once(tmp_path: Path) -> None:
    table = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0.0, 0.0, 1.0]}
    (tmp_path / "rig.json").write_text(json.dumps({f"c{n}": table for n in range(1001)}))
    with pytest.raises(FormatError, match=r"rig\.json: has 1,001 cameras, expected at most 1000"):
        settled_of(tmp_path)


def test_boxes_of_larger_pictures_than_the_videos_are_made_smaller(tmp_path: Path) -> None:
    """Videos were made smaller after the calibration and the detector had seen them."""
    toml(tmp_path)
    detections(tmp_path)
    videos(tmp_path, size=(SIZE[0] // 4, SIZE[1] // 4), frames=60)
    settled = settled_of(tmp_path)
    assert any("4 times as wide" in words for name, words in settled.found if name == "boxes")
    for view, camera in zip(settled.views, cameras(), strict=True):
        assert view.camera.image_size == (SIZE[0] // 4, SIZE[1] // 4)
        assert view.detections is not None
        expected = boxes(camera, PLACES)[1]
        corners = (expected[:, :2] + 0.5) / 4.0 - 0.5
        np.testing.assert_allclose(view.detections.boxes[:, :2], corners, atol=1e-3)
        np.testing.assert_allclose(view.detections.boxes[:, 2:], expected[:, 2:] / 4.0, atol=1e-3)


PICTURES = 30


def _pictures_by_number(folder: Path, numbers: list[int]) -> None:
    """Pictures that are called so, and boxes that name them, of twice as many moments."""
    toml(folder)
    for camera in cameras():
        own = folder / camera.name
        own.mkdir()
        for number in numbers[:PICTURES]:
            cv2.imwrite(str(own / f"{number}.png"), np.zeros((SIZE[1], SIZE[0]), np.uint8))
        frames, found = boxes(camera, PLACES)
        names = [f"{camera.name}/{numbers[f]}.png" for f in frames]
        table(folder / f"{camera.name}.csv", names, found, HEAD.replace("frame", "image"))


@pytest.mark.parametrize("every", [10, 40])
def test_boxes_that_name_pictures_are_of_these(tmp_path: Path, every: int) -> None:
    """Every tenth frame of a film, or the milliseconds since 1970."""
    first = 0 if every == 10 else 1_714_560_000_000
    _pictures_by_number(tmp_path, [first + every * number for number in range(len(PLACES))])
    settled = settled_of(tmp_path, ImportOptions(accept_best=True))
    _assert_cameras(settled)
    assert settled.frames == PICTURES
    assert_boxes(settled, PLACES[:PICTURES])


@pytest.mark.full
def test_boxes_that_are_mostly_of_other_frames_end_the_import(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path, first=1000)
    videos(tmp_path)
    with pytest.raises(FormatError, match=r"boxes are of frames outside the 60 of the recording"):
        settled_of(tmp_path)


def test_frames_without_pictures_are_counted_from_the_first(tmp_path: Path) -> None:
    """Ten thousand frames in which nobody was seen are no part of a recording of sixty."""
    toml(tmp_path)
    detections(tmp_path, first=10_000)
    settled = settled_of(tmp_path)
    assert settled.frames == len(PLACES)
    assert ("frames", "counted from 10000, the first that any file names") in settled.found
    assert_boxes(settled)


def test_cameras_that_count_from_other_frames_are_refused(tmp_path: Path) -> None:
    toml(tmp_path)
    for number, camera in enumerate(cameras()):
        frames, found = boxes(camera, PLACES)
        table(tmp_path / f"{camera.name}.csv", frames + 55 * number, found)
    with pytest.raises(FormatError, match=r"other frames \(cam1 0 … 59, cam2 55 … 114"):
        settled_of(tmp_path)


def _timed(folder: Path, times: list[list[float]], kept: list[int]) -> None:
    """Boxes of each camera with the time of each step, of every so many steps."""
    for camera, own, every in zip(cameras(), times, kept, strict=True):
        frames, found = boxes(camera, PLACES)
        rows = frames % every == 0
        times_of_rows = [own[f] for f in frames[rows]]
        head = HEAD.replace("frame", "time")
        table(folder / f"{camera.name}.csv", times_of_rows, found[rows], head)


def test_times_of_cameras_with_other_rates_are_steps_of_one(tmp_path: Path) -> None:
    toml(tmp_path)
    _timed(tmp_path, [[0.2 * f for f in range(len(PLACES))]] * 4, [1, 1, 2, 2])
    settled = settled_of(tmp_path)
    _assert_cameras(settled)
    assert (settled.fps, settled.frames) == (pytest.approx(5.0), len(PLACES))
    for view, camera, every in zip(settled.views, cameras(), [1, 1, 2, 2], strict=True):
        assert view.detections is not None
        frames = boxes(camera, PLACES)[0]
        np.testing.assert_array_equal(view.detections.frames, frames[frames % every == 0])


def test_a_folder_that_is_imported_into_itself_keeps_its_own_files(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    settled = settled_of(tmp_path)
    write(settled, tmp_path, "itself")
    assert {name: (tmp_path / name).read_bytes() for name in before} == before
    read = read_sequence(tmp_path)
    assert [view.detections is not None for view in read.views] == [True] * 4


@pytest.mark.parametrize("own", [False, True])
def test_an_import_that_cannot_be_written_to_its_end_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: bool
) -> None:
    source, target = tmp_path / "source", tmp_path / "target"
    source.mkdir()
    toml(source)
    detections(source)
    if own:
        target = source
    before = {path.name: path.read_bytes() for path in source.iterdir()}
    settled = settled_of(source)
    calls: list[Path] = []

    def full(path: Path, *given: object, **more: object) -> None:
        calls.append(path)
        path.write_text("frame,left\n")
        if len(calls) == 3:
            raise OSError(f"{path}: cannot be written (No space left on device)")

    monkeypatch.setattr("tracker.io.importing.writing.write_boxes", full)
    with pytest.raises(OSError, match="No space left"):
        write(settled, target, "case")
    assert len(calls) == 3
    assert target.exists() == own
    assert {path.name: path.read_bytes() for path in source.iterdir()} == before
