"""Without a pointer: from an opened page to the exported tracks, by keys alone."""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.looking import as_at_first, by_palette, readout, until
from tests.browser.serving import Server
from tests.browser.walkers import FRAMES
from tracker.export.tracks_csv import read_tracks_csv

MOST_TABS = 90
"""Presses of Tab that reach everything of the page."""


def focused(page: Page) -> str:
    """What has the focus, by its name."""
    name: str = page.evaluate(
        "(() => { const e = document.activeElement;"
        " return e.ariaLabel || e.dataset?.tip || e.innerText || e.tagName; })()"
    )
    return name


def tab_to(page: Page, name: str) -> None:
    """Press Tab until the focus is on something of this name, which then shows its ring."""
    for _ in range(MOST_TABS):
        page.keyboard.press("Tab")
        if focused(page).startswith(name):
            ring = page.evaluate(
                "(() => { const s = getComputedStyle(document.activeElement);"
                " return s.outlineStyle !== 'none' || s.boxShadow !== 'none'"
                " || document.activeElement.matches('.seek'); })()"
            )
            assert ring, f"the focus on {name} cannot be seen"
            return
    raise AssertionError(f"Tab does not reach {name}")


def test_from_opening_to_export_without_a_pointer(
    flat_page: Page, server: Server, tmp_path: Path
) -> None:
    page = flat_page
    as_at_first(server)
    other = Path(str(server.folder) + "-next")
    shutil.copytree(server.folder, other, dirs_exist_ok=True)
    page.goto(server.address)
    expect(page.locator(".lane").first).to_be_visible()

    # what is open can be chosen; the list is the browser's own
    tab_to(page, "Sequence")
    assert page.evaluate("document.activeElement.tagName") == "SELECT"
    # methods
    tab_to(page, "Fusion method")
    page.keyboard.press("s")  # its letters choose: sequential_phd
    page.keyboard.press("Enter")
    server.wait(
        lambda state: (
            state["methods"]["fusion_method"].startswith("s") and state["run"]["state"] == "done"
        )
    )
    # play, step, events
    page.keyboard.press("Escape")
    page.keyboard.press("Home")
    until(page, lambda: readout(page) == "0", "the first step")
    page.keyboard.press("Space")
    until(page, lambda: int(readout(page)) > 3, "it plays")
    page.keyboard.press("Space")
    page.keyboard.press("End")
    until(page, lambda: readout(page) == str(FRAMES - 1), "the last step")
    page.keyboard.press("Shift+N")
    until(page, lambda: int(readout(page)) < FRAMES - 1, "an event before it")
    # the table of tracks: into it, down, chosen
    tab_to(page, "Tracks")
    page.keyboard.press("Escape")
    server.wait(lambda state: state["selection"] is None)
    for _ in range(MOST_TABS):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.tagName") == "TR":
            break
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Enter")
    server.wait(lambda state: state["selection"] is not None)
    # layers, a pane alone, the sheet of keys, the palette
    tab_to(page, "Timeline large")
    before = page.get_by_role("button", name="truth").first.get_attribute("aria-pressed")
    page.keyboard.press("g")
    expect(page.get_by_role("button", name="truth").first).not_to_have_attribute(
        "aria-pressed", before or ""
    )
    page.keyboard.press("g")
    page.keyboard.press("Shift+C")
    expect(page.locator(".app")).to_have_attribute("data-max", "cams")
    page.keyboard.press("Escape")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog", name="Help and keys")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    # export
    with page.expect_download() as download:
        by_palette(page, "export the tracks")
    path = tmp_path / "tracks.csv"
    download.value.save_as(path)
    assert len(read_tracks_csv(path).frames) > 0
    as_at_first(server)


def test_single_keys_can_be_switched_off(flat_page: Page) -> None:
    page = flat_page
    expect(page.locator(".lane").first).to_be_visible()
    page.keyboard.press("?")
    page.get_by_role("checkbox", name="Single-key shortcuts").uncheck()
    page.keyboard.press("Escape")
    truth = page.get_by_role("button", name="truth").first
    before = truth.get_attribute("aria-pressed") or ""
    page.keyboard.press("g")
    page.keyboard.press("ArrowRight")
    until(page, lambda: readout(page) != "0", "arrows stay")
    expect(truth).to_have_attribute("aria-pressed", before)


def test_the_palette_does_what_its_words_say(flat_page: Page) -> None:
    page = flat_page
    expect(page.locator(".lane").first).to_be_visible()  # whoever presses keys sees the page
    by_palette(page, "cameras alone")
    expect(page.locator(".app")).to_have_attribute("data-max", "cams")
    expect(page.locator("section.view")).to_be_hidden()
    page.keyboard.press("Escape")
    expect(page.locator("section.view")).to_be_visible()
    splitter = page.get_by_role("separator", name="Width of cameras and tables")
    splitter.focus()
    before = page.locator("section.side").bounding_box()
    page.keyboard.press("Shift+ArrowLeft")
    until(
        page,
        lambda: page.locator("section.side").bounding_box()["width"] > before["width"] + 40,
        "the tables are wider",
    )


def test_keys_work_after_a_click_into_3d(page: Page, server: Server) -> None:
    as_at_first(server)
    canvas = page.frame_locator("section.view iframe").locator("canvas[data-engine]")
    canvas.wait_for()
    box = canvas.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 8, box["y"] + 200)
    page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "10", "ten steps on")
    page.keyboard.press("Shift+N")
    page.keyboard.press("Home")
    until(page, lambda: readout(page) == "0", "the first step")
