"""Fingers do what pointers do: nothing needs hovering alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.looking import as_at_first, ask, readout, until
from tests.browser.serving import Server


@pytest.fixture
def touched(browser: Browser, server: Server) -> Iterator[Page]:
    """The page on a screen that is touched, without the 3D view."""
    as_at_first(server)
    ask(server, "POST", "seek", {"step": 45})
    context = browser.new_context(viewport={"width": 1280, "height": 800}, has_touch=True)
    context.set_default_timeout(60_000)
    context.route("**/viser/**", lambda route: route.abort())
    context.add_init_script(
        "localStorage.page ??= JSON.stringify({ dismissed: ['software', 'tour'] })"
    )
    page = context.new_page()
    page.goto(f"{server.address}?step=45")
    page.wait_for_selector(".cam[data-overlay='45']")
    yield page
    context.close()


def test_a_finger_selects_seeks_and_plots(touched: Page, server: Server) -> None:
    page = touched
    step = server.get("/api/step/45").json()
    camera = step["cameras"][0]
    track = next(t for t in camera["tracks"] if t["visible"])
    left, top, width, height = track["box"]
    info = server.get("/api/state").json()["sequence"]["cameras"][0]
    cell = page.locator(".cam").first.bounding_box()
    assert cell is not None
    scale = cell["width"] / info["width"]
    page.touchscreen.tap(
        cell["x"] + (left + width / 2) * scale, cell["y"] + (top + height / 2) * scale
    )
    state = server.wait(lambda state: state["selection"] is not None)
    expect(page.locator(".cam .card:not([hidden])").first).to_contain_text("existence")
    plot = page.locator(".plot").bounding_box()
    assert plot is not None
    page.touchscreen.tap(plot["x"] + plot["width"] / 2, plot["y"] + 14)
    until(page, lambda: 20 < int(readout(page)) < 40, "the step under the finger")
    page.get_by_role("button", name="Plots", exact=True).tap()
    page.locator("#plot-height").tap()
    expect(page.locator(".plot-row")).to_contain_text(f"track {state['selection']}")
