"""Marginals of one cluster against Stone Soup's, and what the K best events cost."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator

from tests.benchmarks.measure import Measurement, ratio, seconds
from tests.engine.stone_soup_jpda import Cluster, associators, cluster
from tests.engine.test_association import problem
from tracker.association import exact_marginals, marginals, simplified_murty

TARGETS = (3, 4, 5, 6, 8, 10, 12, 15)
ENUMERATED = 4
"""Beyond, Stone Soup's enumeration of all joint events takes seconds."""
MANAGED, MANAGED_SHORT = 10, 6
"""Beyond, its efficient hypothesis management takes seconds to minutes."""


def run(short: bool) -> Iterator[Measurement]:
    """Clusters in which nearly every target may have made nearly every measurement."""
    theirs = associators()
    for targets in TARGETS:
        problem = cluster(targets, seed=1)
        mine = _exact(problem)
        aim = "≤ 1 ms" if targets == 10 else ""
        name = f"marginals of {targets} targets × {targets + 1}"
        yield Measurement(f"{name}, exact", 1000.0 * seconds(mine), "ms", aim)
        yield Measurement(f"{name}, belief propagation", 1000.0 * seconds(_loopy(problem)), "ms")
        most = {"JPDA": ENUMERATED, "EHM2": MANAGED_SHORT if short else MANAGED}
        for rival, associator in theirs.items():
            if targets <= most[rival]:
                problem.stone_soup(associator)  # remembers its hypotheses
                yield Measurement(
                    f"{name}, exact against Stone Soup's {rival}",
                    ratio(mine, lambda a=associator, p=problem: p.stone_soup(a), pairs=3),  # type: ignore[misc]
                    "×",
                    "≥ 10",
                    10.0,
                )
    yield from _growth()


def _exact(problem: Cluster) -> Callable[[], object]:
    return lambda: exact_marginals(problem.missed, problem.detected, problem.unexplained)


def _loopy(problem: Cluster) -> Callable[[], object]:
    return lambda: marginals(problem.missed, problem.detected, problem.unexplained)


def _growth() -> Iterator[Measurement]:
    """All K = n + M events of the simplified Murty for four times as many targets."""
    small, large = 8, 32
    times: dict[int, list[float]] = {small: [], large: []}
    weights = {size: problem(4, size, size, gated=0.0) for size in times}
    for size in times:
        simplified_murty(*weights[size])
    for _ in range(9):
        for size, taken in times.items():
            begin = time.perf_counter()
            simplified_murty(*weights[size])
            taken.append(time.perf_counter() - begin)
    few, many = (statistics.median(taken) for taken in times.values())
    yield Measurement(f"simplified Murty, {2 * small} events of {small} × {small}", few * 1e3, "ms")
    yield Measurement(
        f"simplified Murty, cubic growth to {large} × {large} over what it takes",
        few * (large / small) ** 3 / many,
        "×",
        "≥ 1",
        1.0,
    )
