"""All scenes in one table, filter and smoothed: the built-in sequences and the real recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tests.papers.claims import cameras, fig1
from tests.papers.claims.fig1 import ROOM
from tests.papers.laboratory import runs
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tracker.evaluation import evaluate_sequence
from tracker.evaluation.figures import number
from tracker.sequences.library import open_sequence

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOMS = ("room24-2p", "room35-2p", ROOM)

ON_BOXES = ("cmc1", "cmc2", "av163-seq45-3p-1111-points", "wildtrack-points-300")
"""Recordings of an outside detector's boxes."""

FIGURES = ("mota", "idf1", "hota", "ospa", "position_error")
SHOWN = (*FIGURES, "found_share")

FILTER, SMOOTHED = "filter", "smoothed"
"""What a live system would see, and what smoothing makes of it."""

FOUND = 0.9
"""Share of all positions from which the people of a scene count as tracked."""

CLAIM = "The scheme tracks the people of every scene, and runs at the speed of the video or faster."


def run(context: Context) -> Result:
    """Track every scene once with its default parameters."""
    measured: dict[str, Any] = {}
    notes = []
    rows = []
    recordings = (cameras.RECORDING, *(() if context.quick else ON_BOXES))
    for name in (*((ROOM,) if context.quick else ROOMS), *recordings):
        steps = None
        if context.quick:
            steps = cameras.QUICK_STEPS if name == cameras.RECORDING else fig1.QUICK_STEPS
        try:
            if name in recordings:
                sequence = runs.recording(context, name)
            else:
                sequence = open_sequence(name)
        except Unavailable as missing:
            notes.append(f"Left out: {missing}.")
            continue
        timed = runs.computed(context, sequence, steps)
        evaluation = evaluate_sequence(sequence, timed.run.filtered, steps=timed.run.done)
        smoothed = evaluate_sequence(sequence, timed.run.tracks, steps=timed.run.done)
        figures: dict[str, Any] = {key: evaluation[key] for key in SHOWN}
        figures |= {
            "smoothed": {key: smoothed[key] for key in SHOWN},
            "steps": timed.run.done,
            "cameras": len(sequence.views),
            "people": len(evaluation.people),
            "steps_per_second": timed.steps_per_second,
            "fps": sequence.fps,
        }
        measured[name] = figures
        size = (f"{figures['cameras']}", f"{figures['people']}", f"{figures['steps']}")
        speed = number(timed.steps_per_second, 0)
        rows += [
            (name, FILTER, *size, *(number(evaluation[key], 3) for key in SHOWN), speed),
            ("", SMOOTHED, "", "", "", *(number(smoothed[key], 3) for key in SHOWN), ""),
        ]
        settings = evaluation.settings
    notes.append(
        f"{settings.in_words(('distance', 'gate'))}; "
        f"OSPA {settings.in_words(('cutoff', 'order'))}; "
        f"found {settings.in_words(('near',))}. "
        "Filter: step by step, as a live system would see it; smoothed: after stage 3, over the "
        "whole recording."
    )
    return Result(
        head=(
            "sequence", "tracks", ">cameras", ">people", ">steps", ">MOTA", ">IDF1", ">HOTA",
            ">OSPA (m)", ">error (m)", ">found", ">steps/s",
        ),
        rows=tuple(rows),
        numbers={"settings": settings.model_dump(), "sequences": measured},
        # the claim is of what pictures tell; other detectors' boxes have misses of their own
        findings=_findings({name: m for name, m in measured.items() if name not in ON_BOXES}),
        figure=lambda: _draw(measured),
        notes=tuple(notes),
    )  # fmt: skip


def _findings(measured: dict[str, Any]) -> tuple[Finding, ...]:
    poorest = min(measured, key=lambda name: measured[name]["found_share"])
    slowest = min(
        measured, key=lambda name: measured[name]["steps_per_second"] / measured[name]["fps"]
    )
    share, slow = measured[poorest]["found_share"], measured[slowest]
    times = slow["steps_per_second"] / slow["fps"]
    return (
        Finding(
            "the people of every scene are tracked",
            f"{100.0 * share:.1f} % of all positions found in the poorest scene, {poorest} "
            f"(tracked: from {100.0 * FOUND:.0f} %)",
            "better" if share >= FOUND else "worse",
        ),
        Finding(
            "at the speed of the video or faster",
            f"{slow['steps_per_second']:.0f} steps/s in the slowest scene, {slowest}: "
            f"{times:.1f} × real time",
            "better" if times >= 1.0 else "worse",
        ),
    )


def _draw(measured: dict[str, Any]) -> Figure:
    from tests.papers.laboratory import drawing

    figure = drawing.sheet(11.0, 0.5 * len(measured) + 1.3, "All scenes, default parameters")
    words = {
        "mota": "MOTA",
        "idf1": "IDF1",
        "hota": "HOTA",
        "ospa": "OSPA (m), lower is better",
        "position_error": "error (m), lower is better",
    }
    plots = drawing.panels(figure, [list(words)])
    for key, plot in plots.items():
        metres = key in ("ospa", "position_error")
        tone = drawing.LINE if metres else drawing.colour(2)
        values = [m[key] for m in measured.values()]
        drawing.bars(plot, list(measured), values, [tone] * len(values), named=key == "mota")
        plot.set_title(words[key])
    return figure


EXPERIMENT = Experiment("sequences", CLAIM, run)
