"""A running server, and its page in the browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.looking import as_at_first, ask
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


@contextmanager
def walking(folders: pytest.TempPathFactory) -> Iterator[Server]:
    """A workbench on a small recording of two walkers."""
    folder = write_walkers(folders.mktemp("data") / "walkers")
    running = Server(folder, folders.mktemp("cache"))
    ask(running, "POST", "seek", {"step": 0})  # else it goes to where something happens
    yield running
    if running.process.poll() is None:
        running.stop()
    running.end_studies()


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """The workbench on two walkers for all tests that leave it as it was."""
    with walking(tmp_path_factory) as running:
        yield running


@pytest.fixture
def server(shared: Server) -> Server:
    """The same, at its defaults and its first step."""
    as_at_first(shared)
    return shared


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


@contextmanager
def opened(
    browser: Browser, server: Server, *, flat: bool = False, new: bool = False, **how: object
) -> Iterator[Page]:
    """The page of the server in a window of its own, with a finished run.

    A new person is told in notes what this page is; they cover nothing, but move the panes.
    """
    server.wait_for_run()
    context = browser.new_context(**{"viewport": {"width": 1440, "height": 900}, **how})  # type: ignore[arg-type]
    if flat:
        context.route("**/viser/**", lambda route: route.abort())
    if not new:
        context.add_init_script(
            "try { localStorage.page ??= JSON.stringify({ dismissed: ['software', 'tour'] }) }"
            " catch {}"
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
    expect(page.locator(".menu.corrects")).to_have_count(1)  # of what is read a moment later
    yield page
    context.close()
    assert errors == []


@pytest.fixture(scope="session")
def screenshots(request: pytest.FixtureRequest) -> Path | None:
    """Where pictures of the page are kept, if somebody wants to look at them."""
    folder: Path | None = request.config.getoption("--screenshots")
    return folder
