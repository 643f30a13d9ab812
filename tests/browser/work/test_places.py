"""Places: a link that restores, back and forward, seeks from elsewhere, tabs in step."""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import Browser, Page, expect

from tests.browser.looking import as_at_first, ask, readout, until
from tests.browser.serving import Server
from tests.browser.walkers import FRAMES
from tests.long_recording import write_long

P_D = "fusion.detection_probability"


def test_a_link_restores_step_selection_camera_and_parameters(
    browser: Browser, server: Server
) -> None:
    server.wait_for_run()
    name = server.get("/api/state").json()["sequence"]["name"]
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    page = context.new_page()
    page.goto(f"{server.address}?seq={name}&step=33&sel=1&cam=2&p.{P_D}=0.71&zooom=3")
    until(page, lambda: readout(page) == "33", "the step of the link")
    state = server.wait(lambda state: state["parameters"][P_D] == 0.71)
    assert state["selection"] == 1
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_text("unknown parts: zooom")).to_be_visible()
    until(page, lambda: f"p.{P_D}=0.71" in page.url, "the address keeps it")
    context.close()
    as_at_first(server)


def test_a_link_to_a_sequence_that_is_not_there_shows_what_is_open_as_usual(
    browser: Browser, server: Server, tmp_path: Path
) -> None:
    before = server.get("/api/state").json()["sequence"]["key"]
    ask(server, "POST", "sequence", {"name": str(write_long(tmp_path / "ring", 20, cameras=3))})
    server.wait(lambda state: state["opening"] is None and state["sequence"]["key"] != before)
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    context.route("**/viser/**", lambda route: route.abort())
    page = context.new_page()
    page.goto(f"{server.address}?seq=nowhere&step=7&cam=3")
    expect(page.get_by_text("nowhere cannot be opened")).to_be_visible()
    expect(page.locator(".cam").first).to_have_attribute("aria-pressed", "true")
    until(page, lambda: readout(page) == "0", "the step of what is open")
    context.close()
    ask(server, "POST", "sequence", {"name": str(server.folder)})
    server.wait(lambda state: state["opening"] is None and state["sequence"]["key"] == before)
    as_at_first(server)


def test_back_and_forward_go_over_what_was_chosen(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    page.goto(server.address)
    expect(page.locator(".lane").first).to_be_visible()
    until(page, lambda: "step=0" in page.url, "the address says where the page is")
    page.keyboard.press("2")
    until(page, lambda: "cam=2" in page.url, "the large camera is in the address")
    server.command("set_parameters", changes={P_D: 0.6})
    until(page, lambda: f"p.{P_D}=0.6" in page.url, "so is the changed value")
    page.keyboard.press("PageDown")
    until(page, lambda: "step=10" in page.url, "so is the step")

    page.go_back()  # the step is no place of its own: scrubbing would fill the history
    server.wait(lambda state: state["changed"] == [])
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    page.go_back()
    expect(page.locator(".cam[aria-pressed=true]")).to_have_count(0)
    page.go_forward()
    expect(page.locator(".cam").nth(1)).to_have_attribute("aria-pressed", "true")
    page.go_forward()
    server.wait(lambda state: state["parameters"][P_D] == 0.6)
    until(page, lambda: readout(page) == "10", "the step that was left")
    as_at_first(server)


def test_a_sequence_opened_elsewhere_and_sought_in_at_once(flat_page: Page, server: Server) -> None:
    page = flat_page
    first, second = str(server.folder), str(server.folder) + "-again"
    shutil.copytree(first, second, dirs_exist_ok=True)
    head = Path(second) / "sequence.toml"
    head.write_text(head.read_text().replace("fps = 25.0", "fps = 20.0"))  # another recording
    ask(server, "POST", "run/cancel")
    page.get_by_role("combobox", name="Sequence").evaluate(
        "select => { select.append(new Option('gone', 'gone')); select.value = 'gone';"
        " select.dispatchEvent(new Event('change')); }"
    )
    note = page.locator(".note", has_text="gone")
    expect(note).to_be_visible()
    for folder, step in ((second, 17), (first, 23)):
        ask(server, "POST", "sequence", {"name": folder})
        server.wait(lambda state: state["sequence"] is not None and state["opening"] is None)
        ask(server, "POST", "seek", {"step": step, "origin": "elsewhere"})
        until(page, lambda step=step: readout(page) == str(step), f"the page is at {step}")
        assert server.get("/api/state").json()["playhead"] == step
    expect(note).to_have_count(0)  # what could not be opened is over
    as_at_first(server)


def test_two_tabs_stay_in_step(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    other = page.context.new_page()
    other.goto(server.address)
    until(other, lambda: readout(other) == readout(page), "both at one step")
    page.bring_to_front()
    page.keyboard.press("Home")
    page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "10", "ten steps on")
    other.bring_to_front()
    until(other, lambda: readout(other) == "10", "the other tab follows")
    other.locator(".lane").first.click()
    other.keyboard.press("End")
    until(other, lambda: readout(other) == str(FRAMES - 1), "the end")
    chosen = other.locator(".lane[aria-pressed=true]").get_attribute("aria-label")
    page.bring_to_front()
    until(page, lambda: readout(page) == str(FRAMES - 1), "the first tab follows back")
    expect(page.locator(".lane[aria-pressed=true]")).to_have_attribute("aria-label", chosen or "")
    other.close()
    as_at_first(server)
