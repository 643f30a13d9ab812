"""One selection: made in any view, it is marked in all of them, and can stand alone."""

from __future__ import annotations

import re

from playwright.sync_api import Page, Route, expect

from tests.browser.looking import as_at_first, ask, readout, shown_in_3d, until, until_still, viser
from tests.browser.serving import Server

STEP = 45
"""Both walkers are in the room and seen by both cameras."""


def by_row(page: Page, server: Server, track: int) -> None:
    page.locator("#panel-tracks tbody tr", has=page.locator(f".id:text-is('{track}')")).click()


def by_lane(page: Page, server: Server, track: int) -> None:
    page.get_by_role("button", name=f"Track {track}", exact=True).click()


def by_plot(page: Page, server: Server, track: int) -> None:
    lane = page.get_by_role("button", name=f"Track {track}", exact=True).bounding_box()
    head = page.locator(".time .ph:not(.wanted)").bounding_box()
    assert lane is not None
    assert head is not None
    page.mouse.click(head["x"] + 1, lane["y"] + lane["height"] / 2)


def by_picture(page: Page, server: Server, track: int) -> None:
    left, top, width, height = box_of(server, track, 1)
    cell = page.locator(".cam").nth(1).bounding_box()
    assert cell is not None
    scale = cell["width"] / 192
    page.mouse.move(cell["x"] + 2, cell["y"] + 2)
    x, y = cell["x"] + (left + width / 2) * scale, cell["y"] + (top + height / 2) * scale
    page.mouse.move(x, y)
    expect(page.locator(".card:visible")).to_contain_text("existence")
    page.mouse.click(x, y)


def by_3d(page: Page, server: Server, track: int) -> None:
    scene = viser(page)
    page.get_by_role("button", name="C1").click()
    server.wait(lambda state: state["view"] == 0)
    canvas = scene.locator("canvas[data-engine]").bounding_box()
    assert canvas is not None
    until(page, lambda: shown_in_3d(scene) == str(STEP), "the step in 3D")
    until_still(page, canvas)  # it is drawn and the flight to the camera is over
    left, top, width, height = box_of(server, track, 0)
    # seen through a camera the picture lies in the middle, as large as it fits
    scale = min(canvas["width"] / 192, canvas["height"] / 144)
    x = canvas["x"] + canvas["width"] / 2 + (left + width / 2 - 96) * scale
    y = canvas["y"] + canvas["height"] / 2 + (top + height / 2 - 72) * scale
    page.mouse.click(x, y)
    server.wait(lambda state: state["selection"] is not None)
    page.get_by_role("button", name="free", exact=True).click()
    server.wait(lambda state: state["view"] is None)


def box_of(server: Server, track: int, camera: int) -> list[float]:
    """Where a track is in a camera's picture."""
    view = server.get(f"/api/step/{STEP}").json()["cameras"][camera]
    box: list[float] = next(t["box"] for t in view["tracks"] if t["id"] == track)
    return box


def test_a_selection_reaches_every_view(flat_page: Page, server: Server) -> None:
    as_at_first(server)
    ask(server, "POST", "seek", {"step": STEP})
    until(flat_page, lambda: readout(flat_page) == str(STEP), "both people are there")
    track = nearest(server)
    for choose in (by_row, by_lane, by_plot, by_picture):
        choose(flat_page, server, track)
        it_is_everywhere(flat_page, server, track)
    by_lane(flat_page, server, track)
    flat_page.locator("body").press("f")  # this one alone
    expect(flat_page.locator(".lane")).to_have_count(1)
    expect(flat_page.locator("#panel-tracks tbody tr")).to_have_count(1)
    expect(flat_page.get_by_role("button", name="only selected")).to_have_attribute(
        "aria-pressed", "true"
    )
    flat_page.locator("body").press("f")
    expect(flat_page.locator(".lane")).to_have_count(2)


def test_a_selection_in_3d_reaches_every_view(page: Page, server: Server) -> None:
    as_at_first(server)
    ask(server, "POST", "seek", {"step": STEP})
    until(page, lambda: readout(page) == str(STEP), "both people are there")
    track = nearest(server)
    by_3d(page, server, track)
    it_is_everywhere(page, server, track)


def nearest(server: Server) -> int:
    """The track nearest to the first camera, whom nobody hides."""
    tracks = [track["id"] for track in server.get(f"/api/step/{STEP}").json()["tracks"]]
    assert len(tracks) == 2
    return max(tracks, key=lambda track: box_of(server, track, 0)[3])


def it_is_everywhere(page: Page, server: Server, track: int) -> None:
    """The track is selected in all of the page's views, and after Escape in none."""
    assert server.wait(lambda state: state["selection"] is not None)["selection"] == track
    lane = page.locator(".lane[aria-pressed=true]")
    expect(lane).to_have_count(1)
    expect(lane).to_have_attribute("aria-label", f"Track {track}")
    row = page.locator("#panel-tracks tr[aria-selected=true]")
    expect(row).to_have_count(1)
    assert re.match(rf"{track}\b", row.inner_text())
    until(page, lambda: f"sel={track}" in page.url, "the address has it")
    page.keyboard.press("Escape")
    server.wait(lambda state: state["selection"] is None)
    expect(page.locator("#panel-tracks tr[aria-selected=true]")).to_have_count(0)
    expect(lane).to_have_count(0)


def test_others_stay_away_whatever_is_told_before_the_answer(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    ask(server, "PATCH", "trail", {"seconds": 4})
    ask(server, "POST", "seek", {"step": STEP})
    until(page, lambda: readout(page) == str(STEP), "both people are there")
    by_lane(page, server, 1)
    server.wait(lambda state: state["selection"] == 1)
    kept: list[Route] = []
    page.route("**/api/layers", lambda route: kept.append(route))
    page.keyboard.press("f")
    until(page, lambda: len(kept) == 1, "the server is asked")
    expect(page.locator(".lane")).to_have_count(1)
    ask(server, "PATCH", "trail", {"seconds": 15})  # news of something else
    expect(page.get_by_label("Length of the trails")).to_have_value("15")
    expect(page.locator(".lane")).to_have_count(1)
    page.keyboard.press("f")
    expect(page.locator(".lane")).to_have_count(2)
    assert len(kept) == 1  # the second waits for the first: it is to be the last word
    kept[0].continue_()
    until(page, lambda: len(kept) == 2, "the server is asked again")
    server.wait(lambda state: not state["layers"]["others"])
    kept[1].continue_()
    server.wait(lambda state: state["layers"]["others"])
    expect(page.locator(".lane")).to_have_count(2)
    ask(server, "PATCH", "trail", {"seconds": 4})


def test_shift_and_a_click_look_through_the_camera(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    page.locator(".cam").nth(1).click(position={"x": 4, "y": 4}, modifiers=["Shift"])
    assert server.wait(lambda state: state["view"] == 1)["view"] == 1
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    page.keyboard.press("0")
    server.wait(lambda state: state["view"] is None)
    expect(page.locator(".cam[aria-pressed=true]")).to_have_count(0)
