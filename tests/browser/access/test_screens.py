"""The main states at all sizes, dark and light: everything is inside the window, and pictures.

``pytest tests/browser/access --screenshots FOLDER`` keeps the pictures, to be looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.browser.conftest import COARSE_3D
from tests.browser.looking import as_at_first, ask, by_palette, readout, until, viser
from tests.browser.serving import Server

SIZES = {"720p": (1280, 720), "laptop": (1440, 900), "wide": (2560, 1440)}

OUTSIDE = """() => {
  // what is shown and reaches out of the window or is cut off by its own pane
  const seen = (e) => e.checkVisibility() && e.getBoundingClientRect().width > 1;
  const outside = [...document.querySelectorAll(
    '.top, .pane, .pane-head > *, .tabs, .tab, .chip, .cam, .foot, .trans, .gr, .plot')]
    .filter(seen)
    .filter((e) => {
      if (e.closest('.lanes') && e.matches('.lane')) return false;  // they scroll
      const { left, top, right, bottom } = e.getBoundingClientRect();
      return left < -1 || top < -1 || right > innerWidth + 1 || bottom > innerHeight + 1;
    })
    .map((e) => e.className + ' ' + (e.dataset.ref ?? e.innerText.slice(0, 30)));
  const words = [...document.querySelectorAll('.chips, .tablist, .seg')]
    .filter(seen)
    .filter((e) => e.scrollWidth > e.clientWidth + 1)
    .map((e) => 'cut off: ' + e.ariaLabel);
  return [...outside, ...words];
}"""


SLIDERS = """() => [...document.querySelectorAll('[role=slider]')].filter((e) => {
  const { x, y, width, height, bottom } = e.getBoundingClientRect();
  const top = document.elementFromPoint(x + width / 2, y + height / 2);
  return height > 0 && bottom <= innerHeight && e.contains(top);
}).length"""
"""How many sliders of viser's panel are wholly in sight."""


IN_SIGHT = """row => {
  const { x, top, bottom, height } = row.getBoundingClientRect();
  const at = (y) => row.contains(document.elementFromPoint(x + 20, y));
  return height > 0 && at(top + 2) && at(bottom - 2);
}"""
"""Whether a row is wholly in sight."""


STANDS = """(width) => new Promise((done) => {
  // ten frames of this window in which nothing moves: what is laid out anew is
  let before = '', same = 0;
  const look = () => {
    const now = [...document.querySelectorAll('.pane, .cam, .plot, .chip, .status')]
      .map((e) => Object.values(e.getBoundingClientRect().toJSON()).join()).join();
    same = innerWidth === width && now === before ? same + 1 : 0;
    before = now;
    if (same < 10) requestAnimationFrame(look);
    else done();
  };
  look();
})"""


def keep(page: Page, folder: Path | None, name: str, tmp_path: Path) -> None:
    """Check that all is in the window, and make a picture of it."""
    assert page.evaluate(OUTSIDE) == [], name
    path = (folder or tmp_path) / f"{name}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=path)
    picture = cv2.imread(str(path))
    assert picture is not None
    assert picture.std() > 10.0, f"{name} is blank"


@pytest.mark.parametrize(
    "size",
    ["720p", *(pytest.param(one, marks=pytest.mark.long) for one in ("laptop", "wide"))],
)
def test_everything_is_inside_the_window(
    browser: Browser, server: Server, size: str, tmp_path: Path, screenshots: Path | None
) -> None:
    as_at_first(server)
    ask(server, "POST", "seek", {"step": 45})
    width, height = SIZES[size]
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme="dark", reduced_motion="reduce"
    )
    if size == "wide":  # the software renderer takes long for so many pixels
        context.route("**/viser/**", lambda route: route.abort())
    if screenshots is None:
        context.add_init_script(COARSE_3D)
    page = context.new_page()
    page.goto(server.address)
    until(page, lambda: readout(page) == "45", "the step")
    expect(page.locator("#panel-tracks tbody tr").first).to_be_visible()
    for strip in ("People", "OSPA", "Position error"):
        expect(page.locator(".gr.strip", has_text=strip)).to_be_visible()
    for theme in ("dark", "light"):
        if theme == "light":
            page.locator("[data-command=theme]").click()
        expect(page.locator("html")).to_have_attribute("data-theme", theme)

        def seen(state: str, theme: str = theme) -> None:
            keep(page, screenshots, f"{size}-{theme}-{state}", tmp_path)

        states(page, size, seen)
    context.close()
    as_at_first(server)


