"""Settings that all tests share."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import pytest
from hypothesis import HealthCheck, Phase, settings
from hypothesis.internal.conjecture import providers
from playwright.sync_api import Browser, sync_playwright

from tracker.kernels.compilation import kernel_folder

INTERPRETED = os.environ.get("NUMBA_DISABLE_JIT") == "1"
"""As ``tests.mutate`` runs kernels: each example takes a hundred times as long, and which one is
the smallest that fails nobody asks."""

# the same examples every time; how long one takes says nothing of whether it is right
settings.register_profile(
    "repeatable",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=30 if INTERPRETED else 60,
    phases=[Phase.explicit, Phase.generate] if INTERPRETED else tuple(Phase),
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("repeatable")
# else it draws constants from whatever modules a process has imported, and each process others
providers.is_local_module_file = lambda path: False

# a shell starts what runs in the background deaf to Ctrl-C, and so is all that it starts
signal.signal(signal.SIGINT, signal.default_int_handler)


# no test ever writes to the library of whoever runs it
_LIBRARY = tempfile.TemporaryDirectory(prefix="multiview-phd-library-")
os.environ["MULTIVIEW_PHD_LIBRARY"] = str(Path(_LIBRARY.name) / "library.sqlite3")
os.environ["MULTIVIEW_PHD_STUDIES"] = str(Path(_LIBRARY.name) / "studies")
os.environ["MULTIVIEW_PHD_DETECTORS"] = str(Path(_LIBRARY.name) / "detectors")
os.environ["MULTIVIEW_PHD_SETTINGS"] = str(Path(_LIBRARY.name) / "settings")


def short(values: Iterable[object], count: int = 1) -> list[object]:
    """Parameters of a test, of which the short form has the first ones."""
    return [
        value if number < count else pytest.param(value, marks=pytest.mark.full)
        for number, value in enumerate(values)
    ]


LONGEST = 1500
"""Seconds after which a test is taken to hang: the slowest takes four minutes of two free cores."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--long``: also what takes long; each such test has a short form that always runs."""
    parser.addoption("--long", action="store_true", help="also run the tests marked long")
    parser.addoption(
        "--update-golden",
        action="store_true",
        help="accept the numbers of tests/golden as they are",
    )
    parser.addoption("--screenshots", type=Path, help="folder that keeps pictures of the page")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[object]:
    """Everything that is imported and collected stays: looking for garbage takes a fifth longer."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)  # what is marked here, -m chooses by
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what belongs to the full form alone; leave long tests out unless they are asked for.

    Of the browser one test is part of the short form; recordings are not everywhere.
    """
    for item in items:
        marks = {mark.name for mark in item.iter_markers()}
        if marks & {"browser", "data"} and "short" not in marks:
            item.add_marker(pytest.mark.full)
    # the longest first, so that no process is left with it while the others have nothing to do
    items.sort(
        key=lambda item: not {"short", "main_job"} & {mark.name for mark in item.iter_markers()}
    )
    if config.getoption("--long") or "long" in config.getoption("-m"):
        return
    long = [item for item in items if item.get_closest_marker("long")]
    if long:
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """End a test that waits for what never comes, so that the others still run."""

    def end(number: int, frame: FrameType | None) -> None:
        pytest.fail(f"not done within {LONGEST} s")

    signal.signal(signal.SIGALRM, end)
    signal.alarm(LONGEST)
    try:
        return (yield)
    finally:
        signal.alarm(0)


@pytest.fixture
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache folder is an empty one; the kernels stay those that the machine has."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kernel_folder()))
    monkeypatch.setenv("MULTIVIEW_PHD_CACHE", str(folder))
    return folder


@pytest.fixture
def npm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Puts a program ``npm`` on the path that does what is written, in Python; nothing else is
    there. What it fetches goes to folders of the test."""
    monkeypatch.setenv("MULTIVIEW_PHD_DETECTORS", str(tmp_path / "data" / "detectors"))
    folder, temporary = tmp_path / "bin", tmp_path / "temporary"
    folder.mkdir()
    temporary.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))

    def write(body: str) -> None:
        program = folder / "npm"
        program.write_text(f"#!{sys.executable}\nimport sys, os, time, shutil\n{body}\n")
        program.chmod(0o755)

    return write


DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of real recordings beside the checkout."""
    if not DATA.is_dir():
        pytest.skip(f"the real recordings are not there: no folder {DATA}")
    return DATA


@pytest.fixture(scope="session")
def foreign() -> Path:
    """The folder of recordings as their makers give them, beside the checkout."""
    folder = DATA.parent / "foreign"
    if not folder.is_dir():
        pytest.skip(f"the recordings of others are not there: no folder {folder}")
    return folder


CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]
"""As Chromium is where there is no graphics card: WebGL is drawn by software, and the page itself
without any. With ``--use-angle=swiftshader`` the page too would be put together by an emulated
card, which takes some 100 ms of processor time a frame and is nothing that a person has."""


PATIENCE = 90.0
"""Seconds that a browser's test waits for what it expects: the software renderer takes its time
where other tests work too. How fast the page is, the benchmarks say."""


@contextmanager
def chromium(path: str, *flags: str) -> Iterator[Browser]:
    """Chromium, headless, with time enough for a busy machine."""
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=path, args=[*CHROMIUM_FLAGS, *flags])
        launched.on("context", lambda context: context.set_default_timeout(1000 * PATIENCE))
        yield launched
        launched.close()


def chromium_path() -> str | None:
    """Where Debian's Chromium is, if it is installed."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Debian's Chromium: one for all tests, since Playwright runs one loop a thread."""
    path = chromium_path()
    if path is None:
        pytest.skip("no Chromium on this machine: install it (Debian: apt-get install chromium)")
    # without samples between the pixels 3D takes two thirds of the software renderer's time
    with chromium(path, "--webgl-antialiasing-mode=none") as launched:
        yield launched
