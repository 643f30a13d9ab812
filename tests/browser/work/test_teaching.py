"""Teaching in the browser: a box becomes a template, a face is dragged, all of it is saved."""

from __future__ import annotations

import copy
import os
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import httpx2
import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.scene import views
from app.scene.scene import _margin_around
from tests.browser.conftest import Server
from tests.browser.looking import as_at_first, ask, by_palette, readout, still, until, viser
from tests.single_view.networks import pooling
from tracker.export.tracks_csv import read_tracks_csv
from tracker.runs import pipeline
from tracker.sequences.reader import FILE, read_sequence
from tracker.sequences.writing.teaching import taught_values, with_taught


def drag(page: Page, begin: tuple[float, float], end: tuple[float, float], pause: int = 0) -> None:
    """Press at one place of the page, move, let go at another."""
    page.mouse.move(*begin)
    page.wait_for_timeout(pause)
    page.mouse.down()
    page.wait_for_timeout(pause)
    for share in np.linspace(0.1, 1.0, 10):
        page.mouse.move(*(a + share * (b - a) for a, b in zip(begin, end, strict=True)))
        page.wait_for_timeout(pause // 4)
    page.wait_for_timeout(pause)
    page.mouse.up()


def test_a_remark_on_the_file_leaves_saving_in_sight(flat_page: Page, server: Server) -> None:
    page = flat_page
    page.set_viewport_size({"width": 1280, "height": 720})
    file = Path(server.get("/api/state").json()["sequence"]["folder"]) / FILE
    before, status = file.read_bytes(), file.stat()
    server.command("set_room_face", side="max", axis=1, value=1.75)
    try:
        file.write_bytes(before + b"# by hand\n")
        page.get_by_role("tab", name="Teach").click()
        remark = page.get_by_text("was changed by another program")
        expect(remark).to_be_in_viewport(ratio=1.0)
        expect(page.get_by_role("button", name="Discard")).to_be_in_viewport(ratio=1.0)
        expect(page.get_by_role("button", name="Save in")).to_be_in_viewport(ratio=1.0)
    finally:
        file.write_bytes(before)
        os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))
        server.command("discard_taught")


