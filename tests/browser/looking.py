"""What a person sees on the page, as values: numbers in pictures, the readout, the 3D view."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable

import cv2
import httpx2
import numpy as np
from numpy import ndarray
from playwright.sync_api import Error, FloatRect, Frame, Locator, Page

from tests.browser.serving import Server
from tests.conftest import PATIENCE
from tests.synthetic import number_in


def viser(page: Page) -> Frame:
    """The 3D view inside the page, once it is connected."""
    page.wait_for_selector("iframe")
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        for frame in page.frames:
            if "/viser/" in frame.url and shown_in_3d(frame) is not None:
                return frame
        page.wait_for_timeout(100)
    raise AssertionError(f"the 3D view did not connect within {PATIENCE} s")


def until(page: Page, condition: Callable[[], bool], what: str, seconds: float = PATIENCE) -> None:
    """Wait for an end state: the software renderer draws a few frames a second."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"not within {seconds} s: {what}")


def until_still(page: Page, box: FloatRect) -> None:
    """Wait until a part of the window looks the same as half a second ago: nothing flies there."""
    before = b""

    def still() -> bool:
        nonlocal before
        now, then = page.screenshot(clip=box), before
        before = now
        page.wait_for_timeout(500)
        return now == then

    until(page, still, "the view stands still")


def painted(page: Page) -> list[ndarray]:
    """The cameras' canvases as they are, pictures and overlays."""
    pictures = []
    # all at one moment
    for url in page.locator(".cam canvas").evaluate_all(
        "all => all.map(canvas => canvas.toDataURL('image/png'))"
    ):
        data = np.frombuffer(base64.b64decode(url.partition(",")[2]), dtype=np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert picture is not None
        pictures.append(np.asarray(picture))
    return pictures


def numbers_in_pictures(page: Page) -> list[int]:
    """What number each camera's picture says it is."""
    small = [cv2.resize(p, (192, 144), interpolation=cv2.INTER_AREA) for p in painted(page)]
    return [number_in(np.asarray(picture)) for picture in small]


def overlay_steps(page: Page) -> list[str | None]:
    """The step whose results are drawn over each picture."""
    steps: list[str | None] = page.locator(".cam").evaluate_all(
        "all => all.map(cam => cam.getAttribute('data-overlay'))"
    )
    return steps


def clear_overlays(page: Page) -> None:
    """Switch every layer off, so that no box covers the number."""
    chips = page.get_by_role("group", name="Layers in the pictures").get_by_role("button")
    for chip in chips.all():
        if chip.get_attribute("aria-pressed") == "true":
            chip.click()


def readout(page: Page) -> str:
    """The step that the transport says is shown."""
    return page.get_by_label("Go to step", exact=True).inner_text().split("/")[0].strip()


def shown_in_3d(frame: Frame) -> str | None:
    """The step that the 3D view says it shows; none while it is being loaded."""
    try:
        status = frame.query_selector("[data-state][data-step]")
        return status.get_attribute("data-step") if status else None
    except Error:  # loaded again in between: after a loss the page does so by itself
        return None


def ask(server: Server, method: str, path: str, body: dict | None = None) -> dict:
    """Have the server do something, as another program would."""
    answer = httpx2.request(method, server.address + f"api/{path}", json=body, timeout=30.0)
    assert answer.status_code == 200, answer.text
    state: dict = answer.json()
    return state


def still(locator: Locator) -> FloatRect:
    """Where an element is once it stands still: rows that arrive move those below."""
    before, box = None, locator.bounding_box()
    while box is None or box != before:
        locator.page.wait_for_timeout(300)
        before, box = box, locator.bounding_box()
    return box


def as_at_first(server: Server) -> None:
    """Defaults, nothing pinned, nothing selected, nobody alone, the first step; and its run."""
    ask(server, "DELETE", "run/pin")
    server.command("reset_parameters")
    ask(server, "POST", "select", {"id": None})
    ask(server, "POST", "seek", {"step": 0})
    # a window that is closed at once takes what it switched last with it
    ask(server, "PATCH", "layers", {"changes": {"others": True}})
    server.wait_for_run()


_OPENED = """() => new Promise((done, late) => {
  // From the click until the lanes of the opened run are in the timeline and painted.
  const button = [...document.querySelectorAll('.lib .btn')].find(
    (one) => one.textContent === 'Open in Tune');
  const time = document.querySelector('.time');
  const lanes = time.querySelector('.lanes');
  const begin = performance.now();
  let renewed = false;  // those of the run before stay until then, and are marked
  new MutationObserver(() => (renewed = !lanes.matches('.old'))).observe(
    lanes, { childList: true, attributeFilter: ['class'] });
  setTimeout(() => late(new Error('the lanes were not painted')), 30000);
  const look = () => {
    const there = renewed && time.checkVisibility() && time.querySelectorAll('.lane').length >= 3
      && !document.querySelector('#tab-changes .count:not([hidden])');
    if (!there) return requestAnimationFrame(look);
    requestAnimationFrame(() => done(performance.now() - begin));
  };
  button.click();
  requestAnimationFrame(look);
})"""


def open_kept(page: Page) -> float:
    """Have the run that the library shows in small opened; milliseconds until its lanes show."""
    taken: float = page.evaluate(_OPENED)
    return taken


def by_palette(page: Page, words: str) -> None:
    """Do what a command's words say, once the palette offers it."""
    page.keyboard.press("Control+k")
    page.keyboard.type(words)
    page.locator("dialog[open] [role=option]").first.wait_for()
    page.keyboard.press("Enter")
