"""The HTTP routes of what a study found: its trials, what it proposes, its reports."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from app.errors import sentence
from app.web.dependencies import ERRORS, file_name
from app.web.studies import models, views
from app.web.studies.dependencies import Named, no_trial
from tracker.sequences.errors import SequenceError
from tracker.studies.errors import StudyError
from tracker.studies.summary import track_commands

router = APIRouter(prefix="/api/studies", responses=ERRORS)

KINDS = {
    "report.html": "text/html; charset=utf-8",
    "trials.csv": "text/csv; charset=utf-8",
    "study.json": "application/json",
}
"""What a study is exported as, and the kind of each file."""


@router.get("/{name}/trials")
def trials(
    store: Named, after: Annotated[float, Query(description="Seconds since 1970.")] = 0.0
) -> models.TrialList:
    """The trials that ended, or those since a moment."""
    found = store.trials(after)
    return models.TrialList(
        trials=[views.trial_of(one) for one in found],
        last=max((one.ended for one in found), default=after),
    )


@router.get("/{name}/trials/{number}", operation_id="get_studies_trial")
def trial(store: Named, number: int) -> models.TrialDetail:
    """A trial with its runs, and the commands that repeat them."""
    try:
        found, definition = store.trial(number), store.definition()
        commands = track_commands(definition, found)
    except (StudyError, SequenceError) as error:
        raise no_trial(error, "number") from None
    runs = []
    for row in found.jobs:
        outcome = store.outcome(row.key)
        if outcome is not None:
            runs.append(
                models.TrialRun(
                    key=row.key, recording=row.recording, seed=row.seed,
                    figures=dict(outcome.figures), seconds=outcome.seconds, worker=outcome.worker,
                    machine=outcome.machine, tracks=outcome.tracks,
                )
            )  # fmt: skip
    return models.TrialDetail(trial=views.trial_of(found), runs=runs, commands=commands)


@router.get("/{name}/tuned")
def tuned(store: Named) -> models.Tuned:
    """What a study proposes at its end."""
    found = store.fact("tuned")
    return views.tuned_of(found)


@router.get(
    "/{name}/export/{file}",
    response_class=Response,
    responses={200: {"content": {kind: {} for kind in KINDS.values()}, "description": "The file."}},
)
def export(store: Named, file: Literal["report.html", "trials.csv", "study.json"]) -> Response:
    """A study as a report, a table, or everything."""
    from tracker.studies import report  # and with it the library of plots

    write = {
        "report.html": report.write_report,
        "trials.csv": report.write_csv,
        "study.json": report.write_json,
    }[file]
    try:
        with tempfile.TemporaryDirectory(prefix="multiview-phd-study-") as folder:
            path = Path(folder) / file
            write(path, store)
            data = path.read_bytes()
    except OSError as error:
        raise StudyError(sentence(error)) from error
    name = file_name(store.name, file)
    return Response(
        data,
        media_type=KINDS[file],
        headers={
            "content-disposition": f'attachment; filename="{name}"',
            "cache-control": "no-store",
        },
    )
