"""Files that replace others: whatever their name, with nothing left beside them."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from tracker.files.atomic import ABANDONED_SECONDS, beside, new_folder, replacing, write_whole

LONGEST = 255
"""Bytes that a name may have."""


@pytest.mark.parametrize("letter", ["a", "é", "人", "🙂"])
@pytest.mark.parametrize("spare", [0, 1, 60])
def test_the_longest_names_are_written(tmp_path: Path, letter: str, spare: int) -> None:
    count = (LONGEST - spare) // len(letter.encode())
    path = tmp_path / (letter * count)
    write_whole(path, b"first")
    write_whole(path, b"second")
    assert path.read_bytes() == b"second"
    assert len(os.fsencode(beside(path).name)) <= LONGEST
    assert [one.name for one in tmp_path.iterdir()] == [path.name]
    with new_folder(tmp_path / (letter * count)[1:]) as folder:
        (folder / "file").touch()
    assert (tmp_path / (letter * count)[1:] / "file").exists()


def test_what_a_dead_process_left_is_removed_and_what_is_being_written_stays(
    tmp_path: Path,
) -> None:
    path = tmp_path / ("人" * 80)
    old, new, other = beside(path), beside(path), beside(tmp_path / "other")
    for temporary in (old, new, other):
        temporary.touch()
    long_ago = time.time() - ABANDONED_SECONDS - 1.0
    for temporary in (old, other):
        os.utime(temporary, (long_ago, long_ago))
    write_whole(path, b"")
    assert set(tmp_path.iterdir()) == {path, new, other}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reading = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_whole(path, b"whole")
        assert os.read(reading, 100) == b"whole"
    finally:
        os.close(reading)
    assert path.is_fifo()
    assert list(tmp_path.iterdir()) == [path]


def test_a_block_that_fails_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_whole(path, b"before")

    def fail() -> None:
        with replacing(path) as temporary:
            temporary.write_bytes(b"after")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]
