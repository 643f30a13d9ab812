"""Frame k is frame k: in every container, in every order, from every thread, also when broken."""

from __future__ import annotations

import random
import shutil
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.app.conftest import wait_until
from tests.synthetic import CODECS, Container, number_in, numbered_picture, write_sequence
from tracker.sequences.pictures import frames as frames_module
from tracker.sequences.pictures import video as video_module
from tracker.sequences.pictures.frames import NEAR, FrameReader
from tracker.sequences.pictures.video import VideoDecoder, VideoError, index_video, read_image
from tracker.sequences.reader import read_sequence

FRAMES = 90
FIRST = 7
CONTAINERS: tuple[Container, ...] = ("mp4", "mjpg.avi", "xvid.avi", "mp4v.avi", "images")
PICTURE_BYTES = 192 * 144 * 3


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One sequence a container; step 0 is frame 7 of each file."""
    base = tmp_path_factory.mktemp("containers")
    return {
        container: write_sequence(
            base / container, frames=FRAMES, container=container, first_frame=FIRST
        )
        for container in CONTAINERS
    }


@pytest.fixture(params=CONTAINERS)
def reader(request: pytest.FixtureRequest, folders: dict[str, Path]) -> Iterator[FrameReader]:
    with FrameReader(read_sequence(folders[request.param])) as opened:
        yield opened


def number_at(reader: FrameReader, camera: int, step: int) -> int:
    picture = reader.picture(camera, step)
    assert picture is not None
    assert picture.shape == (144, 192, 3)
    assert picture.dtype == np.uint8
    return number_in(picture)


@given(st.integers(0, 4095))
def test_a_picture_says_its_number(number: int) -> None:
    assert number_in(numbered_picture(number)) == number


@pytest.mark.full
def test_forwards(reader: FrameReader) -> None:
    for step in range(FRAMES):
        assert [number_at(reader, camera, step) for camera in (0, 1)] == [FIRST + step] * 2


def test_backwards(reader: FrameReader) -> None:
    for step in reversed(range(FRAMES)):
        assert number_at(reader, 0, step) == FIRST + step


def test_in_any_order(reader: FrameReader) -> None:
    order = [0, FRAMES - 1, 0, 1, FRAMES - 1, FRAMES - 2, *range(10, 60, 3), *range(60, 10, -2)]
    order += random.Random(1).choices(range(FRAMES), k=60)
    for step in order:
        assert number_at(reader, step % 2, step) == FIRST + step


def test_in_any_order_without_a_cache(folders: dict[str, Path]) -> None:
    for container in CONTAINERS:
        with FrameReader(read_sequence(folders[container]), cache_bytes=0) as reader:
            for step in random.Random(2).choices(range(FRAMES), k=40):
                assert number_at(reader, 0, step) == FIRST + step


def test_iterating_gives_every_step_once(reader: FrameReader) -> None:
    for first in (0, 33, FRAMES - 1, FRAMES):
        pictures = list(reader.iterate(1, first))
        assert len(pictures) == FRAMES - first
        numbers = [number_in(picture) for picture in pictures if picture is not None]
        assert numbers == [FIRST + step for step in range(first, FRAMES)]


def test_iterating_and_scrubbing_give_the_same_pixels(reader: FrameReader) -> None:
    for step, picture in enumerate(reader.iterate(0)):
        if step % 10 == 3:
            np.testing.assert_array_equal(reader.picture(0, step), picture)


def test_steps_that_do_not_exist_have_no_picture(reader: FrameReader) -> None:
    assert reader.picture(0, -1) is None
    assert reader.picture(0, FRAMES) is None
    for camera in (2, -1):
        with pytest.raises(IndexError, match="camera must be 0 … 1, got"):
            reader.picture(camera, 0)


def test_a_file_may_go_on_after_the_last_step(folders: dict[str, Path]) -> None:
    with FrameReader(replace(read_sequence(folders["images"]), frames=20)) as reader:
        assert number_at(reader, 0, 19) == FIRST + 19
        assert reader.picture(0, 20) is None


def test_cameras_are_not_mixed_up(reader: FrameReader) -> None:
    first, second = reader.picture(0, 5), reader.picture(1, 5)
    assert first is not None
    assert second is not None
    below = slice(40, None)  # under the squares; camera 1 lacks blue, camera 2 green
    assert first[below, :, 0].mean() < 0.7 * first[below, :, 1].mean()
    assert second[below, :, 1].mean() < 0.7 * second[below, :, 0].mean()


def test_many_threads_at_once(reader: FrameReader) -> None:
    def walk(seed: int) -> int:
        chooser = random.Random(seed)
        step, wrong = 0, 0
        for _ in range(60):
            step = chooser.choice([step + 1, step + 1, step - 1, chooser.randrange(FRAMES)])
            step %= FRAMES
            wrong += number_at(reader, chooser.randrange(2), step) != FIRST + step
        return wrong

    with ThreadPoolExecutor(6) as pool:
        walks = [pool.submit(walk, seed) for seed in range(5)]
        numbers = [number_in(p) for p in reader.iterate(0) if p is not None]
    assert [done.result() for done in walks] == [0] * 5
    assert numbers == list(range(FIRST, FIRST + FRAMES))


def test_memory_stays_within_its_bound(folders: dict[str, Path]) -> None:
    bound = 10 * (PICTURE_BYTES + 200)
    with FrameReader(read_sequence(folders["mp4"]), cache_bytes=bound) as reader:
        for step in range(40):
            number_at(reader, step % 2, step)
            assert reader._cache._used <= bound
        assert reader._cache._used == sum(
            picture.nbytes + 200
            for picture in reader._cache._pictures.values()
            if picture is not None
        )
        assert len(reader._cache._pictures) == 10


def test_playing_is_read_ahead(folders: dict[str, Path]) -> None:
    with FrameReader(read_sequence(folders["mp4"])) as reader:
        for step in (10, 11, 12):
            number_at(reader, 0, step)
        wait_until(lambda: reader._cache.has(0, 12 + frames_module.AHEAD))
        assert all(reader._cache.has(0, step) for step in range(13, 13 + frames_module.AHEAD))
        assert not reader._cache.has(0, 13 + frames_module.AHEAD)
        assert not reader._cache.has(1, 13)
        assert number_at(reader, 0, 20) == FIRST + 20


@pytest.mark.parametrize(
    ("steps", "direction", "ahead"),
    [
        ([20], 0, []),
        ([20, 21], 1, [22, 23, 24]),
        ([20, 20 + NEAR], 1, [25, 26, 27]),
        ([20, 21 + NEAR], 0, []),
        ([20, 21, 21], 0, [22, 23, 24]),  # a step that is shown again changes nothing
        ([20, 21, 20], -1, []),
        ([20, 20 - NEAR], -1, []),
        ([20, 19 - NEAR], 0, []),
        ([56, 57], 1, [58, 59]),  # the last step
    ],
)
def test_only_who_goes_on_by_a_few_steps_plays(
    steps: list[int], direction: int, ahead: list[int]
) -> None:
    walk = frames_module._Walk()
    assert [walk.move(step, 60, 3) for step in steps][-1] == direction
    assert list(iter(walk.take, None)) == ahead


def test_pictures_before_a_step_are_kept_where_steps_go_back_alone(
    folders: dict[str, Path],
) -> None:
    with FrameReader(read_sequence(folders["images"])) as reader:
        for step, kept in ((40, False), (20, False), (19, True)):
            number_at(reader, 0, step)
            assert reader._cache.has(0, step - 1) is kept


def test_closing_ends_the_thread_and_may_happen_twice(folders: dict[str, Path]) -> None:
    before = threading.active_count()
    reader = FrameReader(read_sequence(folders["mp4"]))
    for step in range(4):
        number_at(reader, 0, step)
    reader.close()
    reader.close()
    assert threading.active_count() == before
    assert reader.picture(0, 0) is None
    assert reader._cache._used == 0


def test_cameras_without_pictures(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "boxes", frames=3, container=None, detections=True)
    with FrameReader(read_sequence(folder)) as reader:
        assert reader.picture(0, 0) is None
        assert list(reader.iterate(1)) == [None, None, None]


def test_a_file_that_ends_early_or_vanishes(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "short", frames=20)
    text = (folder / "sequence.toml").read_text(encoding="utf-8")
    (folder / "sequence.toml").write_text(text.replace("frames = 20", "frames = 25"))
    sequence = read_sequence(folder)
    assert len(sequence.warnings) == 2
    with FrameReader(sequence) as reader:
        assert [reader.picture(0, step) is None for step in (19, 20, 24, 3)] == [
            False, True, True, False,
        ]  # fmt: skip
        assert [p is None for p in reader.iterate(0, 18)] == [False] * 2 + [True] * 5
    (folder / "cam1.mp4").unlink()
    with FrameReader(sequence) as reader:
        assert reader.picture(0, 3) is None
        assert list(reader.iterate(0, 23)) == [None, None]
        assert number_at(reader, 1, 3) == 3


def test_broken_frames_are_missing_and_shift_nothing(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "broken", frames=60, container="mjpg.avi", cameras=1)
    data = bytearray((folder / "cam1.avi").read_bytes())
    places = [i for i in range(len(data) - 2) if data[i : i + 3] == b"\xff\xd8\xff"]
    assert len(places) == 60
    for frame in (20, 21, 59):
        data[places[frame] : places[frame] + 600] = bytes(600)
    (folder / "cam1.avi").write_bytes(data)
    expected = [None if step in (20, 21, 59) else step for step in range(60)]
    with FrameReader(read_sequence(folder)) as reader:
        pictures = list(reader.iterate(0))
        assert [None if p is None else number_in(p) for p in pictures] == expected
        for step in [*random.Random(3).sample(range(60), 60), 20, 22, 21, 19, 59, 58]:
            picture = reader.picture(0, step)
            assert (None if picture is None else number_in(picture)) == expected[step]


def test_broken_and_misfit_images_are_missing(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "broken", frames=4, container="images", cameras=1)
    (folder / "cam1" / "00001.jpg").write_bytes(b"not a picture")
    cv2.imwrite(str(folder / "cam1" / "00002.jpg"), numbered_picture(2, (96, 72)))
    with FrameReader(read_sequence(folder)) as reader:
        assert [reader.picture(0, step) is None for step in range(4)] == [False, True, True, False]
    assert read_image(tmp_path / "nothing.jpg") is None
    (tmp_path / "empty.jpg").write_bytes(b"")
    assert read_image(tmp_path / "empty.jpg") is None


def test_a_picture_file_has_at_most_so_many_bytes(
    folders: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = next(folders["images"].rglob("*.jpg"))
    for smaller in (0, 1):
        monkeypatch.setattr(video_module, "LARGEST_IMAGE", path.stat().st_size - smaller)
        assert (read_image(path) is None) == smaller


@pytest.mark.parametrize("kept", [0.3, 0.7])
@pytest.mark.parametrize("container", ["mjpg.avi", "xvid.avi"])
def test_a_file_cut_short_is_counted_not_believed(
    folders: dict[str, Path], tmp_path: Path, container: str, kept: float
) -> None:
    whole = (folders[container] / "cam1.avi").read_bytes()
    path = tmp_path / "cut.avi"
    path.write_bytes(whole[: int(kept * len(whole))])
    index = index_video(path)
    assert 0 < index.frames < FRAMES
    with VideoDecoder(index) as decoder:
        for frame in [index.frames - 2, 3, index.frames // 2, 0]:
            picture = decoder.read(frame)
            assert picture is not None
            assert number_in(picture) == frame
        assert decoder.read(index.frames) is None


def test_times_that_cannot_be_trusted_are_not(folders: dict[str, Path]) -> None:
    index = index_video(folders["mp4"] / "cam1.mp4")
    assert index.times is not None
    # a file whose time stamps turn out to say something else than its index
    late, early = (np.concatenate([index.times[:40], index.times[40:] + by]) for by in (1, -1))
    last = np.append(index.times[:-1], index.times[-1] - 1)
    none = np.zeros(1, dtype=int)
    for times, keys in (
        (late, index.keys), (early, index.keys), (last, index.keys), (None, none)
    ):  # fmt: skip
        doubtful = type(index)(index.path, index.size, index.frames, times, keys)
        with VideoDecoder(doubtful) as decoder:
            for frame in [2, 39, 60, 41, 90, 0, 96, 50]:
                picture = decoder.read(frame)
                assert picture is not None
                assert number_in(picture) == frame


def test_two_frames_of_one_time_are_counted(
    folders: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(shutil.copy(folders["mp4"] / "cam1.mp4", tmp_path))
    stamps, keys = video_module._scan(path)
    stamps[-1] = stamps[-2]
    monkeypatch.setattr(video_module, "_scan", lambda _: (stamps, keys))
    index = index_video(path)
    assert (index.times, index.frames) == (None, len(stamps))


@pytest.mark.parametrize("content", [b"", b"hello", b"RIFF\x00\x00\x00\x00AVI LIST", bytes(5000)])
def test_what_is_no_video_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "text.avi"
    path.write_bytes(content)
    with pytest.raises(VideoError, match=r"no picture in it can be|first bytes|empty"):
        index_video(path)


def test_every_container_is_really_what_it_says(folders: dict[str, Path]) -> None:
    for container, code in CODECS.items():
        path = folders[container] / f"cam1.{container.rpartition('.')[2]}"
        assert code.encode() in path.read_bytes()


@pytest.mark.data
@pytest.mark.parametrize("camera", [0, 1, 2])
def test_real_recording_against_plain_decoding(data_folder: Path, camera: int) -> None:
    sequence = read_sequence(data_folder / "av163-seq30-2p-1101")
    view = sequence.views[camera]
    capture = cv2.VideoCapture(str(view.video))
    for _ in range(view.first_frame):
        capture.read()
    plain = [capture.read()[1] for _ in range(sequence.frames)]
    capture.release()
    with FrameReader(sequence, cache_bytes=20 * 360 * 288 * 3) as reader:
        for step, picture in enumerate(reader.iterate(camera)):
            np.testing.assert_array_equal(picture, plain[step])
        steps = [0, 499, 498, 1, 248, 249, 250, *random.Random(camera).sample(range(500), 40)]
        for step in [*steps, *range(300, 330), *range(330, 300, -1)]:
            np.testing.assert_array_equal(reader.picture(camera, step), plain[step])


def test_what_follows_from_the_pictures_is_made_once(tmp_path: Path) -> None:
    sequence = read_sequence(write_sequence(tmp_path / "s", frames=4))
    made: list[int] = []

    def make() -> object:
        made.append(1)
        time.sleep(0.05)
        return object()

    with FrameReader(sequence) as reader:
        found: list[object] = []
        threads = [
            threading.Thread(target=lambda: found.append(reader.once("a", make))) for _ in range(4)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(made) == 1
        assert len(found) == 4
        assert all(one is found[0] for one in found)
        assert reader.once("b", make) is not found[0]
        assert reader.once("nothing", lambda: None) is None
