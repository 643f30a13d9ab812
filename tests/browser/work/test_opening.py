"""The sheet Open…: from files that are dropped to tracks, and recordings found again."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.browser.access.test_accessibility import found
from tests.browser.conftest import opened
from tests.browser.looking import until
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers
from tests.io.importing.test_angles import lay_out
from tests.io.read.recorded import detections, toml, videos

LONG = 300_000
"""Milliseconds for all that is looked into: how fast that is, a benchmark tells."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where recordings are, and a person's own files beside it."""
    return tmp_path_factory.mktemp("opening")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Server]:
    """A workbench with a data folder that holds one recording."""
    write_walkers(folder / "data/walkers")
    running = Server(folder / "data/walkers", folder / "cache", data=folder / "data")
    yield running
    if running.process.poll() is None:
        running.stop()


@pytest.fixture
def page(browser: Browser, server: Server) -> Iterator[Page]:
    """The page without the 3D view."""
    with opened(browser, server, flat=True) as page:
        yield page


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """What another program left: videos, boxes, a calibration in centimetres, and a note."""
    session = tmp_path / "session"
    session.mkdir()
    toml(session, scale=100.0, size=(640, 360))
    videos(session, size=(640, 360))
    detections(session, size=(640, 360))
    (session / "notes.txt").write_text("the door was open\n")
    return session


def drop(page: Page, *files: Path) -> None:
    """Drop files or folders of the disk on the page, as a file manager does."""
    session = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(file) for file in files], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        session.send("Input.dispatchDragEvent", {"type": kind, "x": 300, "y": 400, "data": data})
        if kind == "dragOver":
            expect(page.locator(".drop-layer")).to_be_visible()
    expect(page.locator(".drop-layer")).to_be_hidden()


def settled(page: Page) -> None:
    """Wait until all checks are done."""
    expect(page.locator("[data-do=track]")).to_be_enabled(timeout=LONG)
    checks = page.locator(".opener [aria-label=Checks]")
    expect(checks).not_to_contain_text("looking at", timeout=LONG)


def test_dropped_files_become_tracks(
    page: Page, server: Server, files: Path, folder: Path, screenshots: Path | None
) -> None:
    drop(page, files)
    settled(page)
    sheet = page.locator("dialog.opener")
    expect(sheet.locator("tbody tr")).to_have_count(4)
    expect(sheet.locator("tbody tr").first).to_contain_text("cam1.avi")
    expect(sheet.locator("tbody tr").first).to_contain_text("60 frames · 20 fps · 640 × 360")
    expect(sheet.locator(".s-head")).to_contain_text("Hz, by the videos")
    expect(sheet.locator(".told")).to_contain_text("session/notes.txt: no format that is read")
    expect(sheet.locator(".told")).to_be_in_viewport()
    expect(sheet.get_by_role("group", name="Unit").locator("[aria-pressed=true]")).to_have_text(
        "cm"
    )
    if screenshots is not None:
        page.screenshot(path=screenshots / "open-dropped.png")
    sheet.locator("#in-name").fill("living room")
    sheet.locator("#in-name-1").fill("window")
    page.evaluate("location.hash = '#study'")
    page.keyboard.press("Control+Enter")
    expect(sheet).not_to_be_visible(timeout=LONG)
    tune = page.get_by_role("link", name="Tune")
    expect(tune).to_have_attribute("aria-current", "page")  # where its tracks are seen
    state = server.wait(lambda now: now["sequence"]["name"] == "living room")
    assert [camera["name"] for camera in state["sequence"]["cameras"]][1] == "window"
    state = server.wait_for_run()
    assert state["run"]["done"] == 60
    assert len(server.get("/api/timeline").json()["tracks"]) >= 3
    assert (folder / "data/living room/files/session/cam1.avi").is_file()


