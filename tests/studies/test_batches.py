"""Many recordings at once: each run is kept, obeys its corrections, and is done once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.app.folders import write_crossing
from tests.studies.small import Serial
from tracker.corrections.kinds import make
from tracker.corrections.log import place_of, read_log, write_log
from tracker.library.store import open_library
from tracker.runs import pipeline
from tracker.sequences.library import open_sequence
from tracker.studies.batches import BatchRun, places_of, run_batch
from tracker.studies.errors import StudyError
from tracker.studies.worker import tracks_hash

FRAMES = 60


def run(places: Sequence[str], library: Path, crew: Serial, **how: bool) -> list[BatchRun]:
    with open_library(library) as opened:
        return run_batch(places, {}, 2, opened, 100, lambda: crew, **how)


@pytest.fixture
def corrected(tmp_path: Path) -> Path:
    """A recording of which somebody said that one of two people changes in its middle."""
    folder = write_crossing(tmp_path / "crossing", frames=FRAMES)
    sequence = open_sequence(folder)
    tracks = pipeline.compute(sequence, pipeline.default_parameters(sequence)).tracks
    who = tracks.ids[tracks.frames == FRAMES // 2][0]
    at = {
        step: tracks.positions[(tracks.ids == who) & (tracks.frames == step)][0]
        for step in (FRAMES // 2 - 10, FRAMES // 2)
    }
    places = [[step, *position.tolist()] for step, position in at.items()]
    write_log(place_of(folder), [make(kind="different", places=places)])
    return folder


@pytest.mark.full
def test_a_run_obeys_the_recordings_corrections_as_track_does(
    corrected: Path, tmp_path: Path
) -> None:
    sequence, told = open_sequence(corrected), read_log(place_of(corrected))
    parameters = pipeline.default_parameters(sequence)
    alone = [pipeline.compute(sequence, parameters, seed=k, corrections=told) for k in (0, 1)]
    without = pipeline.compute(sequence, parameters)
    assert tracks_hash(alone[0]) != tracks_hash(without)
    crew = Serial()
    found = run([str(corrected)], tmp_path / "library.sqlite3", crew)
    with open_library(tmp_path / "library.sqlite3") as library:
        for one, other in zip(found, alone, strict=True):
            assert one.run is not None, one.words
            result = library.result(one.run.id)
            assert result.run.key == other.key
            assert result.kept.tracks.ids.tolist() == other.tracks.ids.tolist()
    again = run([str(corrected)], tmp_path / "library.sqlite3", crew)
    assert len(crew.done) == 2
    assert not any(one.computed for one in again)
    plain = run([str(corrected)], tmp_path / "library.sqlite3", crew, corrected=False)
    assert all(one.computed and one.run is not None for one in plain)
    assert plain[0].run is not None
    assert plain[0].run.targets == len(set(without.tracks.ids.tolist()))


def test_what_cannot_be_read_keeps_nobody_up(tmp_path: Path) -> None:
    good, bad, spoilt = (tmp_path / name for name in ("good", "bad", "spoilt"))
    for folder in (good, bad, spoilt):
        write_crossing(folder, frames=20)
    (bad / "sequence.toml").write_text("format = 99\n")
    place_of(spoilt).write_text("[[correction]]\nkind = 7\n")
    (tmp_path / "list.txt").write_text("# all\ngood\nbad\nspoilt\nroom44-4p\nnone/*\n")
    places = places_of([f"@{tmp_path / 'list.txt'}"])
    found = run(places, tmp_path / "library.sqlite3", Serial())
    assert [one.run is not None for one in found] == [True, True, *8 * [False]]
    assert all("format" in one.words for one in found[2:4])
    assert all(place_of(spoilt).name in one.words for one in found[4:6])
    assert all('there is no sequence "room44-4p"' in one.words for one in found[6:8])
    assert all("none/*: there is no such folder" in one.words for one in found[8:])


def test_a_list_names_folders_patterns_and_lists_beside_it(tmp_path: Path) -> None:
    for name in ("one", "two", "three"):
        write_crossing(tmp_path / "lists" / name, frames=5)
    (tmp_path / "lists" / "inner.txt").write_text("t*\n")
    (tmp_path / "lists" / "outer.txt").write_text("one\n@inner.txt\nroom44-3p\n")
    folder = tmp_path / "lists"
    assert places_of([f"@{folder / 'outer.txt'}"]) == [
        *(str(folder / name) for name in ("one", "three", "two")), "room44-3p",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"@list.txt\n", "list.txt: expected recordings, found @"),
        (b"@other.txt\n", "other.txt: expected recordings, found @"),
        (b"# all\na\xff\n", "list.txt, line 2: expected text in UTF-8, found byte 0xff"),
        (None, "list.txt: cannot be read (No such file or directory)"),
    ],
)
def test_a_list_that_cannot_be_read_is_refused_by_name(
    tmp_path: Path, content: bytes | None, words: str
) -> None:
    (tmp_path / "other.txt").write_text("@list.txt\n")
    if content is not None:
        (tmp_path / "list.txt").write_bytes(content)
    with pytest.raises(StudyError) as refused:
        places_of([f"@{tmp_path / 'list.txt'}"])
    assert words in str(refused.value)
