"""Keys that are pressed while the page is still being read are heard once it is there."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page, Route, TimeoutError, expect

from tests.browser.looking import as_at_first
from tests.browser.serving import Server

Held = Callable[[str, str], tuple[Page, Callable[[], None]]]


@pytest.fixture
def held(browser: Browser, server: Server) -> Iterator[Held]:
    """Open an address while a file of the page does not come; what lets it come."""
    as_at_first(server)
    server.wait_for_run()
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(60_000)
    context.route("**/viser/**", lambda route: route.abort())

    def open_(address: str, file: str) -> tuple[Page, Callable[[], None]]:
        page = context.new_page()
        kept: list[Route] = []
        page.route(file, lambda route: kept.append(route))
        page.goto(f"{server.address}{address}", wait_until="commit")
        page.locator(".top .brand").wait_for()
        while not kept:
            page.wait_for_timeout(20)

        def release() -> None:
            while kept:
                kept.pop().continue_()

        return page, release

    yield open_
    context.close()


def test_what_is_sought_before_the_modules_are_there_is_found(held: Held) -> None:
    page, release = held("", "**/js/main.js")
    page.keyboard.press("Control+k")
    page.keyboard.type("library")
    release()
    expect(page.get_by_role("option", name="Library").first).to_be_visible()
    page.keyboard.press("Enter")
    expect(page.locator("main")).to_be_hidden()


def test_the_palette_takes_words_before_it_has_offers(held: Held) -> None:
    page, release = held("", "**/js/later.js")
    page.locator(".cam").first.wait_for()
    page.keyboard.press("Control+k")
    expect(page.get_by_role("dialog", name="Commands")).to_be_visible()
    page.keyboard.type("dark")
    release()
    expect(page.get_by_role("option", name="dark").first).to_be_visible()


@pytest.mark.parametrize("file", ["main", "later"])
def test_enter_that_comes_before_the_offers_takes_the_first(held: Held, file: str) -> None:
    page, release = held("", f"**/js/{file}.js")
    if file == "later":
        page.locator(".cam").first.wait_for()
    page.keyboard.press("Control+k")
    page.keyboard.type("cameras alone")
    page.keyboard.press("Enter")
    release()
    expect(page.locator(".app")).to_have_attribute("data-max", "cams")
    expect(page.get_by_role("dialog", name="Commands")).to_be_hidden()


def test_somebody_is_placed_though_the_key_came_early(held: Held) -> None:
    page, release = held("#check", "**/js/main.js")
    page.keyboard.press("Shift+H")
    release()
    expect(page.get_by_text("Click where")).to_be_visible()


def test_a_panel_that_is_not_read_yet_takes_no_click_and_loses_none(held: Held) -> None:
    page, release = held("?tab=parameters", "**/js/inspector/parameters.js")
    page.locator(".cam").first.wait_for()
    changed_only = page.get_by_text("changed only")
    with pytest.raises(TimeoutError, match="element is inert"):
        changed_only.click(timeout=1_000)
    release()
    changed_only.click()
    expect(changed_only).to_have_attribute("aria-pressed", "true")
