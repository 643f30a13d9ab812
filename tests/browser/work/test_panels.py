"""The panels beside the pictures tell the numbers of the engine, and let nobody lose a place."""

from __future__ import annotations

import re
from typing import Any

from playwright.sync_api import Locator, Page, expect

from tests.browser.looking import as_at_first, ask, until
from tests.browser.serving import Server


def number(value: float | None, digits: int, *, signed: bool = False) -> str:
    """A number as the page writes it."""
    if value is None:
        return "–"
    text = f"{abs(value):.{digits}f}"
    return text if float(text) == 0.0 else f"{'−' if value < 0 else '+' if signed else ''}{text}"


def rows(page: Page, name: str) -> list[list[str]]:
    """The cells of a table."""
    body: list[list[str]] = page.get_by_role("table", name=name).evaluate(
        "table => [...table.tBodies[0].rows].map(row => [...row.cells].map(c => c.textContent))"
    )
    return body


def shown(page: Page, tab: str) -> Locator:
    page.get_by_role("tab", name=tab).click()
    return page.locator(f"#panel-{tab.lower()} [data-fill]")


def test_a_step_is_told_as_the_step_tells_it(flat_page: Page, server: Server) -> None:
    page = flat_page
    ask(server, "POST", "seek", {"step": 40})
    shown(page, "Step")
    expect(page.get_by_role("table", name="People in 3D at step 40")).to_be_visible()
    step: dict[str, Any] = ask(server, "GET", "step/40")
    errors = {person["track"]: person["error"] for person in step["truth"]}
    assert len(step["tracks"]) == 2
    assert rows(page, "People in 3D at step 40") == [
        [
            str(track["id"]),
            number(track["existence"], 3),
            "  ".join(number(value, 2) for value in track["position"]),
            "  ".join(number(value, 2) for value in track["sigma"]),
            number(errors.get(track["id"]), 3),
        ]
        for track in step["tracks"]
    ]
    assert [row[:4] for row in rows(page, "Tracks in the pictures")] == [
        [
            camera["name"],
            str(track["id"]),
            "seen" if track["seen"] else "coasting",
            number(track["detection_probability"], 2),
        ]
        for camera in step["cameras"]
        for track in camera["tracks"]
    ]
    nobodys = sum(
        box["track"] is None for camera in step["cameras"] for box in camera["measurements"]
    )
    table = page.get_by_role("table", name="Detections that are nobody's")
    assert table.locator("tbody tr").count() == nobodys
    series = ask(server, "GET", "evaluation/series")
    curves = {row[0]: row[1] for row in rows(page, "Curves at this step")}
    assert curves["People, true"] == str(len(step["truth"]))
    assert curves["OSPA  m"] == number(series["ospa"][40], 3)
    ask(server, "POST", "seek", {"step": 41})
    expect(page.get_by_role("table", name="People in 3D at step 41")).to_be_visible()
    as_at_first(server)


def test_events_are_listed_and_can_be_gone_to(flat_page: Page, server: Server) -> None:
    page = flat_page
    timeline = ask(server, "GET", "timeline")
    switches = ask(server, "GET", "evaluation/series")["switches"]
    shown(page, "Events")
    listed = page.get_by_role("table", name="Events").locator("tbody tr")
    expect(listed).to_have_count(len(timeline["events"]) + len(switches))
    births = [(step, track) for step, track, kind in timeline["events"] if kind == "birth"]
    page.get_by_role("combobox", name="Kind of event").select_option("birth")
    expect(listed).to_have_count(len(births))
    step, track = births[-1]
    assert rows(page, "Events")[-1] == [str(step), number(step / 25, 2), "birth", str(track)]
    listed.last.get_by_text("birth").click()  # a row as a whole goes there
    server.wait(lambda state: (state["playhead"], state["selection"]) == (step, track))
    head = page.get_by_role("table", name="Events").get_by_role("columnheader", name="Step")
    for _ in range(2):
        head.get_by_role("button").click()
    expect(head).to_have_attribute("aria-sort", "descending")
    page.get_by_role("combobox", name="Kind of event").select_option("")
    expect(listed).to_have_count(len(timeline["events"]) + len(switches))
    steps = [int(row[0]) for row in rows(page, "Events")]
    assert steps == sorted(steps, reverse=True), "also when the table is drawn anew"
    page.get_by_role("combobox", name="Kind of event").select_option("removed")
    expect(page.locator("#panel-events")).to_contain_text("No such event")
    page.get_by_role("combobox", name="Kind of event").select_option("")
    as_at_first(server)


def test_the_focus_goes_on_to_what_is_left(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    changes = {"fusion.detection_probability": 0.6, "fusion.clutter_rate": 2.0}
    server.command("set_parameters", changes=changes)
    page.get_by_role("tab", name="Tracks").focus()
    page.keyboard.press("End")
    expect(page.get_by_role("tab", name="Runs")).to_be_focused()
    page.keyboard.press("Home")
    expect(page.get_by_role("tab", name="Tracks")).to_be_focused()
    page.get_by_role("tab", name="Parameters").click()
    panel = page.locator("#panel-parameters")
    panel.get_by_role("button", name="changed only").click()
    expect(panel.get_by_role("button", name="changed only")).to_have_attribute(
        "aria-pressed", "true"
    )
    resets = panel.get_by_role("button", name=re.compile("^Reset (?!all)"))
    expect(resets).to_have_count(2)
    resets.first.focus()
    page.keyboard.press("Enter")
    expect(resets).to_have_count(1)
    expect(resets.first).to_be_focused()
    page.keyboard.press("Enter")
    expect(resets).to_have_count(0)
    expect(page.locator("#panel-parameters")).to_be_focused()
    as_at_first(server)


def test_what_is_typed_and_where_the_focus_is_outlive_a_change_elsewhere(
    flat_page: Page, server: Server
) -> None:
    """Another window renames a template while somebody types the room's edge."""
    page = flat_page
    box = {"camera": "cam1", "step": 5, "left": 40, "top": 30, "width": 24, "height": 48}
    server.command("add_template", **box, person="Anna")
    panel = shown(page, "Teach")
    name = panel.get_by_role("textbox", name="Name of template 1")
    expect(name).to_have_value("Anna")
    edge = panel.get_by_label("Room, to x, metres")
    edge.focus()
    before = edge.input_value()
    page.keyboard.press("Control+a")
    page.keyboard.type("3.1")
    server.command("rename_template", index=0, person="<b>Bob</b>")
    expect(name).to_have_value("<b>Bob</b>")  # text, never an element
    expect(edge).to_be_focused()
    expect(edge).to_have_value("3.1")
    page.keyboard.press("Escape")
    expect(edge).to_have_value(before)
    server.command("remove_template", index=0)
    expect(name).to_have_count(0)
    until(page, lambda: ask(server, "GET", "state")["teaching"]["unsaved"] == 0, "as it was")
    as_at_first(server)
