"""Tracks against the truth, as the page asks for them: messages and routes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from fastapi import APIRouter, Query, Request, Response
from numpy import ndarray

from app.errors import ApiError
from app.messages import Model, filled
from app.state.evaluator import Evaluator
from app.state.scores import Reference, Scored
from app.web import results
from app.web.dependencies import (
    ERRORS,
    Bench,
    Part,
    a_file,
    download,
    file_name,
    not_finished,
    of_app,
    opened,
)
from app.web.results import State, address_of
from app.web.timeline import Window
from tracker.evaluation import Evaluation, compare
from tracker.evaluation.clear import PersonStatus
from tracker.evaluation.difference import Verdict
from tracker.evaluation.figures import Direction
from tracker.evaluation.tables import TrackKind
from tracker.parameters.values import changed_values, value_of
from tracker.runs import pipeline
from tracker.sequences.sequence import Sequence


class FigureInfo(Model):
    """One figure of a run."""

    name: str
    """Its key."""
    label: str
    group: str
    value: float | int | None
    """Null where it is not defined."""
    unit: str
    digits: int
    """Decimals that matter."""
    direction: Direction
    """Which values are better."""
    help: str
    settings: str
    """What it was measured with, in words: distance, gate, cut-off, order, window."""
    source: str
    headline: bool
    """Whether a short table shows it."""


class PersonInfo(Model):
    """One person of the truth."""

    id: int
    first: int
    last: int
    steps: int
    tracked: int
    """Steps with a pair."""
    status: PersonStatus
    found_share: float
    mean_error: float | None
    """Metres; null without pairs."""
    error_95: float | None
    switches: int
    fragmentations: int
    track: int | None
    """The track that stands for the person in the identity figures."""


class ScoredTrackInfo(Model):
    """One track against the truth."""

    id: int
    first: int
    last: int
    steps: int
    matched: int
    """Steps with a pair."""
    ignored: int
    """Steps at which it matched a position that is not certain."""
    kind: TrackKind
    person: int | None
    """With whom it is paired most often."""
    person_share: float | None
    """Share of its steps that it is."""
    mean_error: float | None
    """To whomever it is paired with, in the unit of the distance."""
    switches: int
    """How often somebody's identity switched to this track."""


class CameraScoreInfo(Model):
    """One camera's reprojected boxes against the truth projected the same way."""

    camera: str
    people: int
    estimates: int
    error: float | None
    """Pixels."""
    error_95: float | None
    overlap: float | None
    found_share: float | None
    false_per_picture: float | None


class EvaluationInfo(Model):
    """The shown run against the truth."""

    run: str
    steps: int
    """Steps 0 … ``steps`` − 1 were scored."""
    partial: bool
    """Whether the run was not finished: steps are missing, or smoothing was still to come."""
    settings: dict[str, Any]
    figures: list[FigureInfo]
    per_person: list[PersonInfo]
    per_track: list[ScoredTrackInfo]
    cameras: list[CameraScoreInfo]
    notes: list[str]
    """What a reader of the figures must know."""
    changes: int
    """How many parameters are not at the defaults of the recording."""


class PersonError(Model):
    """A person's position error over time."""

    person: int
    first: int
    """The first step of the first value's bucket."""
    values: list[float | None]
    """Metres; null where there is no pair."""


class TrackError(Model):
    """A track's distance to whomever it is paired with, over time."""

    track: int
    first: int
    values: list[float | None]


class Switch(Model):
    """A person's identity switched."""

    step: int
    person: int
    before: int
    """The track until then."""
    track: int


class EvaluationSeries(Model):
    """A run against the truth over time: one value a bucket of steps.

    Of a bucket with several steps the worst is told: that with the greatest OSPA, for
    GOSPA and its parts that with the greatest GOSPA, for errors the greatest error.
    """

    run: str
    of: Literal["shown", "pinned", "previous"]
    steps: int
    partial: bool
    first: int
    """The first step of the first bucket."""
    stride: int
    """Steps a bucket: 1 where each step has its own value."""
    unit: str
    """Of the distance: m, or none for boxes."""
    cost: str
    """Cut-off and order of OSPA and GOSPA, in words."""
    gate: str
    """The gate of errors and switches, in words."""
    ospa: list[float]
    ospa_localisation: list[float]
    ospa_cardinality: list[float]
    ospa2: list[float]
    gospa: list[float]
    gospa_localisation: list[float]
    gospa_missed: list[float]
    gospa_false: list[float]
    """The parts of GOSPA are p-th powers and sum to its p-th power."""
    ospa_share: list[float]
    gospa_share: list[float]
    """How much of each is location, 0 … 1; of GOSPA by its powers."""
    mean_error: list[float | None]
    """Metres, over the tracks; null where there is no pair."""
    axes: dict[Literal["ospa", "gospa", "error"], float]
    """Round upper ends for plots; a few spikes leave them."""
    truth: list[int]
    estimates: list[int]
    misses: list[int]
    false_positives: list[int]
    errors: list[PersonError]
    track_errors: list[TrackError]
    switches: list[Switch]