def states(page: Page, size: str, seen: Callable[[str], None]) -> None:
    """The page's panels one after another, and a person chosen."""
    head = page.get_by_role("columnheader", name="x, y, z")
    if size == "720p":  # there the table fits without it, and the step's own tells it
        expect(head).to_be_hidden()
        page.get_by_role("tab", name="Step").click()
        expect(page.locator("#panel-step", has_text="x, y, z")).to_be_visible()
        page.get_by_role("tab", name="Tracks").click()
        panel = viser(page)
        until(page, lambda: panel.evaluate(SLIDERS) >= 8, "all essential sliders are in sight")
        row = page.locator("#panel-tracks tbody tr").first
        height = page.locator("#panel-tracks .scroll").evaluate("e => e.clientHeight")
        assert height > 6 * row.evaluate("e => e.clientHeight"), "a head and five rows fit"
        page.get_by_role("tab", name="Parameters").click()
        rows = page.locator("#panel-parameters tr[data-key]:visible")
        expect(rows.first).to_be_visible()
        assert sum(row.evaluate(IN_SIGHT) for row in rows.all()[:12]) >= 5, "five parameters fit"
        assert panel.evaluate(SLIDERS) >= 8
        words = page.locator("#panel-parameters .name:visible").all_inner_texts()
        assert len(set(words)) == len(words), "it is seen whose each is"
        page.get_by_label("Find a parameter").fill("e")
        cut = "all => all.filter((e) => e.scrollWidth > e.clientWidth).map((e) => e.innerText)"
        cells = page.locator("#panel-parameters :is(.unit, td:has(.name)):visible")
        assert cells.evaluate_all(cut) == []
        page.get_by_label("Find a parameter").fill("")
        page.get_by_role("tab", name="Tracks").click()
        assert page.locator(".cam:visible").count() == 2
    else:
        head.scroll_into_view_if_needed()
        expect(head).to_be_in_viewport()
    seen("tracks")
    if size != "wide":
        for tab in ("Step", "Parameters", "Compare", "Runs"):
            page.get_by_role("tab", name=tab).click()
            name = f"#panel-{tab.lower()}"
            drawn = page.locator(f"{name} [data-fill] > *, {name} tr[data-key]:visible")
            expect(drawn.first).to_be_visible()
            seen(tab.lower())
        wide = page.locator("#panel-runs [data-fill]").evaluate(
            "e => e.scrollWidth - e.clientWidth"
        )
        assert wide == 0, "every column of the runs is in sight"
        expect(page.get_by_role("button", name="only selected")).to_be_visible()
        page.get_by_role("tab", name="Tracks").click()
    page.locator(".lane").first.click()
    page.locator(".lane").first.hover()
    expect(page.locator(".card:visible")).to_be_visible()
    seen("selected")
    page.keyboard.press("Escape")


@pytest.mark.parametrize("layout", ["tune", "inspect", "compare"])
def test_every_layout_fits_every_width(flat_page: Page, server: Server, layout: str) -> None:
    page = flat_page
    as_at_first(server)
    by_palette(page, f"layout {layout}")
    for width, height in ((1100, 720), (1280, 720), (1600, 1000), (1920, 1080), (2560, 1440)):
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(STANDS, width)
        until(page, lambda: page.evaluate(OUTSIDE) == [], f"{layout} fits at {width}", 20.0)
        # below 576 pixels the panel of the 3D view would lie over the room
        view = page.locator(".view")
        until(page, lambda: view.evaluate("e => e.clientWidth") > 576, "beside the panel", 20.0)  # noqa: B023
        status = page.locator(".status")
        cut = "e => e.scrollWidth - e.clientWidth"
        until(page, lambda: status.evaluate(cut) <= 1, "the run's state is whole", 20.0)  # noqa: B023
    page.evaluate("localStorage.removeItem('page')")


def test_alone_the_strips_of_the_timeline_have_the_height_that_lanes_leave(
    flat_page: Page, server: Server
) -> None:
    as_at_first(server)
    flat_page.locator("[data-command=maximise-time]").first.click()
    lane, strip = flat_page.locator(".lane").last, flat_page.locator(".gr.strip:visible").first

    def gap() -> float:
        above, below = lane.bounding_box(), strip.bounding_box()
        assert above is not None
        assert below is not None
        return below["y"] - above["y"] - above["height"]

    until(flat_page, lambda: 0 <= gap() < 40, "no empty room is under the lanes")
    last = flat_page.locator(".gr.strip:visible").last.bounding_box()
    assert last is not None
    assert last["y"] + last["height"] <= 901, "the last strip is inside the window"
    flat_page.keyboard.press("Escape")


def with_candidates(route: Route) -> None:
    """Answer with the steps as if each camera's method had looked at candidates."""
    answer = route.fetch()
    steps = answer.json()
    for step in steps:
        for camera in step["cameras"]:
            camera["information"] = {"candidates": 9, "dropped for colour": 6}
    route.fulfill(response=answer, json=steps)


def test_the_words_of_a_narrow_picture_are_whole_with_samples_on(
    flat_page: Page, server: Server
) -> None:
    as_at_first(server)
    flat_page.route("**/api/steps?*", with_candidates)
    flat_page.get_by_role("button", name="samples").click()
    tags = flat_page.locator(".cam-tag")
    expect(tags.first).to_contain_text("9 candidates, 6 dropped for colour")
    flat_page.set_viewport_size({"width": 1280, "height": 720})
    expect(tags.first).not_to_contain_text("candidates")
    assert tags.evaluate_all("all => all.filter(e => e.scrollWidth > e.clientWidth).length") == 0


def test_pictures_leave_room_for_the_tables_where_notes_make_the_column_low(
    flat_page: Page, server: Server
) -> None:
    as_at_first(server)
    pictures = flat_page.locator(".cam").first
    before = pictures.bounding_box()
    flat_page.locator("main").evaluate("main => { main.style.marginTop = '200px' }")
    flat_page.wait_for_function("() => document.querySelector('.side').clientHeight > 130")
    after = pictures.bounding_box()
    assert before is not None
    assert after is not None
    assert 0.4 * before["height"] < after["height"] < before["height"]
    assert flat_page.evaluate(OUTSIDE) == []
