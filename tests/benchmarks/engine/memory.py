"""Private memory and speed of ``track`` on a long recording, phase by phase.

``cmc1`` is walked to and fro, as long as wished. A command on two lengths shows what one step more
costs, without the program itself, its libraries and compiled kernels.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from typing import Any

from app.command.main import main
from tests.benchmarks.engine.pipeline import DATA
from tests.benchmarks.measure import Measurement
from tests.synthetic import write_lines
from tracker import smoothing
from tracker.io import checks
from tracker.sequences.reader import read_sequence

WALKED = "cmc1"
LENGTHS, SHORT_LENGTHS = (4000, 20_000), (400, 2000)
PHASES = ("opening and check", "stages 1 and 2", "smoothing", "writing")
"""What the command does in turn."""

EVERY = 0.01
"""Seconds between two looks at the memory."""

_STATUS = Path("/proc/self/status")


def run(short: bool) -> Iterator[Measurement]:
    """What one step more takes in each phase, and steps a second; nothing without the recording."""
    if not (DATA / WALKED).is_dir() or not _STATUS.is_file():
        return
    with tempfile.TemporaryDirectory() as name:
        lengths = SHORT_LENGTHS if short else LENGTHS
        few, many = (_alone(write_walk(Path(name) / str(steps), steps)) for steps in lengths)
    steps = lengths[1] - lengths[0]
    what = f"{WALKED} walked to and fro, {lengths[0]} to {lengths[1]} steps"
    for phase in PHASES:
        each = (many["peaks"][phase] - few["peaks"][phase]) / steps
        yield Measurement(f"{what}: private memory, {phase}", each, "kB a step", "≤ 10")
    each = steps / (many["seconds"] - few["seconds"])
    yield Measurement(f"{what}: the whole command", each, "steps/s")


def write_walk(folder: Path, steps: int) -> Path:
    """A recording of so many steps: the boxes of ``cmc1`` forwards, backwards, and so on."""
    folder.mkdir(parents=True)
    source = DATA / WALKED
    frames = read_sequence(source).frames
    cycle = [*range(frames), *range(frames - 2, 0, -1)]
    text = (source / "sequence.toml").read_text(encoding="utf-8")
    text = text.replace(f"\nframes = {frames}\n", f"\nframes = {steps}\n")
    head, _, _ = text.partition("[ground_truth]")
    (folder / "sequence.toml").write_text(head, encoding="utf-8")
    for path in source.glob("cam*.csv"):
        with path.open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        of_frame: list[list[str]] = [[] for _ in range(frames)]
        for row in rows:
            of_frame[int(row[0])].append(",".join(row[1:]))
        write_lines(
            folder / path.name,
            ",".join(header),
            [f"{k},{rest}" for k in range(steps) for rest in of_frame[cycle[k % len(cycle)]]],
        )
    return folder


def _alone(folder: Path) -> Any:
    """Peaks and seconds of the command in a process of its own."""
    line = [sys.executable, "-m", "tests.benchmarks.engine.memory", str(folder)]
    found = subprocess.run(line, capture_output=True, text=True, check=True)
    return json.loads(found.stdout.splitlines()[-1])


def _private() -> int:
    """Memory of this process that no file backs, kB."""
    for line in _STATUS.read_text(encoding="ascii").splitlines():
        if line.startswith("RssAnon:"):
            return int(line.split()[1])
    raise ValueError(f"{_STATUS}: expected a line RssAnon")


def _of_this_process(folder: Path) -> None:
    """Track, and print the largest private memory of each phase and the seconds of all."""
    peaks = dict.fromkeys(PHASES, 0)
    now = [PHASES[0]]
    over = threading.Event()

    def look() -> None:
        while not over.wait(EVERY):
            phase = now[0]
            peaks[phase] = max(peaks[phase], _private())

    def through(function: Callable[..., Any], phase: str, after: str) -> Callable[..., Any]:
        @wraps(function)
        def within(*arguments: Any, **more: Any) -> Any:
            now[0] = phase
            try:
                return function(*arguments, **more)
            finally:
                now[0] = after

        return within

    def create(*arguments: Any) -> Any:
        method = made(*arguments)
        method.smooth = through(method.smooth, PHASES[2], PHASES[3])
        return method

    made, smoothing.create = smoothing.create, create
    checks.check = through(checks.check, PHASES[0], PHASES[1])
    looking = threading.Thread(target=look)
    looking.start()
    begin = time.perf_counter()
    line = ["track", str(folder), "-o", str(folder / "tracks.csv")]
    with contextlib.redirect_stdout(io.StringIO()):
        code = main([*line, "--no-cache", "--library", str(folder / "library.sqlite3")])
    seconds = time.perf_counter() - begin
    over.set()
    looking.join()
    assert not code
    print(json.dumps({"peaks": peaks, "seconds": seconds}))


if __name__ == "__main__":
    _of_this_process(Path(sys.argv[1]))
