"""The page in Chromium: first paint, steps by key and by jump, play, lanes, what it loads."""

from __future__ import annotations

import re
import shutil
import statistics
import tempfile
from collections.abc import Iterator
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from playwright.sync_api import Browser, Page, sync_playwright

from app.paths import static_folder
from tests.benchmarks.measure import Measurement
from tests.browser.serving import Server
from tests.conftest import CHROMIUM_FLAGS
from tests.long_recording import write_long

CAMERAS, SIZE = 4, (640, 480)
WINDOW = {"width": 1440, "height": 900}

WATCH = """() => {
  // every painted step: when, and of which step the overlays are
  window.paints = [];
  const cams = [...document.querySelectorAll('.cam')];
  new MutationObserver(() => {
    const steps = cams.map((cam) => [cam.dataset.step, cam.dataset.overlay]);
    window.paints.push({ at: performance.now(), steps });
  }).observe(cams.at(-1), { attributes: true, attributeFilter: ['data-step'] });
  window.stepTo = (step, act) => new Promise((done, late) => {
    const begin = performance.now();
    const wanted = String(step);
    const limit = setTimeout(() => late(new Error(`step ${step} was not painted`)), 20000);
    const watch = new MutationObserver(() => {
      if (!cams.every((cam) => cam.dataset.step === wanted)) return;
      watch.disconnect();
      clearTimeout(limit);
      done(performance.now() - begin);
    });
    const what = { attributes: true, attributeFilter: ['data-step'] };
    for (const cam of cams) watch.observe(cam, what);
    act();
  });
}"""

BY_KEY = """(step) => window.stepTo(step, () => document.body.dispatchEvent(
  new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true })))"""

BY_JUMP = """(step) => window.stepTo(step, () => {
  const seek = document.querySelector('.seek');
  seek.value = String(step);
  seek.dispatchEvent(new Event('input'));
})"""

LANES = """async ([lanes, steps, runs]) => {
  const { drawLanes, drawRange, drawRuler } = await import('/static/js/draw/rows.js');
  const { palette, prepare } = await import('/static/js/draw/canvas.js');
  const kinds = ['seen', 'coasting', 'seen', 'long miss'];
  const tracks = Array.from({ length: lanes }, (_, lane) => {
    const spans = [];
    for (let k = 0, from = 0; from < steps; k += 1) {
      const to = Math.min(steps - 1, from + 20 + ((lane * 7 + k * 13) % 60));
      spans.push([from, to, kinds[k % 4]]);
      from = to + 1;
    }
    return { id: lane + 1, first: 0, last: steps - 1, seen: 0.8, cameras: [0.8], spans };
  });
  const canvas = document.createElement('canvas');
  document.body.append(canvas);
  const view = { first: 0, last: steps - 1, width: 1240 };
  const times = [];
  for (let k = 0; k < runs; k += 1) {
    await new Promise(requestAnimationFrame);
    const begin = performance.now();
    const g = prepare(canvas, 1254, 40 * 14 + 34);
    const pen = (y, height) => ({ g, view, ink: palette(), row: { y, height } });
    drawLanes(pen(34, 40 * 14), { tracks, pinned: [], scroll: 0, laneHeight: 14, done: steps,
      selection: 3, hover: null, switches: [], decisions: [] });
    drawRange(pen(0, 14), [1, 2, 3], steps, steps);
    drawRuler(pen(14, 20), [null, null], [], null);
    times.push(performance.now() - begin);
  }
  canvas.remove();
  return [times, tracks.reduce((sum, track) => sum + track.spans.length, 0)];
}"""


def run(short: bool) -> Iterator[Measurement]:
    """Four cameras of 640×480 with boxes.

    Without the 3D view, but for the last figures: where there is no graphics card, Chromium
    draws it by software, and that would be measured instead of the page.
    """
    own = sum(file.stat().st_size for file in static_folder().rglob("js/**/*.js"))
    yield Measurement("page: JavaScript of our own, with what is read later", own / 1e3, "kB")
    page = (static_folder() / "index.html").read_text(encoding="utf-8")
    named = set(re.findall(r"/static/(js/[\w/]+\.js)", page))
    own = sum((static_folder() / name).stat().st_size for name in named)
    yield Measurement("page: JavaScript that it begins with", own / 1e3, "kB", "≤ 220 kB")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        return  # what is left needs a browser
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        frames = 150 if short else 400
        folder = write_long(Path(name) / "long", frames, cameras=CAMERAS, size=SIZE)
        server = Server(folder, Path(name) / "cache")
        others = [flag for flag in CHROMIUM_FLAGS if "swiftshader" not in flag]  # no 3D at all
        browser = playwright.chromium.launch(executable_path=path, args=[*others, "--disable-gpu"])
        drawing = playwright.chromium.launch(executable_path=path, args=CHROMIUM_FLAGS)
        try:
            server.wait_for_run(seconds=600.0)
            yield from _opened(browser, server, 2 if short else 5)
            page = _page(browser, server, 0, flat=True)
            yield from _stepped(page, frames, 10 if short else 40)
            yield from _played(page, frames, 2.0 if short else 10.0, "")
            yield from _drawn(page, 15 if short else 60)
            page.context.close()
            page = _page(drawing, server, 1, flat=False)
            yield from _played(page, frames, 2.0 if short else 10.0, " and 3D")
        finally:
            browser.close()
            drawing.close()
            server.stop()


