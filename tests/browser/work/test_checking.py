"""The place Check: an exchange is found and put right by keys alone, everywhere, and for good."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import opened
from tests.browser.looking import ask, by_palette, readout, until, viser
from tests.browser.meeting import FRAMES, HIDDEN, write_meeting
from tests.browser.serving import Server

BEFORE, AFTER = 10, FRAMES - 5
P_D = "fusion.detection_probability"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A workbench on two people who meet and turn back: the filter exchanges them."""
    folder = write_meeting(tmp_path_factory.mktemp("data") / "meeting")
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    ask(running, "POST", "seek", {"step": BEFORE})
    yield running
    if running.process.poll() is None:
        running.stop()


@pytest.fixture
def as_it_was(server: Server) -> None:
    """No correction, and the defaults."""
    for one in corrections(server)["corrections"]:
        server.command("drop_correction", id=one["id"])
    server.command("reset_parameters")
    server.wait_for_run()


@pytest.fixture
def check(browser: Browser, server: Server, as_it_was: None) -> Iterator[Page]:
    """The place, without the 3D view."""
    with opened(browser, server, flat=True) as page:
        page.get_by_role("link", name="Check").click()
        # the first place is chosen a moment after it is listed
        expect(page.locator("[role=option][aria-selected=true]")).to_have_count(1)
        yield page


def places(page: Page):  # type: ignore[no-untyped-def]
    """The queue."""
    return page.get_by_role("listbox", name="Places").get_by_role("option")


def corrections(server: Server) -> dict:
    told: dict = server.get("/api/corrections").json()
    return told


def side_of(server: Server, step: int) -> dict[int, bool]:
    """Of each track whether it is on person 2's side of the room."""
    tracks = server.get(f"/api/step/{step}").json()["tracks"]
    return {track["id"]: track["position"][0] > 0.0 for track in tracks}


def exchanged(server: Server) -> bool:
    """Whether the shown run has the two exchanged."""
    server.wait_for_run()
    before, after = side_of(server, BEFORE), side_of(server, AFTER)
    assert set(before) == set(after)
    assert len(before) == 2
    return before != after


def test_an_exchange_is_put_right_by_keys_alone(
    browser: Browser, server: Server, as_it_was: None, screenshots: Path | None
) -> None:
    assert exchanged(server), "the trap holds"
    with opened(browser, server, flat=True) as page:
        by_palette(page, "next place to check")
        expect(places(page).first).to_have_attribute("aria-selected", "true")
        expect(page.get_by_role("tab", name="Place")).to_have_attribute("aria-selected", "true")
        page.keyboard.press("Shift+M")
        meeting = places(page).and_(page.locator("[aria-selected=true]"))
        expect(meeting).to_contain_text("1 and 2")
        film = page.get_by_role("group", name="Pictures of 1 and 2")
        expect(film.get_by_role("button")).to_have_count(16)
        sign = page.get_by_role("link", name="Check").locator(".count")
        before = int(sign.inner_text())
        page.keyboard.press("v")  # how it would be
        would = page.get_by_role("group", name="Shown").get_by_role("button").nth(1)
        expect(would).to_have_attribute("aria-pressed", "true")
        if screenshots:
            page.screenshot(path=screenshots / "check-would-be.png")
        page.keyboard.press("v")
        expect(would).to_have_attribute("aria-pressed", "false")
        for _ in range(3):  # a key that is held repeats
            page.keyboard.down("v")
            expect(would).to_have_attribute("aria-pressed", "true")
        page.keyboard.up("v")
        expect(would).to_have_attribute("aria-pressed", "false")
        page.keyboard.press("Shift+X")
        expect(page.get_by_role("listbox", name="Corrections").get_by_role("option")).to_have_count(
            1
        )
        assert not exchanged(server)
        until(page, lambda: int(sign.inner_text() or 0) < before, "one place less")
        # lanes and pictures are of the run that obeys
        run = server.wait_for_run()["run"]["key"]
        assert server.get("/api/timeline").json()["run"] == run
        page.keyboard.press("End")
        until(page, lambda: readout(page) == str(FRAMES - 1), "the last step")
        cams = page.locator(".cam")
        left = side_of(server, FRAMES - 1)
        for camera in range(2):
            label = cams.nth(camera).get_attribute("aria-label")
            assert label is not None
            assert all(str(track) in label for track in left)
        if screenshots:
            page.screenshot(path=screenshots / "check-put-right.png")