def test_a_box_dragged_on_a_camera_becomes_a_template_and_changes_the_run(
    flat_page: Page, server: Server, tmp_path: Path
) -> None:
    page = flat_page
    expect(page.locator(".lane").first).to_be_visible(timeout=30_000)
    page.keyboard.press("Home")
    for _ in range(2):
        page.keyboard.press("PageDown")
    until(page, lambda: readout(page) == "20", "twenty steps on")
    server.command("set_parameters", changes={"single_view": "colour_phd"})
    server.wait(lambda state: state["run"]["state"] == "failed")  # there is no template yet
    # which the page says above the pictures: they have moved when it is there
    expect(page.get_by_text("The run stopped at step")).to_be_visible(timeout=20_000)
    page.keyboard.press("c")
    expect(page.locator(".mosaic")).to_have_class(re.compile("drawing"))
    expect(page.get_by_text("Drag a box around a person, or")).to_be_visible(timeout=20_000)
    picture = page.locator(".cam").first.bounding_box()
    assert picture is not None
    scale = picture["width"] / 192
    left, top = picture["x"], picture["y"]
    drag(
        page,
        (left + 40 * scale, top + 30 * scale),
        (left + 64 * scale, top + 78 * scale),
    )
    name = page.get_by_label("Name of template 1")
    expect(name).to_be_focused(timeout=20_000)
    page.keyboard.type("Anna")
    page.keyboard.press("Enter")
    state = server.wait(
        lambda state: state["run"]["state"] == "done" and state["teaching"]["unsaved"] == 1
    )
    assert state["sequence"]["templates"] == 1
    expect(page.locator("#panel-teach img")).to_have_count(2)
    expect(page.get_by_text("1 change not saved")).to_be_visible(timeout=20_000)
    expect(page.get_by_text("template Anna added")).to_be_visible(timeout=20_000)
    natural = "images => images.every((i) => i.complete && i.naturalWidth > 0)"
    until(page, lambda: page.locator("#panel-teach img").evaluate_all(natural), "its pictures")
    assert page.locator(".cam[aria-pressed=true]").count() == 0  # the drag chose no camera

    # what is shown is what the engine finds with that box
    opened = read_sequence(Path(server.folder))
    values = copy.deepcopy(taught_values(opened))
    box = [40.0, 30.0, 24.0, 48.0]
    values["template"].append({"name": "Anna", "camera": "cam1", "frame": 20, "box": box})
    with page.expect_download() as download:
        page.get_by_role("button", name="Export").first.click()
        page.get_by_role("menuitem", name="CSV").first.click()
    path = tmp_path / "tracks.csv"
    download.value.save_as(path)
    shown = read_tracks_csv(path)
    server.command("save_taught")
    (template,) = read_sequence(Path(server.folder)).templates
    assert (template.name, template.camera, template.frame) == ("Anna", "cam1", 20)
    assert template.box == pytest.approx(box, abs=0.6)  # whole pixels of the screen
    values["template"][0]["box"] = template.box.tolist()
    taught = with_taught(opened, values, FILE)
    run = pipeline.compute(taught, pipeline.default_parameters(taught), seed=0)
    assert run.tracks.frames.tolist() == shown.frames.tolist()
    assert shown.positions == pytest.approx(run.tracks.positions, abs=1e-4)

    # undo takes it back, redo brings it again; Escape leaves the mode
    page.keyboard.press("Escape")  # out of the name
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Escape")
    expect(page.get_by_text("Drag a box around a person, or")).to_be_hidden(timeout=20_000)
    page.keyboard.press("Control+z")
    server.wait(lambda state: state["teaching"]["unsaved"] > 0)
    page.keyboard.press("Control+Shift+z")
    server.wait(lambda state: state["teaching"]["unsaved"] == 0)

    # so it is with an earlier run: its templates and its method are one step
    taught = server.wait_for_run()
    page.get_by_role("tab", name="Runs").click()
    again = page.get_by_role("button", name="Use the parameters of run 1 again")
    again.click()
    state = server.wait(lambda state: state["sequence"]["templates"] == 0)
    assert state["methods"]["single_view"] != "colour_phd"
    expect(again).to_have_count(0)
    for key, templates in (("Control+z", 1), ("Control+Shift+z", 0), ("Control+z", 1)):
        page.keyboard.press(key)
        state = server.wait(lambda state, n=templates: state["sequence"]["templates"] == n)
        assert (state["methods"] == taught["methods"]) == (templates == 1)
        assert (state["teaching"]["key"] == taught["teaching"]["key"]) == (templates == 1)
        page.wait_for_timeout(300)  # the page hears of it
    server.command("reset_parameters")
    server.wait_for_run()


