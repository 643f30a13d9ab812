"""The main job as a person does it: see the room, scrub, move a slider, take the tracks away."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard
from playwright.sync_api import Browser, Frame, Locator, Page, WebSocket

from tests.browser.conftest import opened
from tests.browser.looking import (
    as_at_first,
    ask,
    clear_overlays,
    numbers_in_pictures,
    overlay_steps,
    painted,
    readout,
    shown_in_3d,
    still,
    until,
    viser,
)
from tests.browser.serving import Server
from tests.browser.walkers import FRAMES
from tracker.export.tracks_csv import read_tracks_csv
from tracker.parameters.catalogue import PARAMETERS

BUILT_IN = "room44-3p"

LOOKED_AT = (110, 170, *range(250, 310, 2))
"""Steps at which results are compared: the first person has come in, and two more do."""

MOVED = {
    "fusion.extraction_threshold": 0.95,
    "fusion.survival_probability": 0.9,
    "fusion.detection_probability": 0.7,
    "fusion.clutter_rate": 6.0,
    "fusion.birth_rate": 0.3,  # a pixel of the slider is a hundredth
    "fusion.pruning_threshold": 1e-3,
    "colour_phd.merging_threshold": 20.0,  # beside the thumb, which a click does not move
}
"""Where the sliders are moved to, of the methods that a built-in sequence is tracked with: its
fusion merges nobody who was detected, so that merging is that of the single view."""


THUMB = 16
"""Width of the thumb of the browser's own sliders in pixels: its middle stands at a value."""


@pytest.mark.short
def test_pictures_overlays_readout_and_3d_show_the_same_step(page: Page, server: Server) -> None:
    scene = viser(page)
    clear_overlays(page)
    page.keyboard.press("Home")
    for step in range(6):
        if step:
            page.keyboard.press("ArrowRight")
        until(page, lambda step=step: readout(page) == str(step), f"the readout says {step}")
        assert numbers_in_pictures(page) == [step, step]
        assert overlay_steps(page) == [str(step), str(step)]
        until(page, lambda step=step: shown_in_3d(scene) == str(step), f"3D shows {step}")
    page.keyboard.press("End")
    until(page, lambda: readout(page) == str(FRAMES - 1), "the last step")
    until(page, lambda: numbers_in_pictures(page) == [FRAMES - 1] * 2, "its pictures")


@pytest.mark.main_job
def test_main_job(browser: Browser, tmp_path: Path) -> None:
    """A built-in sequence: what is there, what sliders do to it, scrubbing, tracks as CSV."""
    server = Server(BUILT_IN, tmp_path / "cache")
    try:
        with opened(browser, server) as page:
            nodes = sent_to_3d(page)
            page.reload()
            scene = viser(page)
            the_room_is_shown(page, server, scene, nodes)
            the_csv_is_what_is_shown(page, server, tmp_path / "tracks.csv")
            # what a slider does to the filter is seen long before a run's end, and smoothing's
            run = server.get("/api/state").json()["run"]["key"]
            server.command("set_parameters", changes={"smoothing_method": "none"})
            run, found = results(server, after=run)
            for key, to in MOVED.items():
                move_slider(server, page, key, to)
                before = found
                run, found = results(server, after=run)
                assert found != before, key
    finally:
        server.stop()


def test_a_typed_number_counts_when_it_is_finished(page: Page, server: Server) -> None:
    key = "fusion.survival_probability"
    slider = essential(viser(page), key)
    field = slider.locator("xpath=..").locator("input[inputmode=decimal]")
    for delay, end in ((0, "Enter"), (250, "Enter"), (30, "Tab")):
        as_at_first(server)
        default = server.get("/api/state").json()["parameters"][key]
        until(page, lambda: field.input_value() == f"{default:g}", "the default")  # noqa: B023
        field.click()
        field.press("Control+a")
        field.press_sequentially("0.9", delay=delay)
        assert server.get("/api/state").json()["parameters"][key] == default
        field.press(end)
        server.wait(lambda state: state["parameters"][key] == 0.9)
        thumb = slider.get_by_role("slider")
        until(page, lambda: thumb.get_attribute("aria-valuenow") == "0.9", "the slider at 0.9")  # noqa: B023
        assert field.input_value() == "0.9"
    as_at_first(server)


