"""What was open last, of which the file is spoilt."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest

from app.state.recents import Recents
from app.state.workbench import Workbench
from tests.app.scene import scene_case
from tracker.sequences.library import open_sequence

GOOD = {"name": "a", "folder": "/x", "cameras": 3, "frames": 9, "fps": 25.0, "opened": 1e9}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"folder": 3.5}, "0.folder: expected a valid string, found 3.5"),
        ({"name": []}, "0.name: expected a valid string"),
        ({"fps": float("nan")}, "0.fps: expected a finite number"),
        ({"name": "\ud800"}, "expected JSON"),
        ({"cameras": "3"}, "0.cameras: expected a valid integer"),
    ],
)
def test_a_spoilt_list_is_kept_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, change: dict[str, object], words: str
) -> None:
    file, folder = tmp_path / "recent.json", tmp_path / "room"
    folder.mkdir()
    (folder / "sequence.toml").touch()
    file.write_text(json.dumps([{**GOOD, "folder": str(folder)}]))
    assert [one.name for one in Recents(Workbench(), file).all()] == ["a"]
    text = json.dumps([{**GOOD, "folder": str(folder), **change}])
    file.write_text(text)
    with caplog.at_level(logging.WARNING):
        assert Recents(Workbench(), file).all() == []
    assert words in caplog.text
    assert (tmp_path / "recent.unreadable.json").read_text() == text


def test_a_built_in_room_is_among_what_was_open(tmp_path: Path) -> None:
    workbench = Workbench()
    recents = Recents(workbench, tmp_path / "recent.json")
    scene_case.show(workbench, open_sequence("room24-2p"))
    recents.close()
    assert [one.name for one in recents.all()] == ["room24-2p"]
    assert [one.name for one in Recents(Workbench(), tmp_path / "recent.json").all()] == [
        "room24-2p"
    ]
