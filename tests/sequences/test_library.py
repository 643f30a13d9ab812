"""Sequences by name: the built-in rooms, the cache of earlier versions, folders, and the list."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from tests.synthetic import write_sequence
from tracker.files.folders import cache_folder
from tracker.sequences import library
from tracker.sequences.built_in import (
    BUILT_IN,
    ROOMS,
    built_in_name,
    cached_rooms,
    key_of,
    opens_by_name,
)
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.writing.saving import save, save_copy


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(folder))
    return folder


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_built_in_room_opens_at_once_with_pictures_truth_and_templates(name: str) -> None:
    sequence = library.open_sequence(name)
    assert sequence.name == name
    assert (len(sequence.views), sequence.frames) == (2, 600)
    assert sequence.has_pictures
    assert not sequence.warnings
    truth = sequence.ground_truth
    assert truth is not None
    assert {f"person{one}" for one in truth.ids} == {one.name for one in sequence.templates}
    with FrameReader(sequence) as reader:
        assert all(reader.picture(camera, 599) is not None for camera in range(2))


def test_the_built_in_rooms_are_small_enough_to_be_part_of_the_program() -> None:
    files = [path for path in ROOMS.rglob("*") if path.is_file()]
    assert {path.parent.name for path in files} == set(BUILT_IN)
    assert sum(path.stat().st_size for path in files) <= 8_000_000


def test_what_a_person_adds_to_a_built_in_room_lies_under_its_name() -> None:
    assert key_of(library.open_sequence("room24-2p").folder) == "room24-2p"


def test_a_copy_of_a_built_in_room_shares_no_file_with_the_program(tmp_path: Path) -> None:
    sequence = library.open_sequence("room24-2p")
    with pytest.raises(SequenceError, match="room24-2p comes with the program and is never writt"):
        save(sequence, sequence)
    copied = save_copy(sequence, sequence, tmp_path / "mine")
    assert copied.frames == sequence.frames
    assert {path.stat().st_nlink for path in (tmp_path / "mine").iterdir()} == {1}
    assert built_in_name(copied.folder) is None


@pytest.mark.parametrize(
    ("name", "place"),
    [("random-6", "random/random-6"), ("room44-3p-3-cameras", "room44-3p-3-cameras")],
)
def test_a_room_of_an_earlier_version_opens_from_the_cache(name: str, place: str) -> None:
    folder = cached_rooms() / place
    write_sequence(folder, frames=2, cameras=3)
    sequence = library.open_sequence(name)
    assert sequence.folder == folder.resolve()
    assert len(sequence.views) == 3
    assert opens_by_name(sequence.folder)


def test_rooms_of_seeds_in_the_cache_are_listed() -> None:
    write_sequence(cached_rooms() / "random" / "random-6", frames=2)
    (entry,) = (one for one in library.available() if one.name == "random-6")
    assert (entry.kind, entry.error, entry.frames) == ("rendered", None, 2)


@pytest.mark.parametrize(
    ("name", "makes"),
    [
        ("random-7", "random-7"),
        ("room44-3p-3-cameras", "room44-3p --cameras 3"),
        ("room24-2p-2-cameras", "room24-2p --cameras 2"),
    ],
)
def test_a_room_that_is_not_in_the_cache_says_how_its_folder_is_made(name: str, makes: str) -> None:
    assert library.is_room(name)
    with pytest.raises(SequenceError) as caught:
        library.open_sequence(name)
    assert f"`python -m tests.rooms {makes} -o FOLDER`" in str(caught.value)
    assert not cached_rooms().exists()


@pytest.mark.parametrize("name", ["random-x", "random-", "room44-3p-4-cameras", "rooms"])
def test_other_names_are_no_rooms(name: str) -> None:
    assert not library.is_room(name)


NAMES = ["~nosuch", "a\0b", "x" * 300, "x/" * 3000, "\x1b[31m", "a\nb", "\ud800"]


@pytest.mark.parametrize("name", NAMES)
def test_a_name_that_no_file_can_have_gets_a_sentence(name: str, tmp_path: Path) -> None:
    sequence = read_sequence(write_sequence(tmp_path / "room", frames=2))
    for attempt in (
        lambda: library.open_sequence(name),
        lambda: save_copy(sequence, sequence, Path(name)),
    ):
        with pytest.raises(SequenceError) as told:
            attempt()
        assert str(told.value).isprintable()


@pytest.mark.full
def test_a_bad_folder_takes_no_other_from_the_list(tmp_path: Path) -> None:
    good = write_sequence(tmp_path / "good", frames=2, container=None)
    text = (good / "sequence.toml").read_text(encoding="utf-8")
    spoilt = {
        "digits": text.replace("25.0", "1" + "0" * 400),
        "hexadecimal": text.replace("25.0", "0x" + "f" * 9000),
        "deep": text.replace('"numbers"', "[" * 900 + "]" * 900),
        "dotted": text + "\nroom" + ".a" * 5000 + " = 1\n",
        "long": text.replace('"numbers"', f'"{"n" * 5000}"'),
        "escape": text.replace('"numbers"', '"\\u001b[31mred"'),
        "huge": text + "#" * 5_000_000,
        "table": text.replace("fps = 25.0", "fps = { a = 1 }"),
    }
    for name, bad in spoilt.items():
        folder = tmp_path / name
        folder.mkdir()
        (folder / "sequence.toml").write_text(bad, encoding="utf-8")
    (tmp_path / "folder" / "sequence.toml").mkdir(parents=True)
    (tmp_path / "circle").mkdir()
    (tmp_path / "circle" / "sequence.toml").symlink_to(tmp_path / "circle" / "sequence.toml")
    (tmp_path / "zeros").mkdir()
    (tmp_path / "zeros" / "sequence.toml").symlink_to("/dev/zero")
    (tmp_path / "pipe").mkdir()
    os.mkfifo(tmp_path / "pipe" / "sequence.toml")
    entries = {entry.name: entry for entry in library.available(tmp_path)}
    assert entries["good"].error is None
    for name in {*spoilt, "folder", "circle", "zeros", "pipe"}:
        error = entries[name].error
        assert error
        assert error.isprintable()
        assert len(error) < 500


def test_a_file_that_is_a_link_out_of_the_folder_is_neither_read_nor_saved(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "room", frames=2)
    opened = library.open_sequence(folder)
    outside = tmp_path / "outside.toml"
    (folder / "sequence.toml").rename(outside)
    before = outside.read_bytes()
    (folder / "sequence.toml").symlink_to(outside)
    with pytest.raises(SequenceError, match="expected a file in the folder, found a link"):
        library.open_sequence(folder)
    with pytest.raises(SequenceError, match="expected a file in the folder, found a link"):
        save(opened, opened)
    assert outside.read_bytes() == before


def test_a_folder_is_opened_by_its_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_sequence(tmp_path / "room44-3p", frames=2)
    assert library.open_sequence(folder).folder == folder.resolve()
    assert library.open_sequence(str(folder)).frames == 2
    monkeypatch.chdir(tmp_path)
    assert library.open_sequence("./room44-3p").frames == 2
    folder.rename(tmp_path / "mine")
    assert library.open_sequence("mine").frames == 2


def test_an_unknown_name_is_told_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(SequenceError) as caught:
        library.open_sequence("rom44-3p")
    assert str(caught.value) == (
        'there is no sequence "rom44-3p": expected one of the built-in rooms room24-2p, '
        "room35-2p and room44-3p, or the path of a folder with a sequence.toml; "
        'did you mean "room44-3p"?'
    )
    with pytest.raises(SequenceError, match="there is no such folder"):
        library.open_sequence(str(tmp_path / "nowhere"))


def test_the_list_has_rooms_and_folders(tmp_path: Path) -> None:
    data = tmp_path / "data"
    write_sequence(data / "b", frames=3, cameras=3, container=None, detections=True)
    write_sequence(data / "a", frames=2, container=None)
    (data / "c").mkdir()
    (data / "broken").mkdir()
    (data / "broken" / "sequence.toml").write_text("format = ", encoding="utf-8")
    entries = library.available(data)
    assert [(e.name, e.kind) for e in entries[:3]] == [
        (name, "rendered") for name in ("room24-2p", "room35-2p", "room44-3p")
    ]
    assert all(e.cameras == 2 and e.frames == 600 and e.description for e in entries[:3])
    assert [(e.name, e.frames, e.cameras, e.error is None) for e in entries[3:]] == [
        ("a", 2, 2, True),
        ("b", 3, 3, True),
        ("broken", 0, 0, False),
    ]
    assert entries[4].folder == data / "b"
    assert entries[5].error == "broken/sequence.toml, line 1: is not valid TOML: invalid value"
    assert library.available(tmp_path / "nowhere") == entries[:3]
    assert library.available() == entries[:3]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="those have a place of their own")
def test_where_the_cache_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert cache_folder() == tmp_path / "cache"
    monkeypatch.delenv("MULTIVIEW_PHD_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "multiview-phd"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative is not allowed")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "multiview-phd"
