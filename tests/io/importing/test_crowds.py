"""Thousands of files that nobody knows are not opened one by one, and that is told."""

from __future__ import annotations

import random
import string
from pathlib import Path

import pytest

from tests.io.read.recorded import detections, toml
from tracker.io.importing.gathering import gather
from tracker.io.read.source import SourceFile


def _strange(folder: Path, count: int, ending: str) -> None:
    folder.mkdir(exist_ok=True)
    some = random.Random(7)
    for _ in range(count):
        name = "".join(some.choices(string.ascii_lowercase, k=10))
        (folder / f"{name}{ending}").write_text("nobody knows what this is, or means\n")


def test_of_a_crowd_that_nobody_knows_most_are_not_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _strange(tmp_path / "notes", 700, ".txt")
    toml(tmp_path)
    detections(tmp_path)
    # between them in the order of names, but of another size
    (tmp_path / "notes" / "mm.txt").write_text("frame,left,top,width,height\n" + "1,2,3,4,5\n" * 9)
    opened: list[str] = []
    head = SourceFile.head.func
    monkeypatch.setattr(
        SourceFile, "head", property(lambda own: opened.append(own.where) or head(own))
    )
    taken = gather([tmp_path])
    known = [one.label for one in taken if one.pieces]
    assert "notes/mm.txt" in known
    assert len(known) == len({*known}) >= 3
    assert len({name for name in opened if name.startswith("notes/")}) == 201
    (told,) = (one for one in taken if "not opened" in one.complaint)
    assert told.label == "notes/….txt (500)"
    assert told.complaint.endswith(
        "200 of these files are of no format that is read, so 500 more of like size were not "
        "opened; name those that are wanted"
    )


def test_where_one_of_them_is_known_all_are_opened(tmp_path: Path) -> None:
    _strange(tmp_path / "notes", 300, ".txt")
    (tmp_path / "notes" / "aa.txt").write_text(
        "frame,left,top,width,height\n0,2,3,4,5\n1,2,3,4,5\n"
    )
    taken = gather([tmp_path])
    assert len(taken) == 301
