"""Columns on disk: complete or not there, whoever else writes, whatever happens to the file."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import time
from pathlib import Path

import numpy as np
import pytest

from tests.engine.synthetic import crossing, sequence, views_at
from tests.runs.test_columns import same
from tracker.runs import stage_files
from tracker.runs.stage_files import ABANDONED_SECONDS, StageFiles, Views

STEPS = 12
WHOLE = sequence(crossing(STEPS), STEPS, clutter_rate=0.5)
VIEWS: Views = [tuple(views_at(WHOLE, frame)) for frame in range(STEPS)]
HOW = {"frames": STEPS, "cameras": 3}


def test_what_is_written_is_read(tmp_path: Path) -> None:
    files = StageFiles(tmp_path / "not" / "there" / "yet")
    assert files.read("a", **HOW) is None
    assert files.write("a", VIEWS)
    found = files.read("a", **HOW)
    assert found is not None
    assert same(found, VIEWS)
    assert [path.name for path in (tmp_path / "not" / "there" / "yet").iterdir()] == ["a.npz"]


def test_a_file_cut_short_anywhere_or_spoilt_is_not_used(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    path = tmp_path / "a.npz"
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    cuts = [0, 1, 30, len(whole) // 2, len(whole) - 1, *rng.integers(0, len(whole), 20).tolist()]
    spoilt = [whole[:cut] for cut in cuts]
    # a byte of the content of any array: its checksum tells
    content = whole.index(b"\x93NUMPY")
    for place in rng.integers(content, len(whole) * 3 // 4, 20).tolist():
        spoilt.append(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
    for data in spoilt:
        path.write_bytes(data)
        found = files.read("a", **HOW)
        assert found is None or same(found, VIEWS)  # a byte that nothing depends on may differ
        if found is None:
            assert not path.exists()
    assert "computed anew" in caplog.text
    assert files.write("a", VIEWS)
    assert files.read("a", **HOW) is not None


@pytest.mark.parametrize(
    ("key", "how"), [("b", HOW), ("a", {**HOW, "frames": 11}), ("a", {**HOW, "cameras": 2})]
)
def test_a_file_of_something_else_is_not_used(tmp_path: Path, key: str, how: dict) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    (tmp_path / "a.npz").rename(tmp_path / f"{key}.npz")
    assert files.read(key, **how) is None


def test_a_file_of_another_format_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    monkeypatch.setattr(stage_files, "FORMAT", 2)
    assert files.read("a", **HOW) is None


class _Trap:
    def __reduce__(self) -> tuple:
        return (os.abort, ())


def test_objects_are_never_unpickled(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", head=np.array([_Trap()], dtype=object))
    assert StageFiles(tmp_path).read("a", **HOW) is None
    (tmp_path / "a.npz").write_bytes(pickle.dumps(_Trap()))
    assert StageFiles(tmp_path).read("a", **HOW) is None


def test_a_crash_in_the_middle_leaves_nothing_that_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crash(*_: object) -> None:
        raise KeyboardInterrupt  # as if the process ended here: nothing is tidied up

    files = StageFiles(tmp_path)
    monkeypatch.setattr(os, "fsync", crash)
    with pytest.raises(KeyboardInterrupt):
        files.write("a", VIEWS)
    monkeypatch.undo()
    (begun,) = tmp_path.iterdir()
    assert begun.suffix == ".part"
    assert files.read("a", **HOW) is None
    assert files.write("a", VIEWS)
    assert begun.exists(), "it may be another process's, which is still writing"
    long_ago = time.time() - ABANDONED_SECONDS - 1.0
    os.utime(begun, (long_ago, long_ago))
    files.prune()
    assert not begun.exists()


def test_a_full_or_read_only_disk_is_no_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    files = StageFiles(tmp_path)
    monkeypatch.setattr(os, "fsync", full)
    assert not files.write("a", VIEWS)
    assert list(tmp_path.iterdir()) == []
    assert "No space left" in caplog.text
    (tmp_path / "file").touch()
    assert not StageFiles(tmp_path / "file").write("a", VIEWS)
    assert StageFiles(tmp_path / "file").read("a", **HOW) is None


def test_what_was_used_least_recently_goes_first(tmp_path: Path) -> None:
    StageFiles(tmp_path).write("a", VIEWS)
    size = (tmp_path / "a.npz").stat().st_size
    files = StageFiles(tmp_path, limit_bytes=3 * size + 10)
    for number, key in enumerate("abc"):
        files.write(key, VIEWS)
        os.utime(tmp_path / f"{key}.npz", (1000.0 + number,) * 2)
    assert files.read("a", **HOW) is not None  # used again
    files.write("d", VIEWS)
    assert sorted(path.stem for path in tmp_path.iterdir()) == ["a", "c", "d"]
    StageFiles(tmp_path, limit_bytes=0).prune()
    assert list(tmp_path.iterdir()) == []


def _write_and_read(folder: Path, seed: int) -> int:
    files, read = StageFiles(folder, limit_bytes=200_000), 0
    rng = np.random.default_rng(seed)
    for _ in range(40):
        key = "abcd"[rng.integers(4)]
        if rng.random() < 0.5:
            files.write(key, VIEWS)
        else:
            found = files.read(key, **HOW)
            assert found is None or same(found, VIEWS)
            read += found is not None
        if rng.random() < 0.1:
            (folder / f"{key}.npz").unlink(missing_ok=True)
    return read


@pytest.mark.full
def test_two_processes_share_a_folder(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        counts = pool.starmap(_write_and_read, [(tmp_path, seed) for seed in (1, 2)])
    assert min(counts) > 0
    assert not list(tmp_path.glob("*.part"))