def test_pictures_and_lanes_have_who_hindsight_found(check: Page, server: Server) -> None:
    """At a step at which the filter that obeys has nobody yet."""
    by_palette(check, "next place to check")
    check.keyboard.press("Shift+M")
    listed = check.get_by_role("listbox", name="Corrections").get_by_role("option")
    ask(server, "POST", "seek", {"step": 48})
    until(check, lambda: readout(check) == "48", "the page is there")
    check.keyboard.press("Shift+X")
    expect(listed).to_have_count(1)
    server.wait_for_run()
    told = server.get("/api/step/48").json()
    people = sorted(track["id"] for track in told["tracks"])
    assert people == [1, 2]
    for camera in range(2):
        label = check.locator(".cam").nth(camera)
        for track in people:
            expect(label).to_have_attribute("aria-label", re.compile(rf"\b{track}\b"))


def test_it_holds_after_a_slider_a_reload_and_is_undone(check: Page, server: Server) -> None:
    check.keyboard.press("Shift+M")
    check.keyboard.press("Shift+X")
    listed = check.get_by_role("listbox", name="Corrections").get_by_role("option")
    expect(listed).to_have_count(1)
    assert not exchanged(server)
    server.command("set_parameters", changes={P_D: 0.9})
    assert not exchanged(server)
    assert corrections(server)["corrections"][0]["met"] is True
    check.reload()
    expect(listed).to_have_count(1)
    assert not exchanged(server)
    check.keyboard.press("Control+z")  # the slider was moved last, wherever it stands
    server.wait(lambda state: state["changed"] == [])
    expect(check.get_by_text("Undone: Detection probability")).to_be_visible()
    expect(listed).to_have_count(1)
    check.keyboard.press("Control+z")
    expect(listed).to_have_count(0)
    assert exchanged(server)
    check.keyboard.press("Control+Shift+Z")
    expect(listed).to_have_count(1)
    assert not exchanged(server)


def test_who_is_right_is_confirmed_and_who_is_skipped_goes(check: Page, server: Server) -> None:
    server.wait_for_run()
    until(check, lambda: places(check).count() > 0, "there is something to check")
    count = places(check).count()
    check.keyboard.press("y")
    check.keyboard.press("Enter")
    until(check, lambda: places(check).count() < count, "what is confirmed is done")
    assert corrections(server)["corrections"] != []
    assert exchanged(server), "what was confirmed stays as it is"
    left = places(check).count()
    if left:
        check.keyboard.press("Shift+K")
        until(check, lambda: places(check).count() < left, "what is skipped is gone")


def test_who_is_there_all_the_time_is_joined_from_a_step_on(check: Page, server: Server) -> None:
    check.locator(".lane").first.click()
    check.keyboard.press("Shift+J")  # at a place that does not propose to join
    menu = check.get_by_role("menu", name="Join")
    expect(menu.get_by_role("menuitem")).to_have_count(1)
    head = check.locator(".menu.corrects .menu-head")
    expect(head).to_contain_text("nobody comes before step 0")
    expect(head).to_contain_text(f"from step {readout(check)} on")
    told = head.locator(".alone")
    assert told.evaluate("one => one.scrollWidth <= one.clientWidth"), "the whole sentence is there"
    menu.get_by_role("menuitem").first.click()
    until(check, lambda: len(corrections(server)["corrections"]) == 1, "it is said")
    assert corrections(server)["corrections"][0]["kind"] == "same"


def test_a_place_that_a_run_no_longer_has_is_no_error(check: Page, server: Server) -> None:
    places(check).first.click()
    gone = {"code": "no_doubt", "title": "Not Found", "status": 404, "detail": "There is none."}
    check.route("**/api/corrections/ghosts", lambda route: route.fulfill(status=404, json=gone))
    check.keyboard.press("v")
    expect(check.get_by_text("This place has changed")).to_be_visible()
    expect(check.get_by_text("There is none.")).to_have_count(0)
    check.unroute("**/api/corrections/ghosts")


def test_the_menu_of_a_lane_works_in_tune_too(
    browser: Browser, server: Server, as_it_was: None
) -> None:
    with opened(browser, server, flat=True) as page:
        middle = (HIDDEN.start + HIDDEN.stop) // 2
        ask(server, "POST", "seek", {"step": middle + 12})
        page.locator(".lane").first.click()
        menu = page.get_by_role("menu", name="Corrections of track")

        def opens() -> bool:
            """What makes the menu is read after the first picture."""
            page.locator(".lane").first.click(button="right")
            return menu.get_by_role("menuitem").count() > 0

        until(page, opens, "the menu is there")
        expect(menu.get_by_role("menuitem").first).to_be_focused()
        page.keyboard.press("Enter")  # Exchange with…
        page.get_by_role("menu", name="Exchange").get_by_role("menuitem").first.click()
        expect(page.get_by_text("exchanged from step")).to_be_visible()
        until(page, lambda: len(corrections(server)["corrections"]) == 1, "it is kept")
        page.get_by_role("button", name="Undo", exact=True).first.click()
        until(page, lambda: corrections(server)["corrections"] == [], "it is undone")


