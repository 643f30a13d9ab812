"""The HTTP routes of studies."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request, Response

from app.errors import ApiError, sentence
from app.models import State
from app.state.snapshot import Snapshot
from app.state.studies.desk import StudyDesk
from app.web.dependencies import ERRORS, Bench, Own, file_name, nothing_open
from app.web.studies import models, views
from app.web.views import results
from tracker import parameters as table
from tracker.experiments.laboratory.pool import cores
from tracker.sequences.sequence import SequenceError
from tracker.studies.defined.defining import definition_of
from tracker.studies.defined.definition import Definition
from tracker.studies.defined.objectives import OBJECTIVES, WITH_TRUTH, WITHOUT_TRUTH, chosen
from tracker.studies.errors import StudyError
from tracker.studies.kept.store import Store
from tracker.studies.told.commands import track_commands
from tracker.studies.tuning import tuning

router = APIRouter(prefix="/api/studies", responses=ERRORS)

RUN_BYTES, TRIAL_BYTES = 2500, 4000
"""What a run and a trial take on disk, about."""

SECONDS_FOR_A_SCHEDULER = 5.0

KINDS = {
    "report.html": "text/html; charset=utf-8",
    "trials.csv": "text/csv; charset=utf-8",
    "study.json": "application/json",
}
"""What a study is exported as, and the kind of each file."""


def _desk(request: Request) -> StudyDesk:
    desk: StudyDesk = request.app.state.studies
    return desk


Desk = Annotated[StudyDesk, Depends(_desk)]


def no_study(error: StudyError | OSError) -> ApiError:
    """The answer where a study is not as it must be."""
    return ApiError(409, "no_study", f"{sentence(error)}.")


def _study(name: str, desk: Desk) -> Store:
    try:
        return desk.store(name)
    except StudyError as error:
        raise ApiError(404, "no_study", f"{sentence(error)}.", field="name") from None


Named = Annotated[Store, Depends(_study)]


def _told(desk: StudyDesk, store: Store) -> models.Study:
    try:
        return views.study_of(desk, store)
    except StudyError as error:
        raise no_study(error) from None


@router.get("")
def studies(desk: Desk) -> models.StudyList:
    """Every study, the one that was at work last first."""
    found = []
    for store in desk.all():
        try:
            found.append(models.StudyInfo(**desk.info(store)))
        except StudyError as error:
            found.append(
                models.StudyInfo(
                    name=store.name, state="failed", words=sentence(error), done=0, trials=0,
                    touched=store.touched(), seconds_left=None, objective="", best=None,
                    default=None,
                )
            )  # fmt: skip
    return models.StudyList(folder=str(desk.folder), studies=found)


@router.get("/draft")
def draft(
    desk: Desk,
    bench: Bench,
    keys: Annotated[str | None, Query(description="Parameters, with commas between.")] = None,
) -> models.StudyDraft:
    """A study of what is open, its ranges around today's values."""
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    wanted = None if keys is None else [key for key in keys.split(",") if key]
    has_truth = snapshot.sequence.ground_truth is not None
    return models.StudyDraft(
        name=_free_name(desk, snapshot.sequence.name),
        recordings=[views.place_of(snapshot)],
        has_truth=has_truth,
        parameters=views.ranges_of(snapshot, wanted),
        objectives=list(WITH_TRUTH if has_truth else WITHOUT_TRUTH),
        choices=[
            views.objective_of(one) for one in OBJECTIVES.values() if has_truth or one.of != "truth"
        ],
        workers=cores(),
        words=_left_out(snapshot),
    )


def _free_name(desk: StudyDesk, name: str) -> str:
    plain = "".join(c if c.isalnum() or c in " .+-_" else "-" for c in name)[:50].strip(" .+-_")
    taken = {store.name for store in desk.all()}
    number = next(n for n in range(1, len(taken) + 2) if f"{plain or 'study'} {n}" not in taken)
    return f"{plain or 'study'} {number}"


def _left_out(snapshot: Snapshot) -> str:
    if snapshot.sequence is not snapshot.saved:
        return "What was taught since it was saved is not in the study: save it first."
    return ""


def _definition(wish: models.StudyWish, bench: Bench) -> Definition:
    """The study that is wished for, from what is on the sliders.

    Raises:
        StudyError: If something in it does not do.
    """
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    own = table.changed(snapshot.parameters, snapshot.defaults)
    ranges = {key: one.model_dump(exclude_none=True) for key, one in wish.parameters.items()}
    return definition_of(
        {
            "name": wish.name,
            "recordings": wish.recordings or [views.place_of(snapshot)],
            "trials": wish.trials,
            **({} if wish.minutes is None else {"minutes": wish.minutes}),
            "seeds": wish.seeds,
            "search": wish.search,
            "objectives": wish.objectives,
            "prune": wish.prune,
            "values": {key: value for key, value in own.items() if key not in ranges},
            "start": {key: value for key, value in own.items() if key in ranges},
            "parameters": ranges,
        },
        where="study",
        folder=Path.cwd(),
    )


