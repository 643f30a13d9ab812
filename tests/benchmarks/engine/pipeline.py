"""The stages over whole sequences: how many times faster than the recording."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

from tests.benchmarks.measure import Measurement
from tests.engine import synthetic
from tracker import fusion, smoothing
from tracker.fusion import FusionMethod, FusionResult
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence
from tracker.single_view.protocol import ViewResult

_TURNS = 5
"""How often two stages are measured in turns."""

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"


def run(short: bool) -> Iterator[Measurement]:
    """Fusion and hindsight alone, 500 steps and 3 cameras; the whole pipeline on real video, where
    at hand."""
    yield from _fusion()
    video = DATA / "av163-seq30-2p-1101"
    if video.is_dir():
        yield from _video(video, 100 if short else 500)


def _fusion() -> Iterator[Measurement]:
    whole = synthetic.sequence(synthetic.crossing(500), 500)
    views = [synthetic.views_at(whole, frame) for frame in range(500)]
    variants: dict[str, RunParameters] = {
        "sequential_phd as published": with_values(RunParameters(), PRESETS["published"]),
        "sequential_phd": with_values(RunParameters(), {"fusion_method": "sequential_phd"}),
        "multi_bernoulli": with_values(RunParameters(), {"fusion_method": "multi_bernoulli"}),
    }
    for name, parameters in variants.items():
        method = fusion.create(whole, parameters)
        _fused(method, views)  # the first compiles
        taken = _fused(method, views)[1]
        yield Measurement(
            f"fusion alone, 500 steps × {len(whole.views)} cameras, {name}", taken, "s", "≤ 1 s"
        )
    # by the last one, the default
    hindsight = smoothing.create(whole, parameters)
    steps = [tuple(boxes) for boxes in views]
    hindsight.smooth(steps, _fused(method, views)[0])  # the first compiles
    fusing, smoothing_times = [], []
    for _ in range(_TURNS):
        fused, taken = _fused(method, views)
        fusing.append(taken)
        begin = time.perf_counter()
        hindsight.smooth(steps, fused)
        smoothing_times.append(time.perf_counter() - begin)
    smoothed = median(smoothing_times)
    what = f"hindsight alone, 500 steps × {len(whole.views)} cameras, {parameters.smoothing_method}"
    yield Measurement(what, smoothed, "s", "≤ 0.3 s")
    ratio = smoothed / median(fusing)
    yield Measurement(f"{what}, by the fusion's time", ratio, "×", "≤ 2", better="lower")


def _fused(method: FusionMethod, views: list[list[ViewResult]]) -> tuple[list[FusionResult], float]:
    """Stage 2 of all steps, and how many seconds it took."""
    state, fused = method.start(), []
    begin = time.perf_counter()
    for boxes in views:
        state, result = method.step(state, boxes)
        fused.append(result)
    return fused, time.perf_counter() - begin


def _video(folder: Path, frames: int) -> Iterator[Measurement]:
    sequence = read_sequence(folder)
    parameters = pipeline.default_parameters(sequence)
    pipeline.compute(sequence, parameters, steps=10)  # compiles
    begin, work = time.perf_counter(), time.process_time()
    views = pipeline.compute(sequence, parameters, steps=frames)
    whole, work = time.perf_counter() - begin, time.process_time() - work
    recorded = frames / sequence.fps
    yield Measurement(
        f"pipeline on {sequence.name}, {frames} steps × {len(sequence.views)} cameras",
        recorded / whole,
        "× real time",
        "≥ 2 with two cores",
    )
    yield Measurement("the same, processor seconds a recorded second", work / recorded, "s/s")
    again = with_values(parameters, {"fusion.survival_probability": 0.985})
    begin, fusing = time.perf_counter(), time.process_time()
    fused = pipeline.compute(sequence, again, steps=frames, previous=views)
    taken, fusing = time.perf_counter() - begin, time.process_time() - fusing
    yield Measurement(
        f"the same after a change of the fusion's p_S, {frames} steps", taken, "s", "≤ 1 s for 500"
    )
    other = with_values(again, {"fusion.extraction_threshold": 0.55})
    tracking = time.process_time()
    pipeline.compute(sequence, other, steps=frames, previous=fused)
    tracking = time.process_time() - tracking
    for stage, seconds in (
        ("single view", work - fusing),
        ("fusion", fusing - tracking),
        ("tracks", tracking),
    ):
        name = f"{stage} alone, recorded seconds a processor second"
        yield Measurement(name, recorded / max(seconds, 1e-9), "×")
