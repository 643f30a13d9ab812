"""The server ends and is started again: the page says so, and goes on by itself."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.looking import readout, shown_in_3d, until, viser
from tests.browser.serving import Server


def test_the_page_and_the_3d_view_recover_where_they_were(page: Page, server: Server) -> None:
    viser(page)
    page.keyboard.press("Home")
    for _ in range(2):
        page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "20", "step 20")
    theme = page.locator("html").get_attribute("data-theme")
    page.keyboard.press("Shift+D")
    chosen = "light" if theme == "dark" else "dark"
    server.wait(lambda state: state["theme"] == chosen)
    server.stop()
    expect(page.get_by_text("No connection since")).to_be_visible(timeout=20_000)
    expect(page.get_by_text("3D view lost")).to_be_visible()
    server.start()
    server.wait_for_run()
    expect(page.get_by_text("No connection since")).to_be_hidden(timeout=30_000)
    until(page, lambda: readout(page) == "20", "the page is where it was")
    scene = viser(page)
    until(page, lambda: shown_in_3d(scene) == "20", "so is the 3D view")
    server.wait(lambda state: state["theme"] == chosen)
    expect(page.locator("html")).to_have_attribute("data-theme", chosen)


def test_a_new_start_takes_up_where_this_browser_was(flat_page: Page, server: Server) -> None:
    page = flat_page
    server.command("set_parameters", changes={"fusion.detection_probability": 0.8})
    server.wait_for_run()
    page.get_by_role("tab", name="Runs").click()
    page.keyboard.press("Home")
    for _ in range(3):
        page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "30", "step 30")
    until(page, lambda: "step=30" in page.url and "0.8" in page.url, "the address")
    page.goto(f"{server.address}static/icon.svg")
    server.stop()
    server.start()
    server.wait_for_run()
    # the parameters are the recording's, whether or not a page comes back
    assert server.get("/api/state").json()["changed"] == ["fusion.detection_probability"]
    assert len(server.get("/api/runs").json()["runs"]) == 1
    page.goto(server.address)
    until(page, lambda: readout(page) == "30", "the step")
    server.wait(lambda state: state["parameters"]["fusion.detection_probability"] == 0.8)
    expect(page.get_by_role("tab", name="Runs")).to_have_attribute("aria-selected", "true")
    # somebody who goes elsewhere on purpose is not taken back
    page.goto(f"{server.address}?step=4")
    until(page, lambda: readout(page) == "4", "the address wins")
    server.command("reset_parameters")
