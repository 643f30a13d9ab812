"""Many targets in the plane: the engine's filters beside Stone Soup."""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tests.benchmarks.measure import Measurement
from tests.benchmarks.plane.filters import Filter, Labelled, Phd
from tests.benchmarks.plane.scenario import Scenario, ospa, scenario

STEPS = {10: 40, 100: 40, 500: 20, 1000: 10}
THEIR_STEPS = {10: 40, 100: 40, 500: 4, 1000: 2}
"""Stone Soup takes seconds a step where targets are many."""

MILLISECONDS = {100: 0.4, 500: 4.0, 1000: 12.0}
OSPA = {100: 16.6, 500: 16.5, 1000: 15.5}
"""What the engine's GM-PHD filter is to reach, by number of targets."""


@dataclass(frozen=True, slots=True)
class Course:
    """One filter on one scenario."""

    milliseconds: list[float]
    """Processor time of each step but the first."""
    distances: dict[str, list[float]]
    """OSPA of each step, by rule."""

    @property
    def median(self) -> float:
        """Milliseconds a step."""
        return statistics.median(self.milliseconds)

    def ospa(self, rule: str, steps: int | None = None) -> float:
        """Its mean over the first steps, metres."""
        return statistics.fmean(self.distances[rule][:steps])


def course(
    make: Callable[[Scenario], Filter], case: Scenario, steps: int, rules: tuple[str, ...]
) -> Course:
    """Run a filter over the first steps."""
    filtered = make(case)
    taken: list[float] = []
    distances: dict[str, list[float]] = {rule: [] for rule in rules}
    for scan, truth in zip(case.measurements[:steps], case.truth, strict=False):
        # processor time of this thread: what a step costs, whatever else the machine does
        begin = time.thread_time()
        filtered.step(scan)
        taken.append(1000.0 * (time.thread_time() - begin))
        for rule in rules:
            distances[rule].append(ospa(filtered.places(rule), truth[:, [0, 2]]))
    return Course(taken[1:] or taken, distances)


def run(short: bool) -> Iterator[Measurement]:
    """A step of each filter at 10 … 1000 targets, with OSPA by the same rule and by ours."""
    course(Phd, scenario(10, 3), 3, ("W_z",))  # compiles
    course(Labelled, scenario(10, 3), 3, ("components",))
    for targets in (10, 100) if short else STEPS:
        yield from _at(targets, short)


def _at(targets: int, short: bool) -> Iterator[Measurement]:
    steps = STEPS[targets] // (3 if short else 1)
    case = scenario(targets, STEPS[targets])
    name = f"GM-PHD, {targets} targets"
    ours = course(Phd, case, steps, ("components", "W_z"))
    aim = f"≤ {MILLISECONDS[targets]:g} ms" if targets in MILLISECONDS else ""
    yield Measurement(f"{name}: step", ours.median, "ms", aim)
    yield Measurement(f"{name}: OSPA, components", ours.ospa("components"), "m")
    aim = f"≤ {OSPA[targets]:g} m" if targets in OSPA else ""
    yield Measurement(f"{name}: OSPA, W_z", ours.ospa("W_z"), "m", aim)
    labelled = course(Labelled, case, steps, ("components",))
    name = f"multi-Bernoulli, {targets} targets"
    aims = ("≤ 0.6 ms", "≤ 12 m") if targets == 100 else ("", "")
    yield Measurement(f"{name}: step", labelled.median, "ms", aims[0])
    yield Measurement(f"{name}: OSPA", labelled.ospa("components"), "m", aims[1])
    if not short and importlib.util.find_spec("stonesoup") is not None:
        yield from _beside_stone_soup(case, ours)


def _beside_stone_soup(case: Scenario, ours: Course) -> Iterator[Measurement]:
    from tests.benchmarks.plane.stone_soup import StoneSoupPhd

    targets, steps = case.targets, THEIR_STEPS[case.targets]
    theirs = course(StoneSoupPhd, case, steps, ("components",))
    name = f"GM-PHD, {targets} targets"
    many = targets >= 100
    yield Measurement(f"{name}: step, Stone Soup", theirs.median, "ms")
    yield Measurement(
        f"{name}: against Stone Soup", theirs.median / ours.median, "×", "≥ 1000" if many else ""
    )
    yield Measurement(
        f"{name}: OSPA of {steps} steps, components, Stone Soup", theirs.ospa("components"), "m"
    )
    yield Measurement(
        f"{name}: OSPA of {steps} steps, components",
        ours.ospa("components", steps),
        "m",
        f"≤ {np.ceil(10.0 * theirs.ospa('components')) / 10.0:.1f} m",
    )
