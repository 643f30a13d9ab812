"""Columns on disk: complete or not there, whoever else writes, whatever happens to the files."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.engine.synthetic import crossing, sequence, views_at
from tests.runs.test_steps import same
from tracker.files.atomic import ABANDONED_SECONDS
from tracker.runs.stage_cache import StageCache
from tracker.runs.stage_files import StageFiles, Views
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps, steps

STEPS = 12
WHOLE = sequence(crossing(STEPS), STEPS, clutter_rate=0.5)
VIEWS: Views = Steps.of([tuple(views_at(WHOLE, frame)) for frame in range(STEPS)], ViewResult, 3)
HOW = {"frames": STEPS, "cameras": 3}


def is_whole(found: Views | None) -> bool:
    """Whether all steps are there as they were written."""
    return found is not None and same(list(found), list(VIEWS))


def test_what_is_written_is_read(tmp_path: Path) -> None:
    files = StageFiles(tmp_path / "not" / "there" / "yet")
    assert files.read("a", **HOW) is None
    assert files.write("a", VIEWS)
    assert is_whole(files.read("a", **HOW))
    assert [path.name for path in (tmp_path / "not" / "there" / "yet").iterdir()] == ["a"]


def test_a_file_cut_short_spoilt_or_away_makes_the_column_unused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    rng = np.random.default_rng(0)
    for name in sorted(path.name for path in (tmp_path / "a").iterdir()):
        assert files.write("a", VIEWS)
        path = tmp_path / "a" / name
        whole = path.read_bytes()
        place = int(rng.integers(len(whole)))
        changed = whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :]
        for data in (b"", whole[: len(whole) // 2], changed, None):
            assert files.write("a", VIEWS)
            if data is None:
                path.unlink()
            else:
                path.write_bytes(data)
            caplog.clear()
            assert files.read("a", **HOW) is None
            assert "computed anew" in caplog.text
            assert list(tmp_path.iterdir()) == []
    assert files.write("a", VIEWS)
    assert is_whole(files.read("a", **HOW))


@pytest.mark.parametrize(
    ("key", "how"), [("b", HOW), ("a", {**HOW, "frames": 11}), ("a", {**HOW, "cameras": 2})]
)
def test_a_column_of_something_else_is_not_used(tmp_path: Path, key: str, how: dict) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    (tmp_path / "a").rename(tmp_path / key)
    assert files.read(key, **how) is None


def test_a_column_of_another_format_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    monkeypatch.setattr(steps, "FORMAT", 3)
    assert files.read("a", **HOW) is None


def test_a_file_of_an_earlier_version_is_ignored(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", head=np.zeros(3))
    files = StageFiles(tmp_path)
    assert files.read("a", **HOW) is None
    assert files.write("a", VIEWS)
    assert is_whole(files.read("a", **HOW))
    StageFiles(tmp_path, limit_bytes=0).prune()
    assert list(tmp_path.iterdir()) == []


class _Trap:
    def __reduce__(self) -> tuple:
        return (os.abort, ())


def test_objects_are_never_unpickled(tmp_path: Path) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    for path in (tmp_path / "a").glob("*.npy"):
        np.save(path, np.array([_Trap()], dtype=object), allow_pickle=True)
    assert files.read("a", **HOW) is None
    (tmp_path / "a").write_bytes(pickle.dumps(_Trap()))
    assert files.read("a", **HOW) is None


_KILLED = """
import os, sys
from pathlib import Path
from tests.runs.test_stage_files import VIEWS
from tracker.runs.stage_files import StageFiles

count = 0
def killed(descriptor):
    global count
    count += 1
    if count == 3:
        os._exit(0)

