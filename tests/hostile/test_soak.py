"""Hours of use in small: four pages, everything that is cheap to do, and nothing that grows.

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
from playwright.sync_api import Browser

from tests.browser.looking import ask
from tests.browser.serving import Server
from tests.browser.walkers import write_walkers

SECONDS = float(os.environ.get("MULTIVIEW_PHD_SOAK", "45"))
PAGES = 4
SHARE = 0.05
"""By how much the last third may lie above the second."""

SLACK = {"memory": 8.0, "threads": 2, "descriptors": 4, "sockets": 2}
"""What is no growth in any case: MB, and pieces; a picture in the cache, a page that reconnects."""


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


def mean(rows: list[dict[str, float]], name: str) -> float:
    return sum(row[name] for row in rows) / len(rows)


@pytest.mark.full
@pytest.mark.browser
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_nothing_grows_while_four_pages_are_used(
    browser: Browser, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = write_walkers(tmp_path_factory.mktemp("data") / "walkers")
    running = Server(folder, tmp_path_factory.mktemp("cache"))
    contexts = [browser.new_context() for _ in range(PAGES)]
    chance, rows = random.Random(1), []
    try:
        running.wait_for_run()
        pages = []
        for context in contexts:
            # their 3D is drawn without a graphics card here, and would take all of the processor
            context.route("**/viser/**", lambda route: route.abort())
            pages.append(context.new_page())
            pages[-1].goto(running.address)
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < SECONDS:
            page = chance.choice(pages)
            match chance.randrange(8):
                case 0:
                    page.reload()
                case 1:
                    value = round(chance.uniform(0.5, 3.0), 1)
                    changes = {"fusion.clutter_rate": value}
                    ask(running, "PATCH", "parameters", {"changes": changes})
                case 2:
                    ask(running, "POST", "select", {"id": chance.choice([None, 1, 2])})
                case 3:
                    for path in ("timeline", "evaluation", "tables/runs", "recordings"):
                        running.get(f"/api/{path}")
                case 4:
                    page.keyboard.press(chance.choice(["Space", "PageDown", "End", "Home"]))
                case 5:
                    running.get("/api/export/tracks.csv")
                case _:
                    ask(running, "POST", "seek", {"step": chance.randrange(100)})
            page.wait_for_timeout(100)
            if now >= SECONDS / 300.0 * len(rows):
                rows.append(measured(running.serving.pid) | {"seconds": now})
    finally:
        for context in contexts:
            context.close()
        running.stop()
    third = len(rows) // 3
    second, last = rows[third : 2 * third], rows[2 * third :]
    figures = {name: (mean(second, name), mean(last, name)) for name in SLACK}
    print(json.dumps({"seconds": SECONDS, "samples": len(rows), **figures}))
    for name, (before, after) in figures.items():
        assert after <= before * (1.0 + SHARE) + SLACK[name], (name, figures)
