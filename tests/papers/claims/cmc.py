"""Fusion on a real person detector's boxes: the published scheme, ours, the best published."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tracker import fusion
from tracker.evaluation import EvaluationSettings, evaluate_sequence
from tracker.evaluation.figures import number
from tracker.parameters.catalogue import PRESETS, RunParameters
from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled, Run
from tracker.sequences.sequence import Sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GATES = {"cmc1": 1.0, "cmc2": 1.0, "av163-seq45-3p-1111-points": 0.5}
"""The recordings, and the metres within which an estimate is a person's."""

BEST_PUBLISHED = {"cmc1": (1.000, 1.000), "cmc2": (0.985, 0.993)}
"""MOTA and IDF1 of the result files that come with the best published filter, Ong et al. 2022."""

FIGURES = ("mota", "idf1", "id_switches", "ospa2_whole", "position_error")

CLAIM = (
    "From a person detector's boxes of four cameras a filter follows up to ten people in 26 m² "
    "(the best published one: MOTA 1.000 and 0.985)."
)

QUICK_STEPS = 100


def methods() -> dict[str, RunParameters]:
    """The ways of fusing that are compared, by name; all get the boxes as they are."""
    boxes = RunParameters(single_view="none")
    return {
        "sequential_phd as published": with_values(boxes, PRESETS["published"]),
        "sequential_phd": boxes,
        "multi_bernoulli": with_values(boxes, {"fusion_method": "multi_bernoulli"}),
    }


def run(context: Context) -> Result:
    """Fuse the boxes of every recording at hand by every method, with one set of parameters."""
    notes, rows = [], []
    measured: dict[str, dict[str, Any]] = {}
    for name, gate in GATES.items():
        try:
            sequence = runs.recording(context, name)
        except Unavailable as missing:
            notes.append(f"Left out: {missing}.")
            continue
        steps = min(QUICK_STEPS, sequence.frames) if context.quick else sequence.frames
        settings = EvaluationSettings(gate=gate)
        measured[name] = {"gate": gate, "steps": steps, "methods": {}}
        for method, parameters in methods().items():
            context.told(f"{method} on {name}", len(measured[name]["methods"]), len(methods()))
            tracked, speed = _timed(context, sequence, parameters, steps)
            evaluation = evaluate_sequence(sequence, tracked.filtered, settings, steps=steps)
            figures: dict[str, Any] = {key: evaluation[key] for key in FIGURES}
            figures["steps_per_second"] = speed
            measured[name]["methods"][method] = figures
            rows.append(
                (
                    name,
                    method,
                    *(number(figures[key], 3) for key in ("mota", "idf1")),
                    number(figures["id_switches"], 0),
                    *(number(figures[key], 3) for key in ("ospa2_whole", "position_error")),
                    number(speed, 0),
                )
            )
    if not measured:
        raise Unavailable(notes[0].removeprefix("Left out: ").removesuffix("."))
    settings = EvaluationSettings()
    gates = ", ".join(f"{name} {gate:g} m" for name, gate in GATES.items())
    notes.append(
        f"By 3D centres, gate: {gates}; OSPA(2) over the whole, "
        f"{settings.in_words(('cutoff', 'order'))}. Fusion alone on one core, no look-ahead."
    )
    return Result(
        head=(
            "sequence", "fusion", ">MOTA", ">IDF1", ">switches", ">OSPA(2) (m)", ">error (m)",
            ">steps/s",
        ),
        rows=tuple(rows),
        numbers={
            "recordings": measured,
            "best_published": {
                name: {"mota": mota, "idf1": idf1}
                for name, (mota, idf1) in BEST_PUBLISHED.items()
            },
            "parameters": {name: changed_values(p) for name, p in methods().items()},
        },
        findings=_findings(measured),
        figure=lambda: _draw(measured),
        notes=tuple(notes),
    )  # fmt: skip


def _timed(
    context: Context, sequence: Sequence, parameters: RunParameters, steps: int
) -> tuple[Run, float]:
    """A run, and the steps a second of its fusion: the time of this thread on its core."""
    tracked = pipeline.compute(sequence, parameters, steps=steps, cancelled=context.cancelled)
    # the run has compiled what there is to compile
    method = fusion.create(sequence, parameters)
    state, begin = method.start(), time.thread_time()
    for views in tracked.views:
        if context.cancelled():
            raise Cancelled
        state, _ = method.step(state, views)
    return tracked, len(tracked.views) / max(time.thread_time() - begin, 1e-9)


def _findings(measured: dict[str, dict[str, Any]]) -> tuple[Finding, ...]:
    findings = []
    for name, (mota, idf1) in BEST_PUBLISHED.items():
        if name not in measured:
            continue
        ours = measured[name]["methods"]["multi_bernoulli"]
        reached = round(ours["mota"] or 0.0, 3) >= mota
        findings.append(
            Finding(
                f"{name}: the best published filter scores MOTA {mota:.3f}, IDF1 {idf1:.3f}",
                f"multi_bernoulli: MOTA {number(ours['mota'], 3)}, IDF1 {number(ours['idf1'], 3)}, "
                f"{number(ours['id_switches'], 0)} switches",
                "better" if reached else "worse",
            )
        )
    for name, recording in measured.items():
        found = recording["methods"]
        ours, published = found["multi_bernoulli"], found["sequential_phd as published"]
        findings.append(
            Finding(
                f"{name}: the whole box, births from boxes and one label a person beat the "
                "published scheme",
                f"MOTA {number(ours['mota'], 3)} against {number(published['mota'], 3)}",
                "better" if (ours["mota"] or 0.0) > (published["mota"] or 0.0) else "worse",
            )
        )
    return tuple(findings)


def _draw(measured: dict[str, dict[str, Any]]) -> Figure:
    from tests.papers.laboratory import drawing

    names = list(methods())
    figure = drawing.sheet(
        11.0, 0.9 * len(measured) + 1.6, "The same boxes, three ways of fusing them"
    )
    words = {"mota": "MOTA", "idf1": "IDF1", "ospa2_whole": "OSPA(2) (m), lower is better"}
    plots = drawing.panels(figure, [list(words)])
    for key, plot in plots.items():
        labels, values, tones = [], [], []
        for name, recording in measured.items():
            for index, method in enumerate(names):
                labels.append(f"{name.split('-3p')[0]}: {method}")
                values.append(recording["methods"][method][key])
                tones.append(drawing.colour(index))
        drawing.bars(plot, labels, values, tones, named=key == "mota")
        plot.set_title(words[key])
    return figure


EXPERIMENT = Experiment("cmc", CLAIM, run)
