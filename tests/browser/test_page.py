"""The page itself: a link that restores, one selection everywhere, runs compared, tabs in step."""

from __future__ import annotations

import httpx2
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import Server
from tests.browser.test_main_job import readout, until


def patch(server: Server, changes: dict[str, float]) -> None:
    """Change parameters as another program would."""
    answer = httpx2.patch(server.address + "api/parameters", json={"changes": changes})
    assert answer.status_code == 200


def test_a_link_restores_step_selection_camera_and_parameters(
    browser: Browser, server: Server
) -> None:
    server.wait_for_run()
    name = server.get("/api/state").json()["sequence"]["name"]
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page = context.new_page()
    page.goto(
        f"{server.address}?seq={name}&step=33&sel=1&cam=2&p.fusion.detection_probability=0.71"
    )
    until(page, lambda: readout(page) == "33", "the step of the link")
    state = server.wait(lambda state: state["parameters"]["fusion.detection_probability"] == 0.71)
    assert state["selection"] == 1
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    until(page, lambda: "p.fusion.detection_probability=0.71" in page.url, "the address keeps it")
    context.close()
    httpx2.post(server.address + "api/parameters/reset", json={})
    server.wait_for_run()


def test_a_selection_reaches_every_view(page: Page, server: Server) -> None:
    lanes, rows = page.locator(".lane"), page.locator("#panel-tracks tbody tr")
    expect(lanes.first).to_be_visible()
    lanes.first.click()
    expect(lanes.first).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#panel-tracks tr[aria-selected=true]")).to_have_count(1)
    chosen = server.wait(lambda state: state["selection"] is not None)["selection"]
    assert f"Track {chosen}" == lanes.first.get_attribute("aria-label")
    page.keyboard.press("Escape")
    server.wait(lambda state: state["selection"] is None)
    expect(page.locator("#panel-tracks tr[aria-selected=true]")).to_have_count(0)
    rows.last.click()
    server.wait(lambda state: state["selection"] is not None)
    expect(page.locator(".lane[aria-pressed=true]")).to_have_count(1)
    page.keyboard.press("Escape")
    server.wait(lambda state: state["selection"] is None)


def test_a_pinned_run_is_compared_with_the_engines_figures(page: Page, server: Server) -> None:
    page.get_by_role("tab", name="Compare").click()
    pin = page.get_by_role("button", name="Pin as A")
    expect(pin).to_be_enabled(timeout=20_000)
    pin.click()
    server.wait(lambda state: state["pinned"] is not None)
    patch(server, {"fusion.detection_probability": 0.5})
    server.wait_for_run()
    expect(page.get_by_role("table", name="Parameters that differ")).to_contain_text(
        "0.5", timeout=20_000
    )
    told = server.get("/api/evaluation/comparison").json()
    mota = next(row for row in told["rows"] if row["label"] == "MOTA")
    row = page.get_by_role("table", name="Figures").locator("tr", has_text="MOTA")
    expect(row).to_contain_text(f"{mota['a']:.{mota['digits']}f}")
    expect(row).to_contain_text(f"{mota['b']:.{mota['digits']}f}")
    httpx2.delete(server.address + "api/run/pin")
    httpx2.post(server.address + "api/parameters/reset", json={})
    server.wait_for_run()


def test_two_tabs_stay_in_step(page: Page, server: Server) -> None:
    other = page.context.new_page()
    other.goto(server.address)
    until(other, lambda: readout(other) == readout(page), "both at one step")
    page.bring_to_front()
    page.keyboard.press("Home")
    page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "10", "ten steps on")
    other.bring_to_front()
    until(other, lambda: readout(other) == "10", "the other tab follows")
    other.close()


def test_the_palette_does_what_its_words_say(page: Page) -> None:
    expect(page.locator(".lane").first).to_be_visible()  # whoever presses keys sees the page
    page.frame_locator("section.view iframe").locator("canvas").first.wait_for()
    page.keyboard.press("Control+k")
    page.keyboard.type("cameras alone")
    page.keyboard.press("Enter")
    expect(page.locator(".app")).to_have_attribute("data-max", "cams")
    expect(page.locator("section.view")).to_be_hidden()
    page.keyboard.press("Escape")
    expect(page.locator("section.view")).to_be_visible()
    splitter = page.get_by_role("separator", name="Width of cameras and tables")
    splitter.focus()
    before = page.locator("section.side").bounding_box()
    page.keyboard.press("Shift+ArrowLeft")
    until(
        page,
        lambda: page.locator("section.side").bounding_box()["width"] > before["width"] + 40,
        "the tables are wider",
    )
