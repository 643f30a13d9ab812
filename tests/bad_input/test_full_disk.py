"""A disk that is full at any byte: what was there still is, nothing half is left, and it is said.

The limit is real: the operating system refuses to let any file of this process grow beyond it.
"""

from __future__ import annotations

import contextlib
import resource
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.state.kept.drafts import Drafts
from app.state.kept.json_files import read_json, write_json
from app.state.kept.presets import OwnPresets
from app.state.workbench import Workbench
from tests.engine import synthetic
from tests.synthetic import write_sequence
from tests.test_export import PARAMETERS_OF_RUN, SEQUENCE, TRACKS
from tracker import export
from tracker.parameters import ParameterError
from tracker.runs.stage_files import StageFiles
from tracker.sequences.reader import FILE, read_sequence
from tracker.sequences.rendering.writing import whole_folder
from tracker.sequences.sequence import Sequence, SequenceError
from tracker.sequences.writing import saving
from tracker.sequences.writing.teaching import taught_values, with_taught
from tracker.single_view.protocol import ViewResult

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there is no such limit")

ROOM = [0, 1, 60, 120]
"""Bytes that a file may have."""


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


def widened(sequence: Sequence) -> Sequence:
    values = taught_values(sequence)
    values["room"]["max"][0] += 0.25
    return with_taught(sequence, values, "room")


def save_taught(folder: Path) -> None:
    sequence = read_sequence(folder / "room")
    saving.save(widened(sequence), sequence)


def save_copy(folder: Path) -> None:
    sequence = read_sequence(folder / "room")
    saving.save_copy(widened(sequence), sequence, folder / "copy")


def save_preset(folder: Path) -> None:
    OwnPresets(Workbench(), folder / "presets.json").save("another")


def save_draft(folder: Path) -> None:
    sequence = read_sequence(folder / "room")
    drafts = Drafts(folder / "unsaved")
    drafts.keep(sequence.folder, taught_values(sequence), taught_values(widened(sequence)))


def write_tracks(folder: Path) -> None:
    export.save_tracks_csv(folder / "tracks.csv", SEQUENCE, TRACKS, PARAMETERS_OF_RUN, 5)


def write_column(folder: Path) -> None:
    found = ViewResult.of_boxes(synthetic.np.ones((50, 4)), synthetic.np.ones(50),
                                synthetic.np.ones((50, 4)))  # fmt: skip
    StageFiles(folder / "stages").write("key", [(found,)] * 3)


def write_room(folder: Path) -> None:
    with whole_folder(folder / "rendered") as work:
        write_sequence(work, frames=2, cameras=1, container=None)


WRITERS: list[Callable[[Path], None]] = [
    save_taught, save_copy, save_preset, save_draft, write_tracks, write_column, write_room,
]  # fmt: skip


@pytest.mark.parametrize("room", ROOM)
@pytest.mark.parametrize("write", WRITERS, ids=lambda one: one.__name__)
def test_a_full_disk_loses_nothing_and_leaves_nothing(
    tmp_path: Path, write: Callable[[Path], None], room: int, caplog: pytest.LogCaptureFixture
) -> None:
    write_sequence(tmp_path / "room", frames=2, cameras=1, container=None, detections=True)
    write_json(tmp_path / "presets.json", {"mine": {"fusion.clutter_rate": 0.5}})
    (tmp_path / "tracks.csv").write_text("of before\n")
    before = holds(tmp_path)
    told = ""
    try:
        with room_for(room):
            write(tmp_path)
    except (SequenceError, ParameterError, OSError) as error:
        told = str(error)
    told = told or caplog.text  # a cache and a draft go on without
    assert "File too large" in told
    assert told.strip().isprintable() or told == caplog.text
    assert holds(tmp_path) == before
    write(tmp_path)  # and with room again all is well
    assert holds(tmp_path) != before
    assert read_sequence(tmp_path / "room").folder.joinpath(FILE).is_file()
    assert "mine" in read_json(tmp_path / "presets.json")


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
    own = OwnPresets(workbench, path)
    kept = workbench.snapshot().presets
    assert not kept or kept == {"mine": {"fusion.clutter_rate": 0.5}}
    if not kept:
        assert (tmp_path / "presets.unreadable.json").read_bytes() == bytes(data)
    own.save("new")
    again = Workbench()
    OwnPresets(again, path)
    assert "new" in again.snapshot().presets


def test_two_workbenches_keep_each_others_presets(tmp_path: Path) -> None:
    path = tmp_path / "presets.json"
    one, other = (OwnPresets(Workbench(), path) for _ in range(2))
    one.save("of one")
    other.save("of the other")
    assert set(read_json(path)) == {"of one", "of the other"}
    one.rename("of the other", "renamed")
    other.remove("of one")
    assert set(read_json(path)) == {"renamed"}
