"""What lies over a picture, and what stands where there is none."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import opened
from tests.browser.looking import as_at_first, ask, clear_overlays, painted, until
from tests.browser.serving import Server
from tests.browser.walkers import FRAMES
from tests.synthetic import number_in, write_sequence

GONE = 12
"""The step of which the second camera has no picture."""


@pytest.fixture(scope="module")
def gap(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A recording of which a picture is missing."""
    folder = write_sequence(
        tmp_path_factory.mktemp("data") / "gap", frames=FRAMES, container="images", detections=True
    )
    pictures = sorted((folder / "cam2").iterdir())
    pictures[GONE].write_bytes(b"broken")
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    yield running
    running.stop()


def test_the_floor_lies_in_the_pictures_where_the_calibration_puts_it(
    flat_page: Page, server: Server
) -> None:
    page = flat_page
    as_at_first(server)
    clear_overlays(page)
    plain = painted(page)
    page.keyboard.press("Shift+l")
    chip = page.locator("[data-layer2d=floor]")
    expect(chip).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".cam-tag").first).to_contain_text("floor grid 0.5 m")
    until(page, lambda: bool((painted(page)[0] != plain[0]).any()), "it is painted")
    floor = server.get("/api/floor").json()["cameras"]
    for before, now, told in zip(plain, painted(page), floor, strict=True):
        changed = np.abs(before.astype(int) - now.astype(int)).max(axis=2) > 8
        height, width = changed.shape
        expected = np.zeros_like(changed)
        for line in [*told["lines"], *told["edges"]]:
            ends = (np.array(line) + 0.5) * width / 192
            shares = np.linspace(0.0, 1.0, 400)[:, None, None]
            x, y = (
                (ends[:-1] + shares * (ends[1:] - ends[:-1])).reshape(-1, 2).round().astype(int).T
            )
            inside = (x > 3) & (x < width - 4) & (y > 3) & (y < height - 4)
            expected[y[inside], x[inside]] = True
        assert expected.sum() > 100
        assert changed[expected].mean() > 0.95
        near = np.zeros_like(expected)
        for dy in range(-6, 7):
            for dx in range(-6, 7):
                near |= np.roll(expected, (dy, dx), (0, 1))
        rim = np.zeros_like(expected)
        rim[12:-12, 12:-12] = True
        assert not (changed & ~near & rim).any()  # and nowhere else
    until(page, lambda: "floor" in page.url, "the link has it")
    chip.click()
    until(page, lambda: painted(page)[0].tolist() == plain[0].tolist(), "as before")
    page.locator("[data-layer2d=boxes]").click()


def test_a_missing_picture_is_said_and_another_is_shown_only_where_asked_for(
    browser: Browser, gap: Server
) -> None:
    with opened(browser, gap, flat=True) as page:
        ask(gap, "POST", "seek", {"step": GONE})
        second = page.locator(".cam").nth(1)
        expect(second.locator(".cam-absent")).to_have_text(f"cam2: no frame {GONE}")
        expect(page.locator(".cam").first.locator(".cam-absent")).to_be_hidden()
        clear_overlays(page)
        chip = page.locator("[data-command=nearest]")
        expect(chip).to_have_attribute("aria-pressed", "false")
        chip.click()
        expect(second.locator(".cam-tag")).to_contain_text(f"no frame {GONE}, this is {GONE - 1}")
        expect(second.locator(".cam-absent")).to_be_hidden()
        # faint, so that nobody takes it for the one of this step
        until(page, lambda: painted(page)[1].max() < 150, "it is faint")
        small = cv2.resize(painted(page)[1], (192, 144), interpolation=cv2.INTER_AREA)
        assert number_in(np.clip(2.0 * small, 0.0, 255.0)) == GONE - 1
        ask(gap, "POST", "seek", {"step": GONE + 1})
        expect(chip).to_be_hidden()
        expect(second.locator(".cam-tag")).not_to_contain_text("no frame")
        ask(gap, "POST", "seek", {"step": GONE})
        expect(chip).to_have_attribute("aria-pressed", "true")
        chip.click()
        expect(second.locator(".cam-absent")).to_be_visible()
