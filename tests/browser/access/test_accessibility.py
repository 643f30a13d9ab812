"""axe-core finds nothing serious in any main state, dark and light; the theme at first."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.browser.looking import as_at_first, ask
from tests.browser.serving import Server

SERIOUS = ("serious", "critical")
OURS = {"exclude": [["iframe"]]}
"""The 3D view and its panel are viser's page."""


def found(page: Page) -> list[str]:
    """What axe-core finds serious, each with where it is."""
    answer = Axe().run(page, context=OURS).response
    return [
        f"{rule['id']}: {rule['help']}: {node['html'][:160]} {node['failureSummary'][-160:]}"
        for rule in answer["violations"]
        if rule["impact"] in SERIOUS
        for node in rule["nodes"]
    ]


@pytest.fixture(params=["dark", "light"])
def themed(
    browser: Browser, server: Server, request: pytest.FixtureRequest
) -> Iterator[tuple[Page, str]]:
    """The page at its first start on a system that prefers a theme."""
    as_at_first(server)
    ask(server, "POST", "seek", {"step": 45})
    context = browser.new_context(
        viewport={"width": 1440, "height": 900},
        color_scheme=request.param,
        reduced_motion="reduce",  # colours are judged when they have come to rest
    )
    context.set_default_timeout(60_000)
    context.route("**/viser/**", lambda route: route.abort())
    page = context.new_page()
    page.goto(server.address)
    expect(page.locator("#panel-tracks tbody tr").first).to_be_visible()
    yield page, request.param
    context.close()


def test_nothing_serious_in_any_state(themed: tuple[Page, str], server: Server) -> None:
    page, theme = themed
    assert page.locator("html").get_attribute("data-theme") == theme
    states: dict[str, list[str]] = {"tracks": found(page)}
    ask(server, "POST", "run/pin")
    server.command("set_parameters", changes={"fusion.detection_probability": 0.6})
    server.wait_for_run()
    for tab in ("Step", "Events", "Parameters", "Compare", "Runs"):
        page.get_by_role("tab", name=tab).click()
        expect(page.locator(f"#panel-{tab.lower()} tbody tr").first).to_be_visible()
        states[tab] = found(page)
    page.get_by_role("tab", name="Tracks").click()
    page.locator(".lane").first.click()
    states["selected"] = found(page)
    page.keyboard.press("?")
    states["help"] = found(page)
    page.keyboard.press("Escape")
    page.keyboard.press("Control+k")
    states["palette"] = found(page)
    page.keyboard.press("Escape")
    page.get_by_role("combobox", name="Sequence").evaluate(
        "select => { select.append(new Option('gone', 'gone')); select.value = 'gone';"
        " select.dispatchEvent(new Event('change')); }"
    )
    expect(page.locator(".note[role=alert]")).to_be_visible()
    states["failure"] = found(page)
    as_at_first(server)
    assert {name: list_ for name, list_ in states.items() if list_} == {}


def test_the_chosen_theme_stays(themed: tuple[Page, str]) -> None:
    page, theme = themed
    other = "light" if theme == "dark" else "dark"
    page.keyboard.press("Shift+D")
    expect(page.locator("html")).to_have_attribute("data-theme", other)
    page.emulate_media(color_scheme=theme)
    page.add_init_script(
        "addEventListener('DOMContentLoaded', () => {"
        " window.themeAtFirst = document.documentElement.dataset.theme; })"
    )
    page.reload()
    expect(page.locator(".lane").first).to_be_visible()
    assert page.evaluate("window.themeAtFirst") == other, "no flash of the other theme"
    expect(page.locator("html")).to_have_attribute("data-theme", other)
    page.keyboard.press("Shift+D")
    expect(page.locator("html")).to_have_attribute("data-theme", theme)
