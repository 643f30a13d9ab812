"""Opening a kept run: from the click to its lanes in the timeline."""

from __future__ import annotations

import shutil
import statistics
import tempfile
from collections.abc import Iterator
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from tests.benchmarks.measure import Measurement
from tests.browser.looking import ask, open_kept
from tests.browser.serving import Server
from tests.browser.work.test_library import kept
from tests.conftest import CHROMIUM_FLAGS
from tests.long_recording import write_long

STEPS = 1500


def run(short: bool) -> Iterator[Measurement]:
    """Three people over 1,500 steps; the short form has 300. Without the 3D view."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        return
    steps = STEPS // 5 if short else STEPS
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = write_long(Path(name) / "long", steps, cameras=2)
        server = Server(folder, Path(name) / "cache")
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        try:
            server.wait_for_run(600.0)
            kept(server, 1)
            server.command("set_parameters", changes={"fusion.detection_probability": 0.8})
            kept(server, 2)
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.route("**/viser/**", lambda route: route.abort())
            page.goto(server.address)
            page.locator(".cam canvas").first.wait_for()
            taken = [_opened(page, server) for _ in range(3 if short else 12)]
        finally:
            browser.close()
            server.stop()
    words = f"page: a kept run of {steps} steps and 3 people is opened"
    yield Measurement(f"{words}, median", statistics.median(taken), "ms", "≤ 300 ms")
    yield Measurement(f"{words}, slowest", max(taken), "ms")


def _opened(page: Page, server: Server) -> float:
    """The first run, while the second is shown; milliseconds."""
    ask(server, "POST", "library/runs/2/open")
    page.get_by_role("link", name="Library").click()
    page.locator('tr[data-run="1"]').click()
    page.locator(".pv-lanes").wait_for()
    page.wait_for_timeout(1000)  # what is read on arriving there is over
    taken = open_kept(page)
    page.wait_for_timeout(300)
    return taken