def test_somebody_is_placed_by_a_click(check: Page, server: Server) -> None:
    check.keyboard.press("Home")
    until(check, lambda: readout(check) == "0", "the first step is shown")
    check.locator(".lane").first.click()
    check.keyboard.press("Shift+H")
    expect(check.get_by_text("Click where")).to_be_visible()
    check.locator(".cam").first.click(position={"x": 60, "y": 190})
    expect(check.get_by_text("Enter says it")).to_be_visible()
    check.keyboard.press("Enter")
    until(check, lambda: len(corrections(server)["corrections"]) == 1, "it is said")
    told = corrections(server)["corrections"][0]
    assert (told["kind"], told["first"]) == ("here", 0)


def test_who_places_somebody_goes_on_when_the_chosen_place_is_answered_elsewhere(
    check: Page, server: Server
) -> None:
    (chosen, *_) = server.get("/api/corrections/queue").json()["doubts"]
    check.keyboard.press("Shift+H")
    expect(check.locator(".why")).to_contain_text("Click where")
    server.command("answer", doubt=chosen["id"], alternative=0)
    without_a_place = check.locator(".blank").get_by_text("Click where")
    expect(without_a_place).to_be_visible()
    check.keyboard.press("Escape")
    expect(without_a_place).to_have_count(0)


def test_somebody_is_placed_by_keys_at_the_step_that_is_shown(check: Page, server: Server) -> None:
    ask(server, "POST", "seek", {"step": 68})
    until(check, lambda: readout(check) == "68", "the page is there")
    check.keyboard.press("Escape")
    check.keyboard.press("Shift+H")
    ring = check.get_by_role("button", name="Feet of somebody in cam1")
    expect(ring).to_be_focused()
    check.keyboard.press("Enter")  # nobody has said where yet
    assert corrections(server)["corrections"] == []
    check.keyboard.press(".")
    expect(check.get_by_text("stands at step 69")).to_be_visible()
    check.get_by_role("button", name="Feet of somebody in cam2").click()  # as it lies
    expect(check.get_by_text("One picture")).to_be_visible()
    check.keyboard.press("Enter")
    listed = check.get_by_role("listbox", name="Corrections").get_by_role("option")
    expect(listed).to_have_count(1)
    (said,) = corrections(server)["corrections"]
    assert (said["kind"], said["first"]) == ("here", 69)


def test_who_is_dragged_far_by_the_feet_stays_who_he_is(check: Page, server: Server) -> None:
    middle = (HIDDEN.start + HIDDEN.stop) // 2 + 12
    ask(server, "POST", "seek", {"step": middle})
    until(check, lambda: readout(check) == str(middle), "the step is shown")
    check.keyboard.press("]")
    ring = check.locator(".foothold").first
    expect(ring).to_be_visible()
    label = ring.get_attribute("aria-label")
    assert label is not None
    told = server.get(f"/api/step/{middle}").json()["tracks"]
    there = ring.bounding_box()
    assert there is not None
    x, y = there["x"] + there["width"] / 2, there["y"] + there["height"] / 2
    check.mouse.move(x, y)
    check.mouse.down()
    check.mouse.move(x + 20, y + 5, steps=3)
    check.mouse.move(x + 45, y + 12, steps=3)
    check.mouse.up()
    until(check, lambda: len(corrections(server)["corrections"]) == 1, "it is said")
    server.wait_for_run()
    until(check, lambda: corrections(server)["corrections"][0]["met"], "the track is there")
    one = corrections(server)["corrections"][0]
    (place, meant) = one["places"]
    far = sum((a - b) ** 2 for a, b in zip(place[1:3], meant[1:3], strict=True)) ** 0.5
    assert far > 0.5, "where a place alone would be somebody else's"
    now = server.get(f"/api/step/{middle}").json()["tracks"]
    assert {track["id"] for track in now} == {track["id"] for track in told}
    assert f"Feet of track {one['tracks'][0]} in" in label
    check.wait_for_timeout(500)  # the queue of the new run
    assert readout(check) == str(middle), "who places somebody is not led away"
    assert ring.get_attribute("aria-label") == label


