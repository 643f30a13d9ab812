"""A disk that is full at any byte: what was there still is, nothing half is left, and it is said.

The limit is real: the operating system refuses to let any file of this process grow beyond it.
"""

from __future__ import annotations

import contextlib
import resource
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.state.edits import Edits
from app.state.presets import OwnPresets
from app.state.workbench import Workbench
from tests.bad_input.writes import KINDS
from tracker.files.validated import read_json, write_json
from tracker.parameters.values import ParameterError
from tracker.sequences.errors import SequenceError

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")

ROOM = [0, 1, 60]
"""Bytes that a file may have."""

WRITTEN = (
    "presets", "recent", "draft", "sequence", "corrections", "tracks", "copy", "column",
    "rendering", "whole",
)  # fmt: skip
"""The kinds of files that are written anew; databases keep within their own bounds."""


@contextlib.contextmanager
def room_for(count: int) -> Iterator[None]:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def holds(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.endswith(".lock")
    }


@pytest.mark.parametrize("room", ROOM)
@pytest.mark.parametrize("name", WRITTEN)
def test_a_full_disk_loses_nothing_and_leaves_nothing(
    tmp_path: Path, name: str, room: int, caplog: pytest.LogCaptureFixture
) -> None:
    kind = KINDS[name]
    kind.make(tmp_path)
    kind.write(tmp_path, 1)
    before = holds(tmp_path)
    sentence = ""
    try:
        with room_for(room):
            kind.write(tmp_path, 2)
    except (SequenceError, ParameterError, OSError) as error:
        sentence = str(error)
        assert sentence.isprintable()
    except AssertionError:  # a cache goes on without, and its kind says that nothing was written
        assert name == "column"
    assert "File too large" in (sentence or caplog.text)  # as a draft does
    assert holds(tmp_path) == before
    assert kind.newest(tmp_path) == 1
    kind.write(tmp_path, 2)  # and with room again all is well
    assert kind.newest(tmp_path) == 2


@pytest.mark.parametrize("byte", range(0, 120, 7))
def test_a_flipped_byte_of_a_kept_file_is_found_and_nothing_is_lost(
    tmp_path: Path, byte: int
) -> None:
    path = tmp_path / "presets.json"
    write_json(path, {"mine": {"fusion.clutter_rate": 0.5}})
    data = bytearray(path.read_bytes())
    data[byte % len(data)] ^= 1
    path.write_bytes(data)
    workbench = Workbench()
    own = OwnPresets(workbench, Edits(workbench), path)
    kept = workbench.snapshot().presets
    assert not kept or kept == {"mine": {"fusion.clutter_rate": 0.5}}
    if not kept:
        assert (tmp_path / "presets.unreadable.json").read_bytes() == bytes(data)
    own.save("new")
    again = Workbench()
    OwnPresets(again, Edits(again), path)
    assert "new" in again.snapshot().presets


def test_two_workbenches_keep_each_others_presets(tmp_path: Path) -> None:
    path = tmp_path / "presets.json"
    one, other = (OwnPresets((bench := Workbench()), Edits(bench), path) for _ in range(2))
    one.save("of one")
    other.save("of the other")
    assert set(read_json(path)) == {"of one", "of the other"}
    one.rename("of the other", "renamed")
    other.remove("of one")
    assert set(read_json(path)) == {"renamed"}
