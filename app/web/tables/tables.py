"""The page's tables: what its drawings show, in words and numbers, as parts of the page.

``GET /api/tables/…`` answers with HTML that the page puts into its panels as it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from app.models import CameraTrack, Step
from app.state.kept.history import History
from app.state.scores import Scored
from app.state.snapshot import RunPhase, RunState, Snapshot
from app.state.workers.evaluator import Evaluator
from app.state.workers.sensitivity import Curve, Sensitivity
from app.web.dependencies import ERRORS, Bench, nothing_open
from app.web.evaluation import messages
from app.web.evaluation.models import Comparison
from app.web.tables.event_tables import checked
from app.web.tables.markup import (
    Cell,
    Markup,
    blank,
    button,
    escaped,
    id_tag,
    joined,
    line,
    number,
    quiet,
    symbol,
    table,
    value_text,
    vector,
)
from app.web.views import steps
from tracker.evaluation import Evaluation
from tracker.evaluation.difference import Verdict
from tracker.evaluation.figures import Figure
from tracker.parameters.catalogue import METHODS, PARAMETERS
from tracker.parameters.values import changed_values, value_of
from tracker.runs.run import given_names
from tracker.sequences.sequence import Sequence

SIGNS: dict[Verdict, str] = {"better": "▲ ", "worse": "▼ ", "same": "= ", "different": "≠ ",
                             "undefined": ""}  # fmt: skip

PHASES: dict[RunPhase, str] = {
    "idle": "ready",
    "computing": "computing",
    "done": "computed",
    "failed": "failed",
    "cancelled": "partial",
}
"""A run's state, as the page words it."""

router = APIRouter(prefix="/api/tables", responses=ERRORS, default_response_class=HTMLResponse)


@router.get("/step/{step}")
def step_tables(step: int, bench: Bench) -> str:
    """One step: the people in 3D, each camera's view of them, and the curves' values."""
    snapshot = bench.snapshot()
    sequence = snapshot.sequence
    if sequence is None:
        raise nothing_open()
    message = steps.step_of(sequence, snapshot.run, max(0, min(step, sequence.frames - 1)))
    if not message.computed:
        return blank(
            "Nothing is computed at this step",
            "Where people are, what each camera saw of them and the curves' values stand here.",
        )
    names = given_names(snapshot.run) if snapshot.run is not None else {}
    parts = _people(message, names), _pictures(message), _nobodys(message)
    return "".join(parts) + _curves(snapshot, sequence, message)


def _people(message: Step, names: Mapping[int, str]) -> str:
    errors = {person.track: person.error for person in message.truth}
    return table(
        f"People in 3D at step {message.step}",
        ("In 3D", "#Weight", "#x, y, z  m", "#± m", "#Error  m"),
        [
            (
                joined(id_tag(track.id), f" {called}" if (called := names.get(track.id)) else ""),
                number(track.existence, 3),
                vector(track.position),
                vector(track.sigma),
                number(errors.get(track.id), 3),
            )
            for track in message.tracks
        ],
    )


def _pictures(message: Step) -> str:
    return table(
        "Tracks in the pictures",
        ("Camera", "Track", "State", "#p_D", "Because", "Fed by", "#Left, top, width, height  px"),
        [
            (
                camera.name,
                id_tag(track.id),
                "seen" if track.seen else "coasting",
                number(track.detection_probability, 2),
                _because(track),
                _feeding(track),
                "–" if track.box is None else "  ".join(str(round(side)) for side in track.box),
            )
            for camera in message.cameras
            for track in camera.tracks
        ],
    )


def _nobodys(message: Step) -> str:
    """Detections that feed no track, each with the track that it is nearest to."""
    rows: list[tuple[Cell, ...]] = [
        (
            camera.name,
            f"box {index + 1}",
            number(box.score, 2),
            "no track in this picture" if box.nearest is None else id_tag(box.nearest),
            number(box.sigmas, 2),
            number(box.gate, 2),
            "  ".join(str(round(side)) for side in box.box),
        )
        for camera in message.cameras
        for index, box in enumerate(camera.measurements)
        if box.track is None
    ]
    heads = (
        "Camera", "Nobody's", "#Score", "Nearest track", "#σ away", "#Gate, σ",
        "#Left, top, width, height  px",
    )  # fmt: skip
    return table("Detections that are nobody's", heads, rows) if rows else ""


def _because(track: CameraTrack) -> str:
    if track.hidden_by is not None:
        return f"hidden by {track.hidden_by}"
    return track.reason or ""


def _feeding(track: CameraTrack) -> str:
    fed = track.fed_by
    if fed is None:
        return "–"
    return f"box {track.source + 1}, {100 * fed.share:.0f} % sure"