def test_a_name_and_a_checked_range_leave_as_truth(check: Page, server: Server) -> None:
    check.locator(".lane").first.click()
    check.keyboard.press("F2")
    check.keyboard.type("Anna")
    check.keyboard.press("Enter")
    until(check, lambda: "Anna" in corrections(server)["names"].values(), "she has a name")
    check.keyboard.press("Home")
    until(check, lambda: readout(check) == "0", "the first step")
    check.keyboard.press("i")
    check.keyboard.press("PageDown")
    until(check, lambda: readout(check) == "10", "the eleventh")
    check.keyboard.press("o")
    check.keyboard.press("Shift+G")
    until(check, lambda: corrections(server)["checked"] == [[0, 10]], "the range is checked")
    server.wait_for_run()
    with check.expect_download() as saved:
        check.get_by_role("button", name="Save truth").click()
    lines = Path(saved.value.path()).read_text(encoding="utf-8").splitlines()
    assert len(lines) > 11


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_nothing_serious_in_any_state(
    check: Page, server: Server, theme: str, screenshots: Path | None
) -> None:
    check.emulate_media(color_scheme=theme, reduced_motion="reduce")  # type: ignore[arg-type]
    if check.locator("html").get_attribute("data-theme") != theme:
        check.keyboard.press("Shift+D")

    def found() -> list[str]:
        answer = Axe().run(check, context={"exclude": [["iframe"]]}).response
        return [
            f"{rule['id']}: {node['html'][:160]}"
            for rule in answer["violations"]
            if rule["impact"] in ("serious", "critical")
            for node in rule["nodes"]
        ]

    states = {"queue": found()}
    check.keyboard.press("v")
    states["would be"] = found()
    check.keyboard.press("Shift+F10")
    states["menu"] = found()
    check.keyboard.press("Escape")
    check.keyboard.press("Shift+M")
    check.keyboard.press("Shift+X")
    expect(check.get_by_role("listbox", name="Corrections").get_by_role("option")).to_have_count(1)
    # while a run begins anew, what is drawn of the one before is paler
    server.wait_for_run()
    expect(check.locator(".old")).to_have_count(0)
    states["corrected"] = found()
    if screenshots:
        check.screenshot(path=screenshots / f"check-{theme}.png")
    assert {name: bad for name, bad in states.items() if bad} == {}


def test_the_other_button_in_3d_has_the_menu_of_who_is_selected(
    browser: Browser, server: Server, as_it_was: None
) -> None:
    with opened(browser, server) as page:
        ask(server, "POST", "seek", {"step": BEFORE})
        canvas = viser(page).locator("canvas").first.bounding_box()
        assert canvas is not None
        x, y = canvas["x"] + 60, canvas["y"] + 60
        page.keyboard.press("]")
        page.mouse.move(x, y)
        page.mouse.down(button="right")
        page.mouse.move(x + 40, y)  # this moves the view
        page.mouse.up(button="right")
        menu = page.get_by_role("menu", name="Corrections of track")
        page.wait_for_timeout(300)
        expect(menu).to_have_count(0)
        page.mouse.click(x, y, button="right")
        expect(menu.get_by_role("menuitem").first).to_be_focused()
        expect(menu.get_by_role("menuitem").filter(has_text="Was nobody")).to_be_visible()


def test_a_link_to_a_step_of_check_leads_there(
    browser: Browser, server: Server, as_it_was: None
) -> None:
    with opened(browser, server, flat=True) as page:
        page.goto(f"{server.address}?step={BEFORE}#check")
        page.reload()
        expect(places(page).first).to_be_visible()
        page.wait_for_timeout(500)  # the queue is whole
        assert readout(page) == str(BEFORE)
        expect(page.get_by_text("No place is chosen")).to_be_visible()
        page.keyboard.press("y")
        expect(places(page).first).to_have_attribute("aria-selected", "true")


def test_a_new_person_with_a_small_window_has_the_place_and_its_buttons_in_sight(
    browser: Browser, server: Server, as_it_was: None
) -> None:
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    page = context.new_page()
    page.goto(server.address)
    tour = page.get_by_role("heading", name="What you see")
    expect(tour).to_be_visible()
    page.get_by_role("link", name="Check").click()
    expect(tour).to_be_hidden()
    for name in ("Split here", "Confirm"):
        button = page.locator("#panel-place").get_by_role("button", name=name)
        expect(button.first).to_be_in_viewport(ratio=1.0)
    context.close()


def test_a_copy_goes_on_with_its_places_corrections_and_address(
    check: Page, server: Server, tmp_path: Path
) -> None:
    folder = server.get("/api/state").json()["sequence"]["opened_as"]
    server.command("correct", corrections=[{"kind": "checked", "first": 0, "last": 9}])
    server.wait_for_run()
    said = check.get_by_text("steps 0 – 9 checked")
    expect(said.first).to_be_visible(timeout=20_000)
    expect(places(check).first).to_be_visible(timeout=20_000)
    count = places(check).count()
    copied = tmp_path / "copied"
    server.command("copy_taught", folder=str(copied))
    until(check, lambda: str(copied) in parse_qs(urlsplit(check.url).query)["seq"], "its address")
    expect(places(check)).to_have_count(count, timeout=20_000)
    expect(said.first).to_be_visible(timeout=20_000)
    ask(server, "POST", "sequence", {"name": folder})
    server.wait_for_run()
