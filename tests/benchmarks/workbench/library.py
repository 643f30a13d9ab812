"""The library of runs: its size, how long it takes to list 10,000 runs and to read one back."""

from __future__ import annotations

import sqlite3
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.benchmarks.measure import Measurement
from tests.library import runs
from tracker.library.store import Library

RUNS = 10_000


def run(short: bool) -> Iterator[Measurement]:
    """Runs of 500 steps and 10 people, of which the short form writes a fiftieth."""
    written = RUNS // 50 if short else RUNS
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "library.sqlite3"
        with Library(path) as library:
            kinds = [runs.tracks(500, 10, seed=seed) for seed in range(8)]
            begin = time.perf_counter()
            for number in range(written):
                library.keep(runs.RECORDING, runs.run(number, kept=kinds[number % 8]), budget=10**9)
            seconds = (time.perf_counter() - begin) / written
            yield Measurement("library: keep a run", 1e3 * seconds, "ms")
        with Library(path) as library:  # what waited in its log is in the file now
            size = library.size() * RUNS / written / 1e9
            yield Measurement(
                "library: 10,000 runs of 500 steps and 10 people", size, "GB", "≤ 2 GB"
            )
        _multiply(path, RUNS // written)
        with Library(path) as library:
            listing = 1e3 * _fastest(library.runs)
            yield Measurement("library: list 10,000 runs", listing, "ms", "≤ 50 ms")
            reading = 1e3 * _fastest(lambda: library.result(written // 2))
            yield Measurement("library: read a run with its tracks", reading, "ms", "≤ 50 ms")


def _multiply(path: Path, times: int) -> None:
    """Further rows of runs, without tracks: what a list reads."""
    if times <= 1:
        return
    connection = sqlite3.connect(path)
    names = [row[1] for row in connection.execute("PRAGMA table_info(runs)")][1:]
    listed = ", ".join(names)
    connection.execute(
        "WITH RECURSIVE n (i) AS (SELECT 2 UNION ALL SELECT i + 1 FROM n WHERE i < ?) "
        f"INSERT INTO runs ({listed}) SELECT {listed} FROM runs, n",
        (times,),
    )
    connection.commit()
    connection.close()


def _fastest(act: Callable[[], object]) -> float:
    seconds = []
    for _ in range(7):
        begin = time.perf_counter()
        act()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)
