"""``templates``: listed, offered by a run, added and removed, in a terminal."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import pytest

from app.command.main import main
from tests.browser.walkers import write_walkers
from tracker.sequences.reader import FILE, read_sequence


@pytest.fixture
def walkers(tmp_path: Path) -> Path:
    """A recording with pictures, boxes of two people by two cameras, and no template."""
    return write_walkers(tmp_path / "walkers")


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Status and what a command writes to both streams."""
    status = main(["templates", *arguments])
    streams = capsys.readouterr()
    return status, streams.out, streams.err


def test_what_a_run_offers_is_listed_shown_added_and_removed(
    walkers: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (walkers / FILE).read_bytes()
    status, out, err = told(capsys, "list", str(walkers))
    assert (status, out) == (0, "")
    assert "has no templates" in err

    crops = tmp_path / "crops"
    status, out, err = told(capsys, "offer", str(walkers), "--pictures", str(crops))
    assert status == 0, err
    assert "2 cameras agree" in out
    offered = out.count("2 cameras agree")
    assert f"{offered} pictures written to {crops}" in err
    assert cv2.imread(str(crops / f"{offered}.png")) is not None
    assert (walkers / FILE).read_bytes() == before  # to look at them adds nothing

    status, out, _ = told(capsys, "offer", str(walkers), "--json")
    every = json.loads(out)
    assert len(every) == offered
    status, _, err = told(capsys, "offer", str(walkers), "--add", "1", str(offered))
    assert status == 0, err
    assert f"2 of {offered} added" in err
    added = read_sequence(walkers).templates
    assert [(t.camera, t.frame) for t in added] == [
        (one["camera"], one["frame"]) for one in (every[0], every[-1])
    ]
    assert (walkers / f"{FILE}.bak").read_bytes() == before

    status, out, _ = told(capsys, "list", str(walkers), "--json")
    assert [one["box"] for one in json.loads(out)] == [every[0]["box"], every[-1]["box"]]
    status, _, err = told(capsys, "remove", str(walkers), "1")
    assert status == 0, err
    (left,) = read_sequence(walkers).templates
    assert left.frame == every[-1]["frame"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("remove", "1"), "NUMBER: expected none, since there is none, got 1"),
        (("offer", "--add", "99"), "--add: expected a number from 1 to "),
        (("offer", "--add", "1", "--add-all"), "--add and --add-all: expected one of them"),
    ],
)
def test_a_number_that_is_none_is_refused(
    walkers: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    before = (walkers / FILE).read_bytes()
    status, _, err = told(capsys, arguments[0], str(walkers), *arguments[1:])
    assert status == 1
    assert words in err
    assert (walkers / FILE).read_bytes() == before


def test_a_built_in_room_is_looked_at_and_not_written(capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = told(capsys, "offer", "room24-2p", "--add-all")
    assert status == 1
    refused = "room24-2p comes with the program and is never written to; copy its folder"
    assert refused in err
    status, _, err = told(capsys, "remove", "room24-2p", "1")
    assert status == 1
    assert refused in err