class Scores(Model):
    """What the page shows of a run against the truth: figures, and what lies over time."""

    evaluation: EvaluationInfo
    series: EvaluationSeries
    reference: EvaluationSeries | None
    """The series of the run that it is compared with; null where there is none."""


class ComparedRun(Model):
    """One side of a comparison."""

    run: str
    steps: int
    partial: bool
    changed: dict[str, Any]
    """Values that are not the default."""


class DifferenceInfo(Model):
    """One figure of two runs: A the reference, B the shown run."""

    name: str
    label: str
    unit: str
    digits: int
    direction: Direction
    headline: bool
    a: float | int | None
    b: float | int | None
    difference: float | int | None
    """B − A."""
    verdict: Verdict
    """What B is."""
    comparable: bool
    """False where the two were measured with different settings."""
    settings: str


class ParameterDifference(Model):
    """A parameter that the two runs do not share."""

    key: str
    a: Any
    b: Any


class Comparison(Model):
    """The shown run against the pinned or the previous one, over the steps that both have."""

    against: Reference
    steps: int
    """Steps that both were scored over."""
    a: ComparedRun
    b: ComparedRun
    parameters: list[ParameterDifference]
    rows: list[DifferenceInfo]


DECIMALS = 4
"""Decimals of the series, metres."""


def evaluation_of(scored: Scored, evaluation: Evaluation) -> EvaluationInfo:
    """The figures, and the rows by person, track and camera."""
    pairs = evaluation.pairs
    switched = pairs.tracks[pairs.switch]
    return EvaluationInfo(
        run=scored.key,
        steps=scored.steps,
        partial=not scored.final,
        settings=evaluation.settings.model_dump(),
        figures=[
            filled(
                FigureInfo,
                figure.definition,
                name=figure.definition.key,
                label=figure.definition.name,
                value=figure.value,
                unit=figure.unit,
                settings=figure.measured_with,
            )
            for figure in evaluation.figures
        ],
        per_person=[filled(PersonInfo, row, mean_error=row.error) for row in evaluation.people],
        per_track=[
            filled(
                ScoredTrackInfo,
                row,
                mean_error=row.error,
                switches=int((switched == row.id).sum()),
            )
            for row in evaluation.tracks
        ],
        cameras=[
            filled(CameraScoreInfo, row, false_per_picture=row.false_per_step)
            for row in evaluation.cameras
        ],
        notes=list(evaluation.notes),
        changes=len(changed(scored)),
    )


def series_of(
    scored: Scored,
    evaluation: Evaluation,
    of: Literal["shown", "pinned", "previous"],
    window: Window,
) -> EvaluationSeries:
    """Everything over time, of each bucket of the window the worst step."""
    settings, series = evaluation.settings, evaluation.series
    names = set(type(series).__slots__) & set(EvaluationSeries.model_fields)
    rows = {name: window.worst(getattr(series, name)) for name in ("ospa", "ospa2", "gospa")}
    pairs = evaluation.pairs
    tracks = {track: _of_track(evaluation, track) for track in np.unique(pairs.tracks).tolist()}
    shown = {
        name: getattr(series, name)[rows.get(name.partition("_")[0], rows["ospa"])]
        for name in names
    }
    mean = _mean(tracks, window, len(series.ospa))
    return EvaluationSeries(
        run=scored.key,
        of=of,
        steps=scored.steps,
        partial=not scored.final,
        first=window.first,
        stride=window.stride,
        unit=settings.unit,
        cost=settings.in_words(("cutoff", "order")),
        gate=settings.in_words(("distance", "gate")),
        errors=[
            PersonError(person=person, **_trimmed(values, window))
            for person, values in evaluation.errors.items()
        ],
        track_errors=[
            TrackError(track=track, **_trimmed(values, window)) for track, values in tracks.items()
        ],
        switches=switches_of(evaluation),
        ospa_share=_share(shown["ospa_localisation"], shown["ospa_cardinality"]),
        gospa_share=_share(
            shown["gospa_localisation"], shown["gospa_missed"] + shown["gospa_false"]
        ),
        mean_error=[value if value == value else None for value in mean.round(DECIMALS).tolist()],
        axes={
            "ospa": axis_end(series.ospa),
            "gospa": axis_end(series.gospa),
            "error": axis_end(pairs.distances),
        },
        **{name: values.round(DECIMALS).tolist() for name, values in shown.items()},
    )


