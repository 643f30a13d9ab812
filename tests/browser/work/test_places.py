"""Places: a link that restores, back and forward, seeks from elsewhere, tabs in step."""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import Page, Route, expect

from tests.browser.looking import (
    as_at_first,
    ask,
    choose_what_is_gone,
    readout,
    shown_in_3d,
    until,
    viser,
)
from tests.browser.serving import Server
from tests.browser.walkers import FRAMES
from tests.long_recording import write_long

P_D = "fusion.detection_probability"


def test_a_link_restores_what_it_names_and_decides_the_rest(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    name = server.get("/api/state").json()["sequence"]["name"]
    page.goto(f"{server.address}?seq={name}&step=33&sel=1&cam=2&p.{P_D}=0.71&zooom=3")
    until(page, lambda: readout(page) == "33", "the step of the link")
    state = server.wait(lambda state: state["parameters"][P_D] == 0.71)
    assert state["selection"] == 1
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_text("unknown parts: zooom")).to_be_visible()
    until(page, lambda: f"p.{P_D}=0.71" in page.url, "the address keeps it")

    page.goto(f"{server.address}?seq={name}&step=12&tab=events&zoom=5-40&loop=10-30&layers=boxes")
    until(page, lambda: readout(page) == "12", "the step of the second link")
    server.wait(lambda state: state["selection"] is None)
    expect(page.locator("#panel-events")).to_be_visible()
    expect(page.locator("[data-ref=range]")).to_have_text("10 – 30")
    expect(page.locator("[data-layer2d=truth]")).to_have_attribute("aria-pressed", "false")
    until(page, lambda: "zoom=5-40" in page.url and "layers=boxes" in page.url, "it is kept")


def test_back_and_forward_and_a_second_window(
    flat_page: Page, server: Server, tmp_path: Path
) -> None:
    back_and_forward_go_over_what_was_chosen(flat_page, server)
    as_at_first(server)
    other = flat_page.context.new_page()
    other.goto(server.address)
    two_windows_stay_in_step(flat_page, other)
    another_recording_in_one_is_told_in_the_other(flat_page, other, server, tmp_path)


def back_and_forward_go_over_what_was_chosen(page: Page, server: Server) -> None:
    expect(page.locator(".lane").first).to_be_visible()
    until(page, lambda: "step=0" in page.url, "the address says where the page is")
    page.keyboard.press("2")
    until(page, lambda: "cam=2" in page.url, "the large camera is in the address")
    ask(server, "PATCH", "parameters", {"changes": {P_D: 0.6}})
    until(page, lambda: f"p.{P_D}=0.6" in page.url, "so is the changed value")
    page.keyboard.press("PageDown")
    until(page, lambda: "step=10" in page.url, "so is the step")

    # the step is no place of its own: scrubbing would fill the history; nor is what a slow server
    # has not restored yet
    held: list[Route] = []
    page.route("**/api/parameters/reset", lambda route: held.append(route))
    page.go_back()
    until(page, lambda: len(held) == 1, "the server is asked")
    page.wait_for_timeout(600)  # by now the address would follow
    assert P_D not in page.url
    held[0].continue_()
    server.wait(lambda state: state["changed"] == [])
    expect(page.locator("#tab-changes .count")).to_be_hidden()
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    page.go_back()
    expect(page.locator(".cam[aria-pressed=true]")).to_have_count(0)
    page.go_forward()
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    page.go_forward()
    server.wait(lambda state: state["parameters"][P_D] == 0.6)
    until(page, lambda: readout(page) == "10", "the step that was left")


def two_windows_stay_in_step(page: Page, other: Page) -> None:
    until(other, lambda: readout(other) == readout(page), "both at one step")
    page.bring_to_front()
    page.keyboard.press("Home")
    page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "10", "ten steps on")
    other.bring_to_front()
    until(other, lambda: readout(other) == "10", "the other window follows")
    other.locator(".lane").first.click()
    other.keyboard.press("End")
    until(other, lambda: readout(other) == str(FRAMES - 1), "the end")
    chosen = other.locator(".lane[aria-pressed=true]").get_attribute("aria-label")
    page.bring_to_front()
    until(page, lambda: readout(page) == str(FRAMES - 1), "the first window follows back")
    expect(page.locator(".lane[aria-pressed=true]")).to_have_attribute("aria-label", chosen or "")


def another_recording_in_one_is_told_in_the_other(
    page: Page, other: Page, server: Server, tmp_path: Path
) -> None:
    """With the way back; and a link that cannot be opened shows what is open as usual."""
    before = server.get("/api/state").json()["sequence"]
    other.goto(f"{server.address}?seq={write_long(tmp_path / 'ring', 20, cameras=3)}&step=7")
    until(other, lambda: readout(other) == "7", "a link to a folder keeps its step")
    expect(other.locator(".note", has_text="another window")).to_have_count(0)
    other.goto(f"{server.address}?seq=nowhere&step=9&cam=3")
    expect(other.get_by_text("nowhere cannot be opened")).to_be_visible()
    expect(other.locator(".cam").first).to_have_attribute("aria-pressed", "true")
    until(other, lambda: readout(other) == "7", "the step of what is open")
    page.bring_to_front()
    note = page.locator(".note", has_text="was opened in another window")
    expect(note).to_be_visible()
    note.get_by_role("button", name=f"Back to {before['name']}").click()
    server.wait(lambda state: state["sequence"]["key"] == before["key"])
    expect(note).to_have_count(0)
    other.close()


def test_what_is_sought_or_opened_elsewhere_is_followed_whatever_the_page_was_doing(
    page: Page, server: Server
) -> None:
    scene = viser(page)
    for wanted in (30, 5, 41):
        before = int(readout(page))
        page.keyboard.press("ArrowRight")  # its own seek and the other's cross each other
        page.keyboard.press("ArrowRight")
        ask(server, "POST", "seek", {"step": wanted, "origin": "elsewhere"})

        # Which of the three seeks came last is open; where it ends, all must stand.
        def agreed() -> bool:
            told = str(server.get("/api/state").json()["playhead"])
            return told == readout(page) == shown_in_3d(scene)

        def settled() -> bool:
            if not agreed():
                return False
            page.wait_for_timeout(500)
            return agreed()

        until(page, settled, f"page, 3D and server at one step after a seek to {wanted}")
        assert int(readout(page)) in (wanted, before + 1, before + 2)

    first, second = str(server.folder), str(server.folder) + "-again"
    shutil.copytree(first, second, dirs_exist_ok=True)
    head = Path(second) / "sequence.toml"
    head.write_text(head.read_text().replace("fps = 25.0", "fps = 20.0"))  # another recording
    ask(server, "POST", "run/cancel")
    choose_what_is_gone(page)
    note = page.locator(".note", has_text="gone")
    expect(note).to_be_visible()
    for folder, step in ((second, 17), (first, 23)):
        ask(server, "POST", "sequence", {"name": folder})
        server.wait(lambda state: state["sequence"] is not None and state["opening"] is None)
        ask(server, "POST", "seek", {"step": step, "origin": "elsewhere"})
        until(page, lambda step=step: readout(page) == str(step), f"the page is at {step}")
        until(page, lambda step=step: shown_in_3d(scene) == str(step), f"3D is at {step}")
        assert server.get("/api/state").json()["playhead"] == step
    expect(note).to_have_count(0)  # what could not be opened is over
