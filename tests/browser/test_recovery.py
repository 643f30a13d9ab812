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
    server.stop()
    expect(page.get_by_text("No connection since")).to_be_visible(timeout=20_000)
    expect(page.get_by_text("3D view lost")).to_be_visible()
    server.start()
    server.wait_for_run(120.0)
    expect(page.get_by_text("No connection since")).to_be_hidden(timeout=30_000)
    until(page, lambda: readout(page) == "20", "the page is where it was", 60.0)
    scene = viser(page)
    until(page, lambda: shown_in_3d(scene) == "20", "so is the 3D view", 60.0)
