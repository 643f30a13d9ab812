"""The place Library: runs are kept, found again, compared, exported, deleted, opened again."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import walking
from tests.browser.looking import ask
from tests.browser.serving import Server

P_D = "fusion.detection_probability"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A workbench that has kept two runs: the default, and another p_D, which is shown."""
    with walking(tmp_path_factory) as running:
        kept(running, 1)
        ask(running, "PATCH", "parameters", {"changes": {P_D: 0.8}})
        kept(running, 2)
        yield running


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


def test_runs_are_looked_through_by_keys_and_leave_as_files(
    flat_page: Page, server: Server, screenshots: Path | None
) -> None:
    page = flat_page
    page.get_by_role("link", name="Library").click()
    rows = page.locator("tr[data-run]")
    first = page.locator('tr[data-run="1"]')
    expect(rows).to_have_count(2)
    expect(rows.nth(0)).to_contain_text("0.8")  # what differs
    expect(page.locator("main")).to_be_hidden()
    expect(page.locator(".item[aria-selected=true]")).to_contain_text("2 cameras")
    expect(page.get_by_role("img", name="Lanes of run 2")).to_be_visible()
    if screenshots:
        for theme in ("dark", "light"):
            page.emulate_media(color_scheme=theme)  # type: ignore[arg-type]
            page.screenshot(path=screenshots / f"library-{theme}.png")

    # side by side
    page.keyboard.press("Control+a")
    page.get_by_role("button", name="Compare").click()
    dialog = page.get_by_role("dialog", name="Runs side by side")
    expect(dialog).to_contain_text("0.95")
    expect(dialog.get_by_role("row", name="MOTA")).to_be_visible()
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)
    # all of them are deleted, and taken back
    page.get_by_role("button", name="Delete").click()
    expect(page.get_by_role("heading", name="Nothing kept yet")).to_be_visible()
    page.get_by_role("button", name="Undo").click()
    expect(rows).to_have_count(2)

    # a star, a name, one deleted and taken back, by keys
    first.focus()
    page.keyboard.press("s")
    expect(first.get_by_role("button", name="Star")).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("F2")
    page.keyboard.type("baseline")
    page.keyboard.press("Enter")
    expect(first).to_contain_text("baseline 1")
    first.focus()
    page.keyboard.press("Space")
    expect(page.get_by_text("1 chosen")).to_be_visible()
    page.get_by_role("button", name="Export", exact=True).click()
    with page.expect_download() as saved:
        page.get_by_role("menuitem", name="JSON").click()
    assert json.loads(Path(saved.value.path()).read_text(encoding="utf-8"))["tracks"] != []
    assert saved.value.suggested_filename.endswith(".json")
    first.focus()
    page.keyboard.press("Delete")
    expect(rows).to_have_count(1)
    expect(page.get_by_role("status").filter(has_text="Run 1 deleted")).to_be_visible()
    page.keyboard.press("Control+z")
    expect(rows).to_have_count(2)
    assert kept(server, 2)[1]["name"] == "baseline"

    page.keyboard.press("/")
    page.keyboard.type("no such run")
    expect(page.locator("tr[data-run]:visible")).to_have_count(0)
    expect(page.get_by_text("No run matches")).to_be_visible()
    page.keyboard.press("Escape")
    page.keyboard.press("Escape")
    expect(page.locator("main")).to_be_visible()


def test_a_run_is_pinned_opened_and_the_middle_of_a_study(flat_page: Page, server: Server) -> None:
    page = flat_page

    def choose(run: int) -> None:
        page.get_by_role("link", name="Library").click()
        page.locator(f'tr[data-run="{run}"]').click()
        expect(page.get_by_role("img", name=f"Lanes of run {run}")).to_be_visible()

    choose(2)
    page.get_by_role("button", name="Pin as A").click()
    server.wait(lambda state: state["pinned"] is not None)
    ask(server, "DELETE", "run/pin")
    choose(1)
    page.get_by_role("button", name="Open in Tune").click()
    expect(page.locator("main")).to_be_visible()
    expect(page.get_by_text("is shown as it was")).to_be_visible()
    state = server.get("/api/state").json()
    assert (state["run"]["kept"], state["parameters"][P_D]) == (1, 0.95)
    page.get_by_role("button", name="Compute again").click()
    server.wait(lambda state: state["run"]["kept"] is None and state["run"]["state"] == "done")
    choose(2)
    page.get_by_role("button", name="Start a study here").click()
    expect(page.get_by_role("textbox", name="Name of the study")).to_be_visible()
    assert server.get("/api/state").json()["parameters"][P_D] == 0.8
    low, high = page.get_by_role("spinbutton", name="Detection probability").all()
    assert float(low.input_value()) < 0.8 < float(high.input_value())
