"""Sequences by name: the cache of rendered rooms, folders, and the list of both."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.synthetic import write_sequence
from tracker.folders import cache_folder
from tracker.sequences import library, rendering
from tracker.sequences.reader import read_sequence
from tracker.sequences.rendering.writing import SUMS, is_whole, whole_folder
from tracker.sequences.sequence import SequenceError
from tracker.sequences.writing.saving import save, save_copy


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(folder))
    return folder


@pytest.fixture
def rendered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the rooms rendered, in order; a quick stand-in draws numbers in their place."""
    names: list[str] = []

    def quick(
        name: str, folder: Path, *, cameras: int, progress: library.Told, **_: object
    ) -> None:
        names.append(name)
        progress(1, 2)
        with whole_folder(folder) as work:
            write_sequence(work, frames=2, cameras=cameras)
        progress(2, 2)

    monkeypatch.setattr(rendering, "render", quick)
    return names


def test_a_room_is_rendered_once(rendered: list[str], cache: Path) -> None:
    told: list[tuple[int, int]] = []
    first = library.open_sequence("room24-2p", progress=lambda *steps: told.append(steps))
    again = library.open_sequence("room24-2p")
    assert rendered == ["room24-2p"]
    assert told == [(1, 2), (2, 2)]
    assert first.digest == again.digest
    assert first.has_pictures
    assert first.folder.is_relative_to(cache)
    assert f"version-{rendering.VERSION}" in first.folder.parts
    entries = {entry.name: entry for entry in library.available()}
    assert entries["room24-2p"].ready
    assert not entries["room44-3p"].ready


def test_another_number_of_cameras_is_another_folder(rendered: list[str]) -> None:
    def told(*_: int) -> None: ...

    assert len(library.open_sequence("room24-2p", progress=told).views) == 2
    assert len(library.open_sequence("room24-2p", progress=told, cameras=3).views) == 3
    assert len(rendered) == 2


@pytest.mark.parametrize("spoilt", ["sequence.toml", "cam1.mp4"])
def test_a_cached_room_that_was_spoilt_is_rendered_again(rendered: list[str], spoilt: str) -> None:
    def told(*_: int) -> None: ...

    folder = library.open_sequence("room24-2p", progress=told).folder
    (folder / spoilt).unlink()
    assert library.open_sequence("room24-2p", progress=told).has_pictures
    assert rendered == ["room24-2p"] * 2


def cut(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


@pytest.mark.full
@pytest.mark.parametrize("spoil", [cut, flip])
@pytest.mark.parametrize("name", ["sequence.toml", "cam1.mp4", "ground_truth.csv", SUMS])
def test_a_cached_room_that_is_not_what_was_rendered_is_rendered_again(
    rendered: list[str], spoil: Callable[[Path], None], name: str
) -> None:
    def told(*_: int) -> None: ...

    folder = library.open_sequence("room24-2p", progress=told).folder
    spoil(folder / name)
    assert not is_whole(folder)
    again = library.open_sequence("room24-2p", progress=told)
    assert is_whole(folder)
    assert not again.warnings
    assert rendered == ["room24-2p"] * 2


def test_what_a_dead_process_began_to_render_is_swept_away(rendered: list[str]) -> None:
    def told(*_: int) -> None: ...

    place = library.rendered_folder("room24-2p")
    left = place.with_name(f".0123abcd.part.{place.name}")
    (left / "deep").mkdir(parents=True)
    fresh = place.with_name(f".4567abcd.part.{place.name}")
    fresh.mkdir()
    os.utime(left, (1e9, 1e9))
    library.open_sequence("room24-2p", progress=told)
    assert not left.exists()
    assert fresh.exists()  # somebody may be at it now


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
    assert entries["good"].ready
    for name in {*spoilt, "folder", "circle", "zeros", "pipe"}:
        assert not entries[name].ready, name
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
        'there is no sequence "rom44-3p": expected one of the rendered rooms room24-2p, '
        "room35-2p, room44-3p and random-SEED, or the path of a folder with a sequence.toml; "
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
    assert all(e.cameras == 2 and e.frames > 1000 and e.description for e in entries[:3])
    assert [(e.name, e.frames, e.cameras, e.ready) for e in entries[3:]] == [
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


@pytest.mark.full
def test_a_room_of_a_seed_is_rendered_once_and_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    render_random = rendering.render_random
    seeds = []

    def short(seed: int, folder: Path, **others: Any) -> object:
        seeds.append(seed)
        return render_random(seed, folder, frames=2, **others)

    monkeypatch.setattr(rendering, "render_random", short)
    assert library.next_random(library.available()) == "random-1"
    for _ in range(2):
        sequence = library.open_sequence("random-6")
        assert sequence.has_detections
        assert sequence.ground_truth is not None
    assert seeds == [6]
    entries = library.available()
    (entry,) = (one for one in entries if one.name == "random-6")
    assert (entry.kind, entry.ready, entry.frames) == ("rendered", True, 2)
    assert library.next_random(entries) == "random-7"
    assert not library.is_room("random-x")
