"""A running server for each test file, and its page in the browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.looking import ask
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers
from tests.conftest import PATIENCE

expect.set_options(timeout=1000 * PATIENCE)


@pytest.hookimpl(tryfirst=True)  # the settings that all tests share ask for this mark
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder drives the browser."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A workbench on a small recording of two walkers."""
    folder = write_walkers(tmp_path_factory.mktemp("data") / "walkers")
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    ask(running, "POST", "seek", {"step": 0})  # else it goes to where something happens
    yield running
    if running.process.poll() is None:
        running.stop()
    running.end_studies()


@pytest.fixture
def page(browser: Browser, server: Server) -> Iterator[Page]:
    """The page of the server, with a finished run; an error in its console fails the test."""
    with opened(browser, server) as page:
        yield page


@pytest.fixture
def flat_page(browser: Browser, server: Server) -> Iterator[Page]:
    """The same without the 3D view, whose software renderer takes most of the time."""
    with opened(browser, server, flat=True) as page:
        yield page


COARSE_3D = """
if (location.pathname.startsWith("/viser/")) {
  const coarse = new URL(location.href);
  coarse.searchParams.set("fixedDpr", "0.5");
  history.replaceState(null, "", coarse);
}
"""
"""For every page of a context: 3D has half of the pixels each way too, which viser does not take
from the scale of the window, where that is below one."""


@contextmanager
def opened(browser: Browser, server: Server, *, flat: bool = False) -> Iterator[Page]:
    """The page of the server in a window of its own, with a finished run."""
    server.wait_for_run()
    # half of the pixels each way: a quarter of the work of the software renderer
    scale = 1.0 if flat else 0.5
    context = browser.new_context(
        viewport={"width": 1440, "height": 900}, device_scale_factor=scale
    )
    if flat:
        context.route("**/viser/**", lambda route: route.abort())
    else:
        context.add_init_script(COARSE_3D)
    # what is said once to a new person lies over the 3D view
    context.add_init_script(
        "try { localStorage.page ??= JSON.stringify({ dismissed: ['tour'] }) } catch {}"
    )
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on(
        "console",
        lambda told: errors.append(told.text) if "Content Security Policy" in told.text else None,
    )
    page.goto(server.address)
    page.locator(".cam canvas").first.wait_for()  # whoever presses keys sees what he does
    yield page
    context.close()
    assert errors == []


@pytest.fixture(scope="session")
def screenshots(request: pytest.FixtureRequest) -> Path | None:
    """Where pictures of the page are kept, if somebody wants to look at them."""
    folder: Path | None = request.config.getoption("--screenshots")
    return folder
