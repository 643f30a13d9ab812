"""The main job as a person does it: see the room, scrub, move a slider, take the tracks away."""

from __future__ import annotations

import base64
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Frame, Page, expect

from tests.browser.conftest import Server
from tests.browser.walkers import FRAMES
from tests.synthetic import number_in
from tracker import pipeline
from tracker.export import read_tracks_csv
from tracker.parameters import with_values
from tracker.sequences.library import open_sequence


def viser(page: Page) -> Frame:
    """The 3D view inside the page, once it is connected."""
    page.wait_for_selector("iframe")
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        for frame in page.frames:
            if "/viser/" in frame.url and frame.query_selector(".mvp-status[data-step]"):
                return frame
        page.wait_for_timeout(100)
    raise AssertionError("the 3D view did not connect within 60 s")


def until(page: Page, condition: Callable[[], bool], what: str, seconds: float = 30.0) -> None:
    """Wait for an end state: the software renderer draws a few frames a second."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if condition():
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"not within {seconds} s: {what}")


def numbers_in_pictures(page: Page) -> list[int]:
    """What number each camera's picture says it is."""
    numbers = []
    for canvas in page.query_selector_all(".cam canvas"):
        url = canvas.evaluate("canvas => canvas.toDataURL('image/png')")
        data = np.frombuffer(base64.b64decode(url.partition(",")[2]), dtype=np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert picture is not None
        numbers.append(number_in(cv2.resize(picture, (192, 144), interpolation=cv2.INTER_AREA)))
    return numbers


def overlay_steps(page: Page) -> list[str | None]:
    """The step whose results are drawn over each picture."""
    return [cam.get_attribute("data-overlay") for cam in page.query_selector_all(".cam")]


def clear_overlays(page: Page) -> None:
    """Switch every layer off, so that no box covers the number."""
    chips = page.get_by_role("group", name="Layers in the pictures").get_by_role("button")
    for chip in chips.all():
        if chip.get_attribute("aria-pressed") == "true":
            chip.click()


def readout(page: Page) -> str:
    """The step that the transport says is shown."""
    return page.get_by_label("Go to step").inner_text().split("/")[0].strip()


def shown_in_3d(frame: Frame) -> str | None:
    """The step that the 3D view says it shows."""
    status = frame.query_selector(".mvp-status")
    return status.get_attribute("data-step") if status else None


def test_pictures_overlays_readout_and_3d_show_the_same_step(page: Page, server: Server) -> None:
    scene = viser(page)
    clear_overlays(page)
    page.keyboard.press("Home")
    for step in range(12):
        if step:
            page.keyboard.press("ArrowRight")
        until(page, lambda step=step: readout(page) == str(step), f"the readout says {step}")
        assert numbers_in_pictures(page) == [step, step]
        assert overlay_steps(page) == [str(step), str(step)]
        until(page, lambda step=step: shown_in_3d(scene) == str(step), f"3D shows {step}")
    page.keyboard.press("End")
    until(page, lambda: readout(page) == str(FRAMES - 1), "the last step")
    until(page, lambda: numbers_in_pictures(page) == [FRAMES - 1] * 2, "its pictures")


def test_dragging_the_timeline_scrubs_everything(page: Page) -> None:
    scene = viser(page)
    clear_overlays(page)
    plot = page.locator(".time .plot")
    box = plot.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 5, box["y"] + 30)
    page.mouse.down()
    for share in np.linspace(0.05, 0.6, 12):
        page.mouse.move(box["x"] + share * box["width"], box["y"] + 30)
    page.mouse.up()
    until(page, lambda: int(readout(page)) > FRAMES // 3, "the middle of the recording")
    step = int(readout(page))
    until(page, lambda: numbers_in_pictures(page) == [step, step], f"the pictures of step {step}")
    until(page, lambda: shown_in_3d(scene) == str(step), f"3D shows {step}")


def test_a_slider_in_the_3d_panel_changes_the_run_and_the_csv_is_the_engines(
    page: Page, server: Server, tmp_path: Path
) -> None:
    scene = viser(page)
    before = server.get("/api/state").json()
    row = scene.locator("div:has(> .mantine-Text-root > label)", has_text="Detection probability")
    number = row.locator("xpath=..").locator("input.mantine-NumberInput-input").last
    number.fill("0.6")
    number.press("Enter")
    state = server.wait(
        lambda state: (
            state["parameters"]["fusion.detection_probability"] == 0.6
            and state["run"]["state"] == "done"
        )
    )
    assert state["run"]["key"] != before["run"]["key"]
    expect(page.get_by_role("tab", name="Changes")).to_contain_text("1")

    with page.expect_download() as download:
        page.get_by_role("button", name="Export").first.click()
    path = tmp_path / "tracks.csv"
    download.value.save_as(path)
    tracks = read_tracks_csv(path)

    sequence = open_sequence(str(server.folder))
    parameters = with_values(
        pipeline.default_parameters(sequence), {"fusion.detection_probability": 0.6}
    )
    run = pipeline.compute(sequence, parameters, seed=0)
    assert run.tracks.frames.tolist() == tracks.frames.tolist()
    assert run.tracks.ids.tolist() == tracks.ids.tolist()
    assert tracks.positions == pytest.approx(run.tracks.positions, abs=1e-4)