def test_a_wish_that_is_slow_does_not_take_back_the_next(
    flat_page: Page, server: Server, files: Path
) -> None:
    """Each tells all that is wished: of two names that are given at once both count."""
    page = flat_page
    drop(page, files)
    settled(page)
    page.evaluate(
        """() => {
            const fetched = window.fetch;
            window.told = [];
            let sent = 0;
            window.fetch = async (address, how) => {
                if (how?.method !== "PUT") return fetched(address, how);
                if (!sent++) await new Promise((go) => setTimeout(go, 500));
                const answer = await fetched(address, how);
                told.push(address);
                return answer;
            };
        }"""
    )
    sheet = page.locator("dialog.opener")
    sheet.locator("#in-name").fill("living room")
    sheet.locator("#in-name-1").fill("window")
    sheet.locator("#in-name-1").blur()
    page.wait_for_function("() => told.length === 2")
    key = page.evaluate("() => told[0].split('/').at(-2)")
    wish = server.get(f"/api/import/{key}").json()["wish"]
    assert wish["name"] == "living room"
    assert "window" in str(wish)
    page.get_by_role("button", name="Cancel").click()
    expect(sheet).to_contain_text("Open a recording")


def test_four_cameras_fit_a_small_screen(page: Page, files: Path) -> None:
    """Room, checks and target are seen whole, without scrolling, and nothing stands beside them."""
    (files / "notes.txt").unlink()
    page.set_viewport_size({"width": 1280, "height": 720})
    drop(page, files)
    settled(page)
    beyond = page.evaluate(
        """() => [...document.querySelectorAll("dialog.opener, dialog.opener *")]
            .filter((e) => /auto|scroll|hidden/.test(getComputedStyle(e).overflowY))
            .filter((e) => !e.title)  // what is cut has the whole in its tip
            .filter((e) => e.scrollHeight > e.clientHeight + 1 || e.scrollWidth > e.clientWidth + 1)
            .map((e) => `${e.className}: ${e.innerText}`)"""
    )
    assert beyond == []
    stray = page.evaluate(
        """() => [...document.querySelector("dialog.opener").childNodes]
            .map((node) => (node.nodeType === Node.TEXT_NODE ? node.data.trim() : ""))
            .join("")"""
    )
    assert stray == ""
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator("dialog.opener")).to_contain_text("Open a recording")


@pytest.fixture
def boxes(files: Path) -> Path:
    """What another program left that had no videos: boxes and a calibration in metres."""
    for file in [*files.glob("*.avi"), files / "notes.txt"]:
        file.unlink()
    toml(files, size=(640, 360))
    return files


def test_boxes_alone_are_told_of_as_boxes(flat_page: Page, boxes: Path) -> None:
    """No word of videos, no conversion of metres to metres, no name of a section of a file."""
    page = flat_page
    page.keyboard.press("Control+o")
    page.locator("#open-path").fill(str(boxes))  # it need not be below the data folder
    page.keyboard.press("Enter")
    settled(page)
    sheet = page.locator("dialog.opener")
    expect(sheet).to_be_focused()  # not the button Cancel, which Enter would press
    row = sheet.locator("tbody tr").first
    expect(row).to_contain_text("calibration.toml")
    expect(row).to_contain_text("in metres")
    expect(row.locator(".shot")).to_have_count(0)
    expect(sheet).not_to_contain_text("Link")
    expect(sheet.locator(".s-head")).to_contain_text(", since no file says it")
    sheet.get_by_label("Rate, steps a second").fill("20")
    page.keyboard.press("Enter")
    expect(sheet.locator(".s-head")).to_contain_text("Hz, as you say")
    settled(page)
    expect(sheet).to_contain_text("the target is")
    assert not re.search(r"\[\w+\]", sheet.inner_text())
    for field, value in (("Poses", "world-to-camera"), ("Boxes", "ltwh"), ("First frame", "0")):
        expect(sheet.get_by_label(field, exact=True).locator(":checked")).to_have_text(value)
    page.get_by_role("button", name="Cancel").click()