def test_the_field_of_a_new_name_is_no_trap(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    before = server.get("/api/state").json()["sequence"]["templates"]

    def draw(left: float) -> None:
        if "drawing" not in (page.locator(".mosaic").get_attribute("class") or ""):
            page.keyboard.press("c")
            expect(page.locator(".mosaic")).to_have_class(re.compile("drawing"))
        box = still(page.locator(".cam").first)
        scale = box["width"] / 192
        x, y = box["x"] + left * scale, box["y"] + 30 * scale
        drag(page, (x, y), (x + 24 * scale, y + 48 * scale))

    def names() -> list[str]:
        fields = page.locator("[id^=template-]")
        return [str(fields.nth(i).input_value()) for i in range(fields.count())]

    # letters that were meant for the page, and a click elsewhere: no name
    draw(40)
    name = page.locator(f"#template-{before}")
    expect(name).to_be_focused()
    expect(name).to_be_in_viewport()
    given = name.input_value()
    page.keyboard.type("rr")
    page.locator(".plot").click(position={"x": 200, "y": 60})
    expect(name).to_have_value(given)
    # Escape leaves the field, and again the drawing
    draw(80)
    second = page.locator(f"#template-{before + 1}")
    expect(second).to_be_focused()
    page.keyboard.type("Bob")
    page.keyboard.press("Escape")
    expect(second).not_to_be_focused()
    expect(second).to_have_value(names()[before + 1])
    assert "Bob" not in names()
    page.keyboard.press("Escape")
    expect(page.locator(".mosaic")).not_to_have_class(re.compile("drawing"))
    # what was typed is kept by Control and S, and saved
    draw(120)
    expect(page.locator(f"#template-{before + 2}")).to_be_focused()
    page.keyboard.type("Clara")
    page.keyboard.press("Control+s")
    server.wait(lambda state: state["teaching"]["unsaved"] == 0)
    kept = [template.name for template in read_sequence(Path(server.folder)).templates]
    assert kept[before + 2] == "Clara"
    assert "Bob" not in kept
    page.keyboard.press("Escape")
    for index in (2, 1, 0):
        server.command("remove_template", index=before + index)
    server.command("save_taught")
    as_at_first(server)


def test_a_template_is_drawn_moved_and_named_by_keys_alone(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    before = server.get("/api/state").json()["sequence"]["templates"]
    page.keyboard.press("c")
    drawing = re.compile("drawing")  # its code is loaded when it is first asked for
    expect(page.locator(".mosaic")).to_have_class(drawing)
    page.locator(".cam").nth(1).focus()
    page.keyboard.press("Enter")
    box = page.get_by_role("button", name="Box in cam2")
    expect(box).to_be_focused()

    def placed() -> list[float]:
        """Left, top, width and height in pixels of the picture, wherever that is on the page."""
        found: list[float] = box.evaluate(
            """box => {
                const cell = document.querySelectorAll(".cam")[1];
                const whole = cell.getBoundingClientRect();
                const own = box.getBoundingClientRect();
                return [own.x - whole.x, own.y - whole.y, own.width, own.height]
                    .map((length) => length * 192 / whole.width);
            }"""
        )
        return found

    begun = placed()
    readout_before = readout(page)
    for key in ("ArrowRight", "Shift+ArrowDown", "Control+Shift+ArrowRight", "Control+ArrowUp"):
        page.keyboard.press(key)
    changes = [now - before for now, before in zip(placed(), begun, strict=True)]
    assert changes == pytest.approx([1.0, 10.0, 10.0, -1.0], abs=0.2)
    assert readout(page) == readout_before  # the clock has other keys meanwhile
    page.keyboard.press("Escape")  # leaves the box, and again the drawing
    expect(box).to_have_count(0)
    expect(page.locator(".mosaic")).to_have_class(drawing)
    page.keyboard.press("Enter")
    page.keyboard.press("Shift+ArrowLeft")
    page.keyboard.press("Enter")
    name = page.locator(f"#template-{before}")
    expect(name).to_be_focused()
    expect(name).to_be_in_viewport()
    page.keyboard.type("Eve")
    page.keyboard.press("Enter")
    expect(name).to_have_value("Eve")
    page.keyboard.press("Escape")
    expect(page.locator(".mosaic")).not_to_have_class(drawing)
    page.keyboard.press("Control+s")
    server.wait(lambda state: state["teaching"]["unsaved"] == 0)
    template = read_sequence(Path(server.folder)).templates[before]
    assert (template.name, template.camera) == ("Eve", "cam2")
    server.command("remove_template", index=before)
    server.command("save_taught")
    as_at_first(server)


def test_a_template_by_numbers_is_added_once_and_named(flat_page: Page, server: Server) -> None:
    page = flat_page
    as_at_first(server)
    before = server.get("/api/state").json()["sequence"]["templates"]
    by_palette(page, "teach: colours, room")
    # the panel has the focus: what is in it comes next
    expect(page.locator("#panel-teach")).to_be_focused()
    page.keyboard.press("Tab")
    assert page.locator("#panel-teach :focus").count() == 1
    page.locator("#new-step").focus()
    page.keyboard.type("20")
    for number in (40, 30, 24, 48):
        page.keyboard.press("Tab")
        page.keyboard.type(str(number))
    page.keyboard.press("Tab")
    expect(page.get_by_role("button", name="Add", exact=True)).to_be_focused()
    page.keyboard.press("Enter")
    name = page.locator(f"#template-{before}")
    expect(name).to_be_focused()
    page.keyboard.type("Dora")
    page.keyboard.press("Enter")
    expect(name).to_have_value("Dora")
    row = page.get_by_role("row", name="Box of Dora, cam1, step 20")
    expect(row.get_by_role("button", name="Go to step 20, camera cam1")).to_be_focused()
    expect(page.locator("#new-left")).to_have_value("")
    # what is beside a new row keeps the focus
    save = page.get_by_role("button", name="Add an entrance")
    save.focus()
    page.keyboard.press("Enter")
    server.wait(lambda state: state["teaching"]["unsaved"] == 2)
    expect(page.get_by_label("Entrance 1, x, metres")).to_be_visible()
    page.wait_for_timeout(300)  # the table is written anew
    expect(save).to_be_focused()
    assert server.get("/api/state").json()["sequence"]["templates"] == before + 1
    server.command("discard_taught")
    server.wait(lambda state: state["teaching"]["unsaved"] == 0)


def test_a_template_that_the_tracks_offer_is_taken_by_keys_and_undone(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    before = server.get("/api/state").json()["sequence"]["templates"]
    # by the boxes, whatever was taught before: colours of few templates may find nobody
    server.command("set_parameters", changes={"single_view": "none"})
    server.wait(
        lambda state: state["methods"]["single_view"] == "none" and state["run"]["state"] == "done"
    )
    by_palette(page, "teach: colours, room")
    ask_for = page.get_by_role("button", name="Offer from the tracks")
    ask_for.focus()
    page.keyboard.press("Enter")
    listed = page.get_by_role("table", name="Offered templates")
    expect(listed).to_be_visible(timeout=20_000)
    expect(listed).to_contain_text("2 cameras agree")
    boxes = listed.locator("img.swatch")
    natural = "images => images.length && images.every((i) => i.complete && i.naturalWidth > 0)"
    until(page, lambda: boxes.evaluate_all(natural), "the pictures of what is offered")
    offered = page.get_by_role("button", name=re.compile("^Add offer "))
    count = offered.count()
    assert count >= 2
    assert server.get("/api/state").json()["sequence"]["templates"] == before
    # the button of each is within the panel, however narrow
    panel, button = page.locator("#panel-teach").bounding_box(), offered.first.bounding_box()
    assert panel is not None
    assert button is not None
    assert button["x"] + button["width"] <= panel["x"] + panel["width"]
    offered.first.focus()
    page.keyboard.press("Enter")
    server.wait(lambda state: state["sequence"]["templates"] == before + 1)
    expect(page.locator(f"#template-{before}")).to_be_visible(timeout=20_000)
    expect(offered).to_have_count(count - 1)
    page.keyboard.press("Escape")
    page.locator("body").press("Control+z")
    server.wait(lambda state: state["sequence"]["templates"] == before)
    expect(offered).to_have_count(count)
    page.get_by_role("button", name="No more offers").click()
    expect(listed).to_have_count(0)
    as_at_first(server)


def test_whatever_is_come_to_by_tab_is_seen_in_a_low_panel(flat_page: Page) -> None:
    page = flat_page
    page.set_viewport_size({"width": 1280, "height": 720})
    page.get_by_role("tab", name="Teach").click()
    page.locator("#new-step").wait_for()
    page.get_by_role("tab", name="Teach").focus()
    hidden = """() => {
        const { activeElement: own } = document;
        const { x, y, width, height } = own.getBoundingClientRect();
        const there = document.elementFromPoint(x + width / 2, y + height / 2);
        return own.matches("#panel-teach input, #panel-teach button") && !own.contains(there)
            ? own.id || own.textContent : "";
    }"""
    for _ in range(30):
        page.keyboard.press("Tab")
        assert page.evaluate(hidden) == ""


def test_a_face_is_dragged_in_3d_saved_and_reopened(page: Page, server: Server) -> None:
    scene = viser(page)
    before = server.get("/api/state").json()["sequence"]["room"]["min"]
    page.keyboard.press("u")  # from above
    page.keyboard.press("r")
    server.wait(lambda state: state["teaching"]["editing_room"])
    expect(page.locator("[data-command=edit-room]")).to_have_attribute("aria-pressed", "true")
    canvas = scene.locator("canvas").first
    page.wait_for_timeout(3000)  # the flight, a few frames a second
    place = canvas.bounding_box()
    assert place is not None
    room = read_sequence(Path(server.folder)).room
    pose = views.from_above(_margin_around(room), place["width"] / place["height"])
    focal = place["height"] / 2.0 / np.tan(pose.fov / 2.0)

    def on_screen(point: list[float]) -> tuple[float, float]:
        away = focal / (pose.position[2] - point[2])
        x = place["x"] + place["width"] / 2.0 + away * (point[0] - pose.position[0])
        y = place["y"] + place["height"] / 2.0 - away * (point[1] - pose.position[1])
        return float(x), float(y)

    middle = (room.minimum + room.maximum) / 2.0
    arrow = [float(room.minimum[0]) - 0.3, float(middle[1]), float(middle[2])]
    drag(page, on_screen(arrow), on_screen([arrow[0] + 0.6, arrow[1], arrow[2]]), pause=400)
    state = server.wait(lambda state: state["sequence"]["room"]["min"][0] != before[0])
    wide = state["sequence"]["room"]["min"][0]
    assert wide == pytest.approx(before[0] + 0.6, abs=0.15)
    assert state["sequence"]["room"]["min"][1:] == before[1:]
    page.keyboard.press("Escape")
    server.wait(lambda state: not state["teaching"]["editing_room"])
    key = server.wait_for_run()["run"]["key"]
    page.get_by_role("tab", name="Teach").click()
    expect(page.get_by_label("Room, from x, metres")).to_have_value(f"{wide:g}")
    page.get_by_role("button", name="Save in").click()
    state = server.wait(lambda state: state["teaching"]["unsaved"] == 0)
    assert state["run"]["key"] == key
    assert tomllib.loads((Path(server.folder) / FILE).read_text("utf-8"))["room"]["min"][0] == wide
    assert list(Path(server.folder).glob("sequence.toml.bak*"))
    shown = server.get("/api/export/tracks.csv").text.splitlines()
    httpx2.post(server.address + "api/sequence", json={"name": str(server.folder)})
    server.wait(lambda state: state["opening"] is None and state["run"]["state"] == "done")
    again = server.get("/api/export/tracks.csv").text.splitlines()
    assert [line for line in again if line[0] != "#"] == [line for line in shown if line[0] != "#"]
    page.keyboard.press("0")


def test_one_click_compares_the_detector_with_shapes(
    flat_page: Page, server: Server, tmp_path: Path, screenshots: Path | None
) -> None:
    """The shown run is A, the other method's is B, and their figures stand beside each other."""
    page = flat_page
    model = str(pooling(tmp_path / "red.onnx"))
    try:
        ask(server, "PUT", "teach/detector", {"model": model})
        server.wait(_finished_by("onnx_detector"))
        page.get_by_role("tab", name="Teach").click()
        page.get_by_role("button", name="Compare with shapes").click()
        server.wait(_finished_by("shapes"))
        pinned = ask(server, "GET", "state")["pinned"]
        assert pinned["parameters"]["single_view"] == "onnx_detector"
        table = page.locator("#panel-compare")
        expect(table).to_contain_text("pinned run", timeout=30_000)
        expect(table).to_contain_text("onnx_detector")
        if screenshots is not None:
            page.screenshot(path=screenshots / "compared.png")
        page.get_by_role("tab", name="Teach").click()
        expect(page.get_by_role("button", name="Compare with onnx_detector")).to_be_visible()
        if screenshots is not None:
            page.screenshot(path=screenshots / "compare-button.png")
    finally:
        ask(server, "DELETE", "run/pin")
        ask(server, "PUT", "teach/detector", {"model": None})
        as_at_first(server)


def _finished_by(method: str) -> Callable[[dict], bool]:
    """Whether the shown run is one by this single-view method, and is finished."""
    return lambda state: (
        state["methods"]["single_view"] == method
        and state["run"]["state"] == "done"
        and state["run"]["key"] is not None
    )
