"""How time and memory grow with components, people, cameras and steps."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tests.benchmarks.measure import Measurement, seconds
from tests.engine import synthetic
from tests.filters.mixtures import random_mixture
from tracker.filters import gaussian_mixture
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline

PEOPLE = RunParameters(single_view="none", fusion_method="multi_bernoulli")


def run(short: bool) -> Iterator[Measurement]:
    """One step against components, cameras and people; the last against the first of many."""
    yield from _components((30, 300) if short else (30, 100, 300, 1000, 3000))
    yield from _cameras((2, 4) if short else (2, 4, 8, 16))
    yield from _people((2, 8) if short else (2, 5, 10, 20, 50))
    yield from _steps((500,) if short else (500, 2000, 10_000))


def _components(sizes: Sequence[int]) -> Iterator[Measurement]:
    for size in sizes:
        # as many to each other, however many there are
        mixture = random_mixture(np.random.default_rng(1), size, 4, extent=5.0 * size**0.25)

        def merge(mixture: gaussian_mixture.GaussianMixture = mixture) -> object:
            return gaussian_mixture.merge(mixture, 4.0)

        yield Measurement(f"merging of {size} components", 1000.0 * seconds(merge), "ms")


def ring(count: int) -> tuple[Camera, ...]:
    """Cameras around the room."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return tuple(
        synthetic.look_at(f"camera{k}", (4.4 * np.cos(a), 4.4 * np.sin(a), 2.6))
        for k, a in enumerate(angles)
    )


def walkers(count: int, steps: int) -> list[tuple[int, np.ndarray]]:
    """People on circles of their own, for as long as it takes."""
    angles = np.arange(steps) * 0.01
    people = []
    for number in range(count):
        radius, start = 0.3 + 1.0 * (number % 5) / 5.0, 2.0 * np.pi * number / count
        place = [
            radius * np.cos(start + angles),
            radius * np.sin(start + angles),
            np.full(steps, 0.9),
        ]
        people.append((0, np.stack(place, axis=1)))
    return people


def _a_step(people: int, cameras: int, steps: int) -> float:
    """Milliseconds of processor time, of all threads, for a step of fusion and tracks."""
    whole = synthetic.sequence(
        walkers(people, steps), steps, ring(cameras), clutter_rate=1.0, pixel_noise=0.5
    )
    parameters = with_values(PEOPLE, {"fusion.max_components": max(60, 4 * people)})
    pipeline.compute(whole, parameters, steps=5)
    begin = time.process_time()
    pipeline.compute(whole, parameters)
    return 1000.0 * (time.process_time() - begin) / steps


def _cameras(counts: Sequence[int]) -> Iterator[Measurement]:
    for count in counts:
        yield Measurement(f"step with {count} cameras, 3 people", _a_step(3, count, 100), "ms")


def _people(counts: Sequence[int]) -> Iterator[Measurement]:
    for count in counts:
        yield Measurement(f"step with {count} people, 3 cameras", _a_step(count, 3, 60), "ms")


def _steps(counts: Sequence[int]) -> Iterator[Measurement]:
    for count in counts:
        whole = synthetic.sequence(
            walkers(3, count), count, ring(3), clutter_rate=0.5, pixel_noise=0.5
        )
        times: list[float] = []
        # stage 1 beforehand: then only the loop over the steps asks whether to stop
        before = pipeline.compute(whole, PEOPLE)
        again = with_values(PEOPLE, {"fusion.survival_probability": 0.985})
        pipeline.compute(whole, again, previous=before, cancelled=_stamps(times))
        tenth = max(1, count // 10)
        gaps = np.diff(times)
        first, last = statistics.median(gaps[:tenth]), statistics.median(gaps[-tenth:])
        yield Measurement(f"step of {count}, the first tenth", 1000.0 * first, "ms")
        yield Measurement(
            f"step of {count}, the first tenth over the last", first / last, "×", "flat: about 1"
        )
        yield Measurement(f"peak memory of a process that tracks {count} steps", _peak(count), "MB")


def _stamps(times: list[float]) -> Callable[[], bool]:
    def note() -> bool:
        times.append(time.perf_counter())
        return False

    return note


_ALONE = """
import resource, sys
from tests.benchmarks.engine.growth import PEOPLE, ring, walkers
from tests.engine import synthetic
from tracker.runs import pipeline
count = int(sys.argv[1])
whole = synthetic.sequence(walkers(3, count), count, ring(3), clutter_rate=0.5, pixel_noise=0.5)
pipeline.compute(whole, PEOPLE)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


def _peak(count: int) -> float:
    """Megabytes at most, of a process that does nothing else."""
    line = [sys.executable, "-c", _ALONE, str(count)]
    return float(subprocess.run(line, capture_output=True, text=True, check=True).stdout)