def test_exchanged_cameras_are_to_look_at_everywhere(flat_page: Page, boxes: Path) -> None:
    """The head of the checks and the foot count alike, what is exchanged too."""
    page = flat_page
    (boxes / "cam1.csv").rename(boxes / "kept")
    (boxes / "cam2.csv").rename(boxes / "cam1.csv")
    (boxes / "kept").rename(boxes / "cam2.csv")
    drop(page, boxes)
    settled(page)
    sheet = page.locator("dialog.opener")
    expect(sheet.locator("tbody tr").first).to_contain_text("that of cam2")
    expect(sheet.get_by_role("region", name="Checks")).to_contain_text("1 to look at")
    expect(sheet.locator(".say")).to_contain_text("nothing to decide, 1 thing to look at")
    expect(sheet.locator(".dot")).to_have_class("dot warn")
    page.get_by_role("button", name="Cancel").click()


def test_a_camera_of_another_recording_is_left_out_beside_its_warning(
    flat_page: Page, boxes: Path
) -> None:
    """Its row, the check and the foot say the same of it until it is left out."""
    page = flat_page
    table = (boxes / "cam3.csv").read_text().splitlines()
    last = int(table[-1].split(",")[0])
    other = []
    for row in table[1:]:  # people who walk backwards in a picture of the other hand
        frame, left, top, width, height = (float(value) for value in row.split(","))
        other.append(f"{last - frame:.0f},{640 - left - width},{top},{width},{height}")
    (boxes / "cam3.csv").write_text("\n".join([table[0], *other]))
    drop(page, boxes)
    settled(page)
    sheet = page.locator("dialog.opener")
    checks = sheet.get_by_role("region", name="Checks")
    expect(sheet.locator("tbody tr").nth(2)).to_contain_text("does not fit the others")
    expect(sheet.locator(".say")).to_contain_text("3 of 4 cameras ready, 1 thing to decide")
    expect(checks).to_contain_text("1 to look at")
    checks.get_by_role("button", name="Leave out cam3").click()
    expect(sheet.locator("tbody tr")).to_have_count(3)
    settled(page)
    expect(sheet).to_contain_text("Left out: cam3")
    expect(sheet.locator(".say")).to_contain_text("3 of 3 cameras ready, nothing to decide")
    page.get_by_role("button", name="Cancel").click()


