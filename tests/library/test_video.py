"""The video: frame k shows step k, in the range and at the speed that were asked for."""

from __future__ import annotations

import dataclasses
import tracemalloc
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from tests.library.written import written
from tests.synthetic import number_in, write_sequence
from tracker.export.exported_run import ExportedRun, Options, Stopped
from tracker.export.palette import rgb
from tracker.export.registry import FORMATS, save
from tracker.export.video import Mosaic
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.sequences.reader import read_sequence

MP4 = FORMATS["mp4"]


@pytest.fixture(scope="module")
def numbers(tmp_path_factory: pytest.TempPathFactory) -> ExportedRun:
    """Pictures that say which step they are, and nobody in them."""
    folder = tmp_path_factory.mktemp("numbers")
    sequence = read_sequence(write_sequence(folder, frames=40, first_frame=2))
    return ExportedRun(sequence, Trajectories.empty(len(sequence.views)), RunParameters())


def numbers_of(path: Path) -> tuple[list[list[int]], float]:
    """What the cameras' cells of each frame say, and the frames a second."""
    with av.open(str(path)) as file:
        stream = file.streams.video[0]
        assert stream.codec_context.name == "h264"
        found = []
        for frame in file.decode(stream):
            picture = frame.to_ndarray(format="bgr24")
            cells = [picture[:144, 192 * k : 192 * (k + 1)] for k in range(2)]
            found.append([number_in(np.ascontiguousarray(cell)) for cell in cells])
        assert stream.average_rate is not None
        return found, float(stream.average_rate)


def test_frame_k_shows_step_k_of_every_camera(numbers: ExportedRun, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    path = tmp_path / "film.mp4"
    save(path, MP4, numbers, Options(progress=lambda *at: told.append(at)))
    found, rate = numbers_of(path)
    assert found == [[2 + step] * 2 for step in range(40)]
    assert rate == numbers.sequence.fps
    assert told[0] == (0, 40)
    assert told[-1] == (40, 40)


def test_a_range_at_half_the_speed(numbers: ExportedRun, tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    save(path, MP4, numbers, Options(first=7, last=11, speed=0.5))
    found, rate = numbers_of(path)
    assert [pair[0] for pair in found] == [9, 10, 11, 12, 13]
    assert rate == numbers.sequence.fps / 2.0


def test_what_makes_no_film_is_told(numbers: ExportedRun, tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    with pytest.raises(ValueError, match=r"from step 9 to 3: expected two of 0 … 39"):
        save(path, MP4, numbers, Options(first=9, last=3))
    with pytest.raises(ValueError, match="speed 0: expected"):
        save(path, MP4, numbers, Options(speed=0.0))
    with pytest.raises(ValueError, match="no pictures to make a video of"):
        save(path, MP4, written())
    assert list(tmp_path.iterdir()) == []


def test_stopped_in_the_middle_it_leaves_nothing(numbers: ExportedRun, tmp_path: Path) -> None:
    seen: list[int] = []

    def stopped() -> bool:
        seen.append(1)
        return len(seen) > 10

    with pytest.raises(Stopped):
        save(tmp_path / "film.mp4", MP4, numbers, Options(stopped=stopped))
    assert list(tmp_path.iterdir()) == []


def test_people_are_drawn_where_they_are_in_their_colours() -> None:
    run = written()
    mosaic = Mosaic(run)
    width, height = mosaic.size
    assert width % 2 == height % 2 == 0
    step = 10  # when they are apart
    grey = [
        np.full((c.image_size[1], c.image_size[0], 3), 128, np.uint8) for c in run.sequence.cameras
    ]
    with_people = mosaic.draw(step, grey)
    rows = run.tracks.at(step)
    nobody = Mosaic(dataclasses.replace(run, tracks=run.tracks.take(np.zeros(0, dtype=int))))
    changed = np.abs(
        with_people[: 2 * mosaic._cell[1]].astype(int)
        - nobody.draw(step, grey)[: 2 * mosaic._cell[1]].astype(int)
    ).sum(axis=2)
    assert (changed > 30).any()
    for index, camera in enumerate(run.sequence.cameras):
        cell = mosaic._at(with_people, index)
        scale = cell.shape[1] / camera.image_size[0]
        boxes, visible = run.boxes[index]
        for row in range(rows.start, rows.stop):
            if not visible[row]:
                continue
            left, top, wide, high = boxes[row] * scale
            corner = (round(left + wide), round(top + high))
            if not (3 < corner[0] < cell.shape[1] - 3 and 3 < corner[1] < cell.shape[0] - 3):
                continue
            near = cell[corner[1] - 2 : corner[1] + 3, corner[0] - 2 : corner[0] + 3].reshape(-1, 3)
            blue_green_red = np.array(rgb(int(run.tracks.ids[row]))[::-1])
            assert np.abs(near.astype(int) - blue_green_red).sum(axis=1).min() < 40


@pytest.mark.full
def test_memory_is_flat(tmp_path: Path) -> None:
    peaks = []
    for frames in (30, 120):
        sequence = read_sequence(write_sequence(tmp_path / str(frames), frames=frames))
        run = ExportedRun(sequence, Trajectories.empty(2), RunParameters())
        tracemalloc.start()
        save(tmp_path / f"{frames}.mp4", MP4, run)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.3 * peaks[0] + 1e6
    assert cv2.VideoCapture(str(tmp_path / "120.mp4")).get(cv2.CAP_PROP_FRAME_COUNT) == 120
