"""Every file that is read counts as used, and of the others it is said why they are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.io.folders import make_folder
from tracker.io.importing.gathering import file_uses, gather
from tracker.io.importing.options import ImportOptions
from tracker.io.importing.settling import settle

CAMERA = """[cam_{n}]
name = "cam{n}"
size = [1280, 720]
matrix = [[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]]
distortions = [0.0, 0.0, 0.0, 0.0, 0.0]
rotation = [1.2, {turn}, 0.3]
translation = [0.0, 0.5, 6.0]
"""


def rows_of(people: str, flag: int) -> str:
    """MOTChallenge's ground truth of a few frames: of a class, counted or not."""
    return "".join(f"{k},1,{300 + 4 * k},200,60,180,{flag},{people},1\n" for k in range(1, 40))


def recording(folder: Path) -> Path:
    """Two cameras with annotations that name their classes, and files that nobody reads."""
    text = "".join(CAMERA.format(n=n, turn=turn) for n, turn in ((1, -0.8), (2, 0.8)))
    (folder / "calibration.toml").write_text(text)
    for n in (1, 2):
        place = folder / f"cam{n}" / "gt"
        place.mkdir(parents=True)
        (place / "gt.txt").write_text(rows_of("2", 1))
        (place / "labels.txt").write_text("car\nperson\n")
    (folder / "notes.txt").write_text("the door was open\n")
    stranger = folder / "hall" / "gt"
    stranger.mkdir(parents=True)
    (stranger / "gt.txt").write_text(rows_of("1", 1))
    return folder


def test_what_is_read_with_another_file_is_used_where_that_one_is(tmp_path: Path) -> None:
    taken = gather([recording(tmp_path)])
    settled = settle(taken, ImportOptions(fps=25.0, accept_best=True))
    uses = {one.files.label: one for one in file_uses(taken, settled.sources)}
    assert {label: one.used for label, one in uses.items()} == {
        "calibration.toml": 1,
        "cam1/gt/gt.txt": 1,
        "cam1/gt/labels.txt": 1,
        "cam2/gt/gt.txt": 1,
        "cam2/gt/labels.txt": 1,
        "hall/gt/gt.txt": 0,
        "notes.txt": 0,
    }
    assert uses["cam2/gt/labels.txt"].files.read_with == "cam2/gt/gt.txt"
    assert uses["notes.txt"].why == "no format that is read"
    assert any(told.startswith("hall/gt/gt: belongs to no camera") for told in settled.told)
    # before anything is settled, what was read counts
    assert sum(one.used for one in file_uses(taken, None)) == 6


def test_the_lenses_of_a_model_are_used_with_its_poses(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 640 480 500 500 320 240\n")
    (tmp_path / "images.txt").write_text(
        "1 1 0 0 0 0 0 3 1 cam1.jpg\n\n2 0.9 0.1 0.3 0.3 0 0 4 1 cam2.jpg\n\n"
    )
    (tmp_path / "points3D.txt").write_text("# nothing\n")
    uses = {one.files.label: one.used for one in file_uses(gather([tmp_path]), None)}
    assert uses == {"cameras.txt": 1, "images.txt": 1, "points3D.txt": 0}


def test_files_are_counted_not_their_series(tmp_path: Path) -> None:
    known = make_folder(tmp_path, np.random.default_rng([9, 1]), "none", 40)
    taken = gather([tmp_path])
    there = sum(path.is_file() for path in tmp_path.rglob("*"))
    assert sum(one.count for one in taken) == there
    options = known.options.model_copy(update={"accept_best": True})
    uses = file_uses(taken, settle(taken, options).sources)
    assert sum(one.used for one in uses) == there, [(one.files.label, one.used) for one in uses]