def test_the_plan_fills_its_frame_and_nothing_is_drawn_over_a_name(
    flat_page: Page, boxes: Path
) -> None:
    page = flat_page
    drop(page, boxes)
    settled(page)
    for size in ((1280, 720), (1440, 900), (1920, 1080)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        # read in one go: what the server says next draws the plan anew
        frame, ground, over = page.evaluate(
            """() => {
                const plan = document.querySelector(".plan");
                const places = [...plan.querySelectorAll("text:not(.length)")]
                    .map((text) => [text.textContent, text.getBoundingClientRect()]);
                const over = places.flatMap(([name, one], k) => places.slice(k + 1)
                    .filter(([_, other]) => one.left < other.right && other.left < one.right
                        && one.top < other.bottom && other.top < one.bottom)
                    .map(([other]) => `${name} ${other}`));
                const sized = (box) => [box.width, box.height];
                const ground = plan.querySelector(".ground");
                return [sized(plan.getBoundingClientRect()),
                    sized(ground.getBoundingClientRect()), over];
            }"""
        )
        assert ground[0] > 0.97 * frame[0] or ground[0] < ground[1]
        assert ground[1] > 0.97 * frame[1] > 0.0, size
        assert over == [], size
    page.get_by_role("button", name="Cancel").click()


@pytest.mark.data
def test_a_folder_of_others_is_tracked(flat_page: Page, server: Server, foreign: Path) -> None:
    """From the drop to the last track, with what its makers give and nothing told."""
    page, name = flat_page, "wildtrack-60"
    drop(page, foreign / name)
    settled(page)
    page.keyboard.press("Control+Enter")
    expect(page.locator("dialog.opener")).not_to_be_visible(timeout=LONG)
    server.wait(
        lambda now: (
            now["sequence"]["name"] == name
            and now["run"]["state"] == "done"
            and now["run"]["done"] == now["sequence"]["frames"]
        )
    )
    assert server.get("/api/timeline").json()["tracks"]


def test_what_is_changed_is_looked_into_again(flat_page: Page, files: Path) -> None:
    page = flat_page
    drop(page, files)
    settled(page)
    sheet = page.locator("dialog.opener")
    sheet.get_by_label("Poses").select_option("camera-to-world")
    settled(page)
    expect(sheet.get_by_role("button", name="Apply “Poses” world-to-camera")).to_be_visible()
    page.locator("h2", has_text="Import").click()
    page.keyboard.press("Control+z")
    expect(sheet.get_by_role("button", name="Apply “Poses” world-to-camera")).to_have_count(0)
    settled(page)
    sheet.get_by_role("group", name="Unit").get_by_role("button", name="mm").click()
    sheet.get_by_role("button", name="Apply “File's unit” cm").click()
    expect(sheet.get_by_role("button", name="Apply “File's unit” cm")).to_have_count(0)
    sheet.get_by_label("Boxes", exact=True).select_option("xyxy")
    first = sheet.locator("tbody tr").first
    expect(first).to_contain_text("none of its boxes is left as they are read")
    expect(sheet).to_contain_text("0 of 4 cameras ready, 4 things to decide")
    first.get_by_role("button", name="As found").click()
    expect(first).to_contain_text("boxes a step · table")
    expect(first).to_contain_text("ready")
    settled(page)
    seated = sheet.locator(".choice", has_text="Seated")
    seated.click()
    expect(seated).to_have_attribute("aria-pressed", "true")
    settled(page)  # what is looked into again may suggest another room
    plan = sheet.locator(".plan")
    before = sheet.get_by_label("Room, to x, metres").input_value()
    plan.focus()
    page.keyboard.press("Shift+ArrowRight")
    moved = f"{float(before) + 0.05:.2f}"
    expect(sheet.get_by_label("Room, to x, metres")).to_have_value(moved)
    sheet.get_by_role("button", name="As suggested").click()
    expect(sheet.get_by_label("Room, to x, metres")).to_have_value(before)
    late, other = (
        sheet.get_by_label(f"{name} starts late by, frames") for name in ("cam2", "cam1")
    )
    more = sheet.get_by_role("button", name=re.compile("a frame more"))
    more.evaluate_all("all => [all[1], all[0], all[1]].forEach(button => button.click())")
    settled(page)
    expect(late).to_have_value("2")  # also what was pressed before the first was answered
    expect(other).to_have_value("1")
    other.fill("0")
    other.press("Enter")
    late.fill("6")
    late.press("Enter")
    expect(sheet.locator("tbody tr").nth(1)).to_contain_text("Apply 0")
    sheet.get_by_role("button", name="Apply 0").click()
    expect(late).to_have_value("0")
    sheet.get_by_role("button", name="Back to recent").click()
    expect(sheet).to_contain_text("Open a recording")


def test_the_sheet_opens_what_is_there(flat_page: Page, server: Server, folder: Path) -> None:
    page = flat_page
    page.keyboard.press("Control+o")
    sheet = page.locator("dialog.opener")
    own = sheet.locator(".rec", has_text="numbers")
    expect(own).to_contain_text("2 cameras")
    expect(own.locator("img")).to_have_js_property("complete", True)
    expect(sheet.locator(".rec", has_text="room44-3p")).to_be_visible()
    sheet.get_by_label("Find by name").fill("numb")
    expect(sheet.locator(".rec", has_text="room44-3p")).to_be_hidden()
    expect(sheet.get_by_role("heading", name="Built-in rooms")).to_be_hidden()
    expect(sheet.get_by_role("heading", name="Recent")).to_be_visible()
    sheet.get_by_label("Path").fill(str(folder / "nowhere"))
    sheet.get_by_role("button", name="Open", exact=True).click()
    expect(sheet.get_by_role("alert")).to_contain_text("there is no such file or folder")
    shutil.copytree(folder / "data/walkers", folder / "data/others", dirs_exist_ok=True)
    sheet.get_by_label("Path").fill("others/sequence.toml")
    sheet.get_by_label("Path").press("Enter")
    expect(sheet).not_to_be_visible()
    server.wait(lambda now: now["sequence"]["opened_as"].endswith("others"))
    # in the bar's list it is once, though its name is not that of its folder
    listed = page.get_by_role("combobox", name="Sequence")
    expect(listed).to_have_value("others")
    expect(listed.locator("option:checked")).to_have_text("numbers")
    every = server.get("/api/sequences").json()["sequences"]
    expect(listed.locator("option")).to_have_count(len(every))
    page.keyboard.press("Control+o")
    find = sheet.get_by_label("Find by name")
    expect(find).to_have_value("")
    find.fill("room44")  # before the list is there, or after
    expect(sheet.locator(".rec", has_text="room44-3p")).to_be_visible()
    expect(own.first).to_be_hidden()
    expect(sheet.get_by_role("heading", name="Recent")).to_be_hidden()
    find.press("Enter")  # the first that is found
    expect(sheet).not_to_be_visible()
    server.wait(lambda now: now["sequence"]["name"] == "room44-3p")


def test_keys_that_are_pressed_again_while_the_sheet_is_read_open_it(flat_page: Page) -> None:
    """It is there before the list of recordings is."""
    page = flat_page
    waiting: list[Route] = []
    page.route("**/opening/sheet.js", lambda route: waiting.append(route))
    page.route("**/api/recordings", lambda route: None)  # the server is busy
    page.reload()
    page.locator(".cam canvas").first.wait_for()
    with page.expect_request("**/opening/sheet.js"):
        page.keyboard.press("Control+o")
    page.keyboard.press("Control+o")
    waiting[0].continue_()
    expect(page.get_by_role("heading", name="Open a recording")).to_be_visible()
    page.keyboard.press("Escape")


def test_a_path_is_looked_into_by_enter(flat_page: Page, files: Path, folder: Path) -> None:
    page = flat_page
    shutil.copytree(files, folder / "data/by-path")
    page.keyboard.press("Control+o")
    page.locator("#open-path").fill("by-path")
    page.keyboard.press("Enter")
    expect(page.get_by_role("heading", name="Import", exact=True)).to_be_visible(timeout=10_000)
    settled(page)
    expect(page.locator("dialog.opener tbody tr")).to_have_count(4)
    page.get_by_role("button", name="Cancel").click()


def test_an_upload_is_stopped_cleanly(flat_page: Page, files: Path, folder: Path) -> None:
    page, data = flat_page, folder / "data"
    others = set(data.glob(".import-*"))  # sheets that were left open
    page.route("**/files/**", lambda route: None)  # nothing of it ever arrives
    drop(page, files)
    sheet = page.locator("dialog.opener")
    expect(sheet.get_by_role("progressbar", name="Upload")).to_be_visible()
    expect(sheet.locator(".in-files")).to_contain_text("session/cam1.avi")
    sheet.get_by_role("button", name="Stop").click()
    expect(sheet).to_contain_text("Open a recording")
    # the sheet does not wait for the server to have taken it away
    until(page, lambda: set(data.glob(".import-*")) <= others, "the upload is taken away", 20.0)


@pytest.mark.data
def test_a_foreign_recording_is_dropped_and_tracked(
    flat_page: Page, server: Server, foreign: Path
) -> None:
    page = flat_page
    drop(page, foreign / "pose2sim-multi")
    settled(page)
    sheet = page.locator("dialog.opener")
    expect(sheet.locator("tbody tr")).to_have_count(4)
    expect(sheet.locator("tbody tr").first.get_by_title("Qualisys")).to_have_text("Calib.qca.txt")
    expect(sheet.locator("tbody tr").first).to_contain_text("mm → m")
    sheet.get_by_role("button", name="Import and track").click()
    server.wait(lambda now: now["sequence"]["name"].startswith("pose2sim-multi"))
    assert server.wait_for_run()["run"]["done"] == 100


def test_nothing_serious_stands_in_the_way_of_anybody(flat_page: Page, files: Path) -> None:
    page = flat_page
    page.emulate_media(reduced_motion="reduce")  # colours are judged when they have come to rest
    page.keyboard.press("Control+o")
    expect(page.locator(".rec").first).to_be_visible()
    states = {"start": found(page)}
    drop(page, files)
    settled(page)
    for theme in ("light", "dark"):
        page.locator("html").evaluate(f"page => {{ page.dataset.theme = '{theme}' }}")
        states[theme] = found(page)
    assert {name: list_ for name, list_ in states.items() if list_} == {}
    sheet = page.locator("dialog.opener")
    for size in ((1280, 720), (1440, 900), (1920, 1080)):
        page.set_viewport_size({"width": size[0], "height": size[1]})
        wider = sheet.evaluate(
            """sheet => [...sheet.querySelectorAll("button, .lab, h2, h3, input, .in-body, .rf")]
                .filter((part) => part.scrollWidth > part.clientWidth + 1 && part.clientWidth)
                .map((part) => part.outerHTML.slice(0, 120))"""
        )
        assert wider == [], size


def test_pairs_of_many_cameras_stand_in_a_square(flat_page: Page, files: Path) -> None:
    """What is odd comes first, the farthest apart of it before."""
    page = flat_page
    names = [f"cam{number}" for number in range(1, 13)]

    def of_twelve(route: Route) -> None:
        answer = route.fetch()
        told = answer.json()
        info = told.get("draft") or told
        if info.get("pairs"):
            (camera, *_), (pair, *_) = info["cameras"], info["pairs"]
            info["cameras"] = [{**camera, "name": name, "key": name} for name in names]
            info["pairs"] = [
                {
                    **pair,
                    "first": a,
                    "second": b,
                    "pixels": 9.5 if b == "cam12" else 1.5,
                    "odd": a == "cam3",
                }
                for a, b in combinations(names, 2)
            ]
        route.fulfill(response=answer, json=told)

    page.route(re.compile("/api/import/[^/?]+(/arrived|/wish)?$"), of_twelve)
    drop(page, files)
    settled(page)
    grid = page.locator(".opener .pair-grid")
    expect(grid.locator("td[title*='their boxes meet']")).to_have_count(66)
    listed = grid.locator("li")
    expect(listed).to_have_count(8)
    expect(listed.first).to_have_text("cam3 – cam12 9.5 px")
    expect(grid.locator("li.w", has_text="cam3 – ")).to_have_count(8)


def test_what_the_files_leave_open_is_asked_for(
    flat_page: Page, folder: Path, tmp_path: Path
) -> None:
    """A calibration where there is none, and how angles are meant that no video shows."""
    page = flat_page
    alone, angles = tmp_path / "alone", folder / "data/angles"
    for folder in (alone, angles):
        folder.mkdir()
    detections(alone)
    lay_out(angles, "into the camera", seen=False)
    sheet = page.locator("dialog.opener")
    drop(page, alone)
    expect(sheet.get_by_role("button", name="Add a calibration file…")).to_be_visible(timeout=LONG)
    sheet.get_by_role("button", name="Back to recent").click()
    sheet.locator("#open-path").fill(str(angles))
    page.keyboard.press("Enter")
    expect(sheet.get_by_label("Angles")).to_be_visible(timeout=LONG)
    expect(sheet.locator(".say")).to_contain_text("tell their order")
    sheet.get_by_role("button", name="Cancel").click()
    expect(sheet).to_contain_text("Open a recording")
