"""What was taught, written back: nothing else in the file is touched, and nothing is ever lost."""

from __future__ import annotations

import copy
import os
import re
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.synthetic import write_sequence
from tracker.files import atomic
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import FILE, WHERE_NOW, read_sequence
from tracker.sequences.sequence import Sequence
from tracker.sequences.writing import saving
from tracker.sequences.writing.saving import rewritten, taught_in
from tracker.sequences.writing.teaching import Values, changes, taught_values, with_taught

Edit = Callable[[Values], Any]

NEW = {"name": "Anna", "camera": "cam2", "frame": 3, "box": [50.0, 40.0, 20.5, 40.0]}
DOOR = {"position": [0.0, 1.4, 1.0], "sigma": [0.2, 0.2, 0.1]}


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    """A sequence with everything in its file, which no test writes to."""
    folder = write_sequence(tmp_path_factory.mktemp("kept") / "room", frames=8, detections=True)
    return read_sequence(folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A sequence to be saved over."""
    return write_sequence(tmp_path / "room", frames=8, detections=True)


def taught(opened: Sequence, *edits: Edit) -> Sequence:
    """A sequence after some edits of its values."""
    values = copy.deepcopy(taught_values(opened))
    for edit in edits:
        edit(values)
    return with_taught(opened, values, f"{opened.folder.name}/{FILE}")


def add(values: Values) -> None:
    values["template"].append(dict(NEW))


def widen(values: Values) -> None:
    values["room"]["max"][0] = 1.75


def shrink(values: Values) -> None:
    values["target"]["half_extents"] = [0.25, 0.25, 0.75]


def move_door(values: Values) -> None:
    values["room"]["entrances"][0]["position"][1] = -0.5


def test_what_was_taught_has_another_digest_and_the_same_one_has_the_same(
    opened: Sequence,
) -> None:
    first, second = taught(opened, add), taught(opened, add)
    assert first.digest == second.digest != opened.digest
    assert taught(opened).digest == opened.digest
    assert first.views is opened.views
    assert [template.name for template in first.templates] == ["person1", "Anna"]


def test_changes_are_told_one_by_one(opened: Sequence) -> None:
    before = taught_values(opened)

    def after(*edits: Edit) -> list[str]:
        return changes(before, taught_values(taught(opened, *edits)))

    assert after() == []
    assert after(add) == ["template Anna added"]
    assert after(lambda v: v["template"].clear()) == ["template person1 removed"]
    assert after(lambda v: v["template"][0].update(name="Bob")) == ["template person1 renamed Bob"]
    assert after(widen) == ["room, max x: 1.5 to 1.75 m"]
    assert after(shrink) == ["target: 0.5 × 0.5 × 1.5 m"]
    assert after(move_door) == ["entrance 1 moved"]
    assert after(lambda v: v["room"]["entrances"].insert(0, DOOR)) == ["entrance 1 added"]
    assert after(lambda v: v["room"]["entrances"].clear()) == ["entrance 1 removed"]


@pytest.mark.parametrize(
    ("edit", "complaint"),
    [
        (
            lambda v: v["room"]["max"].__setitem__(2, -1.0),
            "room/sequence.toml, [room], max: expected z above that of min, 0, found -1",
        ),
        (
            lambda v: v["target"]["half_extents"].__setitem__(2, 0.0),
            "room/sequence.toml, [target], half_extents: expected 3 positive numbers (half width, "
            "depth and height in metres), found [0.3, 0.3, 0.0]",
        ),
        (
            lambda v: v["template"].append({**NEW, "name": " "}),
            'room/sequence.toml, template " ", name: expected some text, found none',
        ),
        (
            lambda v: v["template"].append({**NEW, "camera": "cam9"}),
            'room/sequence.toml, template "Anna", camera: expected one of cam1 and cam2, '
            'found "cam9"; did you mean "cam1"?',
        ),
        (
            lambda v: v["template"].append({**NEW, "frame": 8}),
            'room/sequence.toml, template "Anna", frame: expected a whole number from 0 to 7, '
            "found 8",
        ),
        (
            lambda v: v["template"].append({**NEW, "box": [180.0, 40.0, 20.0, 40.0]}),
            'room/sequence.toml, template "Anna", box: expected a box inside the 192×144 picture, '
            "found x from 180 to 200 and y from 40 to 80",
        ),
    ],
)
def test_what_does_not_fit_is_told_as_of_a_file(
    opened: Sequence, edit: Edit, complaint: str
) -> None:
    with pytest.raises(SequenceError) as caught:
        taught(opened, edit)
    assert str(caught.value).startswith(complaint.partition(";")[0])


COMMENTED = """# my recording
format = 1
name = "kept"          # a name
fps = 25.0

frames = 8
[ room ]               # metres
  min = [ -1.5, -1.5, 0 ]   # the corner
  max = [1.5,1.5,2.0]
entrances = [ # where
  { position = [1.4, 0, 1.0], sigma = [0.3, 0.3, 0.15] }, # the door
  # { position = [0, 0, 0], sigma = [1, 1, 1] },  a note
]
"""


def test_only_the_values_that_differ_are_touched(folder: Path) -> None:
    path = folder / FILE
    text = path.read_text(encoding="utf-8")
    rest = text[text.index("[target]") :].replace("frame = 4", "frame = 4   # a good one")
    path.write_text(COMMENTED + rest, encoding="utf-8")
    opened = read_sequence(folder)
    saving.save(taught(opened, add, widen, move_door), opened)
    after = path.read_text(encoding="utf-8")
    expected = (
        (COMMENTED + rest)
        .replace("[1.5,1.5,2.0]", "[1.75,1.5,2.0]")
        .replace("[1.4, 0, 1.0]", "[1.4, -0.5, 1.0]")
        .replace(
            "[ground_truth]",
            '[[template]]\nname = "Anna"\ncamera = "cam2"\nframe = 3\n'
            "box = [50.0, 40.0, 20.5, 40.0]\n\n[ground_truth]",
        )
    )
    assert after == expected


def test_a_save_keeps_what_was_there_and_reads_back(folder: Path) -> None:
    before = (folder / FILE).read_bytes()
    mode = (folder / FILE).stat().st_mode
    opened = read_sequence(folder)
    first = taught(opened, add, widen)
    backup = saving.save(first, opened)
    assert (backup.name, backup.read_bytes()) == ("sequence.toml.bak", before)
    assert (folder / FILE).stat().st_mode == mode
    assert taught_values(read_sequence(folder)) == taught_values(first)
    between = (folder / FILE).read_bytes()
    again = saving.save(opened, first)
    assert (again.name, again.read_bytes()) == ("sequence.toml.bak2", between)
    assert backup.read_bytes() == before
    assert taught_values(read_sequence(folder)) == taught_values(opened)
    assert sorted(p.name for p in folder.iterdir() if p.name.startswith(".")) == []


def test_a_backup_is_not_written_through_a_link(folder: Path) -> None:
    outside = folder.parent / "outside"
    (folder / "sequence.toml.bak").symlink_to(outside)
    opened = read_sequence(folder)
    assert saving.save(taught(opened, add), opened).name == "sequence.toml.bak2"
    assert not outside.exists()


def test_at_no_line_of_a_save_is_a_file_there_that_is_not_whole(folder: Path) -> None:
    """A process may be killed between any two lines."""
    before = (folder / FILE).read_bytes()
    opened = read_sequence(folder)
    changed = taught(opened, add)
    seen: set[tuple[str, bytes]] = set()

    def look(frame: FrameType, event: str, value: object) -> Any:
        if frame.f_code.co_filename not in (saving.__file__, atomic.__file__):
            return None
        for file in folder.glob(f"{FILE}*"):
            seen.add((file.name, file.read_bytes()))
        return look

    sys.settrace(look)
    try:
        backup = saving.save(changed, opened)
    finally:
        sys.settrace(None)
    after = (folder / FILE).read_bytes()
    assert seen == {(FILE, before), (backup.name, before), (FILE, after)}


def test_line_ends_and_the_byte_order_mark_stay(folder: Path) -> None:
    path = folder / FILE
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    opened = read_sequence(folder)
    saving.save(taught(opened, add, lambda v: v["room"]["entrances"].append(DOOR)), opened)
    data = path.read_bytes()
    assert data.startswith(b"\xef\xbb\xbf")
    assert data.count(b"\n") == data.count(b"\r\n") > 30
    assert len(read_sequence(folder).room.entrances) == 2


@given(st.data())
def test_any_edits_after_any_others_are_written(opened: Sequence, data: st.DataObject) -> None:
    def state() -> Sequence:
        names = st.sampled_from(["person1", "Anna", "Bob"])
        boxes = st.sampled_from([[10.0, 10.0, 20.0, 40.0], [60.0, 50.0, 24.0, 48.0]])
        templates = [
            {"name": data.draw(names), "camera": "cam1", "frame": frame, "box": data.draw(boxes)}
            for frame in data.draw(st.lists(st.integers(0, 4), max_size=4))
        ]
        places = st.sampled_from([-1.0, 0.0, 0.25, 1.4])
        entrances = [
            {"position": [x, data.draw(places), 1.0], "sigma": [0.3, 0.3, 0.15]}
            for x in data.draw(st.lists(places, max_size=4))
        ]

        def edit(values: Values) -> None:
            values["template"] = templates
            values["room"]["entrances"] = entrances
            values["room"]["max"][data.draw(st.integers(0, 2))] = data.draw(st.floats(3.0, 9.0))

        return taught(opened, edit)

    text = (opened.folder / FILE).read_text(encoding="utf-8")
    before, after = state(), state()
    text = rewritten(text, opened, before, "room")
    again = rewritten(text, before, after, "room")
    assert taught_in(tomllib.loads(again)) == taught_values(after)


@pytest.mark.parametrize("notation", ["inline", "tables"])
def test_other_notations_are_kept(folder: Path, notation: str) -> None:
    path = folder / FILE
    text = path.read_text(encoding="utf-8")
    room = text[text.index("[room]") : text.index("[target]")]
    door = "position = [1.4, 0.0, 1.0]\nsigma = [0.3, 0.3, 0.15]\n"
    other = "[room]\nmin = [-1.5, -1.5, 0.0]\nmax = [1.5, 1.5, 2.0]\n"
    other += (
        f"[[room.entrances]]\n{door}\n"
        if notation == "tables"
        else "entrances = [{position = [1.4, 0.0, 1.0], sigma = [0.3, 0.3, 0.15]}]\n\n"
    )
    path.write_text(text.replace(room, other), encoding="utf-8")
    opened = read_sequence(folder)
    saving.save(taught(opened, lambda v: v["room"]["entrances"].append(DOOR)), opened)
    after = path.read_text(encoding="utf-8")
    assert after.count("[[room.entrances]]") == (2 if notation == "tables" else 0)
    assert len(read_sequence(folder).room.entrances) == 2


def test_templates_and_entrances_can_be_the_first_and_the_last(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "bare", frames=8, templates=False)
    path = folder / FILE
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text[: text.index("entrances")] + text[text.index("\n[target]") :], encoding="utf-8"
    )
    opened = read_sequence(folder)
    full = taught(opened, add, lambda v: v["room"]["entrances"].append(DOOR))
    saving.save(full, opened)
    reread = read_sequence(folder)
    assert (len(reread.templates), len(reread.room.entrances)) == (1, 1)
    saving.save(opened, full)
    reread = read_sequence(folder)
    assert (len(reread.templates), len(reread.room.entrances)) == (0, 0)


def test_a_file_that_somebody_else_changed_is_left_alone(folder: Path) -> None:
    opened = read_sequence(folder)
    path = folder / FILE
    path.write_text(path.read_text("utf-8").replace("max = [1.5,", "max = [1.6,"), "utf-8")
    changed = path.read_bytes()
    with pytest.raises(SequenceError, match="another program has changed the file; save a copy"):
        saving.save(taught(opened, add), opened)
    assert path.read_bytes() == changed
    assert not (folder / "sequence.toml.bak").exists()


def test_what_else_was_changed_meanwhile_stays_changed(folder: Path) -> None:
    opened = read_sequence(folder)
    path = folder / FILE
    path.write_text(path.read_text("utf-8").replace("fps = 25.0", "fps = 12.5"), "utf-8")
    saving.save(taught(opened, add), opened)
    assert read_sequence(folder).fps == 12.5


def test_a_failing_disk_loses_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = read_sequence(folder)
    before = (folder / FILE).read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SequenceError, match="No space left on device"):
        saving.save(taught(opened, add), opened)
    assert (folder / FILE).read_bytes() == before
    assert sorted(p.name for p in folder.iterdir() if p.name.startswith(".")) == []


def test_a_place_that_may_only_be_read_offers_the_copy(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = read_sequence(folder)
    assert saving.why_not_in_place(folder) is None
    monkeypatch.setattr(saving.os, "access", lambda *_: False)
    with pytest.raises(SequenceError, match="is a place that you may only read; save a copy"):
        saving.save(taught(opened, add), opened)


def test_a_folder_that_is_gone_says_so(folder: Path, tmp_path: Path) -> None:
    opened = read_sequence(folder)
    folder.rename(tmp_path / "elsewhere")
    why = f"there is no {FILE} in {folder} any more"
    assert saving.why_not_in_place(folder) == why
    words = re.escape(f"cannot be saved, since {why}; {WHERE_NOW}")
    with pytest.raises(SequenceError, match=words):
        saving.save(taught(opened, add), opened)
    with pytest.raises(SequenceError, match=words):
        saving.save_copy(taught(opened, add), opened, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()


def test_a_rendered_room_is_never_altered(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(folder.parent))
    opened = read_sequence(folder)
    before = (folder / FILE).read_bytes()
    with pytest.raises(SequenceError, match=r"lies in the cache.*save a copy"):
        saving.save(taught(opened, add), opened)
    assert (folder / FILE).read_bytes() == before


@pytest.mark.parametrize("container", ["mp4", "images"])
def test_a_copy_is_whole_and_its_own(tmp_path: Path, container: Any) -> None:
    source = write_sequence(tmp_path / "room", frames=8, detections=True, container=container)
    with FrameReader(read_sequence(source)) as reader:
        cv2.imwrite(str(source / "empty.png"), next(iter(reader.iterate(0))))
    text = (source / FILE).read_text(encoding="utf-8")
    text = text.replace('name = "cam1"', 'name = "cam1"\nbackground = "empty.png"')
    (source / FILE).write_text(text, encoding="utf-8")
    opened = read_sequence(source)
    before = {path: path.stat().st_mtime_ns for path in source.rglob("*")}
    copied = saving.save_copy(taught(opened, add, widen), opened, tmp_path / "new" / "mine")
    assert (copied.name, copied.folder) == ("mine", tmp_path / "new" / "mine")
    assert taught_values(copied) == taught_values(taught(opened, add, widen))
    assert copied.ground_truth is not None
    assert copied.has_pictures
    assert copied.views[0].background == copied.folder / "empty.png"
    assert copied.has_detections
    (copied.folder / "cam1.csv").write_text("changed", encoding="utf-8")
    assert {path: path.stat().st_mtime_ns for path in source.rglob("*")} == before
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["mine"]


def test_a_copy_has_appearance_and_time_stamps(tmp_path: Path) -> None:
    source = write_sequence(tmp_path / "room", frames=8, container=None, detections=True)
    stamps = "".join(f"{0.25 * step}\n" for step in range(8))
    text = (source / FILE).read_text(encoding="utf-8")
    for camera in ("cam1", "cam2"):
        np.save(source / f"{camera}.npy", np.eye(8, 3, dtype=np.float32))
        (source / f"{camera}-times.csv").write_text(f"frame_time\n{stamps}", encoding="utf-8")
        table = f'detections = "{camera}.csv"'
        own = f'appearance = "{camera}.npy"\ntimestamps = "{camera}-times.csv"'
        text = text.replace(table, f"{table}\n{own}")
    (source / FILE).write_text(text, encoding="utf-8")
    opened = read_sequence(source)
    copied = saving.save_copy(taught(opened, widen), opened, tmp_path / "mine")
    assert copied.digest != opened.digest
    for view, other in zip(opened.views, copied.views, strict=True):
        assert view.detections is not None
        assert other.detections is not None
        np.testing.assert_array_equal(view.detections.embeddings, other.detections.embeddings)
    np.save(copied.folder / "cam1.npy", np.zeros((8, 3)))
    assert np.load(source / "cam1.npy").any()


def test_a_copy_is_copied_while_its_pictures_are_read_where_they_were(tmp_path: Path) -> None:
    opened = read_sequence(write_sequence(tmp_path / "room", frames=8, detections=True))
    first = saving.save_copy(opened, opened, tmp_path / "first")
    shown = replace(opened, name=first.name, folder=first.folder)
    second = saving.save_copy(taught(shown, add), shown, tmp_path / "second")
    assert taught_values(second) == taught_values(taught(opened, add))
    videos = [view.video for view in second.views]
    assert all(video is not None and video.parent == second.folder for video in videos)


def test_a_copy_goes_into_new_or_empty_folders_only(tmp_path: Path, opened: Sequence) -> None:
    full = tmp_path / "full"
    full.mkdir()
    (full / "letter.txt").write_text("mine", encoding="utf-8")
    for place, words in (
        (full, "expected a new or an empty folder, found one with 1 files in it"),
        (full / "letter.txt", "expected a new folder, found a file"),
        (opened.folder / "in", "expected a folder beside the sequence, found one inside it"),
        (full / "letter.txt" / "x", "choose another"),
    ):
        with pytest.raises(SequenceError, match=words):
            saving.save_copy(opened, opened, place)
    assert [p.name for p in full.iterdir()] == ["letter.txt"]
    empty = tmp_path / "empty"
    empty.mkdir()
    assert saving.save_copy(opened, opened, empty).name == "empty"


def test_a_saved_copy_reopens_to_the_same_run(tmp_path: Path) -> None:
    from tests.browser.walkers import write_walkers

    opened = read_sequence(write_walkers(tmp_path / "walkers"))
    changed = taught(opened, widen, move_door)
    parameters = with_values(
        pipeline.default_parameters(changed), {"fusion.detection_probability": 0.8}
    )
    run = pipeline.compute(changed, parameters, seed=0)
    plain = pipeline.compute(opened, parameters, seed=0)
    copied = saving.save_copy(changed, opened, tmp_path / "copy")
    again = pipeline.compute(read_sequence(copied.folder), parameters, seed=0)
    assert again.tracks.positions.tolist() == run.tracks.positions.tolist()
    assert again.tracks.ids.tolist() == run.tracks.ids.tolist()
    assert again.tracks.positions.tolist() != plain.tracks.positions.tolist()
