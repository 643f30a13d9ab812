"""From a stranger's files to tracks: by the page, dropped on it, and by two commands.

A random room, rendered with the boxes that a detector would find, is written as other programs
leave a recording: OpenCV's calibration in millimetres, AVI, MOTChallenge's text.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
from playwright.sync_api import sync_playwright

from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server
from tests.browser.work.test_opening import drop
from tests.conftest import CHROMIUM_FLAGS
from tests.manual.places import ROOT
from tests.rooms import render_random
from tracker.sequences.library import open_sequence
from tracker.sequences.sequence import Sequence

SEED = 7103
RUNS = 3


def run(short: bool) -> Iterator[Measurement]:
    """The median of three runs; the short form has one."""
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        render_random(SEED, place / "room", detections=True)
        sequence = open_sequence(place / "room")
        files = _as_of_others(sequence, place / "visit")
        runs = 1 if short else RUNS
        words = f"{len(sequence.views)} cameras, {sequence.frames} steps of a stranger's files"
        commands = [_by_command(files, place / f"command-{n}") for n in range(runs)]
        for what, taken in zip(("import", "track"), zip(*commands, strict=True), strict=True):
            yield Measurement(f"opening: {words}, {what}", statistics.median(taken), "s")
        total = statistics.median(sum(taken) for taken in commands)
        yield Measurement(f"opening: {words}, by command in all", total, "s", "≤ 120 s")
        if shutil.which("chromium") or shutil.which("chromium-browser"):
            pages = [_by_page(files, place / f"page-{n}") for n in range(runs)]
            for what, taken, aim in zip(
                ("can be imported", "first tracks"), zip(*pages, strict=True), ("", "≤ 300 s"),
                strict=True,
            ):  # fmt: skip
                median = statistics.median(taken)
                yield Measurement(f"opening: {words}, dropped until {what}", median, "s", aim)


def _app(*words: str) -> None:
    line = [sys.executable, "-m", "app", *words]
    subprocess.run(line, check=True, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _as_of_others(sequence: Sequence, folder: Path) -> Path:
    folder.mkdir()
    storage = cv2.FileStorage(str(folder / "calibration.yml"), cv2.FILE_STORAGE_WRITE)
    for view in sequence.views:
        camera, number = view.camera, view.camera.name.removeprefix("cam")
        storage.write(f"K_{number}", camera.intrinsics)
        storage.write(f"dist_{number}", camera.distortion)
        storage.write(f"R_{number}", cv2.Rodrigues(camera.rotation)[0])
        storage.write(f"T_{number}", 1000.0 * camera.translation)
        assert view.detections is not None
        rows = zip(
            view.detections.frames + 1, view.detections.boxes, view.detections.scores, strict=True
        )
        (folder / f"{number}.txt").write_text(
            "".join(
                f"{frame},-1,{','.join(f'{side:.2f}' for side in box)},{score:.3f},-1,-1,-1\n"
                for frame, box, score in rows
            )
        )
        shutil.copy(next(sequence.folder.glob(f"{camera.name}.avi")), folder / f"{number}.avi")
    storage.release()
    return folder


def _by_command(files: Path, folder: Path) -> tuple[float, float]:
    """Seconds of the two commands."""
    begin = time.perf_counter()
    _app("import", str(files), "-o", str(folder))
    between = time.perf_counter()
    _app("track", str(folder), "-o", str(folder / "tracks.csv"), "--no-cache", "--keep", "0")
    return between - begin, time.perf_counter() - between


def _by_page(files: Path, folder: Path) -> tuple[float, float]:
    """Seconds from the drop until it can be imported, and until there are tracks."""
    (folder / "data").mkdir(parents=True)
    server = Server("room24-2p", folder / "cache", data=folder / "data")
    with sync_playwright() as playwright:
        path = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        try:
            server.wait_for_run(600.0)
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.route("**/viser/**", lambda route: route.abort())
            page.goto(server.address)
            page.locator(".cam canvas").first.wait_for()
            begin = time.perf_counter()
            drop(page, files)
            page.locator("[data-do=track]:enabled").wait_for(timeout=120_000)
            ready = time.perf_counter()
            page.keyboard.press("Control+Enter")
            server.wait(
                lambda now: now["sequence"]["name"] == files.name and now["run"]["done"] > 0, 120.0
            )
            while not server.get("/api/timeline").json()["tracks"]:
                time.sleep(0.1)
                assert time.perf_counter() - ready < 300.0
            return ready - begin, time.perf_counter() - begin
        finally:
            browser.close()
            server.stop()
