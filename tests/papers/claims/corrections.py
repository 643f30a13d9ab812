"""How far a few answers go: somebody who knows the truth answers the queue of doubtful places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tests.papers.laboratory import runs
from tests.papers.laboratory.answering import Answered, session
from tests.papers.laboratory.attainable import attainable
from tests.papers.laboratory.experiment import Context, Experiment, Finding, Result, Unavailable
from tracker.evaluation import EvaluationSettings
from tracker.evaluation.figures import number
from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Task:
    """A recording that is not tracked well."""

    name: str
    gate: float
    """Metres within which a track is a person's."""
    changes: dict[str, Any]
    words: str


TASKS = (
    Task(
        "cmc2",
        1.0,
        {"fusion.detection_probability": 0.3, "fusion.clutter_rate": 30.0},
        "p_D 0.3 and λ_c 30, both far off",
    ),
    Task("wildtrack-points-300", 1.0, {}, "defaults"),
    Task("av163-seq30-2p-1101", 0.5, {"single_view": "jpda"}, "without templates"),
)

ANSWERS, QUICK_ANSWERS = 15, 2
PROPOSALS = 10
"""Of which at least :data:`REAL` should be mistakes."""
REAL = 6
COMPLETE = 0.9995
"""IDF1 of which nothing is missing, as it is written."""

CLAIM = (
    "Fifteen answers to what the program asks win half of what is missing of IDF1, and six of its "
    "first ten questions are about a mistake."
)


def run(context: Context) -> Result:
    """Answer the queue of every recording at hand, truthfully, one question after another."""
    notes, rows, findings = [], [], []
    measured: dict[str, dict[str, Any]] = {}
    wanted = QUICK_ANSWERS if context.quick else ANSWERS
    for task in TASKS[: 1 if context.quick else None]:
        try:
            sequence = runs.recording(context, task.name)
        except Unavailable as missing:
            notes.append(f"Left out: {missing}.")
            continue
        parameters = with_values(pipeline.default_parameters(sequence), task.changes)
        settings = EvaluationSettings(gate=task.gate)
        steps: list[Answered] = []
        for one in session(sequence, parameters, settings, wanted):
            if context.cancelled():
                raise Cancelled
            steps.append(one)
            context.told(f"answers on {task.name}", one.answers, wanted)
        curve = [one.idf1 for one in steps]
        best = attainable(sequence, steps[0].run.tracks, settings, wanted)
        real = sum(one.wrong for one in steps[1 : PROPOSALS + 1])
        asked = min(len(steps) - 1, PROPOSALS)
        target = curve[0] + 0.5 * (1.0 - curve[0])
        needed = next((k for k, idf1 in enumerate(curve) if idf1 >= target), None)
        unmet = sum(not outcome.met for outcome in steps[-1].run.outcomes)
        measured[task.name] = {
            "gate": task.gate,
            "changes": {**changed_values(parameters)},
            "idf1": curve,
            "identities": best.identities,
            "best": list(best.best),
            "questions": [
                {
                    "kind": one.doubt.kind, "title": one.doubt.title, "wrong": one.wrong,
                    "skipped": one.skipped, "probability": one.doubt.probability,
                    "stake": one.doubt.stake,
                }
                for one in steps if one.doubt is not None
            ],
            "unmet": unmet,
        }  # fmt: skip
        rows.append(
            (
                task.name, task.words, number(curve[0], 3), number(curve[-1], 3),
                number(best.best[-1], 3), number(best.identities, 3),
                "" if needed is None else str(needed), f"{real} of {asked}", str(len(curve) - 1),
                str(unmet),
            )
        )  # fmt: skip
        won, most = (
            (last - curve[0]) / max(1.0 - curve[0], 1e-9) for last in (curve[-1], best.best[-1])
        )
        if min(curve) > COMPLETE:  # what is not wrong can neither be won nor asked about
            nothing = f"nothing: {curve[0]:.3f}, and {curve[-1]:.3f} after {len(curve) - 1} answers"
            findings.append(Finding(f"{task.name}: what is missing of the IDF1", nothing, "better"))
            continue
        findings.append(
            Finding(
                f"{task.name}: half of the missing IDF1 with at most {ANSWERS} answers",
                f"{100.0 * won:.0f} % of it after {len(curve) - 1} answers: "
                f"{curve[0]:.3f} → {curve[-1]:.3f}"
                + ("" if needed is None else f"; half after {needed}")
                + (
                    f"; the best {len(best.best) - 1} single changes alone win {100.0 * most:.0f} %"
                    if len(best.best) > 1
                    else "; of the ids none was wrong at the start"
                ),
                "better" if needed is not None else "worse",
            )
        )
        if not context.quick:
            findings.append(
                Finding(
                    f"{task.name}: of the first {PROPOSALS} questions {REAL} about a mistake",
                    f"{real} of {asked}",
                    "better" if real >= REAL else "worse",
                )
            )
    if not measured:
        raise Unavailable(notes[0].removeprefix("Left out: ").removesuffix("."))
    notes.append(
        "The recording was seen backwards in time once before; an answer is one of the "
        "alternatives that the program offers, or none."
    )
    notes.append(
        f"Best alone: the {ANSWERS} single changes that win most, one after another, chosen by "
        "somebody who knows the truth and made in the tracks: two exchanged from a step on, one "
        "that goes on as another, one that is two people's. Ids right: every track's row has the "
        "id of its person; more cannot be won by saying who is who."
    )
    return Result(
        head=(
            "sequence", "tracked with", ">IDF1", ">after", ">best alone", ">ids right",
            ">half after", ">mistakes asked", ">answers", ">unmet",
        ),
        rows=tuple(rows),
        numbers={"recordings": measured},
        findings=tuple(findings),
        figure=lambda: _draw(measured),
        notes=tuple(notes),
    )  # fmt: skip


def _draw(measured: dict[str, dict[str, Any]]) -> Figure:
    from tests.papers.laboratory import drawing

    figure = drawing.sheet(8.0, 4.0, "IDF1 against answers")
    plot = drawing.panels(figure, [["idf1"]])["idf1"]
    for index, (name, found) in enumerate(measured.items()):
        plot.plot(
            range(len(found["idf1"])), found["idf1"], marker="o", markersize=3.0,
            color=drawing.colour(index), label=name,
        )  # fmt: skip
    plot.set_xlabel("answers")
    plot.set_ylabel("IDF1")
    plot.legend(frameon=False)
    return figure


EXPERIMENT = Experiment("corrections", CLAIM, run)
