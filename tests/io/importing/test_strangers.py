"""What belongs to no camera, and cameras that are calibrated in part, are named whole."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.io.importing.test_usage import CAMERA
from tracker.io.importing.gathering import gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import settle
from tracker.io.read.pieces import FormatError

BOXES = "frame,left,top,width,height\n" + "".join(f"{k},{300 + k},200,60,180\n" for k in range(40))
OPTIONS = ImportOptions(fps=25.0, accept_best=True)


def cameras(folder: Path, texts: dict[int, str]) -> Path:
    """Cameras and their boxes; the text is what a camera has besides its name and size."""
    text = ""
    for n, own in texts.items():
        text += f'[cam_{n}]\nname = "cam{n}"\nsize = [1280, 720]\n{own}'
        (folder / f"cam{n}.csv").write_text(BOXES)
    (folder / "calibration.toml").write_text(text)
    return folder


def test_all_files_that_belong_to_no_camera_are_named(tmp_path: Path) -> None:
    text = "".join(CAMERA.format(n=n, turn=n) for n in (1, 2, 3))
    (tmp_path / "calibration.toml").write_text(text)
    for name in ("x", "y"):
        (tmp_path / f"{name}.csv").write_text(BOXES)
    with pytest.raises(FormatError) as refusal:
        settle(gather([tmp_path]), OPTIONS)
    words = "x, y: belong to no camera of the calibration (cam1, cam2, cam3); --camera NAME=FILE"
    assert words in str(refusal.value)


def test_a_camera_that_is_calibrated_in_part_lacks_what_it_lacks(tmp_path: Path) -> None:
    lens = "".join(CAMERA.format(n=0, turn=1).splitlines(keepends=True)[3:5])
    pose = "rotation = [1.2, {turn}, 0.3]\ntranslation = [0.0, 0.5, 6.0]\n"
    whole = {n: lens + pose.format(turn=turn) for n, turn in ((1, -0.8), (2, 0.8))}
    plan = settle(gather([cameras(tmp_path, {**whole, 3: lens, 4: lens})]), OPTIONS)
    (words,) = (told for told in plan.told if "unlike the others" in told)
    assert "cam3, cam4: no pose, unlike the others" in words
    assert "lens" not in words
