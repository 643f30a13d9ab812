"""Folders of files to import: links that leave them, pictures, a spoilt file among good ones."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from tracker.io.importing.gathering import gather
from tracker.io.read.pieces import FormatError


def test_links_out_of_the_folder_are_not_followed(tmp_path: Path) -> None:
    inside, outside = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    outside.mkdir()
    secret = outside / "secret.json"
    secret.write_text(json.dumps([{"image_id": 1, "bbox": [1, 2, 3, 4], "score": 1}]))
    (inside / "link.json").symlink_to(secret)
    (inside / "folder").symlink_to(outside)
    (inside / "circle").symlink_to(inside / "circle")
    os.mkfifo(inside / "pipe.json")
    taken = gather([inside])
    assert len(taken) == 4
    assert all(not one.pieces and one.complaint for one in taken)


def test_one_spoilt_file_of_several_cameras_costs_no_other(tmp_path: Path) -> None:
    for number in range(1, 5):
        rows = "".join(f"{frame},10,20,30,80\n" for frame in range(9))
        rows = "0,10,20\0\0" if number == 3 else rows
        (tmp_path / f"cam{number}.csv").write_text(f"frame,left,top,width,height\n{rows}")
    spoilt, whole = gather([tmp_path])
    assert spoilt.label == "cam3.csv"
    assert "cam3.csv: expected text" in spoilt.complaint
    assert whole.label == "cam1.csv … (3)"
    assert [piece.source.name for piece in whole.pieces] == ["cam1.csv", "cam2.csv", "cam4.csv"]


def test_pictures_that_are_none_are_told(tmp_path: Path) -> None:
    for number in range(3):
        (tmp_path / f"{number:03}.jpg").write_bytes(b"\xff\xd8\xff\xe0" + bytes(60))
    (one,) = gather([tmp_path])
    assert "000.jpg: cannot be read as a picture (64 bytes); expected a whole JPEG" in one.complaint


def test_what_is_not_there_is_said() -> None:
    with pytest.raises(FormatError, match="no such file"):
        gather([Path("/nowhere/at/all")])