def _curves(snapshot: Snapshot, sequence: Sequence, message: Step) -> str:
    rows: list[tuple[Cell, ...]] = [
        ("People, reported", len(message.tracks), None),
        ("People, expected", number(message.cardinality, 2), None),
        ("Components", message.components, None),
    ]
    if sequence.ground_truth is not None:
        rows.insert(0, ("People, true", sum(person.valid for person in message.truth), None))
    scores, run = snapshot.scores, snapshot.run
    b = scores.shown if run is not None and scores.shown and scores.shown.is_of(run) else None
    shown = [b, scores.reference[1] if scores.reference is not None else None]
    for name, words in (
        ("ospa", "OSPA"),
        ("ospa_localisation", "OSPA, location"),
        ("ospa_cardinality", "OSPA, number"),
        ("gospa", "GOSPA"),
    ):
        values = [_value_at(scored, name, message) for scored in shown]
        if values[0] is not None:
            rows.append((f"{words}  m", *(number(value, 3) for value in values)))
    for camera in message.cameras:
        for word, value in camera.information.items():
            rows.append((f"{camera.name}, {word}", f"{value:.4g}", None))
    return table("Curves at this step", ("Measure", "#B", "#A"), rows)


def _value_at(scored: Scored | None, name: str, message: Step) -> float | None:
    if scored is None or scored.evaluation is None or message.step >= scored.steps:
        return None
    return float(getattr(scored.evaluation.series, name)[message.step])


@router.get("/changes")
def change_table(request: Request, bench: Bench) -> str:
    """What differs from the defaults, each with its reset; and what parameters would change."""
    snapshot = bench.snapshot()
    sensitivity: Sensitivity = request.app.state.sensitivity
    curves = _curves_of(sensitivity.curves())
    if curves and not changed_values(snapshot.parameters, snapshot.defaults):
        return line("All parameters stand at their defaults.") + curves
    return _changed(snapshot) + curves


def _curves_of(curves: Mapping[str, Curve]) -> str:
    rows = [
        (
            quiet(_stage(key)),
            _name(key),
            value_text(value),
            number(score, 3 if curve.measure == "MOTA" else 0),
        )
        for key, curve in curves.items()
        for value, score in zip(curve.values, curve.scores, strict=True)
    ]
    measure = next((curve.measure for curve in curves.values()), "")
    heads = ("Stage", "What it would change", "#Value", f"#{measure}")
    return table("What parameters would change", heads, rows) if rows else ""


def _changed(snapshot: Snapshot) -> str:
    changed = changed_values(snapshot.parameters, snapshot.defaults)
    if not changed:
        return blank(
            "All parameters stand at their defaults",
            "Move a slider in the panel of the 3D view; what differs is listed here.",
        )
    return table(
        "Changed parameters",
        ("Stage", "Parameter", "#Default", "#Now", "#"),
        [
            (
                quiet(_stage(key)),
                _name(key),
                quiet(value_text(value_of(snapshot.defaults, key))),
                joined(value_text(value), quiet(f" {_unit(key)}".rstrip())),
                button("reset", "reset", key, label=f"Reset {_label(key)}"),
            )
            for key, value in changed.items()
        ],
    )


def _label(key: str) -> str:
    known = PARAMETERS.get(key)
    return known.label if known is not None else key.replace("_", " ")


def _stage(key: str) -> str:
    group = key.partition(".")[0]
    if group in METHODS:
        return "method"
    return group if group in METHODS["single_view"] else group.replace("_", " ")


def _name(key: str) -> Markup:
    known = PARAMETERS.get(key)
    if known is None:
        return Markup(escaped(_label(key)))
    words = joined(known.label, " ", symbol(known.symbol)).html
    return Markup(f'<span title="{escaped(known.help)}">{words}</span>')


def _unit(key: str) -> str:
    known = PARAMETERS.get(key)
    return known.unit if known is not None else ""


