"""Files that are still being copied are waited for, never taken for the whole."""

from __future__ import annotations

import os
import struct
import time
from pathlib import Path

import pytest

from tests.io.read.recorded import detections, toml, videos
from tracker.io.importing import arriving
from tracker.io.importing.arriving import (
    changed_since,
    footprint,
    gather_whole,
    growing,
    said_bytes,
)
from tracker.io.importing.settling import settle
from tracker.io.read.pieces import VideoPiece

SMALL = (64, 48)


def _recording(folder: Path) -> Path:
    toml(folder, size=SMALL)
    detections(folder, size=SMALL)
    videos(folder, SMALL)
    return folder / "cam2.avi"


def _aged(path: Path, seconds: float = 60.0) -> None:
    then = time.time() - seconds
    os.utime(path, (then, then))


def test_a_video_that_arrives_in_pieces_is_read_whole(tmp_path: Path) -> None:
    video = _recording(tmp_path)
    content = video.read_bytes()
    video.write_bytes(content[: len(content) // 3])
    sentences: list[str] = []

    def copy_on(_: float) -> None:
        there = video.stat().st_size
        with video.open("ab") as file:
            file.write(content[there : there + len(content) // 4])

    taken, read = gather_whole([tmp_path], sentences.append, copy_on)
    assert all(sentence.startswith("cam2.avi is ") for sentence in sentences)
    assert sentences
    (piece,) = (p for one in taken for p in one.pieces
                if isinstance(p, VideoPiece) and p.path == video)  # fmt: skip
    assert piece.frames == 60
    assert read[video][0] == len(content)


def test_a_video_that_lacks_bytes_is_waited_for_while_it_is_fresh(tmp_path: Path) -> None:
    video = _recording(tmp_path)
    content = video.read_bytes()
    video.write_bytes(content[: 2 * len(content) // 3])
    waits: list[float] = []
    assert "is not complete (" in growing([tmp_path], waits.append)
    assert waits == [arriving.BETWEEN_SECONDS]
    for path in tmp_path.iterdir():
        _aged(path)
    assert growing([tmp_path], waits.append) == ""
    assert len(waits) == 1  # nothing was written lately: nothing is waited for
    told = settle(gather_whole([tmp_path], waits.append)[0]).told  # type: ignore[arg-type]
    (said,) = (sentence for sentence in told if "copy it again" in sentence)
    assert said.startswith("cam2.avi says that it has ")


def test_what_changes_while_it_is_read_is_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _recording(tmp_path)
    for path in tmp_path.iterdir():
        _aged(path)
    reads = []
    gather = arriving.gather

    def slowly(sources: list[Path]) -> object:
        reads.append(len(list(tmp_path.iterdir())))
        if len(reads) == 1:
            (tmp_path / "late.csv").write_text("frame,left,top,width,height\n")
            _aged(tmp_path / "late.csv")
        return gather(sources)

    monkeypatch.setattr(arriving, "gather", slowly)
    gather_whole([tmp_path], print)
    assert reads == [9, 10]


def test_files_that_come_later_are_noticed(tmp_path: Path) -> None:
    video = _recording(tmp_path)
    before = footprint([tmp_path])
    assert changed_since([tmp_path], before) == []
    (tmp_path / ".cam9.avi.part").write_bytes(b"1")  # as rsync has it until it is whole
    assert changed_since([tmp_path], before) == []
    video.write_bytes(b"other")
    (tmp_path / "cam9.csv").write_text("")
    assert changed_since([tmp_path], before) == [video, tmp_path / "cam9.csv"]


def _box(kind: bytes, size: int, content: bytes = b"") -> bytes:
    return struct.pack(">I", size) + kind + content


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (_box(b"ftyp", 16, b"isom0000") + _box(b"mdat", 1000), 1016),
        (_box(b"ftyp", 16, b"isom0000") + _box(b"mdat", 1, struct.pack(">Q", 5000)), 5016),
        (_box(b"ftyp", 16, b"isom0000") + _box(b"mdat", 0), 0),
        (b"RIFF" + struct.pack("<I", 992) + b"AVI LIST", 1000),
        (b"RIFF" + struct.pack("<I", 0) + b"AVI LIST", 0),
        (b"\x1aE\xdf\xa3" + bytes(20), 0),
        (b"", 0),
    ],
)
def test_how_long_a_video_says_that_it_is(tmp_path: Path, content: bytes, said: int) -> None:
    path = tmp_path / "video"
    path.write_bytes(content)
    assert said_bytes(path) == said