os.fsync = killed
StageFiles(Path(sys.argv[1])).write("a", VIEWS)
"""


@pytest.mark.full
def test_a_crash_in_the_middle_leaves_nothing_that_is_read(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", _KILLED, str(tmp_path)], check=True)
    files = StageFiles(tmp_path)
    (begun,) = tmp_path.iterdir()
    assert begun.name != "a"
    assert files.read("a", **HOW) is None
    assert files.write("a", VIEWS)
    assert begun.exists(), "it may be another process's, which is still writing"
    long_ago = time.time() - ABANDONED_SECONDS - 1.0
    os.utime(begun, (long_ago, long_ago))
    files.prune()
    assert not begun.exists()
    assert is_whole(files.read("a", **HOW))


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
    size = sum(path.stat().st_size for path in (tmp_path / "a", *(tmp_path / "a").iterdir()))
    files = StageFiles(tmp_path, limit_bytes=3 * size + 10)
    for number, key in enumerate("abc"):
        files.write(key, VIEWS)
        os.utime(tmp_path / key, (1000.0 + number,) * 2)
    assert files.read("a", **HOW) is not None  # used again
    files.write("d", VIEWS)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "c", "d"]
    StageFiles(tmp_path, limit_bytes=0).prune()
    assert list(tmp_path.iterdir()) == []


def test_what_is_larger_than_the_limit_is_not_written_and_takes_nothing_with_it(
    tmp_path: Path,
) -> None:
    StageFiles(tmp_path).write("a", VIEWS)
    for limit in (0, VIEWS.nbytes - 1):
        assert not StageFiles(tmp_path, limit_bytes=limit).write("b", VIEWS)
        assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_the_limit_is_that_of_the_environment_where_none_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    StageFiles(tmp_path).write("a", VIEWS)
    size = sum(path.stat().st_size for path in (tmp_path / "a", *(tmp_path / "a").iterdir()))
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE_GB", str(2.5 * size / 2**30))
    files = StageFiles(tmp_path)
    for number, key in enumerate("abc"):
        assert files.write(key, VIEWS)
        os.utime(tmp_path / key, (1000.0 + number,) * 2)
    files.prune()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b", "c"]
    for wrong in ("-1", "much", "nan", "1e9"):
        monkeypatch.setenv("MULTIVIEW_PHD_CACHE_GB", wrong)
        with pytest.raises(ValueError, match=rf"expected 0 to 65536 GB, got '{wrong}'"):
            StageFiles(tmp_path)


def test_a_cache_on_disk_deletes_at_its_start_what_is_beyond_a_new_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(tmp_path))
    StageFiles(tmp_path / "stages").write("a", VIEWS)
    StageCache.on_disk()
    assert [path.name for path in (tmp_path / "stages").iterdir()] == ["a"]
    StageCache.on_disk(disk_bytes=0)
    assert list((tmp_path / "stages").iterdir()) == []


def test_a_cache_that_cannot_be_written_to_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    StageFiles(tmp_path).write("a", VIEWS)
    monkeypatch.setattr(os, "utime", refused)
    assert is_whole(StageFiles(tmp_path).read("a", **HOW))


def test_a_column_that_is_deleted_stays_readable_where_it_was_mapped(tmp_path: Path) -> None:
    files = StageFiles(tmp_path)
    files.write("a", VIEWS)
    found = files.read("a", **HOW)
    shutil.rmtree(tmp_path / "a")
    assert is_whole(found)


def _write_and_read(folder: Path, seed: int) -> int:
    files, read = StageFiles(folder, limit_bytes=200_000), 0
    rng = np.random.default_rng(seed)
    for _ in range(40):
        key = "abcd"[rng.integers(4)]
        if rng.random() < 0.5:
            files.write(key, VIEWS)
        else:
            found = files.read(key, **HOW)
            assert found is None or is_whole(found)
            read += found is not None
        if rng.random() < 0.1:
            shutil.rmtree(folder / key, ignore_errors=True)
    return read


@pytest.mark.full
def test_two_processes_share_a_folder(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    with context.Pool(2) as pool:
        counts = pool.starmap(_write_and_read, [(tmp_path, seed) for seed in (1, 2)])
    assert min(counts) > 0
    assert not list(tmp_path.glob(".*"))
