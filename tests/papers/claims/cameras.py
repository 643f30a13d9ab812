"""More cameras, less error: the real recording by three cameras, each two and each one."""

from __future__ import annotations

from functools import partial
from itertools import combinations, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.papers.claims.fig3 import parameters_of
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result
from tracker.evaluation import EvaluationSettings, evaluate
from tracker.evaluation.figures import number
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import changed_values
from tracker.runs.processes import WorkerControl
from tracker.sequences.reader import read_sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RECORDING = "av163-seq30-2p-1101"

SEEDS, QUICK_SEEDS = 6, 1

QUICK_STEPS = 160

FIGURES = ("position_error", "found_share", "false_per_step", "mota", "idf1", "ospa")

CLAIM = (
    "On real video too the fusion of cameras has less error than a single one "
    "(about 56 % less without occlusion; the single camera's almost twice with it)."
)


def run(context: Context) -> Result:
    """Track with every seed, and fuse the boxes of every choice of cameras."""
    sequence = runs.recording(context, RECORDING)
    steps = min(QUICK_STEPS, sequence.frames) if context.quick else sequence.frames
    seeds = list(range(context.seeds_of(SEEDS, QUICK_SEEDS)))
    parameters = parameters_of(sequence)
    count = len(sequence.views)
    choices = [c for size in range(count, 0, -1) for c in combinations(range(count), size)]
    work = partial(
        _one_seed, folder=sequence.folder, parameters=parameters, steps=steps, choices=choices
    )
    answers = context.spread(work, seeds, words=f"{len(seeds)} seeds", steps=steps * len(seeds))
    measured: dict[str, Any] = {}
    rows = []
    for index, choice in enumerate(choices):
        name = " + ".join(sequence.cameras[c].name for c in choice)
        figures = {key: _mean([answer[index][key] for answer in answers]) for key in FIGURES}
        spread_of = _deviation([answer[index]["ospa"] for answer in answers])
        measured[name] = {"cameras": len(choice), "ospa_deviation": spread_of, **figures}
        rows.append((name, *(number(figures[key], 3) for key in FIGURES), number(spread_of, 3)))
    settings = EvaluationSettings()
    by_count = {
        size: {key: _mean([m[key] for m in measured.values() if m["cameras"] == size])
               for key in FIGURES}
        for size in range(1, count + 1)
    }  # fmt: skip
    return Result(
        head=(
            "cameras", ">error (m)", f">found within {settings.near:g} m", ">false a step",
            ">MOTA", ">IDF1", ">OSPA (m)", ">± over seeds",
        ),
        rows=tuple(rows),
        numbers={
            "sequence": sequence.name,
            "steps": steps,
            "seeds": len(seeds),
            "settings": settings.model_dump(),
            "parameters": changed_values(parameters),
            "choices": measured,
            "by_count": {str(size): figures for size, figures in by_count.items()},
        },
        findings=_findings(by_count),
        figure=lambda: _draw(sequence.name, measured, len(seeds)),
        notes=(
            f"Means over {len(seeds)} seeds of the samples; all choices have the same boxes.",
            f"Error, MOTA, IDF1: {settings.in_words(('distance', 'gate'))}.",
            f"OSPA: {settings.in_words(('cutoff', 'order'))}.",
        ),
    )  # fmt: skip


def _one_seed(
    seed: int,
    control: WorkerControl,
    *,
    folder: Path,
    parameters: RunParameters,
    steps: int,
    choices: list[tuple[int, ...]],
) -> list[dict[str, Any]]:
    sequence = read_sequence(folder)
    tracked = runs.tracked(sequence, parameters, control, seed=seed, steps=steps)
    scored = []
    for choice in choices:
        tracks = runs.fused_again(tracked, choice)
        evaluation = evaluate(sequence.ground_truth, tracks, steps=steps)
        scored.append({key: evaluation[key] for key in FIGURES})
    return scored


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _deviation(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.std(known, ddof=1)) if len(known) > 1 else None


def _findings(by_count: dict[int, dict[str, Any]]) -> tuple[Finding, ...]:
    most = max(by_count)
    several, one = by_count[most], by_count[1]
    a, b = several["position_error"], one["position_error"]
    less = 100.0 * (1.0 - a / b) if a is not None and b else None
    found = (
        f"{most} cameras {number(a, 3)} m, one alone {number(b, 3)} m: {number(less, 0)} % less; "
        f"found {number(several['found_share'], 2)} against {number(one['found_share'], 2)}"
    )
    costs = [by_count[size]["ospa"] for size in sorted(by_count)]
    falling = all(more < fewer for fewer, more in pairwise(costs))
    return (
        Finding(
            "less error than a single camera, about 56 %",
            found,
            "better" if less is not None and round(less) >= 56 else "worse",
        ),
        Finding(
            "every camera more helps",
            "OSPA by number of cameras: "
            + ", ".join(f"{size}: {number(by_count[size]['ospa'], 3)} m" for size in by_count),
            "better" if falling else "worse",
        ),
    )


def _draw(name: str, measured: dict[str, Any], seeds: int) -> Figure:
    from tests.papers.laboratory import drawing

    figure = drawing.sheet(
        11.0, 3.9, f"{name}: fused from three, two and one camera, {seeds} seeds"
    )
    plots = drawing.panels(figure, [["position_error", "found_share", "ospa"]])
    words = {
        "position_error": "mean position error (m), lower is better",
        "found_share": "share found within 0.3 m, higher is better",
        "ospa": "OSPA (m), lower is better",
    }
    tones = {1: drawing.LINE, 2: drawing.NEAR}
    for key, plot in plots.items():
        drawing.bars(
            plot,
            list(measured),
            [m[key] for m in measured.values()],
            [tones.get(m["cameras"], drawing.colour(2)) for m in measured.values()],
            named=key == "position_error",
        )
        plot.set_title(words[key])
    return figure


EXPERIMENT = Experiment("cameras", CLAIM, run)