def _page(browser: Browser, server: Server, step: int, *, flat: bool) -> Page:
    """The page at a step; without one it goes to where something happens."""
    context = browser.new_context(viewport=WINDOW)
    page = context.new_page()
    if flat:
        _without_3d(page)
    page.goto(f"{server.address}?step={step}")
    page.wait_for_selector(".cam[data-overlay]:not([data-overlay=''])")
    page.evaluate(WATCH)
    return page


def _without_3d(page: Page) -> None:
    """Have nothing of viser's loaded; by the browser, since a route would hold up every request."""
    devtools = page.context.new_cdp_session(page)
    devtools.send("Network.enable")
    devtools.send("Network.setBlockedURLs", {"urls": ["*/viser/*"]})


def _opened(browser: Browser, server: Server, times: int) -> Iterator[Measurement]:
    first, whole = [], []
    others: set[str] = set()
    for _ in range(times):
        context = browser.new_context(viewport=WINDOW)
        page = context.new_page()
        _without_3d(page)
        page.on("request", lambda request: others.add(urlsplit(request.url).hostname or ""))
        page.goto(f"{server.address}?step=0")  # else it goes to where something happens
        page.wait_for_selector(".cam[data-overlay='0']")
        whole.append(page.evaluate("performance.now()"))
        first.append(
            page.evaluate(
                "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN"
            )
        )
        context.close()
    yield Measurement("page: first paint, median", statistics.median(first) / 1e3, "s", "≤ 1 s")
    yield Measurement(
        "page: pictures with their overlays, median", statistics.median(whole) / 1e3, "s"
    )
    elsewhere = others - {"127.0.0.1", ""}
    yield Measurement("page: other hosts that were asked", len(elsewhere), "", "0")


def _stepped(page: Page, frames: int, times: int) -> Iterator[Measurement]:
    cached, jumped = [], []
    page.wait_for_timeout(1500)  # what lies ahead is read meanwhile
    for step in range(1, times + 1):
        cached.append(page.evaluate(BY_KEY, step))
        page.wait_for_timeout(120)
    step = times
    for number in range(times):
        step = (step + frames // 2 + 7 * number) % frames
        jumped.append(page.evaluate(BY_JUMP, step))
        page.wait_for_timeout(120)
    words = f"page: {CAMERAS} cameras of {SIZE[0]}×{SIZE[1]}, a step is painted"
    for how, aim, taken in (
        ("read ahead", "≤ 50 ms", cached),
        ("not read yet", "≤ 150 ms", jumped),
    ):
        yield Measurement(f"{words}, {how}, median", statistics.median(taken), "ms", aim)
        p95 = statistics.quantiles(taken, n=20)[-1]
        yield Measurement(f"{words}, {how}, 95 %", p95, "ms", aim)


def _played(page: Page, frames: int, seconds: float, also: str) -> Iterator[Measurement]:
    count = min(int(25.0 * seconds), frames - 40)
    page.evaluate(BY_JUMP, 0)
    page.wait_for_timeout(1500)
    page.evaluate("window.paints = []")
    page.keyboard.press("Space")
    page.wait_for_function("(count) => window.paints.length >= count", arg=count, timeout=120_000)
    page.keyboard.press("k")
    told: list[dict[str, Any]] = page.evaluate("window.paints")
    # a step that is painted again, since something arrived for it, counts once
    paints = [next(same) for _, same in groupby(told, key=lambda paint: paint["steps"][0][0])]
    shown = [int(paint["steps"][0][0]) for paint in paints]
    whole = [
        all(step == overlay == str(shown[k]) for step, overlay in paint["steps"])
        for k, paint in enumerate(paints)
    ]
    skipped = sum(b - a - 1 for a, b in pairwise(shown))
    taken = (paints[-1]["at"] - paints[0]["at"]) / 1e3
    words = f"page: play, {CAMERAS} cameras of {SIZE[0]}×{SIZE[1]}{also}"
    pace = (len(shown) - 1) / taken
    yield Measurement(f"{words}: steps a second", pace, "1/s", "25 /s", better="higher")
    yield Measurement(f"{words}: steps skipped", skipped, "", "0")
    yield Measurement(f"{words}: steps without all their overlays", whole.count(False), "", "0")


def _drawn(page: Page, times: int) -> Iterator[Measurement]:
    taken, spans = page.evaluate(LANES, [40, 5000, times])
    words = f"page: 40 lanes of 5,000 steps, {spans} spans, drawn anew"
    yield Measurement(f"{words}, median", statistics.median(taken), "ms", "≤ 8 ms")
    yield Measurement(f"{words}, 95 %", statistics.quantiles(taken, n=20)[-1], "ms", "≤ 8 ms")
