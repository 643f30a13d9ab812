"""The HTTP routes of what a study found: its trials, what it proposes, its reports."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response

from app.errors import ApiError, sentence
from app.models import State
from app.web.dependencies import ERRORS, Bench, Own, file_name, nothing_open
from app.web.studies import models, views
from app.web.studies.dependencies import Named, no_study
from app.web.views import results
from tracker.parameters.catalogue import METHODS, PARAMETERS
from tracker.parameters.values import changed_values, value_of, with_values
from tracker.sequences.errors import SequenceError
from tracker.studies.errors import StudyError
from tracker.studies.store import Store
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
    try:
        found = store.trials(after)
    except StudyError as error:
        raise no_study(error) from None
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
        raise ApiError(404, "no_trial", f"{sentence(error)}.", field="number") from None
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


@router.post("/{name}/trials/{number}/use")
def use(store: Named, number: int, bench: Bench) -> State:
    """Set all parameters to those of a trial, as one step."""
    bench.set_parameters(_values(store, number, bench), "api")
    return results.state_of(bench.snapshot())


@router.post("/{name}/trials/{number}/preset")
def preset(store: Named, number: int, wish: models.PresetWish, bench: Bench, own: Own) -> State:
    """Keep the values of a trial as a preset."""
    _keep(wish.name, _values(store, number, bench), bench, own)
    return results.state_of(bench.snapshot())


def _keep(name: str, values: dict[str, object], bench: Bench, own: Own) -> None:
    defaults = bench.snapshot().defaults
    own.keep(name, changed_values(with_values(defaults, values), defaults))


def _values(store: Store, number: int, bench: Bench) -> dict[str, object]:
    """Of all parameters: a trial's own, what its study holds, and the defaults."""
    try:
        found, definition = store.trial(number), store.definition()
    except StudyError as error:
        raise ApiError(404, "no_trial", f"{sentence(error)}.", field="number") from None
    return _all({**definition.held(), **(found.values if number else {})}, bench)


def _all(values: dict[str, object], bench: Bench) -> dict[str, object]:
    """Of all parameters, these and the defaults."""
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    parameters = with_values(snapshot.defaults, values)
    return {key: value_of(parameters, key) for key in (*METHODS, *PARAMETERS)}


@router.get("/{name}/tuned")
def tuned(store: Named) -> models.Tuned:
    """What a study proposes at its end."""
    try:
        found = store.fact("tuned")
    except StudyError as error:
        raise no_study(error) from None
    return views.tuned_of(found)


@router.post("/{name}/tuned/use")
def use_tuned(store: Named, bench: Bench) -> State:
    """Set all parameters to what a study proposes, as one step."""
    bench.set_parameters(_proposed(store, bench), "api")
    return results.state_of(bench.snapshot())


@router.post("/{name}/tuned/preset")
def keep_tuned(store: Named, wish: models.PresetWish, bench: Bench, own: Own) -> State:
    """Keep what a study proposes as a preset."""
    _keep(wish.name, _proposed(store, bench), bench, own)
    return results.state_of(bench.snapshot())


def _proposed(store: Store, bench: Bench) -> dict[str, object]:
    try:
        found, definition = store.fact("tuned"), store.definition()
    except StudyError as error:
        raise no_study(error) from None
    if found is None or not found["better"]:
        raise ApiError(409, "nothing_better", f"The study {store.name} proposes nothing.")
    return _all({**definition.held(), **found["values"]}, bench)


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
    except (StudyError, OSError) as error:
        raise no_study(error) from None
    name = file_name(store.name, file)
    return Response(
        data,
        media_type=KINDS[file],
        headers={
            "content-disposition": f'attachment; filename="{name}"',
            "cache-control": "no-store",
        },
    )
