"""The main job as a person does it: see the room, scrub, move a slider, take the tracks away."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.browser.looking import (
    as_at_first,
    clear_overlays,
    numbers_in_pictures,
    overlay_steps,
    readout,
    shown_in_3d,
    until,
    viser,
)
from tests.browser.serving import Server
from tests.browser.walkers import FRAMES
from tracker import pipeline
from tracker.export import read_tracks_csv
from tracker.parameters import with_values
from tracker.sequences.library import open_sequence


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
    # on its way it may show steps before the one at which it was let go
    let_go = 0.6 * (FRAMES - 1)
    until(page, lambda: abs(int(readout(page)) - let_go) <= 1.0, "where it was let go")
    step = int(readout(page))
    until(page, lambda: numbers_in_pictures(page) == [step, step], f"the pictures of step {step}")
    until(page, lambda: shown_in_3d(scene) == str(step), f"3D shows {step}")


@pytest.mark.main_job
def test_a_slider_in_the_3d_panel_changes_the_run_and_the_csv_is_the_engines(
    page: Page, server: Server, tmp_path: Path
) -> None:
    scene = viser(page)
    before = server.get("/api/state").json()
    row = scene.locator("div:has(> .mantine-Text-root > label)", has_text="Detection probability")
    number = row.locator("xpath=..").locator("input.mantine-NumberInput-input").first
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


def test_a_slider_moved_twenty_times_in_a_second_ends_in_one_run(
    page: Page, server: Server
) -> None:
    as_at_first(server)
    scene = viser(page)
    key = "fusion.detection_probability"
    before = server.wait_for_run()["parameters"][key]
    row = scene.locator("div:has(> .mantine-Text-root > label)", has_text="Detection probability")
    thumb = row.locator("xpath=..").get_by_role("slider").first
    thumb.focus()
    begin = time.monotonic()
    for _ in range(20):
        thumb.press("ArrowLeft", no_wait_after=True)
        page.wait_for_timeout(max(0.0, 50.0 - 1e3 * (time.monotonic() - begin) % 50.0))
    wanted = float(thumb.get_attribute("aria-valuenow") or "nan")
    assert wanted < before - 0.1
    state = server.wait(
        lambda state: (
            state["parameters"][key] == pytest.approx(wanted) and state["run"]["state"] == "done"
        )
    )
    page.wait_for_timeout(500)
    assert server.get("/api/state").json()["run"]["key"] == state["run"]["key"], "no run follows"
    runs = server.get("/api/tables/runs").text
    assert runs.count("computing") == 0
    assert float(thumb.get_attribute("aria-valuenow") or "nan") == pytest.approx(wanted)

    sequence = open_sequence(str(server.folder))
    parameters = with_values(pipeline.default_parameters(sequence), state["parameters"])
    run = pipeline.compute(sequence, parameters, seed=0)
    lives = {
        int(track): (int(steps.min()), int(steps.max()))
        for track in np.unique(run.tracks.ids)
        if len(steps := run.tracks.frames[run.tracks.ids == track])
    }
    rows = page.locator("#panel-tracks tbody tr")
    expect(rows).to_have_count(len(lives))
    for row in rows.all():
        track, _, born, died = (cell.inner_text() for cell in row.locator("td").all()[:4])
        first, last = lives[int(track)]
        assert born == str(first)
        assert died == ("–" if last == FRAMES - 1 else str(last))
    as_at_first(server)
