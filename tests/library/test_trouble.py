"""A library that is locked, read-only, on a full disk or damaged: a sentence."""

from __future__ import annotations

import contextlib
import os
import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from tests.library.runs import RECORDING, filled, made_by_the_version_before, run
from tracker.library import repair
from tracker.library.errors import LibraryError, explained
from tracker.library.store import Library, open_library


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "library.sqlite3"
    filled(path, 4).close()
    return path


def test_held_by_another_program(path: Path) -> None:
    holder = sqlite3.connect(path, isolation_level=None)
    holder.execute("BEGIN IMMEDIATE")
    with Library(path, wait_seconds=0.05) as library:
        assert len(library.runs()) == 4  # who only reads need not wait
        with pytest.raises(LibraryError, match="another program holds the library"):
            library.star(1)
        holder.execute("ROLLBACK")
        holder.close()
        library.star(1)
        assert library.run(1).star == 1


def test_on_a_full_disk(path: Path) -> None:
    with Library(path) as library:
        pages = library._connection.execute("PRAGMA page_count").fetchone()[0]
        library._connection.execute(f"PRAGMA max_page_count = {pages}")

        def fill() -> None:
            for number in range(100, 140):
                library.keep(RECORDING, run(number))

        with pytest.raises(LibraryError, match="no space left"):
            fill()
        whole = [library.result(r.id) for r in library.runs()]  # those that were kept, wholly
        assert len(whole) >= 4
    assert repair.check(path).complaints == ()


def test_one_that_may_only_be_read(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path.chmod(0o444)
    if os.geteuid() == 0:  # who may write anywhere; the others are told by their rights
        monkeypatch.setattr(os, "access", lambda *_: False)
    with open_library(path) as library:
        assert library.read_only
        assert len(library.runs()) == 4
        with pytest.raises(LibraryError, match="open for reading alone"):
            library.keep(RECORDING, run(9))
        with pytest.raises(LibraryError, match="can be read but not written"), explained(path):
            library._connection.execute("UPDATE runs SET star = 1")


def whole_runs(path: Path) -> int:
    """How many runs can be read, however damaged the file."""
    with contextlib.suppress(LibraryError):
        return repair.check(path).runs
    return 0


def flipped(path: Path, rng: np.random.Generator) -> None:
    data = bytearray(path.read_bytes())
    for place in rng.integers(0, len(data), int(rng.integers(1, 9))).tolist():
        data[place] ^= 1 << int(rng.integers(8))
    path.write_bytes(bytes(data))


def try_flipped(path: Path, folder: Path, tries: int) -> None:
    """Damage copies at random; whatever is then done ends well or in a sentence, and no run that
    could be read before is lost by it, repaired or not."""
    rng = np.random.default_rng(1)
    complaints = 0
    for number in range(tries):
        spoilt = folder / f"{number}.sqlite3"
        shutil.copy(path, spoilt)
        flipped(spoilt, rng)
        readable = whole_runs(spoilt)
        try:
            with open_library(spoilt) as library:
                for one in library.runs():
                    library.result(one.id).run.to_json()
                library.recordings()
                library.keep(RECORDING, run(1000 + number))
                library.star(1)
        except LibraryError as error:
            complaints += str(spoilt) in str(error)
        assert whole_runs(spoilt) >= readable
        with contextlib.suppress(LibraryError):
            if repair.check(spoilt).complaints:
                copied = spoilt.read_bytes()
                aside, saved, _ = repair.repair(spoilt)
                assert aside.read_bytes() == copied
                assert saved >= readable
                assert repair.check(spoilt).complaints == ()
        for left in folder.glob(f"{number}*"):
            left.unlink()
    assert complaints > tries / 10  # else the damage was none


@pytest.mark.full
def test_flipped_bytes(path: Path, tmp_path: Path) -> None:
    try_flipped(path, tmp_path, 60)


@pytest.mark.long
def test_flipped_bytes_500_times(path: Path, tmp_path: Path) -> None:
    try_flipped(path, tmp_path, 500)


def test_a_file_of_the_version_before_is_checked_and_repaired(path: Path) -> None:
    made_by_the_version_before(path)
    assert repair.check(path) == repair.Checked((), 4)
    _, saved, lost = repair.repair(path)
    assert (saved, lost) == (4, 0)
    with Library(path) as library:
        assert [one.provisional for one in library.runs()] == [False] * 4
