"""The place Library: runs are kept, found again, compared, exported, deleted, opened again."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import Page, expect

from tests.browser.looking import ask, still
from tests.browser.serving import Server
from tracker.export.registry import FORMATS

P_D = "fusion.detection_probability"


@pytest.fixture(scope="module", autouse=True)
def two_runs(server: Server) -> None:
    """The default, and another p_D, which is shown."""
    kept(server, 1)
    server.command("set_parameters", changes={P_D: 0.8})
    kept(server, 2)


def kept(server: Server, count: int) -> list[dict]:
    """The runs of the open recording, once there are so many."""
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        for recording in server.get("/api/library").json()["recordings"]:
            if recording["runs"] >= count:
                runs = server.get(f"/api/library/recordings/{recording['id']}/runs").json()
                listed: list[dict] = runs["runs"]
                return listed
        time.sleep(0.1)
    raise AssertionError(f"{count} runs were not kept")


@pytest.fixture
def library(flat_page: Page) -> Page:
    """The place with its two runs."""
    flat_page.get_by_role("link", name="Library").click()
    expect(flat_page.locator("tr[data-run]")).to_have_count(2)
    return flat_page


def test_runs_are_listed_with_what_differs(library: Page, screenshots: Path | None) -> None:
    rows = library.locator("tr[data-run]")
    expect(rows.nth(0)).to_contain_text("0.8")
    expect(library.locator("main")).to_be_hidden()
    expect(library.locator(".item[aria-selected=true]")).to_contain_text("2 cameras")
    small = library.get_by_role("region", name="The run")
    expect(small.get_by_role("img", name="Lanes of run 2: 2 tracks over 60 steps")).to_be_visible()
    expect(small.get_by_role("img", name="Ways from above")).to_be_visible()
    for word in ("People", "OSPA"):
        chart = small.get_by_role("application", name=f"{word} over time")
        chart.focus()
        library.keyboard.press("Home")
        expect(chart.get_by_role("status")).to_contain_text(f"step 0\n{word} ", use_inner_text=True)
    assert small.locator("polyline").count() == 4, "two curves and the ways of two tracks"
    expect(small.locator("dd").nth(3)).to_have_text("0.95 → 0.8")
    note, part = (
        small.locator(one).evaluate("one => one.clientWidth") for one in (".addnote", "dl")
    )
    assert note > 0.8 * part, "a note has room"
    if screenshots:
        for theme in ("dark", "light"):
            library.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
            library.screenshot(path=screenshots / f"library-{theme}.png")


def test_keys_choose_star_name_and_delete(library: Page, server: Server) -> None:
    first = library.locator('tr[data-run="1"]')
    first.focus()
    library.keyboard.press("s")
    expect(first.get_by_role("button", name="Star")).to_have_attribute("aria-pressed", "true")
    library.keyboard.press("F2")
    library.keyboard.type("baseline")
    library.keyboard.press("Enter")
    expect(first).to_contain_text("baseline 1")
    first.focus()
    library.keyboard.press("Space")
    expect(library.get_by_text("1 chosen")).to_be_visible()
    library.keyboard.press("Delete")
    expect(library.locator("tr[data-run]")).to_have_count(1)
    expect(library.get_by_text("Run 1 deleted")).to_be_visible()
    expect(library.locator('tr[data-run="2"]')).to_be_focused()
    library.keyboard.press("Control+z")
    expect(library.locator("tr[data-run]")).to_have_count(2)
    expect(library.get_by_text("Undone: run 1 deleted")).to_be_visible()
    assert kept(server, 2)[1]["name"] == "baseline"
    library.keyboard.press("Escape")
    expect(library.locator("main")).to_be_visible()


def test_the_last_runs_of_a_recording_are_taken_back(library: Page) -> None:
    library.keyboard.press("Control+a")
    library.get_by_role("button", name="Delete").click()
    head = library.get_by_role("heading", name="Nothing kept yet")
    expect(head).to_be_visible()
    expect(head.locator("~ button")).to_have_count(0)  # the recording is open already
    library.get_by_role("button", name="Undo", exact=True).last.click(timeout=10_000)
    expect(library.locator("tr[data-run]")).to_have_count(2)


def test_recordings_are_listed_before_their_runs_and_a_plan_holds_its_entrances(
    library: Page,
) -> None:
    cut = """svg => { const edge = svg.getBoundingClientRect();
      return [...svg.querySelectorAll('ellipse, rect')].some((one) => {
        const { left, right, top, bottom } = one.getBoundingClientRect();
        return left < edge.left || right > edge.right || top < edge.top || bottom > edge.bottom;
      }); }"""
    plan = library.get_by_role("img", name="Ways from above")
    expect(plan.locator("ellipse").first).to_be_attached()
    assert not plan.evaluate(cut)
    library.route("**/api/library/recordings/*/runs", lambda route: None)  # it never comes
    library.reload()
    expect(library.locator(".lib .item").first).to_be_visible()
    expect(library.locator("tr[data-run]")).to_have_count(0)


def test_finding_leaves_what_matches(library: Page) -> None:
    library.keyboard.press("/")
    library.keyboard.type("no such run")
    expect(library.locator("tr[data-run]:visible")).to_have_count(0)
    expect(library.get_by_text("No run matches")).to_be_visible()
    expect(library.locator(".lib .item")).to_have_count(0)
    library.keyboard.press("Escape")
    expect(library.locator("tr[data-run]:visible")).to_have_count(2)


def test_a_recording_that_is_found_is_chosen_where_no_run_is(library: Page) -> None:
    library.get_by_label("Find", exact=True).fill("room24")
    items = library.get_by_role("listbox", name="Recordings").get_by_role("option")
    expect(items).to_have_count(1)
    expect(items).to_contain_text("room24-2p")
    expect(items).to_have_attribute("aria-selected", "true")
    expect(library.get_by_role("heading", name="Runs of room24-2p")).to_be_visible()


def test_arrows_go_on_from_the_run_that_was_clicked(library: Page) -> None:
    rows = library.locator("tr[data-run]")
    rows.first.locator("td").nth(2).click()
    library.keyboard.press("ArrowDown")
    expect(rows.nth(1)).to_be_focused()


def test_runs_stand_side_by_side(library: Page, server: Server) -> None:
    library.keyboard.press("Control+a")
    library.get_by_role("button", name="Compare").click()
    dialog = library.get_by_role("dialog", name="Runs side by side")
    expect(dialog).to_contain_text("0.95")
    expect(dialog.get_by_role("row", name="MOTA")).to_be_visible()
    names = [run["name"] or f"Run {run['id']}" for run in kept(server, 2)]
    expect(dialog.get_by_role("columnheader")).to_have_text(["What", *names])
    rows = dialog.get_by_role("table").first.locator("tbody tr")
    expect(rows.first).to_contain_text("MOTA")  # figures first, then what differs
    expect(rows.last).to_contain_text("Detection probability")
    alike = dialog.get_by_role("table", name="Equal in all of them")
    expect(alike).to_be_hidden()
    dialog.get_by_text(re.compile(r"^\d+ equal$")).click()
    expect(alike).to_contain_text("multi bernoulli")
    dialog.get_by_role("row", name="MOTA").click()  # what is told can be marked
    expect(dialog.get_by_role("heading", name="Runs side by side")).to_be_visible()
    dialog.get_by_role("button", name="Close").click()
    expect(dialog).to_have_count(0)
    library.get_by_role("button", name="Compare").click()
    library.keyboard.press("Escape")
    expect(dialog).to_have_count(0)


def test_a_run_leaves_as_a_file(library: Page) -> None:
    library.locator('tr[data-run="1"] input').click()
    library.get_by_role("button", name="Export", exact=True).click()
    with library.expect_download() as saved:
        library.get_by_role("menuitem", name="JSON").click()
    told = json.loads(Path(saved.value.path()).read_text(encoding="utf-8"))
    assert told["tracks"] != []
    assert saved.value.suggested_filename.endswith(".json")


def test_the_shown_run_leaves_in_the_same_forms(flat_page: Page) -> None:
    page = flat_page
    page.get_by_role("button", name="Export this run").click()
    expect(page.get_by_role("menuitem")).to_have_count(len(FORMATS))
    box = page.get_by_role("menu", name="Export as").bounding_box()
    assert box is not None
    assert 0 <= box["x"] <= 1440 - box["width"], "all of it is in the window"
    with page.expect_download() as saved:
        page.get_by_role("menuitem", name="JSON").click()
    told = json.loads(Path(saved.value.path()).read_text(encoding="utf-8"))
    assert told["tracks"] != []


def test_a_run_is_opened_as_it_was_without_computing(library: Page, server: Server) -> None:
    library.locator('tr[data-run="1"]').click()
    expect(library.get_by_role("img", name="Lanes of run 1")).to_be_visible()
    library.get_by_role("button", name="Open in Tune").click()
    expect(library.locator("main")).to_be_visible()
    expect(library.get_by_text("is shown as it was")).to_be_visible()
    state = server.get("/api/state").json()
    assert (state["run"]["kept"], state["parameters"][P_D]) == (1, 0.95)
    ask(server, "POST", "library/runs/2/open")
    # before it would go by itself
    expect(library.get_by_text("is shown as it was")).to_have_count(0, timeout=2000)
    ask(server, "POST", "library/runs/1/open")
    server.wait(lambda state: state["run"]["kept"] == 1)
    library.get_by_role("link", name="Library").click()
    library.locator('tr[data-run="1"]').click()
    library.get_by_role("button", name="Open in Tune").click()
    library.get_by_role("button", name="Compute again").click()
    state = server.wait(lambda state: state["run"]["kept"] is None)
    server.wait_for_run()


def test_a_folder_that_cannot_be_found_is_told_where_it_was_asked_for(
    library: Page, server: Server
) -> None:
    folder = Path(server.get("/api/library").json()["recordings"][0]["place"])
    moved = folder.with_name("elsewhere")
    folder.rename(moved)
    try:
        library.set_viewport_size({"width": 1280, "height": 720})
        library.reload()
        place = library.get_by_role("textbox", name="Folder where the recording lies now")
        button = library.get_by_role("button", name="Find…")
        above = still(library.get_by_text("Its runs stay readable"))
        assert above["y"] + above["height"] <= still(place)["y"]
        assert abs(still(place)["y"] - still(button)["y"]) < 6, "they are in one row"
        place.fill(str(folder.with_name("nowhere")))
        button.click()
        refused = library.get_by_role("region", name="Runs").get_by_role("alert")
        expect(refused).to_contain_text("there is no such folder")
        expect(place).to_have_value(str(folder.with_name("nowhere")))
    finally:
        moved.rename(folder)
    place.fill(str(folder))
    library.get_by_role("button", name="Find…").click()
    expect(place).to_be_hidden()
    expect(refused).to_be_hidden()


COVERED = """() => {
    const over = document.querySelector(".notes").getBoundingClientRect();
    return [...document.querySelectorAll(".lib :is(button, input, select)")]
        .filter((one) => one.checkVisibility())
        .filter((one) => {
            const { left, right, top, bottom } = one.getBoundingClientRect();
            return left < over.right && right > over.left && top < over.bottom && bottom > over.top;
        })
        .map((one) => one.ariaLabel ?? one.textContent);
}"""


def test_notes_cover_nothing_that_can_be_pressed_in_the_lowest_window(
    library: Page, server: Server
) -> None:
    library.set_viewport_size({"width": 1280, "height": 720})
    expect(library.get_by_role("img", name="Ways from above")).to_be_visible()
    for number in range(4):
        name = f"/recordings/of a hall with a name that takes several lines of a note/and {number}"
        answer = httpx2.post(f"{server.address}api/sequence", json={"name": name}, timeout=30.0)
        assert answer.status_code == 422
    expect(library.locator(".note")).to_have_count(4)
    assert library.evaluate(COVERED) == []


def test_a_run_is_pinned_as_a(library: Page, server: Server) -> None:
    library.locator('tr[data-run="2"]').click()
    expect(library.get_by_role("img", name="Lanes of run 2")).to_be_visible()
    library.get_by_role("button", name="Pin as A").click()
    server.wait(lambda state: state["pinned"] is not None)
    ask(server, "DELETE", "run/pin")


def test_a_study_starts_around_the_values_of_a_run(library: Page, server: Server) -> None:
    library.locator('tr[data-run="2"]').click()
    expect(library.get_by_role("img", name="Lanes of run 2")).to_be_visible()
    library.get_by_role("button", name="Start a study here").click()
    expect(library.get_by_role("textbox", name="Name of the study")).to_be_visible()
    assert server.get("/api/state").json()["parameters"][P_D] == 0.8
    low, high = library.get_by_role("spinbutton", name="Detection probability").all()
    assert float(low.input_value()) < 0.8 < float(high.input_value())
