"""The manual's pictures of the page, of a built-in sequence: ``tests.manual --pictures``."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy import ndarray
from playwright.sync_api import FloatRect, Page

from tests.browser.looking import ask
from tests.browser.serving import Server
from tests.conftest import chromium, chromium_path
from tests.manual.places import PAGES, ROOT

ROOM, STEP, PERSON = "room44-3p", 438, 3
WIDTH = 360
"""Pixels of the room's pictures."""

CHANGED = {"fusion.detection_probability": 0.6}
"""What a pinned run is compared with."""


def record() -> None:
    """Start the workbench and take all of them anew; the README has the first too.

    Raises:
        FileNotFoundError: If there is no Chromium.
    """
    path = chromium_path()
    if path is None:
        raise FileNotFoundError("expected Chromium to take pictures with, found none: install it")
    with tempfile.TemporaryDirectory() as cache, chromium(path) as browser:
        server = Server(ROOM, Path(cache))
        try:
            context = browser.new_context(
                viewport={"width": 1600, "height": 1000}, color_scheme="dark"
            )
            context.add_init_script("localStorage.page = JSON.stringify({ dismissed: ['tour'] })")
            page = context.new_page()
            page.goto(server.address)
            page.locator(".cam canvas").first.wait_for()
            show(server, STEP, PERSON)
            keep(page, "workbench")
            shutil.copy(place("workbench"), ROOT / ".readme" / "workbench.jpg")
            why(page, server)
            compared(page, server)
        finally:
            server.stop()


def show(server: Server, step: int, person: int) -> None:
    """A step and a person, when the run is there with its smoothing."""
    server.wait(lambda state: bool(state["run"]["smoothed"]), seconds=600.0)
    ask(server, "POST", "seek", {"step": step})
    ask(server, "POST", "select", {"id": person})


def why(page: Page, server: Server) -> None:
    """The card of somebody whom another person hides in a camera."""
    step, camera, person, (x, y) = next(hidden(server))
    show(server, step, person)
    cell = page.locator(".cam").nth(camera).locator("canvas").first.bounding_box()
    pane = page.locator(".pane.cams").bounding_box()
    assert cell is not None
    keep(page, "why", pane)
    scale = cell["width"] / WIDTH
    page.mouse.move(cell["x"] + x * scale, cell["y"] + y * scale)
    page.locator(".cam .card:visible").wait_for()
    keep(page, "why", pane)
    page.mouse.move(0, 0)


def hidden(server: Server) -> Iterator[tuple[int, int, int, tuple[float, float]]]:
    """Step, camera and person where another hides it, and a pixel of its box that is not both's."""
    for step in range(STEP - 100, STEP + 150):
        for camera, view in enumerate(server.get(f"/api/step/{step}").json()["cameras"]):
            by_id: dict[int, Any] = {one["id"]: one for one in view["tracks"]}
            for own in view["tracks"]:
                other = by_id.get(own["hidden_by"])
                if own["seen"] or other is None or not own["box"] or not other["box"]:
                    continue
                left, top, width, height = own["box"]
                for x in (left + 0.1 * width, left + 0.9 * width):
                    if not -5.0 < x - other["box"][0] < other["box"][2] + 5.0:
                        yield step, camera, own["id"], (x, top + 0.5 * height)


def compared(page: Page, server: Server) -> None:
    """A pinned run beside a changed one."""
    page.get_by_role("tab", name="Compare").click()
    page.get_by_role("button", name="Pin as A").click()
    page.mouse.move(0, 0)
    server.wait(lambda state: state["pinned"] is not None)
    server.command("set_parameters", changes=CHANGED)
    show(server, STEP, PERSON)
    keep(page, "compare")


def place(name: str) -> Path:
    """Where a picture lies."""
    return PAGES / "images" / f"{name}.jpg"


def keep(page: Page, name: str, clip: FloatRect | None = None) -> None:
    """Write what the page shows when it has come to rest."""
    before: ndarray | None = None
    for _ in range(30):
        page.wait_for_timeout(2000)
        now = np.frombuffer(page.screenshot(clip=clip), np.uint8)
        if before is not None and np.array_equal(before, now):
            break
        before = now
    picture = cv2.imdecode(now, cv2.IMREAD_COLOR)
    cv2.imwrite(str(place(name)), picture, [cv2.IMWRITE_JPEG_QUALITY, 88])
