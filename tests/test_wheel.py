"""What an installation has: a wheel built of the checkout, listed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from tracker.sequences.built_in import BUILT_IN

ROOT = Path(__file__).resolve().parents[1]

ROOMS = "tracker/sequences/rooms/"
MOST_BYTES = 8e6
"""The built-in sequences are no larger, all together."""


@pytest.mark.full
def test_the_wheel_has_engine_page_manual_and_built_in_sequences(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(tmp_path)]
    subprocess.run([*line, str(ROOT)], check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with ZipFile(wheel) as archive:
        size_of = {one.filename: one.file_size for one in archive.infolist()}
    assert {name.partition("/")[0] for name in size_of if ".dist-info" not in name} == {
        "app",
        "tracker",
    }
    # neither the experiments nor the generator of rooms, which are the tests'
    assert not [name for name in size_of if "experiment" in name or "rendering" in name]
    checkout = {
        path.relative_to(ROOT).as_posix()
        for package in ("app", "tracker")
        for path in (ROOT / package).rglob("*.py")
        if "__pycache__" not in path.parts
    }
    assert checkout <= size_of.keys()
    assert {"app/static/index.html", "app/manual/index.html"} <= size_of.keys()
    for room in BUILT_IN:
        kept = {path.name for path in (ROOT / ROOMS / room).iterdir()}
        assert kept == {name.rpartition("/")[2] for name in size_of if f"{ROOMS}{room}/" in name}
        assert {"sequence.toml", "cam1.mp4", "ground_truth.csv"} <= kept
    assert sum(size for name, size in size_of.items() if name.startswith(ROOMS)) <= MOST_BYTES
