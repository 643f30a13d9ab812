"""The first minute: what a new person is told once, and how it goes for good."""

from __future__ import annotations

import re

from playwright.sync_api import Browser, expect

from tests.browser.conftest import opened
from tests.browser.looking import ask
from tests.browser.serving import Server


def test_what_a_new_person_is_told_goes_for_good_and_comes_back_by_help(
    browser: Browser, server: Server
) -> None:
    with opened(browser, server, flat=True, new=True) as page:
        strip = page.locator(".tour")
        expect(strip).to_contain_text("Play on")
        page.keyboard.press("Space")
        expect(strip.locator(".done")).to_have_count(1)
        # a note under the pointer stays while a run goes on
        note = page.locator(".note", has_text="without a graphics card")
        close = note.get_by_role("button", name="Dismiss")
        close.evaluate("button => (button.isTheOne = true)")
        ask(server, "PATCH", "parameters", {"changes": {"fusion.detection_probability": 0.6}})
        expect(page.locator("#tab-changes .count")).to_have_text("1")
        server.wait_for_run()
        expect(page.locator(".status")).to_contain_text("smoothed")
        assert close.evaluate("button => button.isTheOne")
        close.click()
        expect(close).to_have_count(0)
        strip.get_by_role("button", name=re.compile("Close for good")).click()
        page.reload()
        expect(page.locator(".cam canvas").first).to_be_visible()
        expect(strip).to_be_hidden()
        expect(note).to_have_count(0)
        page.keyboard.press("?")
        page.get_by_role("button", name="Three things to try").click()
        expect(strip).to_be_visible()
