"""Tuning: two runs beside each other, presets by name, back to the defaults, undo."""

from __future__ import annotations

import re

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import opened
from tests.browser.looking import as_at_first, ask, by_palette, until
from tests.browser.serving import Server
from tracker.parameters import PARAMETERS

P_D = "fusion.detection_probability"


def test_a_pinned_run_is_compared_exchanged_and_in_the_link(
    browser: Browser, flat_page: Page, server: Server
) -> None:
    page = flat_page
    page.get_by_role("tab", name="Compare").click()
    page.get_by_role("button", name="Pin as A").click()
    server.wait(lambda state: state["pinned"] is not None)
    ask(server, "PATCH", "parameters", {"changes": {P_D: 0.15}})
    server.wait_for_run()
    differing = page.get_by_role("table", name="Parameters that differ")
    expect(differing.locator("tbody tr")).to_have_count(1)
    expect(differing).to_contain_text("0.15")
    figures = page.get_by_role("table", name="Figures").locator("tbody tr")
    few = figures.count()
    page.get_by_role("button", name="All figures").click()
    until(page, lambda: figures.count() > few, "all figures")
    until(page, lambda: "worse" in " ".join(figures.all_inner_texts()), "the change is judged")
    expect(page.get_by_role("button", name="run A")).to_be_visible()  # its layer in 3D
    page.get_by_role("button", name="Exchange A and B").click()
    server.wait(lambda state: state["pinned"]["parameters"][P_D] == 0.15)
    state = server.wait(lambda state: state["parameters"][P_D] != 0.15)
    assert P_D not in state["changed"]
    server.wait_for_run()
    # the address follows a little later: for a while it is that of both runs with the same value
    until(
        page,
        lambda: f"a.{P_D}=0.15" in page.url and page.url.count(f"{P_D}=0.15") == 1,
        "the link names run A, and B by its own values",
    )
    link = page.url

    as_at_first(server)
    with opened(browser, server, flat=True) as other:
        other.goto(link)
        state = server.wait(lambda state: state["pinned"] is not None)
        assert state["pinned"]["parameters"][P_D] == pytest.approx(0.15)
        server.wait(lambda state: state["changed"] == [])


def test_reset_all_resets_all(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    for way in ("button", "palette"):
        ask(server, "PATCH", "parameters", {"changes": {P_D: 0.6}})
        page.get_by_role("tab", name=re.compile("Changes")).click()
        button = page.get_by_role("button", name="Reset all", exact=True)
        expect(button).to_be_enabled()
        if way == "button":
            button.click()
        else:
            by_palette(page, "reset all")
        server.wait(lambda state: state["changed"] == [])
        expect(page.locator(".note")).to_have_count(0)


def test_undo_is_offered_only_where_there_is_something_to_undo(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    page.reload()
    page.get_by_role("tab", name=re.compile("Changes")).click()
    undo = page.get_by_role("button", name="Undo", exact=True)
    expect(undo).to_be_disabled()
    ask(server, "PATCH", "parameters", {"changes": {P_D: 0.6}})
    expect(undo).to_be_enabled()
    undo.click()
    server.wait(lambda state: state["changed"] == [])
    expect(undo).to_be_disabled()
    as_at_first(server)


def test_presets_of_ones_own_by_keyboard(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    ask(server, "PATCH", "parameters", {"changes": {P_D: 0.6}})
    page.get_by_role("tab", name="Changes").click()
    preset = page.get_by_role("combobox", name="Preset")
    expect(preset).to_have_value("")  # own values
    page.get_by_role("button", name="Save as").focus()
    page.keyboard.press("Enter")
    page.keyboard.type("published")
    page.keyboard.press("Enter")
    expect(page.get_by_text("expected a name of your own")).to_be_visible()
    page.get_by_role("textbox", name="Name of the preset").fill("quick <b>look</b>")
    page.keyboard.press("Enter")
    expect(preset).to_have_value("quick <b>look</b>")
    expect(preset).to_be_focused()
    page.get_by_role("button", name="Rename").focus()
    page.keyboard.press("Enter")
    page.keyboard.type("quick")
    page.keyboard.press("Enter")
    expect(preset).to_have_value("quick")

    preset.focus()
    preset.select_option("robust")
    server.wait(lambda state: state["changed"] == [])
    preset.select_option("quick")
    server.wait(lambda state: state["parameters"][P_D] == 0.6)
    # the page takes back what it knows of
    expect(page.locator("#panel-changes")).to_contain_text("0.6")
    page.keyboard.press("Control+z")
    state = server.wait(lambda state: state["parameters"][P_D] != 0.6)
    assert state["parameters"][P_D] == PARAMETERS[P_D].default
    page.keyboard.press("Control+Shift+z")
    server.wait(lambda state: state["preset"] == "quick")
    page.reload()
    expect(preset).to_have_value("quick")
    page.get_by_role("button", name="Remove").click()
    server.wait(lambda state: state["presets"] == [])
    assert server.get("/api/state").json()["parameters"][P_D] == 0.6, "the values stay"
    as_at_first(server)
