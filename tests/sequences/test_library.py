"""Sequences by name: the cache of rendered rooms, folders, and the list of both."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.synthetic import write_sequence
from tracker.folders import cache_folder
from tracker.sequences import library, rendering
from tracker.sequences.sequence import SequenceError


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
        write_sequence(folder, frames=2, cameras=cameras)
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