@router.get("/compare")
def compare_tables(
    request: Request,
    bench: Bench,
    every: Annotated[bool, Query(description="Not the headlines alone.")] = False,
) -> str:
    """The shown run, B, against the truth, beside A: the pinned run or the one before."""
    snapshot = bench.snapshot()
    sequence, scored = snapshot.sequence, snapshot.scores.shown
    if sequence is None:
        return blank("Figures appear here", "once a sequence is open.")
    identity = checked(request, snapshot)
    if sequence.ground_truth is None:
        return identity + line(
            quiet(
                f"{sequence.name} names no file of true positions ([ground_truth] in "
                "sequence.toml), so its tracks cannot be scored."
            )
        )
    if scored is None or scored.evaluation is None:
        return blank(
            "Not scored yet", "The tracks are set against the truth while the run goes on."
        )
    evaluation, reference = scored.evaluation, snapshot.scores.reference
    notes = "".join(line(text) for text in (messages.stated_of(evaluation), *evaluation.notes))
    if reference is None:
        words = " · no run to compare with: pin this one, or change a parameter"
        head = line(Markup("<b>B</b> "), _side(_shown(snapshot, scored), scored), words)
        return head + _figures(evaluation, every) + notes + identity
    against, other = reference
    evaluator: Evaluator = request.app.state.evaluator
    before = evaluator.beginning(other, scored.steps)
    comparison = messages.comparison_of(against, (other, before), (scored, evaluation))
    head = line(
        Markup("<b>A</b> "),
        _side("pinned run" if against == "pinned" else "run before", other),
        Markup(" <b>B</b> "),
        _side(_shown(snapshot, scored), scored),
        f" · {comparison.steps} steps",
    )
    tables = _differences(comparison, evaluation, every) + _differing(comparison)
    return head + tables + notes + identity


@router.get("/runs")
def run_table(request: Request, bench: Bench) -> str:
    """The current run and those before it, each with the way back to it."""
    history: History = request.app.state.history
    snapshot = bench.snapshot()
    runs = history.runs
    if not runs:
        return blank("No run yet", "What is computed is listed here, and can be taken up again.")
    open_now = snapshot.sequence.name if snapshot.sequence is not None else ""
    rows: list[tuple[Cell, ...]] = []
    for run in runs:
        state, methods = run.state, (run.parameters.single_view, run.parameters.fusion_method)
        current, speed = state.key == snapshot.run_state.key, state.steps_per_second
        again: Cell = quiet("another sequence")
        if current:
            again = quiet("current")
        elif run.sequence == open_now or run.recording == snapshot.sequence_key:
            label = f"Use the parameters of run {run.number} again"
            again = button("use again", "useAgain", run.number, label=label)
        rows.append(
            (
                run.number,
                joined(Markup(f"<span>{escaped(run.sequence)}</span> "), quiet(run.at)),
                joined(quiet(f"{methods[0]} ·"), " ", quiet(methods[1])),
                _phase(state, current),
                number(speed, 0 if speed >= 10.0 else 1) if speed else None,
                run.changes,
                again,
            )
        )
    heads = ("Run", "Sequence", "Methods", "State", "#Steps/s", "#Changes", "#")
    return table("Runs", heads, rows)


def _phase(state: RunState, current: bool) -> str:
    words = "overtaken" if state.state == "computing" and not current else PHASES[state.state]
    return words if state.done >= state.total else f"{words} {state.done}/{state.total}"


def _figures(evaluation: Evaluation, every: bool) -> str:
    return table(
        "Figures",
        ("Measure", "#B"),
        [
            (_measure(figure), number(figure.value, figure.definition.digits))
            for figure in evaluation.figures
            if every or figure.definition.headline
        ],
    )


def _differences(comparison: Comparison, evaluation: Evaluation, every: bool) -> str:
    figures = {figure.definition.key: figure for figure in evaluation.figures}
    return table(
        "Figures",
        ("Measure", "#A", "#B", "#Difference", "B is"),
        [
            (
                _measure(figures[row.name]),
                quiet(number(row.a, row.digits)),
                number(row.b, row.digits),
                number(row.difference, row.digits, signed=True) if row.comparable else "–",
                _verdict(row.verdict) if row.comparable else "other settings",
            )
            for row in comparison.rows
            if every or row.headline
        ],
    )


def _differing(comparison: Comparison) -> str:
    rows = [
        (_name(row.key), quiet(value_text(row.a)), value_text(row.b))
        for row in comparison.parameters
    ]
    return table("Parameters that differ", ("B differs in", "#A", "#B"), rows) if rows else ""


def _measure(figure: Figure) -> Markup:
    words = joined(figure.definition.name, quiet(f" {figure.unit}".rstrip())).html
    title = f"{figure.definition.help}\n{figure.measured_with}".strip()
    return Markup(f'<span title="{escaped(title)}">{words}</span>')


def _shown(snapshot: Snapshot, scored: Scored) -> str:
    """Whose the figures are: just after a change still those of the run before."""
    behind = snapshot.run is not None and snapshot.run.key != scored.key
    return "the run before, this one is being scored" if behind else "this run"


def _side(words: str, scored: Scored) -> str:
    count = len(messages.changed(scored))
    changes = f"{count} change{'s' if count > 1 else ''}" if count else "default parameters"
    return f"{words}, {changes}{'' if scored.final else ', not finished'}"


def _verdict(verdict: Verdict) -> Markup:
    words = "–" if verdict == "undefined" else f"{SIGNS[verdict]}{verdict}"
    return Markup(f'<span class="{verdict}">{escaped(words)}</span>')
