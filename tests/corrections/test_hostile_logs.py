"""A log that came with a recording leads nowhere and keeps nobody waiting."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tracker.corrections import log


@pytest.fixture(autouse=True)
def _settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MULTIVIEW_PHD_SETTINGS", str(tmp_path / "settings"))


@pytest.mark.parametrize("target", ["/etc/passwd", "/dev/zero", "corrections.toml"])
def test_a_link_out_of_the_folder_is_neither_read_nor_written(tmp_path: Path, target: str) -> None:
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / log.FILE).symlink_to(target)
    assert log.open_log(folder).path == log.own_place(folder)
    assert log.writing_place(folder) == log.own_place(folder)
    assert log.open_log(folder).problem is None


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / log.FILE)
    assert "expected a file, found a folder, pipe" in (log.open_log(tmp_path).problem or "")


@pytest.mark.parametrize("text", ["a = " + "[" * 9000, "format = " + "9" * 9000])
def test_depth_and_digits_get_a_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / log.FILE).write_text(text, encoding="utf-8")
    assert "a few levels and numbers" in (log.open_log(tmp_path).problem or "")
