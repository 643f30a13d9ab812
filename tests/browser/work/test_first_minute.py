"""The first minute, and what once tripped people up on the way."""

from __future__ import annotations

import re
from pathlib import Path

from playwright.sync_api import Browser, Page, expect

from tests.browser.looking import as_at_first, ask, by_palette, readout, until
from tests.browser.serving import Server
from tests.long_recording import write_long

P_D = "fusion.detection_probability"


def test_reset_all_resets_all(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    for way in ("button", "palette"):
        server.command("set_parameters", changes={P_D: 0.6})
        page.get_by_role("tab", name=re.compile("Parameters")).click()
        button = page.get_by_role("button", name="Reset all", exact=True)
        expect(button).to_be_enabled()
        if way == "button":
            button.click()
        else:
            by_palette(page, "reset all")
        server.wait(lambda state: state["changed"] == [])
        expect(page.locator(".note")).to_have_count(0)


def test_lists_of_choices_stay_as_they_are_while_they_have_the_same(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    lists = "select[data-ref=sequence], select[data-ref=single_view]"
    mark = "all => all.forEach(list => [...list.options].forEach(one => (one.same = true)))"
    page.locator(lists).evaluate_all(mark)
    server.command("set_parameters", changes={P_D: 0.6})
    expect(page.get_by_role("tab", name=re.compile("Parameters"))).to_contain_text("1")
    kept = "all => all.map(list => [...list.options].every(one => one.same))"
    assert page.locator(lists).evaluate_all(kept) == [True, True]
    as_at_first(server)


def test_undo_is_offered_only_where_there_is_something_to_undo(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    while server.get("/api/state").json()["edits"]["undo"]:
        server.command("undo")  # what other tests did with this server
    # not reloaded: the address may name what was undone only just now, and would bring it back
    page.goto(server.address)
    page.get_by_role("tab", name=re.compile("Parameters")).click()
    undo = page.get_by_role("button", name="Undo", exact=True)
    expect(undo).to_be_disabled()
    server.command("set_parameters", changes={P_D: 0.6})
    expect(undo).to_be_enabled()
    undo.click()
    server.wait(lambda state: state["changed"] == [])
    expect(undo).to_be_disabled()
    as_at_first(server)


def test_what_was_edited_is_undone_inside_a_dialog_too(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    server.command("set_parameters", changes={P_D: 0.6})
    expect(page.locator("#tab-parameters .count")).to_have_text("1")
    page.keyboard.press("?")
    expect(page.locator("dialog.help")).to_be_visible()
    page.keyboard.press("Control+z")
    server.wait(lambda state: state["changed"] == [])
    page.keyboard.press("Escape")
    as_at_first(server)


def test_the_theme_is_the_systems_until_one_is_chosen(flat_page: Page, server: Server) -> None:
    page, whole = flat_page, flat_page.locator("html")
    for theme in ("dark", "light", "dark"):
        page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
        expect(whole).to_have_attribute("data-theme", theme)
    page.locator("[data-command=theme]").first.click()
    expect(whole).to_have_attribute("data-theme", "light")
    page.emulate_media(color_scheme="light")
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(300)
    expect(whole).to_have_attribute("data-theme", "light")


def test_a_note_under_the_pointer_stays_while_a_run_goes_on(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    page.goto(server.address + "?nowhere=1")
    close = page.locator(".note", has_text="unknown parts").get_by_role("button", name="Dismiss")
    close.evaluate("button => (button.isTheOne = true)")
    server.command("set_parameters", changes={P_D: 0.6})
    expect(page.locator("#tab-parameters .count")).to_have_text("1")
    server.wait_for_run()
    expect(page.locator(".status")).to_contain_text("computed")
    assert close.evaluate("button => button.isTheOne")
    close.click()
    expect(close).to_have_count(0)
    as_at_first(server)


def test_notes_lie_over_the_page_and_a_few_are_seen(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    notes, timeline = page.locator(".note"), page.locator(".time")
    last = server.get("/api/state").json()["sequence"]["frames"] - 1
    before = timeline.bounding_box()
    for step in range(last, last - 4, -1):
        ask(server, "POST", "seek", {"step": step})
        until(page, lambda step=step: readout(page) == str(step), "the step")
        page.keyboard.press("n")
        expect(notes.first).to_contain_text(f"after step {step}")
    expect(notes).to_have_count(4)
    expect(notes.last).to_contain_text("1 more")
    assert timeline.bounding_box() == before
    notes.last.get_by_role("button", name="Dismiss all").click()
    expect(notes).to_have_count(0)
    as_at_first(server)


def test_who_did_not_open_the_other_recording_is_told_with_the_way_back(
    flat_page: Page, server: Server, tmp_path: Path
) -> None:
    page = flat_page
    before = server.get("/api/state").json()["sequence"]
    folder = write_long(tmp_path / "ring", 20, cameras=3)
    other = page.context.new_page()
    other.goto(f"{server.address}?seq={folder}&step=7")
    until(other, lambda: readout(other) == "7", "a link to a folder keeps its step")
    expect(other.locator(".note", has_text="another window")).to_have_count(0)
    page.bring_to_front()
    note = page.locator(".note", has_text="was opened in another window")
    expect(note).to_be_visible()
    note.get_by_role("button", name=f"Back to {before['name']}").click()
    server.wait(lambda state: state["sequence"]["key"] == before["key"])
    expect(note).to_have_count(0)
    other.close()
    as_at_first(server)


def test_a_link_decides_who_is_selected_and_how_it_is_looked_at(
    browser: Browser, server: Server
) -> None:
    as_at_first(server)
    name = server.get("/api/state").json()["sequence"]["name"]
    ask(server, "POST", "select", {"id": 1})
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.route("**/viser/**", lambda route: route.abort())
    page = context.new_page()
    link = f"?seq={name}&step=12&tab=events&zoom=5-40&loop=10-30&layers=boxes"
    page.goto(server.address + link)
    until(page, lambda: readout(page) == "12", "the step")
    server.wait(lambda state: state["selection"] is None)
    expect(page.locator("#panel-events")).to_be_visible()
    expect(page.locator("[data-ref=range]")).to_have_text("10 – 30")
    expect(page.locator("[data-layer2d=truth]")).to_have_attribute("aria-pressed", "false")
    until(page, lambda: "zoom=5-40" in page.url and "layers=boxes" in page.url, "it is kept")
    context.close()
    as_at_first(server)


def test_the_wheel_zooms_over_the_lanes_and_values_stand_by_the_pointer(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    card = page.locator(".hint-card")

    def told() -> bool:
        plot = page.locator(".plot").bounding_box()
        lane = page.locator(".lane").first.bounding_box()
        if plot is None or lane is None:
            return False
        # lanes of a run that has just ended may be laid out meanwhile
        page.mouse.move(plot["x"] + plot["width"] / 2 - 9, lane["y"] + lane["height"] / 2)
        page.mouse.move(plot["x"] + plot["width"] / 2, lane["y"] + lane["height"] / 2)
        return bool(re.search(r"step \d+.*people", card.inner_text(), re.DOTALL))

    until(page, told, "values by the pointer")
    page.mouse.wheel(0, -300)
    until(page, lambda: "zoom=" in page.url, "a part is shown")
    page.keyboard.press("x")
    until(page, lambda: "zoom=" not in page.url, "all of it again")


def test_three_things_to_try_go_for_good_and_come_back_by_help(
    browser: Browser, server: Server
) -> None:
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.route("**/viser/**", lambda route: route.abort())
    page = context.new_page()
    page.goto(server.address)
    strip = page.locator(".tour")
    expect(strip).to_contain_text("Play on")
    page.keyboard.press("Space")
    expect(strip.locator(".done")).to_have_count(1)
    expect(page.get_by_text("software", exact=True)).to_be_visible()  # that 3D is drawn so
    assert page.locator(".note").count() == 0  # and nothing takes the panes' room
    strip.get_by_role("button", name=re.compile("Close for good")).click()
    page.reload()
    expect(page.locator(".cam canvas").first).to_be_visible()
    expect(strip).to_be_hidden()
    page.keyboard.press("?")
    page.get_by_role("button", name="Three things to try").click()
    expect(strip).to_be_visible()
    context.close()
    as_at_first(server)
