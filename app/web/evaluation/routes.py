"""The HTTP routes of the evaluation."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response

from app.errors import ApiError
from app.models import State
from app.state.scores import Scored
from app.state.snapshot import Snapshot
from app.state.workers.evaluator import Evaluator
from app.web.dependencies import ERRORS, Bench, Part, file_name, not_finished, nothing_open
from app.web.evaluation import messages, models
from app.web.views import results
from app.web.views.link import address_of
from tracker.evaluation import Evaluation

router = APIRouter(prefix="/api", responses=ERRORS)


def _evaluator(request: Request) -> Evaluator:
    evaluator: Evaluator = request.app.state.evaluator
    return evaluator


Scorer = Annotated[Evaluator, Depends(_evaluator)]


def _evaluated(snapshot: Snapshot, scored: Scored | None) -> tuple[Scored, Evaluation]:
    if snapshot.sequence is None:
        raise nothing_open()
    if snapshot.sequence.ground_truth is None:
        raise ApiError(
            409,
            "no_truth",
            f"{snapshot.sequence.name} has no truth to set the tracks against.",
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
def evaluation(bench: Bench) -> models.EvaluationInfo:
    """The run scored last against the truth: figures, people, tracks, cameras."""
    snapshot = bench.snapshot()
    return messages.evaluation_of(*_evaluated(snapshot, snapshot.scores.shown))


@router.get("/evaluation/series")
def series(
    bench: Bench,
    part: Part,
    of: Annotated[Literal["shown", "pinned", "previous"], Query(description="Whose.")] = "shown",
) -> models.EvaluationSeries:
    """OSPA, GOSPA and their parts, the errors and the identity switches over time."""
    snapshot = bench.snapshot()
    scores = snapshot.scores
    scored = {"shown": scores.shown, "pinned": scores.pinned, "previous": scores.before}[of]
    if of != "shown" and scored is None:
        raise _nothing_to_compare()
    run, evaluated = _evaluated(snapshot, scored)
    return messages.series_of(run, evaluated, of, part.window(run.sequence.frames))


@router.get("/evaluation/curves")
def curves(bench: Bench, part: Part) -> models.Scores:
    """The figures and the series of the run scored last, and the series of the run it is compared
    with, all of the same moment."""
    snapshot = bench.snapshot()
    run, evaluated = _evaluated(snapshot, snapshot.scores.shown)
    window = part.window(run.sequence.frames)
    against, other = snapshot.scores.reference or (None, None)
    reference = None
    if against is not None and other is not None and other.evaluation is not None:
        reference = messages.series_of(other, other.evaluation, against, window)
    return models.Scores(
        evaluation=messages.evaluation_of(run, evaluated),
        series=messages.series_of(run, evaluated, "shown", window),
        reference=reference,
    )


@router.get("/evaluation/comparison")
def comparison(bench: Bench, evaluator: Scorer) -> models.Comparison | None:
    """The run scored last, B, against the pinned or else the previous finished one, A.

    While B is under way, both stand as far as B has come, and no figure is called better. Null
    where there is no A: none is pinned, and none was finished before.
    """
    snapshot = bench.snapshot()
    b = _evaluated(snapshot, snapshot.scores.shown)
    if snapshot.scores.reference is None:
        return None
    against, scored = snapshot.scores.reference
    if against == "pinned":
        _evaluated(snapshot, scored)
    a = evaluator.beginning(scored, b[0].steps)
    return messages.comparison_of(against, (scored, a), b)


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
        snapshot = bench.snapshot()
        if snapshot.sequence is None:
            raise nothing_open()
        done = snapshot.run.done if snapshot.run is not None else 0
        raise not_finished("can be pinned", done, snapshot.sequence.frames)
    return results.state_of(bench.snapshot())


@router.delete("/run/pin")
async def unpin(bench: Bench) -> State:
    """Pin nothing."""
    bench.unpin()
    return results.state_of(bench.snapshot())


@router.get(
    "/export/report.html",
    response_class=Response,
    responses={200: {"content": {"text/html": {}}, "description": "The report."}},
)
def export_report(request: Request, bench: Bench, evaluator: Scorer) -> Response:
    """The finished run against the truth, as one HTML file."""
    from tracker.evaluation.report.page import report_html  # brings plotly

    snapshot = bench.snapshot()
    scored, evaluated = _evaluated(snapshot, snapshot.scores.shown)
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
    return Response(
        text,
        media_type="text/html; charset=utf-8",
        headers={
            "content-disposition": f'attachment; filename="{name}"',
            "cache-control": "no-store",
            "x-run-key": scored.key,
        },
    )
