"""At, one below and one above what a recording's values compare with: steps, clocks, pictures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests import world
from tracker.sequences.clock import Clock, Timing
from tracker.sequences.pictures.numbering import whole_row
from tracker.sequences.sequence import PRESETS, FileState, Room, View

ROOM = Room(np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 3.0]))


def test_a_room_ends_at_its_walls_and_a_margin_beyond() -> None:
    points = np.array([[1.0, 2.0, 3.0], [-1.0, -2.0, 0.0], [1.5, 0.0, 1.0], [0.0, 0.0, -0.5],
                       [0.0, np.nextafter(2.0, 9.0), 0.0], [np.nan, 0.0, 0.0]])  # fmt: skip
    assert_array_equal(ROOM.contains(points), [True, True, False, False, False, False])
    assert_array_equal(ROOM.contains(points, 0.5), [True, True, True, True, True, False])
    assert_array_equal(ROOM.contains(points[:0]), [])


def test_usual_targets_are_as_deep_as_wide_and_who_is_whole_stands_upright() -> None:
    """Of every camera alike: the middle of width and depth is what a box is as wide as."""
    for width, depth, height in PRESETS.values():
        assert width == depth <= height
    assert PRESETS["Head"] < PRESETS["Seated"] < PRESETS["Person"]


def test_the_rows_of_a_step_are_those_between_its_neighbours() -> None:
    paths = world.together(world.stand([0, 0], 3), world.walk([(0, 1), (0, 1)], [0.1, 0.2], 10))
    truth, boxes = world.truth(paths), world.boxes(world.ring(1), paths)[0].detections()
    for rows, found in ((truth, truth.frames), (boxes, boxes.frames)):
        for step in (-1, 0, 1, 2, 3):
            assert_array_equal(np.flatnonzero(found == step), np.arange(len(found))[rows.at(step)])


def view(**more: object) -> View:
    return replace(View(world.ring(1)[0], images=(Path("0.png"),) * 4, first_frame=2), **more)


def test_a_step_has_a_picture_where_its_frame_was_there() -> None:
    there = np.array([True, False, True, False])
    assert [view().frame_at(step) for step in range(3)] == [2, 3, 4]
    assert_array_equal(view().frames_due(3), [True] * 3)
    assert_array_equal(view().pictures_expected(3), [True] * 3)
    # frames 2, 3, 4 and 5 of four
    assert_array_equal(view(pictures_exist=there).pictures_expected(4), [True, False, False, False])
    clock = Clock(np.array([0, -1, 1, 2, 3, 4]), np.array([0, 2, 3, 4, 5]))
    assert_array_equal(view(clock=clock).frames_due(6), [True, False, True, True, True, True])
    assert_array_equal(
        view(clock=clock, pictures_exist=there).pictures_expected(6),
        [True, False, False, True, False, False],
    )
    assert [view(clock=clock).frame_at(step) for step in range(3)] == [0, -1, 1]
    blind = view(images=(), pictures_exist=there)
    assert not blind.has_pictures
    assert not blind.frames_due(4).any()
    assert not blind.pictures_expected(4).any()
    assert view(detector_ran=None).detector_ran_at(9)
    looked = view(detector_ran=np.array([True, False]))
    assert [looked.detector_ran_at(step) for step in range(2)] == [True, False]


def test_a_sequence_has_what_every_camera_has(tmp_path: Path) -> None:
    cameras, paths = world.ring(2), world.together(world.stand([0, 0], 2))
    bare = world.sequence(cameras, paths)
    seen = world.sequence(cameras, paths, world.boxes(cameras, paths), fps=8.0)
    assert (bare.has_pictures, bare.has_detections, seen.has_detections) == (False, False, True)
    one = replace(bare, views=(seen.views[0], bare.views[1]))
    assert not one.has_detections
    filmed = replace(bare, views=tuple(replace(v, video=Path("a.mp4")) for v in bare.views))
    assert filmed.has_pictures
    assert not replace(filmed, views=(filmed.views[0], bare.views[1])).has_pictures
    assert seen.step_time == 0.125
    assert seen.cameras == cameras
    file = tmp_path / "a.csv"
    file.write_text("1")
    opened = replace(bare, files=(FileState.of(file),))
    assert opened.changed_files() == ()
    file.write_text("12")
    assert opened.changed_files() == (file,)
    file.unlink()
    assert opened.changed_files() == (file,)


@pytest.mark.parametrize(
    ("time", "step"),
    [
        (-0.051, -1),
        (-0.05, 0),
        (0.0, 0),
        (0.049, 0),
        (0.05, 1),
        (0.349, 3),
        (0.35, -1),
        (np.nan, -1),
    ],
)
def test_a_frame_belongs_to_the_nearest_step_of_those_there_are(time: float, step: int) -> None:
    clock = Clock.of_times(np.array([time]), 10.0, 4)
    assert clock.step_of_frame.tolist() == [step]
    assert clock.frame_of_step.tolist() == [0 if step == k else -1 for k in range(4)]
    assert clock.steps_of(np.array([-1, 0, 1])).tolist() == [-1, step, -1]


def test_of_two_frames_at_a_step_the_nearer_counts_and_of_equals_the_first() -> None:
    clock = Clock.of_times(np.array([0.02, -0.01, 0.125, 0.08]), 10.0, 2)
    assert clock.frame_of_step.tolist() == [1, 3]
    clock = Clock.of_times(np.array([0.15625, 0.09375]), 8.0, 2)
    assert clock.frame_of_step.tolist() == [-1, 0]


def test_times_of_frames_follow_the_table() -> None:
    assert Timing(7).clock(25.0, 100) is None
    for own in (Timing(fps=25.0), Timing(time_offset=0.1), Timing(stamps=())):
        assert own.is_own
    # frame n was taken (n - 2) / 5 + 0.2 seconds after step 0, of ten steps a second
    clock = Timing(2, 5.0, 0.2).clock(10.0, 9)
    assert clock is not None
    assert clock.frame_of_step.tolist() == [1, -1, 2, -1, 3, -1, 4, -1, 5]
    stamped = Timing(1, None, 0.1, (40.0, 40.1, 40.3)).clock(10.0, 6, beginning=40.0)
    assert stamped is not None
    assert stamped.frame_of_step.tolist() == [-1, -1, 1, -1, 2, -1]
    assert stamped.step_of_frame.tolist() == [-1, 2, 4]
    assert Timing(2, 5.0, 0.2).seconds(12, 10.0, 0.0) == pytest.approx(2.2)
    assert Timing(2, None, 0.2).seconds(12, 10.0, 0.0) == pytest.approx(1.2)
    own = Timing(1, None, 0.1, (40.0, 40.1, 40.3))
    assert own.seconds(2, 10.0, 40.0) == pytest.approx(0.3)
    assert own.seconds(9, 10.0, 40.0) == pytest.approx(0.5)
    assert own.seconds(0, 10.0, 40.0) == pytest.approx(0.2)


def row(*numbers: int) -> tuple[Path, ...]:
    return tuple(Path(f"a/cam1_{number:03d}.png") for number in numbers)


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        ((1, 2, 4), (1, 2, 3, 4)),
        ((1, 2), None),  # of two nobody can tell
        ((0, 10, 20, 40), (0, 10, 20, 30, 40)),
        ((0, 10, 15), (0, 5, 10, 15)),  # of two distances as frequent the shorter
        ((0, 10, 20, 25), None),  # no multiple
        ((1, 2, 2, 3), None),
        ((3, 2, 1), None),
        ((1, 2, 6), (1, 2, 3, 4, 5, 6)),  # as many missing as there are
        ((1, 2, 7), None),
    ],
)
def test_a_row_of_pictures_has_its_holes(
    numbers: tuple[int, ...], expected: tuple[int, ...] | None
) -> None:
    found, there = whole_row(row(*numbers))
    assert found == row(*(expected or numbers))
    assert_array_equal(there, [number in numbers for number in expected or numbers])
