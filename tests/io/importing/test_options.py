"""What whoever imports knows better than the files, and time stamps of cameras."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pytest
from numpy import ndarray

from app.command.arguments import Import
from app.command.flags import parse
from app.command.importing import options_of
from app.command.main import main
from tests.conftest import short
from tests.io.read.recorded import PLACES, assert_boxes, detections, settled_of, toml, videos
from tests.io.read.rig import SIZE, boxes, cameras
from tracker.io.checks import check
from tracker.io.conventions.questions import Undecided, Unexplained
from tracker.io.conventions.reading import Reading
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.remedies import for_import
from tracker.io.importing.writing import as_sequence, write
from tracker.io.read.pieces import Direction, FormatError, Layout, Unit, Up
from tracker.sequences.finding import Remedy, warning
from tracker.sequences.reader import read_sequence


def test_every_flag_of_import_states_its_option() -> None:
    flags = (
        "--unit 0.5 --up=-z --pose camera-to-world --axes opengl --euler zyx "
        "--boxes xyxy-normalised --first-index 1 --fps 25 --accept-best --as-named "
        "--camera a=a.mp4 --swap a=b --swap b=c"
    )
    command = parse(["import", "x", "--dry-run", *flags.split()])
    assert isinstance(command, Import)
    assert options_of(command) == ImportOptions(
        unit=0.5,
        up="-z",
        pose="camera-to-world",
        axes="opengl",
        turns="zyx",
        boxes="xyxy",
        normalised=True,
        first_index=1,
        fps=25.0,
        accept_best=True,
        as_named=True,
        cameras=(("a", Path("a.mp4")),),
        swap=(("a", "b"), ("b", "c")),
    )
    none = parse(["import", "x", "--dry-run"])
    assert isinstance(none, Import)
    assert options_of(none) == ImportOptions()


@pytest.mark.parametrize("up", get_args(Up))
def test_the_axis_that_a_check_names_can_be_typed_as_it_is_printed(up: Up) -> None:
    command = parse(["import", "x", "--dry-run", *str(Remedy("--up", up)).split()])
    assert isinstance(command, Import)
    assert options_of(command) == ImportOptions(up=up)


def test_files_that_are_matched_by_order_are_named_with_their_cameras(tmp_path: Path) -> None:
    toml(tmp_path)
    videos(tmp_path)
    names = ["window", "door", "stairs", "hall"][: len(cameras())]
    for camera, name in zip(cameras(), names, strict=True):
        (tmp_path / f"{camera.name}.avi").rename(tmp_path / f"{name}.avi")
    (words,) = [why for what, why in settled_of(tmp_path).found if what == "matching"]
    told = ", ".join(
        f"{camera.name} = {name}" for camera, name in zip(cameras(), sorted(names), strict=True)
    )
    assert words == f"files go to cameras by order: {told}; --camera NAME=FILE"


def test_a_file_of_several_cameras_is_not_said_to_go_to_each(tmp_path: Path) -> None:
    toml(tmp_path)
    lines = ["frame,camera,left,top,width,height"]
    for number, camera in enumerate(cameras()):
        for frame, box in zip(*boxes(camera, PLACES), strict=True):
            lines.append(",".join(map(str, [frame, number + 7, *box])))
    (tmp_path / "all.csv").write_text("\n".join(lines))
    settled = settled_of(tmp_path)
    assert_boxes(settled)
    (words,) = [why for what, why in settled.found if what == "matching"]
    whose = "cam1, cam2, cam3 and cam4"
    assert words == f"the parts of a file of several cameras go to {whose} by number"


def test_boxes_as_parts_of_the_picture_are_read_where_it_is_told(tmp_path: Path) -> None:
    toml(tmp_path)
    half, sides = np.array([0.5, 0.5, 0.0, 0.0]), np.array([*SIZE, *SIZE])
    detections(tmp_path, written=lambda ltwh: (ltwh + half) / sides)
    assert_boxes(settled_of(tmp_path, ImportOptions(boxes="ltwh", normalised=True)))


def test_parts_of_the_picture_may_reach_beyond_it(tmp_path: Path) -> None:
    toml(tmp_path)

    def parts(found: ndarray) -> ndarray:
        found[::50, 3] += 2.0 * SIZE[1]  # drawn on below the picture
        corners = np.hstack([found[:, :2], found[:, :2] + found[:, 2:]])
        return (corners + 0.5) / np.array([*SIZE, *SIZE])

    detections(tmp_path, head="frame,x1,y1,x2,y2", written=parts)
    for view in settled_of(tmp_path).views:
        assert view.detections is not None
        assert np.median(view.detections.boxes[:, 3]) > 50.0


@pytest.mark.full
def test_exchanged_calibrations_are_mended_and_named_with_the_flag(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files, out = tmp_path / "files", tmp_path / "out"
    files.mkdir()
    toml(files)
    detections(files)
    text = (files / "calibration.toml").read_text()
    names = {"cam1": "cam3", "cam2": "cam1", "cam3": "cam2", "cam4": "cam4"}
    for old, new in names.items():
        text = text.replace(f"[{old}]", f"[x{new}]").replace(f'"{old}"', f'"x{new}"')
    (files / "calibration.toml").write_text(text.replace("xcam", "cam"))
    assert main(["import", str(files), "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "--swap" in said
    assert "exchanged" in said
    by_name = {camera.name: camera for camera in read_sequence(out).cameras}
    for camera in cameras():
        np.testing.assert_allclose(by_name[camera.name].centre, camera.centre, atol=1e-6)


def test_swap_names_cameras_that_are_there(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    with pytest.raises(FormatError, match="--swap door: expected a camera of the calibration"):
        settled_of(tmp_path, ImportOptions(swap=(("door", "cam1"),)))


@pytest.mark.full
def test_time_stamps_say_when_frames_were_taken(tmp_path: Path) -> None:
    """One camera begins half a second late and leaves out every third frame."""
    files, out = tmp_path / "files", tmp_path / "out"
    files.mkdir()
    toml(files)
    videos(files)
    rows = ["sync_index,port,frame_index,frame_time"]
    times = {port: 100.0 + np.arange(60) / 20.0 for port in (1, 2, 3, 4)}
    times[2] = 100.5 + np.delete(np.arange(90), slice(2, None, 3)) / 20.0
    rows += [f"{n},{port},{n},{t}" for port in times for n, t in enumerate(times[port])]
    (files / "frame_time_history.csv").write_text("\n".join(rows))
    settled = settled_of(files)
    assert settled.fps == pytest.approx(20.0, rel=1e-3)
    write(settled, out, "stamped")
    sequence = read_sequence(out)
    shown = [[view.frame_at(step) for step in range(8, 20)] for view in sequence.views]
    assert shown[0] == list(range(8, 20))
    assert shown[1] == [-1, -1, 0, 1, -1, 2, 3, -1, 4, 5, -1, 6]


def test_time_stamps_must_be_seconds(tmp_path: Path) -> None:
    toml(tmp_path)
    videos(tmp_path, frames=2)
    (tmp_path / "timestamps.csv").write_text("cam_id,frame_time\n1,0.0\n1,noon\n")
    taken = {one.label: one for one in gather([tmp_path])}
    assert "line 3, frame_time: expected seconds, found 'noon'" in (
        taken["timestamps.csv"].complaint
    )


def test_what_is_known_better_is_taken(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    options = ImportOptions(
        left_out=frozenset({"cam4"}),
        names={"cam1": "door"},
        offsets={"cam2": -0.4},
        fps=20.0,
        room=((-4.0, -4.0, 0.0), (4.0, 4.0, 2.5)),
        half_extents=(0.25, 0.25, 0.9),
    )
    settled = settled_of(tmp_path, options)
    assert settled.suggested.maximum[0] != 4.0
    write(settled, tmp_path / "out", "told")
    sequence = read_sequence(tmp_path / "out")
    assert [camera.name for camera in sequence.cameras] == ["door", "cam2", "cam3"]
    assert sequence.views[1].frame_at(0) == 8
    assert sequence.room.maximum.tolist() == [4.0, 4.0, 2.5]
    assert sequence.target_half_extents.tolist() == [0.25, 0.25, 0.9]
    frames = sequence.views[1].detections
    assert frames is not None
    assert frames.frames.max() == 51


@pytest.mark.full
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (ImportOptions(names={"cam1": "cam2"}), 'found "cam2" twice'),
        (ImportOptions(names={"cam1": " "}), "a name of its own"),
        (ImportOptions(room=((0.0, 0.0, 0.0), (1.0, -1.0, 2.0))), "expected y to end above 0 m"),
        (ImportOptions(left_out=("cam1", "cam2", "cam3", "cam4")), "left out"),
    ],
)
def test_what_cannot_be_taken_is_told(tmp_path: Path, options: ImportOptions, words: str) -> None:
    toml(tmp_path)
    detections(tmp_path)
    with pytest.raises(FormatError, match=words):
        settled_of(tmp_path, options)


@pytest.mark.full
@pytest.mark.parametrize(
    ("options", "flags"),
    [
        (ImportOptions(up="-y"), "--up z"),
        (ImportOptions(up="x"), "--up z"),
    ],
)
def test_what_was_told_wrongly_is_mended_by_the_right_flag(
    tmp_path: Path, options: ImportOptions, flags: str
) -> None:
    toml(tmp_path)
    detections(tmp_path)
    settled = settled_of(tmp_path, options)
    checks = [for_import(one, settled.reading) for one in check(as_sequence(settled, "told"))]
    told = [str(remedy) for one in checks for remedy in one.remedies]
    assert flags in told


@pytest.mark.parametrize(
    "options",
    short(
        [
            ImportOptions(pose="camera-to-world", axes="opencv"),
            ImportOptions(axes="opengl", pose="world-to-camera"),
        ]
    ),
)
def test_poses_that_were_told_wrongly_are_not_taken(tmp_path: Path, options: ImportOptions) -> None:
    toml(tmp_path)
    detections(tmp_path)
    with pytest.raises(Unexplained, match="without it 98 % "):
        settled_of(tmp_path, options)
    settled = settled_of(tmp_path, options.model_copy(update={"accept_best": True}))
    assert settled.open is not None
    write(settled, tmp_path / "out", "accepted")
    assert "--accept-best" in (tmp_path / "out" / "sequence.toml").read_text().splitlines()[0]


def _corners(ltwh: ndarray) -> ndarray:
    return np.hstack([ltwh[:, :2], ltwh[:, :2] + ltwh[:, 2:]])


def _middles(ltwh: ndarray) -> ndarray:
    return np.hstack([ltwh[:, :2] + ltwh[:, 2:] / 2.0, ltwh[:, 2:]])


@pytest.mark.parametrize(("written", "holds"), [(_corners, "xyxy"), (_middles, "cxcywh")])
def test_a_header_that_the_boxes_contradict_is_asked_about(
    tmp_path: Path, written: Callable[[ndarray], ndarray], holds: Layout
) -> None:
    toml(tmp_path)
    detections(tmp_path, written=written)
    with pytest.raises(Undecided, match="the files name the boxes' numbers") as asked:
        settled_of(tmp_path)
    assert asked.value.question.code == "layout"
    assert asked.value.question.flags == (f"--boxes {holds}", "--boxes ltwh")
    assert_boxes(settled_of(tmp_path, ImportOptions(boxes=holds)))
    assert_boxes(settled_of(tmp_path, ImportOptions(accept_best=True)))


@pytest.mark.parametrize(
    ("read", "named", "remedy"),
    [
        ("world-to-camera", "transposed", "--pose transposed"),
        ("transposed", "transposed", "--pose world-to-camera"),
        ("camera-to-world", "camera-to-world", "--pose world-to-camera"),
        ("position", "position", "--pose world-to-camera"),
        ("camera-to-world", "transposed", None),
    ],
)
def test_a_pose_that_was_stated_wrongly_is_mended_by_the_flag_that_undoes_it(
    read: Direction, named: str, remedy: str | None
) -> None:
    told = for_import(warning("poses", "", Remedy("--pose", named)), Reading(direction=read))
    assert [str(one) for one in told.remedies] == ([] if remedy is None else [remedy])


def test_an_import_asks_and_refuses_with_a_status_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    toml(tmp_path)
    detections(tmp_path)
    wrong = ["--pose", "camera-to-world", "--axes", "opencv"]
    assert main(["import", str(tmp_path), "-o", str(tmp_path / "out"), *wrong]) in (3, 4)
    assert "nothing was written" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.full
@pytest.mark.parametrize(
    ("counted", "stated", "words"),
    [
        (0, 1, "are of frame 0, so frames are counted from 0, not from 1: --first-index 0"),
        (1, 0, "the one after the last of 60, so frames are counted from 1: --first-index 1"),
        (5, 0, "boxes are left out: of frames after frame 59, the last of the recording"),
    ],
)
def test_where_counting_begins_was_told_wrongly(
    tmp_path: Path, counted: Literal[0, 1], stated: Literal[0, 1], words: str
) -> None:
    toml(tmp_path)
    videos(tmp_path)
    detections(tmp_path, first=counted)
    settled = settled_of(tmp_path, ImportOptions(first_index=stated))
    named = [sentence.partition(": ")[0] for sentence in settled.told if words in sentence]
    assert {name for names in named for name in names.split(", ")} == {
        f"cam{number + 1}.csv" for number in range(4)
    }


@pytest.mark.full
@pytest.mark.parametrize(("scale", "unit", "right"), [(1.0, "mm", "m"), (100.0, "mm", "cm")])
def test_people_smaller_than_a_head_are_told_with_the_unit_that_makes_them_people(
    tmp_path: Path, scale: float, unit: Unit, right: str
) -> None:
    toml(tmp_path, scale=scale)
    detections(tmp_path)
    settled = settled_of(tmp_path, ImportOptions(unit=unit))
    checks = [for_import(one, settled.reading) for one in check(as_sequence(settled, "told"))]
    told = [str(remedy) for one in checks for remedy in one.remedies]
    assert f"--unit {right}" in told


@pytest.mark.full
def test_people_smaller_than_a_hand_are_told(tmp_path: Path) -> None:
    toml(tmp_path)
    detections(tmp_path)
    settled = settled_of(tmp_path, ImportOptions(unit="mm"))
    told = [str(one) for one in check(as_sequence(settled, "told")) if one.status == "warning"]
    assert any("nobody is as small" in words for words in told)
