"""Every single-view method as stage 1 of the same fusion, on the rooms and on the recordings."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.papers.claims import cameras, fig1
from tests.papers.laboratory import runs, sequences
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.evaluation.figures import number
from tracker.parameters.catalogue import METHODS, RunParameters, method_of
from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.sequences.sequence import Sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ON_BOXES = "detection_phd"
"""The method that needs an outside detector's boxes, where the others need pictures."""

ON_PICTURES = tuple(
    name
    for name in METHODS["single_view"]
    if method_of("single_view", name).used(RunParameters()).finds_people
)
"""Those that need nothing else: a detection network is brought by somebody."""

BOXES_RECORDING = "cmc1"
"""A recording with such boxes, and without pictures."""

QUICK_STEPS = 220
QUICK_RECORDED_STEPS = 40
"""Two people are there, and have passed each other."""

FIGURES = ("mota", "idf1", "ospa", "position_error", "found_share")

FUSION = "multi_bernoulli"

CLAIM = "Each single-camera tracker serves as stage 1 of the 3D fusion, and people are followed."


def run(context: Context) -> Result:
    """Track every scene with every method that it has the input for, fused in the same way."""
    notes: list[str] = []
    scenes = _scenes(context, notes)
    measured: dict[str, dict[str, dict[str, Any]]] = {}
    rows = []
    for sequence, steps in scenes:
        names = ON_PICTURES if sequence.has_pictures else (ON_BOXES,)
        measured[sequence.name] = {}
        for name in names:
            figures = _measure(context, sequence, name, steps)
            measured[sequence.name][name] = figures
            rows.append(
                (
                    sequence.name if name == names[0] else "",
                    name,
                    *(number(figures[key], 3) for key in FIGURES),
                    number(figures["steps_per_second"], 0),
                )
            )
    settings = EvaluationSettings()
    notes += [
        f"{settings.in_words(('distance', 'gate'))}; "
        f"OSPA {settings.in_words(('cutoff', 'order'))}; "
        f"found {settings.in_words(('near',))}. Default parameters, seed 0, fusion {FUSION}.",
        f"{ON_BOXES} needs an outside detector's boxes: the rooms and {cameras.RECORDING} have "
        f"none, and {BOXES_RECORDING} has no pictures for the others.",
    ]
    return Result(
        head=(
            "sequence", "single view", ">MOTA", ">IDF1", ">OSPA (m)", ">error (m)", ">found",
            ">steps/s",
        ),
        rows=tuple(rows),
        numbers={
            "fusion": FUSION,
            "settings": settings.model_dump(),
            "sequences": measured,
            "parameters": {
                name: changed_values(_parameters(name)) for name in (*ON_PICTURES, ON_BOXES)
            },
        },
        findings=_findings(measured),
        figure=lambda: _draw(measured),
        notes=tuple(notes),
    )  # fmt: skip


def _scenes(context: Context, notes: list[str]) -> list[tuple[Sequence, int]]:
    """What can be run here, and how many steps of it."""
    names = (fig1.ROOM,) if context.quick else sequences.ROOMS
    scenes = []
    for name in names:
        room = runs.room(context, name, QUICK_STEPS if context.quick else None)
        scenes.append((room, room.frames))
    for name in (cameras.RECORDING, BOXES_RECORDING):
        try:
            recording = runs.recording(context, name)
        except Unavailable as missing:
            notes.append(f"Left out: {missing}.")
            continue
        steps = recording.frames
        scenes.append((recording, min(QUICK_RECORDED_STEPS, steps) if context.quick else steps))
    return scenes


def _parameters(name: str) -> RunParameters:
    return with_values(RunParameters(), {"single_view": name, "fusion_method": FUSION})


def _measure(context: Context, sequence: Sequence, name: str, steps: int) -> dict[str, Any]:
    words = f"{name} in {sequence.name}"
    context.told(words, 0, steps)
    begin = time.perf_counter()
    tracked = pipeline.compute(
        sequence,
        _parameters(name),
        steps=steps,
        on_progress=lambda _, progress: context.told(words, progress.done, progress.total),
        cancelled=context.cancelled,
    )
    seconds = time.perf_counter() - begin
    evaluation = evaluate_sequence(sequence, tracked.filtered, steps=tracked.done)
    figures: dict[str, Any] = {key: evaluation[key] for key in FIGURES}
    return figures | {"steps": tracked.done, "steps_per_second": tracked.done / seconds}


def _findings(measured: dict[str, dict[str, dict[str, Any]]]) -> tuple[Finding, ...]:
    """Of each method its poorest scene."""
    findings = []
    for name in (*ON_PICTURES, ON_BOXES):
        shares = {
            scene: figures[name]["found_share"] or 0.0
            for scene, figures in measured.items()
            if name in figures
        }
        if not shares:
            continue
        poorest = min(shares, key=lambda scene: shares[scene])
        figures = measured[poorest][name]
        findings.append(
            Finding(
                f"{name} serves as stage 1",
                f"{100.0 * shares[poorest]:.1f} % of all positions found in its poorest scene, "
                f"{poorest}, MOTA {number(figures['mota'], 3)} "
                f"(followed: from {100.0 * sequences.FOUND:.0f} %)",
                "better" if shares[poorest] >= sequences.FOUND else "worse",
            )
        )
    return tuple(findings)


def _draw(measured: dict[str, dict[str, dict[str, Any]]]) -> Figure:
    from tests.papers.laboratory import drawing

    names = (*ON_PICTURES, ON_BOXES)
    bars = [
        (f"{scene.split('-2p-')[0]}: {name}", figures, drawing.colour(names.index(name)))
        for scene, by_name in measured.items()
        for name, figures in by_name.items()
    ]
    figure = drawing.sheet(
        12.0, 0.28 * len(bars) + 1.3, f"Single-view methods as stage 1 of {FUSION}"
    )
    words = {
        "mota": "MOTA",
        "idf1": "IDF1",
        "ospa": "OSPA (m), lower is better",
        "position_error": "error (m), lower is better",
    }
    plots = drawing.panels(figure, [list(words)])
    labels, values, tones = (list(column) for column in zip(*bars, strict=True))
    for key, plot in plots.items():
        shown = [figures[key] for figures in values]
        lowest = min((value for value in shown if value is not None), default=0.0)
        drawing.bars(plot, labels, shown, tones, named=key == "mota")
        plot.set_title(words[key])
        plot.set_xlim(left=float(np.minimum(0.0, lowest)))
    return figure


EXPERIMENT = Experiment("methods", CLAIM, run)