def the_room_is_shown(
    page: Page, server: Server, scene: Frame, nodes: dict[str, dict[str, Any]]
) -> None:
    """Frusta and Gaussian components in 3D, reprojected boxes in the pictures, all of one step."""
    for step in (250, 249, 300):
        ask(server, "POST", "seek", {"step": step})
        until(page, lambda step=step: readout(page) == str(step), f"the readout says {step}")
        until(page, lambda step=step: overlay_steps(page) == [str(step)] * 2, f"boxes of {step}")
        until(page, lambda step=step: shown_in_3d(scene) == str(step), f"3D shows {step}")
    assert sum(node["visible"] for name, node in nodes.items() if is_frustum(name)) == 2
    assert nodes["/people/ellipsoids"]["visible"]
    found = server.get(f"/api/step/{step}").json()
    assert found["components"] >= len(found["tracks"]) > 0
    state = server.get("/api/state").json()
    widths = {one["name"]: one["width"] for one in state["sequence"]["cameras"]}
    with_boxes = painted(page)
    clear_overlays(page)

    def boxes_are_gone() -> bool:
        """Whether the pictures have changed where the boxes of the people were, and only so."""
        for shown, picture, camera in zip(with_boxes, painted(page), found["cameras"], strict=True):
            scale = shown.shape[1] / widths[camera["name"]]
            changed = np.abs(shown.astype(int) - picture).max(axis=2) > 20
            boxes = scale * np.array([one["box"] for one in camera["tracks"] if one["visible"]])
            for left, top, width, _ in boxes.reshape(-1, 4):
                edge = changed[max(0, round(top) - 3) : round(top) + 4]
                if edge[:, round(left) : round(left + width)].any(axis=0).mean() < 0.5:
                    return False
        return True

    assert all(any(one["visible"] for one in camera["tracks"]) for camera in found["cameras"])
    until(page, boxes_are_gone, "the edges of the boxes were drawn, and are not any more", 20.0)


def is_frustum(node: str) -> bool:
    return re.fullmatch(r"/cameras/\d\d", node) is not None


def sent_to_3d(page: Page) -> dict[str, dict[str, Any]]:
    """What the 3D view is told of each node of the scene, from the next load of the page on.

    The frames are those of viser's exact version: 16 bytes of lengths, then messages as msgpack
    compressed by Zstandard, then the arrays.
    """
    nodes: dict[str, dict[str, Any]] = {}

    def on_frame(frame: bytes | str) -> None:
        assert isinstance(frame, bytes)
        content = zstandard.ZstdDecompressor().decompressobj().decompress(frame[16:])
        told = msgspec.msgpack.decode(content)
        for message in told["messages"] if isinstance(told, dict) else told:
            if "name" in message:
                node = nodes.setdefault(message["name"], {"visible": True})
                node.update({key: message[key] for key in ("visible",) if key in message})

    def on_socket(socket: WebSocket) -> None:
        if socket.url.endswith("/viser"):
            socket.on("framereceived", on_frame)

    page.on("websocket", on_socket)
    return nodes


def move_slider(server: Server, page: Page, key: str, to: float) -> None:
    """Click on a parameter's slider where a value is, and wait until it holds: beside the 3D view
    on those of the essential ones, on the page on the others."""
    parameter = PARAMETERS[key]
    before = server.get("/api/state").json()["parameters"][key]
    if parameter.slider is not None:
        slider = essential(viser(page), key)
        low, high, _ = parameter.slider
        share, rim = (to - low) / (high - low), 0.0
    else:
        page.get_by_role("tab", name="Parameters").click()
        page.get_by_label("Find a parameter").fill(key)
        slider = page.locator(f'tr[data-key="{key}"]').get_by_role("slider")
        ends = np.array([parameter.minimum, parameter.maximum, to], dtype=float)
        low, high, place = np.log10(ends) if parameter.log else ends
        share, rim = (place - low) / (high - low), THUMB / 2
    box = still(slider)
    x = rim + (box["width"] - 2 * rim) * share
    slider.click(position={"x": x, "y": box["height"] / 2})
    moved = server.wait(lambda state: state["parameters"][key] != before)["parameters"][key]
    assert moved == pytest.approx(to, rel=0.2)


def essential(scene: Frame, key: str) -> Locator:
    """The slider of an essential parameter, by the words beside it."""
    label = scene.locator("label", has_text=re.compile(f"^{PARAMETERS[key].label}$"))
    return scene.locator(f'[id="{label.get_attribute("for")}"]')


def results(server: Server, *, after: str) -> tuple[str, list[Any]]:
    """The key of the run that follows another one; its people, components and cardinality."""
    state = server.wait(
        lambda state: state["run"]["key"] != after and state["run"]["done"] > LOOKED_AT[-1]
    )
    key = state["run"]["key"]
    steps = [server.get(f"/api/step/{step}").json() for step in LOOKED_AT]
    assert all(one["computed"] and one["run"] == key for one in steps)
    return key, [(one["tracks"], one["components"], one["cardinality"]) for one in steps]


def the_csv_is_what_is_shown(page: Page, server: Server, path: Path) -> None:
    """The exported tracks, read again, have the people of the steps as they are shown."""
    server.wait_for_run()
    with page.expect_download() as download:
        page.get_by_role("button", name="Export").first.click()
        page.get_by_role("menuitem", name="CSV").first.click()
    download.value.save_as(path)
    tracks = read_tracks_csv(path)
    for step in LOOKED_AT:
        people = server.get(f"/api/step/{step}").json()["tracks"]
        rows = np.flatnonzero(tracks.frames == step)
        assert sorted(one["id"] for one in people) == sorted(tracks.ids[rows].tolist())
        expected = np.array([one["position"] for one in sorted(people, key=lambda p: p["id"])])
        order = np.argsort(tracks.ids[rows])
        np.testing.assert_allclose(tracks.positions[rows][order], expected, atol=1e-3)
