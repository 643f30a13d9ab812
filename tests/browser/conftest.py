"""A running server and a real browser for each test file; skipped where there is no Chromium."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from tests.browser.walkers import write_walkers

FLAGS = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything in this folder drives the browser."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Debian's Chromium, headless."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no Chromium on this machine: install it (Debian: apt-get install chromium)")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield chromium
        chromium.close()


class Server:
    """`multiview-phd serve` as a person starts it, on a free port."""

    def __init__(self, sequence: Path, cache: Path, port: int = 0) -> None:
        self.folder = sequence
        self._arguments = [str(sequence), "--no-open", "--data", str(sequence.parent)]
        self._environment = os.environ | {"MULTIVIEW_PHD_CACHE": str(cache)}
        self.port = port
        self.start()

    def start(self) -> None:
        """Start, on the port used before if there was one, and wait for the first answer."""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "app", "serve", *self._arguments, "--port", str(self.port)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self._environment,
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.search(r"http://[\w.]+:(\d+)", line)
        assert found, f"the server did not say where it is: {line}"
        self.port = int(found[1])
        self.wait(lambda state: state["sequence"] is not None and state["opening"] is None)

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://127.0.0.1:{self.port}/"

    def get(self, path: str) -> httpx2.Response:
        """One answer."""
        return httpx2.get(self.address.rstrip("/") + path, timeout=30.0)

    def wait(self, condition: Callable[[dict], bool], seconds: float = 60.0) -> dict:
        """The state, once it is as wished."""
        deadline = time.monotonic() + seconds
        state: dict = {}
        while time.monotonic() < deadline:
            try:
                state = self.get("/api/state").json()
                if condition(state):
                    return state
            except httpx2.TransportError:
                pass
            time.sleep(0.1)
        raise AssertionError(f"the server did not get there within {seconds} s: {state}")

    def wait_for_run(self) -> dict:
        """The state with a finished run of the parameters that hold now."""
        return self.wait(lambda state: state["run"]["state"] == "done")

    def stop(self) -> float:
        """End it as Ctrl-C does; the seconds that took."""
        begin = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=20.0)
        if self.process.stdout is not None:
            self.process.stdout.close()
        return time.monotonic() - begin


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A workbench on a small recording of two walkers."""
    folder = write_walkers(tmp_path_factory.mktemp("data") / "walkers")
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    yield running
    if running.process.poll() is None:
        running.stop()


@pytest.fixture
def page(browser: Browser, server: Server) -> Iterator[Page]:
    """The page of the server, with a finished run; an error in its console fails the test."""
    server.wait_for_run()
    context = browser.new_context(viewport={"width": 1440, "height": 900})
    opened = context.new_page()
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.goto(server.address)
    yield opened
    context.close()
    assert errors == []