@router.post("/estimate")
def estimate(wish: models.StudyWish, desk: Desk, bench: Bench) -> models.StudyCost:
    """What a study would take, and why it would be refused."""
    try:
        definition = _definition(wish, bench)
        if wish.name in {store.name for store in desk.all()}:
            raise StudyError(f'name: there is a study "{wish.name}" already; take another')
        snapshot = bench.snapshot()
        assert snapshot.sequence is not None
        if wish.recordings is None:
            has_truth = {snapshot.sequence.name: snapshot.sequence.ground_truth is not None}
            chosen(definition.objectives, has_truth)
    except StudyError as error:
        return models.StudyCost(runs=0, seconds=None, bytes=0, words="", error=sentence(error))
    runs = definition.trials * len(definition.recordings) * len(definition.seeds)
    seconds = _seconds(snapshot, definition, runs)
    if seconds is not None and definition.minutes is not None:
        seconds = min(seconds, 60.0 * definition.minutes)
    size = runs * RUN_BYTES + definition.trials * TRIAL_BYTES
    words = f"up to {runs} runs" + (
        "" if seconds is None else f", about {_minutes(seconds)} with {cores()} workers"
    )
    return models.StudyCost(runs=runs, seconds=seconds, bytes=size, words=words, error=None)


def _seconds(snapshot: Snapshot, definition: Definition, runs: int) -> float | None:
    speed, sequence = snapshot.run_state.steps_per_second, snapshot.sequence
    if not speed or sequence is None:
        return None
    truth = sequence.ground_truth is not None
    looks = "identity" in (definition.objectives or (WITH_TRUTH if truth else WITHOUT_TRUTH))
    times = 2 + len(sequence.views) if looks else 1
    return runs * times * sequence.frames / speed / cores()


def _minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90.0 else f"{seconds / 60.0:.0f} min"


@router.post("")
def define(wish: models.StudyWish, desk: Desk, bench: Bench) -> models.Study:
    """Make a study; it is started by a call of its own."""
    try:
        return _told(desk, desk.define(_definition(wish, bench)))
    except StudyError as error:
        raise ApiError(422, "bad_study", f"{sentence(error)}.") from None


@router.post("/scheduler")
def scheduler(wish: models.SchedulerWish) -> models.SchedulerInfo:
    """Whether a Dask scheduler answers at an address, and who works for it."""
    from tracker.studies.work.cluster import look_at

    try:
        found = look_at(wish.address, SECONDS_FOR_A_SCHEDULER)
    except StudyError as error:
        return models.SchedulerInfo(
            address=wish.address, workers=0, threads=0, machines=[], error=sentence(error)
        )
    return models.SchedulerInfo(address=wish.address, **found, error=None)


@router.post("/tune")
def tune(wish: models.TuneWish, desk: Desk, bench: Bench) -> models.Study:
    """Define and start the study that tunes the open recording from today's values."""
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    try:
        desk.check_place(wish.workers, wish.scheduler)
        definition = tuning(
            _free_name(desk, f"tune {snapshot.sequence.name}"),
            [views.place_of(snapshot)],
            minutes=wish.minutes,
            changes=table.changed(snapshot.parameters, snapshot.defaults),
            without_truth=wish.without_truth,
        )
        desk.define(definition)
        return _told(desk, desk.start(definition.name, wish.workers, wish.scheduler))
    except StudyError as error:
        raise no_study(error) from None


@router.get("/{name}", operation_id="get_study")
def study(store: Named, desk: Desk) -> models.Study:
    """Everything of a study but its trials."""
    return _told(desk, store)


@router.post("/{name}/start")
def start(store: Named, desk: Desk, wish: models.StartWish | None = None) -> models.Study:
    """Start a study, or go on with it."""
    wish = wish or models.StartWish()
    try:
        return _told(desk, desk.start(store.name, wish.workers, wish.scheduler))
    except StudyError as error:
        raise no_study(error) from None


@router.post("/{name}/stop")
def stop(store: Named, desk: Desk) -> models.Study:
    """Stop a study, or pause it: everything is kept, and starting it goes on."""
    return _told(desk, desk.stop(store.name))


@router.delete("/{name}")
def remove(store: Named, desk: Desk) -> models.StudyList:
    """Delete a study with everything in it."""
    try:
        desk.remove(store.name)
    except (StudyError, OSError) as error:
        raise no_study(error) from None
    return studies(desk)


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
    own.keep(name, table.changed(table.with_values(defaults, values), defaults))


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
    parameters = table.with_values(snapshot.defaults, values)
    return {key: table.value(parameters, key) for key in (*table.METHODS, *table.PARAMETERS)}


@router.get("/{name}/tuned")
def tuned(store: Named) -> models.Tuned:
    """What a study proposes at its end."""
    try:
        found = store.told("tuned")
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
        found, definition = store.told("tuned"), store.definition()
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
    from tracker.studies.told import report  # and with it the library of plots

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