def _share(part: ndarray, rest: ndarray) -> list[float]:
    whole = part + rest
    share = np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0.0)
    return [float(value) for value in share.round(3)]


def _mean(tracks: dict[int, ndarray], window: Window, steps: int) -> ndarray:
    """Mean over the paired tracks of each track's largest error within a bucket."""
    starts = window.starts(steps)
    values = [values[window.worst(values)] for values in tracks.values()]
    table = np.array(values).reshape(len(values), len(starts))
    count = np.isfinite(table).sum(axis=0)
    sums = np.nansum(table, axis=0)
    mean: ndarray = np.divide(sums, count, out=np.full(len(starts), np.nan), where=count > 0)
    return mean


def axis_end(values: ndarray) -> float:
    """A round number that all but the largest two in a hundred values stay below: 0.1, 0.2, 0.5, …

    Args:
        values: None below 0; those that are not numbers do not count.
    """
    known = np.sort(values[np.isfinite(values)])
    most = max(float(known[math.ceil(0.98 * len(known)) - 1]) if len(known) else 0.0, 0.1)
    ten = 10.0 ** math.floor(math.log10(most) + 1e-9)
    return round(ten * next((k for k in (1, 2, 5) if k * ten >= most - 1e-9), 10), 9)


def _of_track(evaluation: Evaluation, track: int) -> ndarray:
    pairs = evaluation.pairs
    values = np.full(evaluation.steps, np.nan)
    rows = pairs.tracks == track
    values[pairs.steps[rows]] = pairs.distances[rows]
    return values


def _trimmed(values: ndarray, window: Window) -> dict[str, Any]:
    """From the first to the last bucket that has a value."""
    starts, shown = window.starts(len(values)), values[window.worst(values)]
    there = np.flatnonzero(np.isfinite(shown))
    if not len(there):
        return {"first": window.first, "values": []}
    kept = shown[there[0] : there[-1] + 1].round(DECIMALS).tolist()
    return {
        "first": int(starts[there[0]]),
        "values": [value if value == value else None for value in kept],
    }


def switches_of(evaluation: Evaluation) -> list[Switch]:
    """Where a person's identity went from one track to another."""
    pairs = evaluation.pairs
    switches = []
    for i in np.flatnonzero(pairs.switch).tolist():
        earlier = np.flatnonzero(pairs.people[:i] == pairs.people[i])
        switches.append(
            Switch(
                step=int(pairs.steps[i]),
                person=int(pairs.people[i]),
                before=int(pairs.tracks[earlier[-1]]),
                track=int(pairs.tracks[i]),
            )
        )
    return switches


def comparison_of(
    against: Reference, a: tuple[Scored, Evaluation], b: tuple[Scored, Evaluation]
) -> Comparison:
    """Every figure of A and of B, and the parameters in which they differ.

    The figures are compared once both runs are finished: those of a run under way are of the
    filter's tracks, which smoothing changes.
    """
    compared = compare(a[1], b[1])
    if not (a[0].final and b[0].final):
        compared = tuple(replace(row, difference=None, verdict="undefined") for row in compared)
    before, after = a[0].parameters, b[0].parameters
    return Comparison(
        against=against,
        steps=b[1].steps,
        a=_side(a[0]),
        b=_side(b[0]),
        parameters=[
            ParameterDifference(key=key, a=value_of(before, key), b=value)
            for key, value in changed_values(after, before).items()
        ],
        rows=[
            filled(
                DifferenceInfo,
                row,
                name=row.definition.key,
                label=row.definition.name,
                digits=row.definition.digits,
                direction=row.definition.direction,
                headline=row.definition.headline,
                settings=row.measured_with,
            )
            for row in compared
        ],
    )


def _side(scored: Scored) -> ComparedRun:
    return ComparedRun(
        run=scored.key,
        steps=scored.steps,
        partial=not scored.final,
        changed=changed(scored),
    )


def changed(scored: Scored) -> dict[str, Any]:
    """The values of a run that are not the defaults of its sequence."""
    return changed_values(scored.parameters, pipeline.default_parameters(scored.sequence))


router = APIRouter(prefix="/api", responses=ERRORS)


Scorer = Annotated[Evaluator, of_app("evaluator")]


