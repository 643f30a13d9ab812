"""Hours of use in small: four pages, everything that is cheap to do, and nothing that grows.

What is compared is what remains at rest, before and after: while pages are used, a browser has
as many connections open, and the server as many threads at work, as it is just then asked for.
``MULTIVIEW_PHD_SOAK=SECONDS`` has it longer; the figures are printed with ``-s``.
"""

from __future__ import annotations

import json
import os
import random
import sys
import time
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.looking import ask
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers

SECONDS = float(os.environ.get("MULTIVIEW_PHD_SOAK", "12"))
PAGES = 4
KINDS = 8
"""Kinds of things that are done; what each needs for the first time is there at the first rest."""

REST = 12.0
"""Seconds until no connection is kept open (5) and idle threads of the pool may go (10)."""

SHARE = 0.05
"""By how much the last rest may lie above the first."""

SLACK = {"memory": 8.0, "threads": 2, "descriptors": 2, "sockets": 2}
"""What is no growth in any case: MB, and pieces; a picture in the cache, a file just read."""


def measured(process: int) -> dict[str, float]:
    """Of a process: memory in MB, threads, open descriptors and sockets among them."""
    status = dict(
        line.split(":", 1) for line in Path(f"/proc/{process}/status").read_text().splitlines()
    )
    opened = []
    for path in Path(f"/proc/{process}/fd").iterdir():
        try:
            opened.append(os.readlink(path))
        except FileNotFoundError:  # closed meanwhile
            continue
    return {
        "memory": int(status["VmRSS"].split()[0]) / 1024.0,
        "threads": float(status["Threads"]),
        "descriptors": float(len(opened)),
        "sockets": float(sum(name.startswith("socket:") for name in opened)),
    }


def at_rest(running: Server, pages: list[Page]) -> dict[str, float]:
    """What the server holds when no page is open and nothing has been asked for a while."""
    for page in pages:
        page.goto("about:blank")
    time.sleep(REST)
    running.get("/api/timeline")  # with it the pool lets go of what has been idle for long
    time.sleep(0.5)
    return measured(running.serving.pid)


def use(running: Server, pages: list[Page], chance: random.Random, seconds: float) -> int:
    """Do what people do, each thing once and then any, on pages and past them; how many things."""
    for page in pages:
        page.goto(running.address)
    begin, done = time.monotonic(), 0
    while time.monotonic() - begin < seconds or done < KINDS:
        page = chance.choice(pages)
        match done if done < KINDS else chance.randrange(KINDS):
            case 0:
                page.reload()
            case 1:
                value = round(chance.uniform(0.5, 3.0), 1)
                running.command("set_parameters", changes={"fusion.clutter_rate": value})
            case 2:
                ask(running, "POST", "select", {"id": chance.choice([None, 1, 2])})
            case 3:
                for path in ("timeline", "evaluation", "runs", "recordings"):
                    running.get(f"/api/{path}")
            case 4:
                page.keyboard.press(chance.choice(["Space", "PageDown", "End", "Home"]))
            case 5:
                running.get("/api/export/tracks.csv")
            case _:
                ask(running, "POST", "seek", {"step": chance.randrange(100)})
        page.wait_for_timeout(100)
        done += 1
    return done


@pytest.mark.full
@pytest.mark.browser
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_nothing_grows_while_four_pages_are_used(
    browser: Browser, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = write_walkers(tmp_path_factory.mktemp("data") / "walkers")
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    contexts = [browser.new_context() for _ in range(PAGES)]
    chance = random.Random(1)
    try:
        running.wait_for_run()
        for context in contexts:
            # their 3D is drawn without a graphics card here, and would take all of the processor
            context.route("**/viser/**", lambda route: route.abort())
        pages = [context.new_page() for context in contexts]
        use(running, pages, chance, SECONDS / 3.0)
        before = at_rest(running, pages)
        done = use(running, pages, chance, 2.0 * SECONDS / 3.0)
        after = at_rest(running, pages)
    finally:
        for context in contexts:
            context.close()
        running.stop()
    figures = {name: (before[name], after[name]) for name in SLACK}
    print(json.dumps({"seconds": SECONDS, "things done": done, **figures}))
    for name, (first, last) in figures.items():
        assert last <= first * (1.0 + SHARE) + SLACK[name], (name, figures)
