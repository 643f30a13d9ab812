"""Marginals of one cluster against Stone Soup's, and what the K best events cost."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import numpy as np

from tests.benchmarks.measure import Measurement, ratio, seconds
from tests.filters.test_association import Cluster, associators, cluster, problem
from tracker.filters.association import exact_marginals, marginals, simplified_murty

TARGETS = (3, 4, 5, 6, 8, 10, 12, 15)
ENUMERATED = 4
"""Beyond, Stone Soup's enumeration of all joint events takes seconds."""
MANAGED, MANAGED_SHORT = 10, 6
"""Beyond, its efficient hypothesis management takes seconds to minutes."""
GROWTH, GROWTH_SHORT = (8, 16, 32, 64, 128), (8, 16, 32)


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
    yield from _growth(short)


def _exact(problem: Cluster) -> Callable[[], object]:
    return lambda: exact_marginals(problem.missed, problem.detected, problem.unexplained)


def _loopy(problem: Cluster) -> Callable[[], object]:
    return lambda: marginals(problem.missed, problem.detected, problem.unexplained)


def _growth(short: bool) -> Iterator[Measurement]:
    """All K = n + M events of the simplified Murty, by how many targets there are.

    Many different problems of each size, since of one that is solved again and again the
    processor remembers the way; processor time, since others may be at work too.
    """
    sizes, gated = (GROWTH_SHORT if short else GROWTH), (0.0, 0.5)
    for outside in gated:
        times = [_events_seconds(size, outside) for size in sizes]
        exponents = np.log2(np.divide(times[1:], times[:-1]))
        apart = f"{outside:.0%} of the pairs outside the gates"
        for size, taken in zip(sizes, times, strict=True):
            name = f"simplified Murty, up to {2 * size} events of {size} × {size}, {apart}"
            yield Measurement(name, 1000.0 * taken, "ms")
        for size, exponent in zip(sizes[1:], exponents.tolist(), strict=True):
            name = f"simplified Murty, exponent from {size // 2} to {size} targets, {apart}"
            yield Measurement(name, exponent, "", "≤ 3")
        overall = np.log2(times[-1] / times[0]) / (len(sizes) - 1)
        yield Measurement(
            f"simplified Murty, 3 over the exponent from {sizes[0]} to {sizes[-1]}, {apart}",
            3.0 / float(overall),
            "×",
            "≥ 1",
            1.0,
        )


def _events_seconds(size: int, outside: float) -> float:
    problems = [problem(seed, size, size, gated=outside) for seed in range(max(3, 1000 // size))]
    best = math.inf
    for _ in range(3):
        begin = time.process_time()
        for weights in problems:
            simplified_murty(*weights)
        best = min(best, time.process_time() - begin)
    return best / len(problems)
