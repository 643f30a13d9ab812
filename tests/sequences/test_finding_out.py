"""What a file leaves open: rate, steps and sizes from its videos, a room from where boxes meet."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests import world
from tracker.sequences.built_in import BUILT_IN, ROOMS, earlier_key, key_of
from tracker.sequences.clock import Clock, Timing, read_timing
from tracker.sequences.csv_columns import Columns
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import Fields
from tracker.sequences.filling import check_missing, find_room, find_time
from tracker.sequences.pictures import video
from tracker.sequences.pictures.media import PictureProperties, check_pictures
from tracker.sequences.pictures.video import VideoError, VideoIndex, index_video
from tracker.sequences.sequence import View
from tracker.sequences.tables import BoxTable, OpenedFiles
from tracker.sequences.views import Source, read_views
from tracker.sequences.writing.teaching import Values, carried_over, changes, paired_entrances

CAMERA = world.ring(1, image_size=(64, 48))[0]


def fields(**values: Any) -> Fields:
    return Fields("file", values, [*values, "fps", "frames"])


def source(
    frames: int | None = None, rate: float | None = None, boxes: int | None = None, **timing: Any
) -> Source:
    """A camera with a video of so many frames a second, or with a box in each of some frames."""
    table = None
    if boxes is not None:
        values = {"frame": np.arange(float(boxes))}
        table = BoxTable(
            Columns("a", ("frame",), values, np.arange(boxes)), 0, False, 0, np.zeros((0, 0))
        )
    pictures = None if frames is None else PictureProperties((64, 48), frames, rate)
    nothing = np.zeros(0, dtype=bool)
    return Source("a", fields(), None, (), nothing, pictures, Timing(**timing), table)


@pytest.mark.parametrize(
    ("sources", "fps", "found", "steps", "own"),
    [
        ([source(50, 25.0), source(60, 25.0)], None, 25.0, 60, False),
        ([source(50, 25.0), source(48, 12.0)], None, 25.0, 100, True),
        ([source(50, 25.0), source(50, 24.75)], None, 25.0, 50, False),  # a hundredth is no other
        ([source(50, 25.0), source(50, 24.7)], None, 25.0, 50, True),
        ([source(50, 25.0), source(50, 12.5)], 25.0, 25.0, 50, False),  # what is stated counts
        ([source(50, 25.0, fps=10.0)], None, 10.0, 50, False),
        ([source(50, None), source(20, 10.0)], None, 10.0, 50, False),
        ([source(50, 25.0, first_frame=10)], None, 25.0, 40, False),
        ([source(50, 25.0, time_offset=0.2)], None, 25.0, 55, False),
        ([source(boxes=9)], 5.0, 5.0, 9, False),
        ([source(boxes=9, fps=10.0)], 5.0, 5.0, 4, False),
        ([source(boxes=9, time_offset=0.4)], 5.0, 5.0, 11, False),
        ([source(50, 25.0), source(boxes=90)], None, 25.0, 90, False),
        ([source(stamps=(7.0, 7.5, 9.0)), source(stamps=(6.5,))], 4.0, 4.0, 11, False),
    ],
)
def test_rate_and_steps_follow_from_the_longest_and_the_fastest(
    sources: list[Source], fps: float | None, found: float, steps: int, own: bool
) -> None:
    time = find_time(sources, fps, None, fields())
    assert (time.fps, time.steps, time.own_rates) == (found, steps, own)
    reported = [one.partition(" is")[0] for one in time.remarks]
    assert reported == (["fps", "frames"] if fps is None else ["frames"])
    assert ("fastest" in time.remarks[0]) == own
    assert find_time(sources, fps, 7, fields()).steps == 7
    assert time.beginning == (6.5 if sources[0].timing.stamps else 0.0)


def test_without_anything_that_tells_rate_and_steps_are_asked_for() -> None:
    with pytest.raises(SequenceError, match='field "fps" is missing'):
        find_time([source(), source(9, None)], None, 5, fields())
    with pytest.raises(SequenceError, match='field "frames" is missing'):
        find_time([source()], 5.0, None, fields())
    assert find_time([source(1, 5.0)], 5.0, None, fields()).steps == 1


def test_of_several_things_that_are_missing_all_are_reported() -> None:
    def reported(top: dict[str, Any], *cameras: dict[str, Any]) -> str:
        tables = [Fields("c", camera, camera) for camera in cameras]
        try:
            check_missing(Fields("file", top, top), tables)
        except SequenceError as error:
            return str(error).partition("found out: ")[2]
        return ""

    pose = {"K": [], "R": [], "t": []}
    whole = {"name": "x", "video": "x.mp4", **pose}
    assert reported({}, whole) == ""  # one alone is left to its reader
    assert reported({}, {"name": "x", **pose}) == (
        "name; fps (steps a second); frames (the number of steps)"
    )
    assert reported({"fps": 1.0}, {"name": "x", "images": "*", **pose}) == ""
    assert reported({"name": "a"}, {"name": "x", "detections": "a.csv", "projection": []}) == ""
    assert reported({"name": "a"}, {"images": "", "K": [], "R": []}) == (
        "fps (steps a second); name and t of camera 1"
    )
    assert reported({"name": "a"}, whole, {"name": "y", "t": []}, {"projection": []}) == (
        'K and R of camera "y"; name of camera 3'
    )


def test_room_and_target_are_where_boxes_of_two_cameras_meet() -> None:
    rng = np.random.default_rng(0)
    cameras = world.ring(3)
    paths = world.together(*(world.wander(rng, 80, size=3.0, pace=0.1) for _ in range(2)))
    seen = world.boxes(cameras, paths, 0.5, rng)
    views = list(world.sequence(cameras, paths, seen).views)
    room, half, reported = find_room(views, None, None, fields())
    inside = room.contains(world.present(paths)[2], margin=0.3)
    assert inside.mean() > 0.9
    assert_allclose(half, world.PERSON, atol=0.15)
    assert [one.partition(" is")[0] for one in reported] == ["[room]", "[target]"]
    assert all("boxes of two cameras meet" in reported[0] for _ in reported)
    # what is stated is left as it is
    stated = world.volume(1.0)
    same, half, reported = find_room(views, stated, None, fields())
    assert same is stated
    assert len(reported) == 1
    given = np.array([0.2, 0.2, 0.6])
    _, half, reported = find_room(views, None, given, fields())
    assert half is given
    assert len(reported) == 1
    # boxes of a low score are none, and from boxes of one camera nothing follows
    unsure = [replace(one, detections=replace(one.detections, scores=np.full(len(
        one.detections.frames), score))) for one, score in zip(views, (0.29, 0.29, 1.0),
                                                               strict=True)]  # fmt: skip
    for few in (unsure, [views[0], *(replace(one, detections=None) for one in views[1:])]):
        assert "views overlap" in find_room(few, None, None, fields())[2][0]
    away = (world.look_at(str(x), (x, 0.0, 2.0), (9.0 * x, 0.0, 2.0)) for x in (5.0, -5.0))
    alone = [View(camera) for camera in away]
    with pytest.raises(SequenceError, match=r"table \[target\] is missing"):
        find_room(alone, stated, None, fields())
    with pytest.raises(SequenceError, match=r"table \[room\] is missing"):
        find_room(alone, None, None, fields())


# ── pictures and videos


def images(*names: str, **more: Any) -> View:
    return View(CAMERA, images=tuple(Path(name) for name in names), **more)


def warnings(view: View, count: int, steps: int) -> list[str]:
    found = check_pictures(view, PictureProperties(CAMERA.image_size, count, None), fields(), steps)
    return [one.removeprefix('camera "cam1": ') for one in found]


def test_pictures_that_are_too_few_are_counted() -> None:
    row = images(*(f"{k:02d}.png" for k in range(8)))
    assert warnings(row, 8, 8) == warnings(row, 8, 7) == []
    assert warnings(row, 8, 9) == [
        "the images are too few: expected 9 frames, found 8; step 8 has no picture"
    ]
    assert warnings(replace(row, first_frame=2), 8, 6) == []
    assert warnings(replace(row, first_frame=2), 8, 8) == [
        "the images are too few: expected 8 frames from frame 2 on, found 6; "
        "steps 6 to 7 have no picture"
    ]
    assert warnings(replace(row, first_frame=9), 8, 2)[0].endswith("steps 0 to 1 have no picture")
    video = View(CAMERA, video=Path("a.mp4"))
    assert warnings(video, 3, 4)[0].startswith("the video has too few: expected 4 frames, found 3")
    clock = Clock(np.array([5, -1, 6, 7]), np.zeros(0, dtype=np.int64))
    assert warnings(replace(video, clock=clock), 8, 4) == []
    assert warnings(replace(video, clock=clock), 6, 4) == [
        "the video has too few: expected at least 8 frames, found 6; "
        "from step 2 on it has no picture"
    ]
    with pytest.raises(SequenceError, match="frame size 48×64 does not match calibration 64×48"):
        list(check_pictures(video, PictureProperties((48, 64), 9, None), fields(), 3))


@pytest.mark.parametrize(
    ("gone", "reported"),
    [
        ([], ""),
        ([2], '"02.png" is missing in the row'),
        ([2, 4, 5], '"02.png", "04.png" and "05.png" are missing in the row'),
        ([2, 4, 5, 6], '"02.png" and 3 others are missing in the row'),
    ],
)
def test_holes_in_a_row_are_named(gone: list[int], reported: str) -> None:
    there = np.ones(9, dtype=bool)
    there[gone] = False
    found = warnings(images(*(f"{k:02d}.png" for k in range(9)), pictures_exist=there), 9, 9)
    assert [one.startswith(reported) for one in found] == ([True] if reported else [])


def test_names_that_sort_otherwise_than_their_numbers_are_reported() -> None:
    assert warnings(images("a1b2.png", "a1b10.png"), 2, 2) == []
    (reported,) = warnings(images("a1.png", "a10.png", "a2.png"), 3, 3)
    assert 'so "a10.png" comes before "a2.png"' in reported


def view_of(
    table: dict[str, Any], pictures: PictureProperties | None = None, steps: int = 5
) -> View:
    known = [*table, "background", "image_size", "distortion", "lens", "projection"]
    own = Fields("file", table, known)
    film = Path("a.mp4") if pictures else None
    one = Source("a", own, film, (), np.ones(9, dtype=bool), pictures, Timing(), None)
    time = find_time([one], 5.0, steps, own)
    return read_views([one], replace(time, own_rates=True), OpenedFiles(Path()))[0]


POSE = {"K": [[60.0, 0, 31.5], [0, 60.0, 23.6], [0, 0, 1]], "R": np.eye(3).tolist(),
        "t": [0.0, 0.0, 4.0]}  # fmt: skip


def test_a_pictures_size_is_stated_or_the_pictures_or_twice_the_principal_point() -> None:
    film = PictureProperties((64, 48), 9, None)
    assert view_of(POSE | {"image_size": [64, 48]}, film).camera.image_size == (64, 48)
    assert view_of(POSE, film).camera.image_size == (64, 48)
    assert view_of(POSE).camera.image_size == (64, 48)
    odd = [[60.0, 0, -9.0], [0, 60.0, 1e5], [0, 0, 1]]
    assert view_of(POSE | {"K": odd}).camera.image_size == (2, 65535)
    for size, good in (([65535, 1], True), ([65536, 1], False), ([8192, 8192], True),
                       ([8192, 8193], False), ([63.5, 48], False)):  # fmt: skip
        if good:
            assert view_of(POSE | {"image_size": size}).camera.image_size == tuple(size)
            continue
        with pytest.raises(SequenceError, match="image_size: expected"):
            view_of(POSE | {"image_size": size})


def test_a_background_is_a_range_of_steps_with_both_ends() -> None:
    film = PictureProperties((64, 48), 9, None)
    for first, last in ((0, 4), (2, 2), (0, 0)):
        found = view_of(POSE | {"background": [first, last]}, film).background
        assert found == range(first, last + 1)
    for ends in ([0, 5], [3, 2], [-1, 2], [0.5, 2], [0, 2.5]):
        with pytest.raises(SequenceError, match="whole numbers from 0 to 4, found"):
            view_of(POSE | {"background": ends}, film)


def test_a_video_of_another_rate_has_a_clock_where_none_is_stated() -> None:
    assert view_of(POSE).clock is None
    clock = view_of(POSE, PictureProperties((64, 48), 9, 10.0)).clock
    assert clock is not None
    assert_array_equal(clock.frame_of_step, [0, 2, 4, 6, 8])
    assert view_of(POSE, PictureProperties((64, 48), 9, None)).clock is None


def written(path: Path, codec: str, fps: float, frames: int) -> VideoIndex:
    code = cv2.VideoWriter.fourcc(*codec)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, fps, (64, 48))
    for _ in range(frames):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    writer.release()
    return index_video(path)


@pytest.mark.parametrize(
    ("times", "claimed", "rate"),
    [
        ([0], 25.0, 25.0),
        ([0], 0.0, None),
        ([0], 1000.0, None),
        ([0, 100_000], 0.0, 10.0),
        ([0, 1001], 1000.0, 999.001),
        ([0, 1001], 999.0, 999.0),
    ],
)
def test_a_header_may_claim_a_rate_above_0_and_below_1000(
    times: list[int], claimed: float, rate: float | None
) -> None:
    assert video._rate(np.array(times), claimed) == rate


@pytest.mark.parametrize(
    ("decoded", "in_order"),
    [
        ([0], True),
        ([0, 20, 30], True),
        ([10, 20], False),  # the first frame is missing
        ([0, 20, 10], False),
        ([0, 10, 10], False),
        ([0, 15], False),  # no frame has this time
        ([0, 40], False),
    ],
)
def test_pictures_are_in_order_from_frame_0_on_with_ascending_times_of_frames(
    decoded: list[int], in_order: bool
) -> None:
    assert video._in_order(np.array([0, 10, 20, 30]), np.array(decoded)) is in_order


@pytest.mark.parametrize(("limit", "most"), [("LARGEST_COUNT", 5), ("MOST_PIXELS", 64 * 48)])
def test_a_video_at_a_limit_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, most: int
) -> None:
    monkeypatch.setattr(video, limit, most)
    assert written(tmp_path / "a.avi", "MJPG", 25.0, 5).frames == 5
    monkeypatch.setattr(video, limit, most - 1)
    with pytest.raises(VideoError, match=r"expected .*at most"):
        written(tmp_path / "b.avi", "MJPG", 25.0, 5)


@pytest.mark.parametrize("fps", [25.0, 590.0])
def test_of_one_frame_the_header_says_the_rate(tmp_path: Path, fps: float) -> None:
    index = written(tmp_path / "a.avi", "MJPG", fps, 1)
    assert (index.frames, index.fps) == (1, pytest.approx(fps))


@pytest.mark.parametrize("fps", [5.0, 12.5, 29.97])
def test_a_videos_rate_and_frames_are_counted(tmp_path: Path, fps: float) -> None:
    for name, codec in (("a.mp4", "mp4v"), ("a.avi", "MJPG")):
        index = written(tmp_path / name, codec, fps, 30)
        assert (index.size, index.frames) == ((64, 48), 30)
        assert index.fps == pytest.approx(fps, rel=1e-4)
        if index.times is not None:
            assert_allclose(index.times / 1e6, np.arange(30) / fps, atol=2e-3)
        # what is coded by differences begins anew every 12 frames
        assert index.keys.tolist() == list(range(0, 30, 12 if codec == "mp4v" else 1))


@pytest.mark.parametrize(("claimed", "spacing", "found"), [(25, 100.0, 10.0), (30, 1e3 / 30, 30.0)])
def test_time_stamps_say_the_rate_unless_they_are_the_headers_rounded(
    tmp_path: Path, claimed: int, spacing: float, found: float
) -> None:
    """Twenty frames at stamps of whole milliseconds, in a file that claims a rate."""
    path = tmp_path / "a.mkv"
    with av.open(str(path), "w") as file:
        stream = file.add_stream("mpeg4", rate=claimed)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for number in range(20):
            frame = av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="rgb24")
            frame.pts, frame.time_base = round(spacing * number), Fraction(1, 1000)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())
    index = index_video(path)
    assert (index.frames, index.fps) == (20, found)


# ── time stamps


def stamps(tmp_path: Path, text: str, name: str = "cam2") -> tuple[float, ...] | None:
    (tmp_path / "times.csv").write_text(text, encoding="utf-8")
    known = Fields("file", {"name": name}, ["name"])
    return read_timing(known, tmp_path, "room", tmp_path / "times.csv").stamps


def test_stamps_are_those_of_the_port_that_ends_the_cameras_name(tmp_path: Path) -> None:
    table = "port,frame_time\n1,5\n2,9\n1,3\n12,4\n2,8\n"
    assert stamps(tmp_path, table) == (8.0, 9.0)
    assert stamps(tmp_path, table, "cam1") == (3.0, 5.0)
    assert stamps(tmp_path, table, "1cam12b") == (4.0,)
    assert stamps(tmp_path, table.replace("port", "cam_id")) == (8.0, 9.0)
    # of one camera alone nobody asks for the name
    assert stamps(tmp_path, "port,frame_time\n7,5\n7,4\n") == (4.0, 5.0)
    assert stamps(tmp_path, "frame_time\n1e19\n") == (1e19,)
    for name in ("cam3", "door"):
        with pytest.raises(SequenceError, match=r'column "port": .* found ports 1, 2 and 12; name'):
            stamps(tmp_path, table, name)
    with pytest.raises(SequenceError, match="at most 1e"):
        stamps(tmp_path, "frame_time\n1.1e19\n")


# ── what a person taught


def taught(*frames: int, width: float = 1.5) -> Values:
    return {
        "room": {"min": [0.0] * 3, "max": [width, 1.0, 2.0], "entrances": []},
        "target": {"half_extents": [0.3, 0.3, 0.8]},
        "template": [
            {"name": f"n{k}", "camera": "cam1", "frame": k, "box": [1.0, 2.0, 3.0, 4.0]}
            for k in frames
        ],
    }


def test_of_what_was_taught_on_another_rendering_that_is_carried_over_which_fits() -> None:
    before, now = taught(1, 2), taught(3, width=4.0)
    same = carried_over(before, before, now, 9)
    assert same == now
    after = carried_over(before, taught(2, 7, 8, 9, width=2.0), now, 9)
    assert [one["frame"] for one in after["template"]] == [3, 7, 8]
    assert after["room"]["max"] == [2.0, 1.0, 2.0]
    assert [one["frame"] for one in now["template"]] == [3]


def test_entrances_are_paired_in_their_new_order() -> None:
    before, after = [{"x": 1}, {"x": 2}], [{"x": 3}, {"x": 1}, {"x": 4}]
    assert paired_entrances(before, after) == [(1, 0), (0, 1), (None, 2)]
    assert paired_entrances(before, after[1:2]) == [(0, 0), (1, None)]


def test_changes_of_entrances_and_templates_are_paired_by_what_stays() -> None:
    door, gate, hatch = ({"position": [x, 0.0, 1.0], "sigma": [0.1] * 3} for x in (1.0, 2.0, 3.0))

    def reported(old: list[Values], new: list[Values]) -> list[str]:
        one, other = taught(), taught()
        one["room"]["entrances"], other["room"]["entrances"] = old, new
        return changes(one, other)

    assert reported([door, gate], [gate, door]) == []
    assert reported([door, gate], [gate]) == ["entrance 1 removed"]
    assert reported([door, gate, hatch], [gate]) == ["entrance 1 removed", "entrance 3 removed"]
    assert reported([gate], [door, gate, hatch]) == ["entrance 1 added", "entrance 3 added"]
    assert reported([door, gate], [door, hatch]) == ["entrance 2 moved"]
    assert reported([door], [gate, hatch]) == ["entrance 1 moved", "entrance 2 added"]
    swapped = changes(taught(1, 2), taught(2, 1, 3))
    assert swapped == ["template n3 added"]
    wider = taught()
    wider["room"]["min"][1], wider["target"]["half_extents"][0] = -0.25, 0.2
    assert changes(taught(), wider) == ["room, min y: 0 to -0.25 m", "target: 0.4 × 0.6 × 1.6 m"]


def test_a_recording_is_known_by_its_place_and_a_built_in_one_by_its_name(tmp_path: Path) -> None:
    for name in BUILT_IN:
        assert key_of(ROOMS / name) == name
        earlier = earlier_key(ROOMS / name)
        assert earlier is not None
        assert len(earlier) == 16
        assert key_of(tmp_path / name) not in (name, earlier)
        assert earlier_key(tmp_path / name) is None
    assert len({key_of(tmp_path / one) for one in "ab"}) == 2
    assert len(key_of(tmp_path)) == 16
