"""A long recording opens without its video in memory, and a page gets what it shows.

``MULTIVIEW_PHD_STEPS=10240`` has it longer.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from app.web.dependencies import Settings
from app.web.server import create_app
from tests.app.conftest import ADDRESS, is_evaluated, run_is, wait_until
from tests.long_recording import write_long

pytestmark = pytest.mark.full

STEPS = int(os.environ.get("MULTIVIEW_PHD_STEPS", "4096"))
"""Of the long recording; a multiple of a page's 256 buckets."""

OPENS = """
import resource, sys, time
import numpy as np
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
def megabytes():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20
before = megabytes()
sequence = read_sequence(sys.argv[1])
with FrameReader(sequence, cache_bytes=8 << 20) as reader:
    for step in np.random.default_rng(0).integers(0, sequence.frames, 25).tolist():
        assert reader.picture(step % 4, step) is not None
    print(megabytes() - before)
"""

FIRST_LOAD = (
    "/", "/api/state", "/api/schema", "/api/timeline", "/api/evaluation",
    "/api/evaluation/series", "/api/step/0",
)  # fmt: skip
"""What a page asks for when it is opened; lengths are multiples of its 256 buckets."""


def opening_takes(folder: Path) -> float:
    """Megabytes that a process grows by when it opens a recording and looks into it."""
    line = [sys.executable, "-c", OPENS, str(folder)]
    return float(subprocess.run(line, capture_output=True, text=True, check=True).stdout)


def first_load(folder: Path) -> dict[str, int]:
    """Bytes of each answer to a page that is opened beside the finished run."""
    app = create_app(Settings(sequence=str(folder), with_viser=False))
    with TestClient(app, base_url=ADDRESS) as client:
        wait_until(run_is(client, "done"), 600.0)
        wait_until(is_evaluated(client), 120.0)
        return {path: len(client.get(f"{path}?buckets=256").content) for path in FIRST_LOAD}


def compare(short: dict[str, int], long: dict[str, int]) -> None:
    """No answer grows with the recording, but for numbers that have more digits."""
    for path, size in long.items():
        if path == "/api/step/0":  # as large as what happens at that step
            assert size < 20_000
        else:
            assert size <= 1.3 * short[path] + 300, path


def test_a_recording_opens_without_its_video_in_memory(tmp_path: Path) -> None:
    folder = write_long(tmp_path / "long", 1500, size=(128, 96))
    decoded = 1500 * 4 * 128 * 96 * 3 / 2**20
    assert decoded > 200.0
    assert opening_takes(folder) < 80.0


def test_the_first_load_of_a_page_does_not_grow(tmp_path: Path) -> None:
    compare(
        first_load(write_long(tmp_path / "short", 512)),
        first_load(write_long(tmp_path / "long", 1536)),
    )


@pytest.mark.long
def test_thousands_of_steps_of_four_cameras(tmp_path: Path) -> None:
    folder = write_long(tmp_path / "long", STEPS, size=(640, 480))
    assert opening_takes(folder) < 120.0
    compare(first_load(write_long(tmp_path / "short", 512)), first_load(folder))
