"""The HTTP routes of studies."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query

from app.errors import ApiError, sentence
from app.state.snapshot import Snapshot
from app.state.studies import StudyDesk
from app.web.dependencies import ERRORS, Bench, nothing_open
from app.web.studies import models, views
from app.web.studies.dependencies import Desk, Named
from tracker.parameters.values import changed_values
from tracker.runs.processes import available_cores
from tracker.sequences.built_in import place_of
from tracker.studies.definition import StudyDefinition, definition_of
from tracker.studies.errors import StudyError
from tracker.studies.objectives import OBJECTIVES, SELF_CONSISTENCY, WITH_TRUTH, chosen
from tracker.studies.tuning import tuning

router = APIRouter(prefix="/api/studies", responses=ERRORS)

RUN_BYTES, TRIAL_BYTES = 2500, 4000
"""What a run and a trial take on disk, about."""

FEWEST_STEPS = 50
"""Of a run before its speed says anything: the first ones wait for what is compiled and read."""

SECONDS_FOR_A_SCHEDULER = 5.0


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
        recordings=[place_of(snapshot.sequence.folder)],
        has_truth=has_truth,
        parameters=views.ranges_of(snapshot, wanted),
        objectives=list(WITH_TRUTH if has_truth else SELF_CONSISTENCY),
        choices=[
            views.objective_of(one) for one in OBJECTIVES.values() if has_truth or one.of != "truth"
        ],
        workers=available_cores(),
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


def _definition(wish: models.StudyWish, bench: Bench) -> StudyDefinition:
    """The study that is wished for, from what is on the sliders.

    Raises:
        StudyError: If something in it does not do.
    """
    snapshot = bench.snapshot()
    if snapshot.sequence is None:
        raise nothing_open()
    own = changed_values(snapshot.parameters, snapshot.defaults)
    ranges = {key: one.model_dump(exclude_none=True) for key, one in wish.parameters.items()}
    return definition_of(
        {
            "name": wish.name,
            "recordings": wish.recordings or [place_of(snapshot.sequence.folder)],
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
def estimate(wish: models.CostWish, desk: Desk, bench: Bench) -> models.StudyCost:
    """What a study would take, and why it would be refused."""
    try:
        definition = _definition(wish, bench)
        if wish.name in {store.name for store in desk.all()}:
            raise StudyError(f'name: there is a study "{wish.name}" already; take another')
        desk.check_place(wish.workers, wish.scheduler)
        snapshot = bench.snapshot()
        assert snapshot.sequence is not None
        if wish.recordings is None:
            has_truth = {snapshot.sequence.name: snapshot.sequence.ground_truth is not None}
            chosen(definition.objectives, has_truth)
    except StudyError as error:
        return models.StudyCost(runs=0, seconds=None, bytes=0, words="", error=sentence(error))
    runs = definition.trials * len(definition.recordings) * len(definition.seeds)
    words, seconds = f"up to {runs} runs", _seconds(snapshot, definition, runs)
    if wish.scheduler is not None:
        if seconds is not None:
            words += f", about {_minutes(seconds)} of one worker's time"
        seconds = None
    elif seconds is not None:
        cores = available_cores()
        workers = wish.workers or cores
        seconds /= min(workers, cores)
        if definition.minutes is not None:
            seconds = min(seconds, 60.0 * definition.minutes)
        words += f", about {_minutes(seconds)} with {workers} worker{'s' if workers > 1 else ''}"
        if workers > cores:
            words += f" on {cores} cores"
    size = runs * RUN_BYTES + definition.trials * TRIAL_BYTES
    return models.StudyCost(runs=runs, seconds=seconds, bytes=size, words=words, error=None)


def _seconds(snapshot: Snapshot, definition: StudyDefinition, runs: int) -> float | None:
    """Of one worker, for all runs; None where nothing is known yet."""
    state, sequence = snapshot.run_state, snapshot.sequence
    speed = state.steps_per_second
    if not speed or sequence is None or state.done < min(FEWEST_STEPS, sequence.frames):
        return None
    truth = sequence.ground_truth is not None
    looks = "identity" in (definition.objectives or (WITH_TRUTH if truth else SELF_CONSISTENCY))
    times = 2 + len(sequence.views) if looks else 1
    return runs * times * sequence.frames / speed


def _minutes(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.0f} h"


@router.post("")
def define(wish: models.StudyWish, desk: Desk, bench: Bench) -> models.Study:
    """Make a study; it is started by a call of its own."""
    try:
        return views.study_of(desk, desk.define(_definition(wish, bench)))
    except StudyError as error:
        raise ApiError(422, "bad_study", f"{sentence(error)}.") from None


@router.post("/scheduler")
def scheduler(wish: models.SchedulerWish) -> models.SchedulerInfo:
    """Whether a Dask scheduler answers at an address, and who works for it."""
    from tracker.studies.cluster import scheduler_numbers

    try:
        found = scheduler_numbers(wish.address, SECONDS_FOR_A_SCHEDULER)
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
    desk.check_place(wish.workers, wish.scheduler)
    definition = tuning(
        _free_name(desk, f"tune {snapshot.sequence.name}"),
        [place_of(snapshot.sequence.folder)],
        minutes=wish.minutes,
        changes=changed_values(snapshot.parameters, snapshot.defaults),
        ignore_truth=wish.without_truth,
    )
    desk.define(definition)
    return views.study_of(desk, desk.start(definition.name, wish.workers, wish.scheduler))


@router.get("/{name}", operation_id="get_study")
def study(store: Named, desk: Desk) -> models.Study:
    """Everything of a study but its trials."""
    return views.study_of(desk, store)


@router.post("/{name}/start")
def start(store: Named, desk: Desk, wish: models.StartWish | None = None) -> models.Study:
    """Start a study, or go on with it."""
    wish = wish or models.StartWish()
    return views.study_of(desk, desk.start(store.name, wish.workers, wish.scheduler))


@router.post("/{name}/stop")
def stop(store: Named, desk: Desk) -> models.Study:
    """Stop a study, or pause it: everything is kept, and starting it goes on."""
    return views.study_of(desk, desk.stop(store.name))


@router.delete("/{name}")
def remove(store: Named, desk: Desk) -> models.StudyList:
    """Delete a study with everything in it."""
    try:
        desk.remove(store.name)
    except OSError as error:
        raise StudyError(sentence(error)) from error
    return studies(desk)
