"""Fingers do what pointers do: nothing needs hovering alone."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, CDPSession, Page, expect

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
    context.add_init_script("localStorage.page ??= JSON.stringify({ dismissed: ['tour'] })")
    page = context.new_page()
    page.goto(f"{server.address}?step=45")
    page.wait_for_selector(".cam[data-overlay='45']")
    # read a moment after the page
    expect(page.locator(".menu.corrects")).to_have_count(1)
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


def test_a_finger_held_still_opens_the_menu_of_a_track(touched: Page) -> None:
    menu = touched.locator(".menu.corrects")
    for place in (touched.locator(".lane").first, touched.locator(".cam").first):
        box = place.bounding_box()
        assert box is not None
        _finger(touched, [(box["x"] + 12, box["y"] + box["height"] / 2)])
        expect(menu).to_be_visible()
        _finger(touched, [])
        touched.wait_for_timeout(400)  # letting go is no press elsewhere, which would close it
        expect(menu).to_be_visible()
        touched.keyboard.press("Escape")
        expect(menu).to_be_hidden()


def test_two_fingers_zoom_the_timeline(touched: Page) -> None:
    plot = touched.locator(".plot").bounding_box()
    assert plot is not None
    x, y = plot["x"] + plot["width"] / 2, plot["y"] + 60
    _finger(touched, [(x - 60, y)])
    _finger(touched, [(x - 60, y), (x + 60, y)])
    for apart in (90, 120, 150):
        _finger(touched, [(x - apart, y), (x + apart, y)], "touchMove")
    _finger(touched, [])
    until(touched, lambda: "zoom=" in touched.url, "a part of the timeline is shown")


def test_a_pen_drags_along_the_timeline_and_reads_its_values(touched: Page) -> None:
    plot = touched.locator(".plot").bounding_box()
    assert plot is not None
    _pen(touched, "mousePressed", plot["x"] + plot["width"] / 4, plot["y"] + 14)
    _pen(touched, "mouseMoved", plot["x"] + plot["width"] / 2, plot["y"] + 14)
    expect(touched.locator(".hint-card")).to_contain_text("step")
    _pen(touched, "mouseReleased", plot["x"] + plot["width"] / 2, plot["y"] + 14)
    until(touched, lambda: 25 < int(readout(touched)) < 35, "the step under the pen")


def _finger(page: Page, places: list[tuple[float, float]], kind: str = "touchStart") -> None:
    """Fingers at some places of the window; none: they are lifted."""
    points = [{"x": x, "y": y, "id": index} for index, (x, y) in enumerate(places)]
    how = {"type": kind if points else "touchEnd", "touchPoints": points}
    _devtools(page).send("Input.dispatchTouchEvent", how)


def _pen(page: Page, kind: str, x: float, y: float) -> None:
    how = {"type": kind, "x": x, "y": y, "button": "left", "pointerType": "pen"}
    pressed = {"buttons": 0 if kind == "mouseReleased" else 1, "clickCount": 1}
    _devtools(page).send("Input.dispatchMouseEvent", how | pressed)


_SESSIONS: dict[Page, CDPSession] = {}


def _devtools(page: Page) -> CDPSession:
    if page not in _SESSIONS:
        _SESSIONS[page] = page.context.new_cdp_session(page)
    return _SESSIONS[page]