def _evaluated(sequence: Sequence, scored: Scored | None) -> tuple[Scored, Evaluation]:
    if sequence.ground_truth is None:
        raise ApiError(
            409,
            "no_truth",
            f"{sequence.name} has no truth to set the tracks against.",
            hint="Name its file in [ground_truth] of sequence.toml.",
        )
    if scored is None or scored.evaluation is None:
        raise ApiError(
            409,
            "nothing_evaluated",
            "No run has been set against the truth yet.",
            hint="Wait a moment, or compute the run again.",
        )
    return scored, scored.evaluation


@router.get("/evaluation")
def evaluation(bench: Bench) -> EvaluationInfo:
    """The run scored last against the truth: figures, people, tracks, cameras."""
    snapshot, sequence = opened(bench)
    return evaluation_of(*_evaluated(sequence, snapshot.scores.shown))


@router.get("/evaluation/series")
def series(
    bench: Bench,
    part: Part,
    of: Annotated[Literal["shown", "pinned", "previous"], Query(description="Whose.")] = "shown",
) -> EvaluationSeries:
    """OSPA, GOSPA and their parts, the errors and the identity switches over time."""
    snapshot, sequence = opened(bench)
    scores = snapshot.scores
    scored = {"shown": scores.shown, "pinned": scores.pinned, "previous": scores.before}[of]
    if of != "shown" and scored is None:
        raise _nothing_to_compare()
    run, evaluated = _evaluated(sequence, scored)
    return series_of(run, evaluated, of, part.window(run.sequence.frames))


@router.get("/evaluation/curves")
def curves(bench: Bench, part: Part) -> Scores:
    """The figures and the series of the run scored last, and the series of the run it is compared
    with, all of the same moment."""
    snapshot, sequence = opened(bench)
    run, evaluated = _evaluated(sequence, snapshot.scores.shown)
    window = part.window(run.sequence.frames)
    against, other = snapshot.scores.reference or (None, None)
    reference = None
    if against is not None and other is not None and other.evaluation is not None:
        reference = series_of(other, other.evaluation, against, window)
    return Scores(
        evaluation=evaluation_of(run, evaluated),
        series=series_of(run, evaluated, "shown", window),
        reference=reference,
    )


@router.get("/evaluation/comparison")
def comparison(bench: Bench, evaluator: Scorer) -> Comparison | None:
    """The run scored last, B, against the pinned or else the previous finished one, A.

    While B is under way, both stand as far as B has come, and no figure is called better. Null
    where there is no A: none is pinned, and none was finished before.
    """
    snapshot, sequence = opened(bench)
    b = _evaluated(sequence, snapshot.scores.shown)
    if snapshot.scores.reference is None:
        return None
    against, scored = snapshot.scores.reference
    if against == "pinned":
        _evaluated(sequence, scored)
    a = evaluator.beginning(scored, b[0].steps)
    return comparison_of(against, (scored, a), b)


def _nothing_to_compare() -> ApiError:
    return ApiError(
        409,
        "nothing_to_compare",
        "There is no run to compare with: none is pinned, and none was finished before.",
        hint="Pin the finished run, or change a parameter.",
    )


@router.post("/run/pin")
async def pin(bench: Bench) -> State:
    """Pin the finished run that is shown: later runs are compared with it."""
    if not bench.pin():
        snapshot, sequence = opened(bench)
        done = snapshot.run.done if snapshot.run is not None else 0
        raise not_finished("can be pinned", done, sequence.frames)
    return results.state_of(bench.snapshot())


@router.delete("/run/pin")
async def unpin(bench: Bench) -> State:
    """Pin nothing."""
    bench.unpin()
    return results.state_of(bench.snapshot())


@router.get("/export/report.html", **a_file("text/html", "The report."))
def export_report(request: Request, bench: Bench, evaluator: Scorer) -> Response:
    """The finished run against the truth, as one HTML file."""
    from tracker.evaluation.report.page import report_html  # brings plotly

    snapshot, own = opened(bench)
    scored, evaluated = _evaluated(own, snapshot.scores.shown)
    if not scored.final:
        raise not_finished("has a report", scored.steps, scored.sequence.frames)
    reference = snapshot.scores.reference
    sequence = snapshot.named(scored.sequence)
    text = report_html(
        sequence,
        scored.tracks,
        scored.parameters,
        evaluated,
        reference=evaluator.beginning(reference[1], scored.steps) if reference else None,
        seed=scored.seed,
        back=address_of(
            str(request.base_url), snapshot.opened_as, scored.parameters, snapshot.defaults
        ),
    )
    name = file_name(sequence.name, "report.html")
    return download(text, name, "text/html; charset=utf-8", x_run_key=scored.key)
