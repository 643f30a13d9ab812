"""A kept run of 1,500 steps and three people is there as soon as it is opened."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.conftest import opened
from tests.browser.looking import ask, open_kept
from tests.browser.serving import Server
from tests.browser.work.test_library import kept
from tests.long_recording import write_long

STEPS = 1500

BOUND_MS = 3000.0
"""Generous: 300 ms are asked for of a machine that does nothing else, see the benchmark."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A workbench on a long recording with two kept runs, of which the later is shown."""
    folder = write_long(tmp_path_factory.mktemp("data") / "long", STEPS, cameras=2)
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    running.wait_for_run(300.0)
    kept(running, 1)
    ask(running, "PATCH", "parameters", {"changes": {"fusion.detection_probability": 0.8}})
    kept(running, 2)
    yield running
    running.stop()


@pytest.fixture
def page(browser: Browser, server: Server) -> Iterator[Page]:
    with opened(browser, server, flat=True) as page:
        yield page


def test_a_kept_run_is_painted_at_once(flat_page: Page, server: Server) -> None:
    page = flat_page
    page.get_by_role("link", name="Library").click()
    expect(page.locator("tr[data-run]")).to_have_count(2)
    page.locator('tr[data-run="1"]').click()
    expect(page.locator(".pv-lanes")).to_be_visible()
    taken = open_kept(page)
    print(f"\na kept run of {STEPS} steps is painted {taken:.0f} ms after the click")
    state = server.get("/api/state").json()
    assert (state["run"]["kept"], state["run"]["done"]) == (1, STEPS)
    assert taken < BOUND_MS
