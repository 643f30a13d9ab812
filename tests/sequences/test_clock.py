"""Cameras with clocks of their own: rates, offsets, time stamps, frames that are not there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.synthetic import number_in, write_lines, write_sequence
from tracker.sequences.clock import Timing
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence, read_summary


@given(
    fps=st.floats(1.0, 60.0),
    own=st.floats(1.0, 120.0),
    offset=st.floats(-3.0, 3.0),
    first=st.integers(0, 30),
)
def test_a_step_shows_the_nearest_frame_and_a_frame_belongs_to_one_step(
    fps: float, own: float, offset: float, first: int
) -> None:
    clock = Timing(first, own, offset).clock(fps, 80)
    assert clock is not None
    shown = clock.frame_of_step
    steps = np.flatnonzero(shown >= 0)
    frames = shown[steps]
    assert (np.diff(frames) > 0).all()
    times = (frames - first) / own + offset
    assert (np.abs(times * fps - steps) <= 0.5 + 1e-6).all()
    np.testing.assert_array_equal(clock.steps_of(frames), steps)
    if own >= fps:  # a faster camera has a frame at every step after its first
        begun = np.arange(80) / fps > offset - (first - 0.5) / own
        assert (shown[begun] >= 0).all()


def edited(folder: Path, old: str, new: str) -> Path:
    """The folder with some text of its file replaced."""
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    assert old in text
    (folder / "sequence.toml").write_text(text.replace(old, new), encoding="utf-8")
    return folder


def test_a_late_camera_shows_and_detects_what_it_took_then(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "room", frames=20, detections=True, container="images")
    edited(folder, 'images = "cam2/*.jpg"', 'images = "cam2/*.jpg"\ntime_offset = -0.12')
    sequence = read_sequence(folder)
    first, second = sequence.views
    assert [second.frame_at(step) for step in (0, 5, 16)] == [3, 8, 19]
    assert first.clock is None
    with FrameReader(sequence) as reader:
        picture = reader.picture(1, 5)
        assert picture is not None
        assert number_in(picture) == 8
    own = second.detections
    assert own is not None
    assert own.boxes[own.at(5), 0].tolist() == [28.5]
    assert own.frames.max() == 16
    assert any("from step 17 on it has no picture" in said for said in sequence.warnings)


def test_time_stamps_in_the_layout_of_caliscope(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "room", frames=10, container="images", templates=False)
    rows = [f"{k},1,{k},{100.0 + k / 25:.4f}" for k in range(10)]
    rows += [f"{k},2,{k},{100.0 + (2 * k + 1) / 25:.4f}" for k in range(5)]
    write_lines(folder / "times.csv", "sync_index,port,frame_index,frame_time", rows)
    for name in ("cam1", "cam2"):
        line = f'images = "{name}/*.jpg"'
        edited(folder, line, f'{line}\ntimestamps = "times.csv"')
    first, second = read_sequence(folder).views
    assert [first.frame_at(step) for step in range(10)] == list(range(10))
    assert [second.frame_at(step) for step in range(10)] == [-1, 0, -1, 1, -1, 2, -1, 3, -1, 4]
    edited(folder, 'name = "cam2"', 'name = "door"')
    with pytest.raises(SequenceError, match="name the camera after its port"):
        read_sequence(folder)


def test_what_the_videos_know_need_not_be_stated(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "room", frames=30, first_frame=4)
    full = read_sequence(folder)
    for line in ("fps = 25.0\n", "frames = 30\n", "image_size = [192, 144]\n"):
        edited(folder, line, "")
    sequence = read_sequence(folder)
    assert (sequence.fps, sequence.frames) == (25.0, 30)
    assert [c.image_size for c in sequence.cameras] == [c.image_size for c in full.cameras]
    assert any(said.startswith("fps is not stated: 25") for said in sequence.warnings)
    summary = read_summary(folder)
    assert (summary.fps, summary.frames) == (None, None)


def test_room_and_target_are_found_where_views_overlap(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "room", frames=8)
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[room]")
    rest = rest[rest.index("[[camera]]") :]
    (folder / "sequence.toml").write_text(head + rest, encoding="utf-8")
    sequence = read_sequence(folder)
    assert sequence.room.contains(np.array([[0.0, 0.0, 1.0]])).all()
    assert sequence.target_half_extents.tolist() == [0.3, 0.3, 0.85]
    assert [said.partition(" is")[0] for said in sequence.warnings][:2] == ["[room]", "[target]"]
