"""Studies over HTTP: their messages, and the routes of what they are and what they found."""

from __future__ import annotations

import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Response
from pydantic import Field

from app.errors import ApiError, sentence
from app.messages import Model, filled
from app.state.snapshot import Snapshot
from app.state.studies import StudyDesk
from app.web.dependencies import ERRORS, Bench, Owned, download, file_name, opened
from tracker.parameters.catalogue import METHODS, PARAMETERS
from tracker.parameters.values import changed_values, shown_keys, value_of, with_values
from tracker.runs.processes import available_cores
from tracker.sequences.built_in import place_of
from tracker.sequences.errors import SequenceError
from tracker.studies.definition import StudyDefinition, definition_of
from tracker.studies.errors import StudyError
from tracker.studies.objectives import OBJECTIVES, SELF_CONSISTENCY, WITH_TRUTH, Objective, chosen
from tracker.studies.space import Varied, around
from tracker.studies.store import Store, Trial, free_name
from tracker.studies.summary import track_commands
from tracker.studies.tuning import tuning


class StudyInfo(Model):
    """A study in a line."""

    name: str
    state: Literal["new", "running", "stopped", "done", "failed"]
    words: str
    """What it waits for, or why it ended."""
    done: int
    """Trials that ended."""
    trials: int | None
    """All there are to be; null where the time alone ends it."""
    touched: float
    """When it was at work last, seconds since 1970."""
    seconds_left: float | None
    objective: str
    """Name of the leading figure."""
    best: float | None
    """Its best value."""
    default: float | None


class StudyList(Model):
    """All studies, the one that was at work last first."""

    folder: str
    studies: list[StudyInfo]


class RangeInfo(Model):
    """A parameter, or the choice of a method, with the range that is tried."""

    key: str
    label: str
    symbol: str
    unit: str
    help: str
    kind: Literal["float", "int", "bool", "choice"]
    minimum: float | None
    """Of its definition."""
    maximum: float | None
    low: float | None
    high: float | None
    log: bool
    choices: list[Any]
    """Of what is no range."""
    default: Any
    now: Any
    """Today's value."""


class ObjectiveInfo(Model):
    """A figure that trials can be judged by."""

    key: str
    name: str
    help: str
    higher: bool
    """Whether more of it is better."""
    unit: str
    digits: int
    of: Literal["truth", "run", "agreement"]
    """What it needs: a truth, nothing but the run, or other looks at the recording."""


class StudyDraft(Model):
    """A study as it could be defined from what is open."""

    name: str
    """One that is free."""
    recordings: list[str]
    has_truth: bool
    parameters: list[RangeInfo]
    objectives: list[str]
    """Those that it would have."""
    choices: list[ObjectiveInfo]
    """Those that it could have."""
    workers: int
    """Cores of the machine."""
    words: str
    """What is not in the study though it is on the screen; empty for nothing."""


class RangeWish(Model):
    """How far a parameter is varied; what is null follows from its definition."""

    low: float | None = None
    high: float | None = None
    log: bool | None = None
    steps: int | None = None
    """Of a number on a grid."""
    choices: list[Any] | None = None


class StudyWish(Model):
    """What is to be studied; what is not varied is held at today's values."""

    name: str
    recordings: list[str] | None = None
    """Rooms and folders; null for the one that is open."""
    parameters: dict[str, RangeWish]
    trials: int = Field(default=60, ge=1)
    minutes: float | None = Field(default=None, gt=0)
    """No trial begins after so long."""
    seeds: int = Field(default=1, ge=1, le=1000)
    search: str = "auto"
    objectives: list[str] = Field(default_factory=list)
    """The leading one first; none: they follow the recordings."""
    prune: bool = True


class StartWish(Model):
    """Where a study runs."""

    workers: int | None = Field(default=None, ge=1, le=1024)
    """Processes on this machine."""
    scheduler: str | None = None
    """Address of a Dask scheduler. With neither it runs where it ran last, and at first with one
    process a core of this machine."""


class CostWish(StudyWish, StartWish):
    """A study, and where it is to run."""


class StudyCost(Model):
    """What a study would take."""

    runs: int
    seconds: float | None
    """Null where nothing is known of how long a run takes, or of how many there are at a time."""
    bytes: int
    words: str
    error: str | None
    """Why it would be refused."""


class SchedulerWish(Model):
    """A cluster that is asked after."""

    address: str


class SchedulerInfo(Model):
    """What answers at a scheduler's address."""

    address: str
    workers: int
    threads: int
    machines: list[str]
    error: str | None
    """Why it cannot be used."""


class WorkerInfo(Model):
    """A worker of a study that runs."""

    name: str
    machine: str
    words: str
    """What it waits for; empty while it works on a run."""
    trial: int | None
    recording: str | None
    seed: int | None
    since: float
    """Seconds since 1970."""


class StudyStatus(Model):
    """What a study does now."""

    runs: int
    """That ended, however often it was started."""
    seconds: float
    """In which it was at work."""
    seconds_left: float | None
    busy: float | None
    """Share of the workers' time in which they worked."""
    workers: list[WorkerInfo]


class ImportanceInfo(Model):
    """How much of the leading figure's variance a parameter explains by itself."""

    key: str
    share: float
    spread: float
    """Standard deviation, over trials drawn with replacement."""


class Study(Model):
    """Everything of a study but its trials."""

    info: StudyInfo
    definition: dict[str, Any]
    """As its file has it."""
    toml: str
    objectives: list[ObjectiveInfo]
    beside: list[ObjectiveInfo]
    """Other figures worth a column, by their keys in those of the trials."""
    varied: list[RangeInfo]
    status: StudyStatus
    best: int | None
    """Number of the best trial; 0 where nothing is better than the defaults."""
    front: list[int]
    """Trials that no other beats in all objectives."""
    importance: list[ImportanceInfo]
    """Empty while there are too few trials."""
    importance_trials: int
    sentences: list[str]


class TrialInfo(Model):
    """A trial that ended."""

    number: int
    state: Literal["complete", "pruned", "failed"]
    values: dict[str, Any]
    objectives: list[float] | None
    """Over recordings and seeds; null where it failed."""
    spreads: list[float | None]
    """Of each over the seeds."""
    figures: dict[str, float]
    vetoed: bool
    """Whether people overlap too little with the cameras that were left out."""
    words: str
    seconds: float
    """Of its runs."""
    ended: float
    """Seconds since 1970."""


class TrialList(Model):
    """Trials that ended after a moment."""

    trials: list[TrialInfo]
    last: float
    """To be given as `after` the next time."""


class TrialRun(Model):
    """One run of a trial."""

    key: str
    """Hash of recording, values, seed and code."""
    recording: str
    seed: int
    figures: dict[str, float | None]
    seconds: float
    worker: str
    machine: str
    tracks: str
    """Hash of its tracks."""


class TrialDetail(Model):
    """A trial with its runs and what repeats them."""

    trial: TrialInfo
    runs: list[TrialRun]
    commands: list[str]


class TuneWish(StartWish):
    """The open recording is to be tuned, from today's values."""

    minutes: float = Field(default=5.0, gt=0, le=10_000)
    without_truth: bool = False
    """Whether truth is not looked at though it is there."""


class TunedRow(Model):
    """A parameter that the proposal changes."""

    key: str
    symbol: str
    unit: str
    default: Any
    before: Any
    after: Any
    brought: float | None
    """Of the leading figure, against the proposal without it; null where the time was over."""


class TunedFigure(Model):
    """A figure of the proposal, on the seeds that no trial had."""

    key: str
    name: str
    default: float | None
    before: float | None
    after: float | None


class Tuned(Model):
    """What a study proposes at its end."""

    done: bool
    """Whether the best were measured again; all else is empty before."""
    better: bool
    """Whether anything better was found than where somebody was."""
    words: str
    trial: int | None
    """Of the same values; null where changes that bring nothing were put back."""
    seeds: list[int]
    rows: list[TunedRow]
    figures: list[TunedFigure]


def _desk(owners: Owned) -> StudyDesk:
    return owners.studies


Desk = Annotated[StudyDesk, Depends(_desk)]


def no_trial(error: StudyError | SequenceError, field: str) -> ApiError:
    """The answer where a study has no such trial."""
    return ApiError(404, "no_trial", f"{sentence(error)}.", field=field)


def store_of(desk: StudyDesk, name: str) -> Store:
    """The study of a name.

    Raises:
        ApiError: If there is none.
    """
    try:
        return desk.store(name)
    except StudyError as error:
        raise ApiError(404, "no_study", f"{sentence(error)}.", field="name") from None


def _study(name: str, desk: Desk) -> Store:
    return store_of(desk, name)


Named = Annotated[Store, Depends(_study)]


_METHOD_HELP = {
    "single_view": "Method of stage 1.",
    "fusion_method": "Method of stage 2.",
    "smoothing_method": "Method of stage 3.",
}


def study_of(desk: StudyDesk, store: Store) -> Study:
    """A study but its trials."""
    summary, status = desk.summary(store), store.status()
    defaults = summary.defaults
    return Study(
        info=StudyInfo(**desk.info(store)),
        definition=summary.definition.to_json(),
        toml=summary.definition.to_toml(),
        objectives=[objective_of(one) for one in summary.objectives],
        beside=[objective_of(one) for one in summary.beside],
        varied=[
            range_of(one, defaults.get(one.key), summary.definition.start.get(one.key))
            for one in summary.definition.varied
        ],
        status=filled(
            StudyStatus,
            status,
            runs=max(status.all_runs, status.runs),  # an older status has those of a start alone
            seconds=max(status.all_seconds, status.seconds),
            workers=[WorkerInfo(**one) for one in status.workers],
        ),
        best=None if summary.best is None else summary.best.number,
        front=summary.front,
        importance=[
            ImportanceInfo(key=key, share=share, spread=spread)
            for key, (share, spread) in summary.importance
        ],
        importance_trials=summary.importance_trials,
        sentences=summary.sentences(),
    )


def objective_of(one: Objective) -> ObjectiveInfo:
    """A figure that trials are judged by."""
    return filled(ObjectiveInfo, one)


def range_of(one: Varied, default: Any, now: Any) -> RangeInfo:
    """A varied parameter."""
    parameter = PARAMETERS.get(one.key)
    own = default if default is not None or parameter is None else parameter.default
    return filled(
        RangeInfo,
        one,
        label=one.key.replace("_", " ").capitalize() if parameter is None else parameter.label,
        symbol="" if parameter is None else parameter.symbol,
        unit="" if parameter is None else parameter.unit,
        help=_METHOD_HELP.get(one.key, "") if parameter is None else parameter.help,
        kind="choice" if parameter is None else parameter.kind,
        minimum=None if parameter is None else parameter.minimum,
        maximum=None if parameter is None else parameter.maximum,
        choices=list(one.choices),
        default=own,
        now=own if now is None else now,
    )


def trial_of(trial: Trial) -> TrialInfo:
    """A trial that ended."""
    told = asdict(trial)
    del told["jobs"], told["missing_overlap"]
    return TrialInfo(**told)


def tuned_of(found: dict[str, Any] | None) -> Tuned:
    """What a study proposes; None where it has not come to its end."""
    if found is None:
        return Tuned(done=False, better=False, words="", trial=None, seeds=[], rows=[], figures=[])
    rows = []
    for row in found["rows"]:
        parameter = PARAMETERS.get(row["key"])
        symbol = "" if parameter is None else parameter.symbol
        unit = "" if parameter is None else parameter.unit
        rows.append(TunedRow(symbol=symbol, unit=unit, **row))
    figures = [TunedFigure(**one) for one in found["figures"]]
    facts = {name: found[name] for name in ("better", "words", "trial", "seeds")}
    return Tuned(done=True, rows=rows, figures=figures, **facts)


def ranges_of(snapshot: Snapshot, keys: list[str] | None) -> list[RangeInfo]:
    """Ranges around today's values.

    Args:
        snapshot: Of the workbench.
        keys: Which parameters; None for the essential ones that have an effect.

    Raises:
        ParameterError: If there is none of a key.
    """
    now, defaults = snapshot.parameters, snapshot.defaults
    if keys is None:
        keys = [key for key in shown_keys(now) if key in PARAMETERS and PARAMETERS[key].essential]
    found = []
    for key in keys:
        if key not in PARAMETERS and key not in METHODS:
            with_values(now, {key: None})  # says what is wrong
        own, default = value_of(now, key), value_of(defaults, key)
        if key == "single_view":
            fit = [
                one for one in METHODS["single_view"] if one not in snapshot.unfit["single_view"]
            ]
            one = Varied(key, choices=tuple(fit))
        else:
            one = around(key, own, default)
        found.append(range_of(one, default, own))
    return found


router = APIRouter(prefix="/api/studies", responses=ERRORS)

RUN_BYTES, TRIAL_BYTES = 2500, 4000
"""What a run and a trial take on disk, about."""

FEWEST_STEPS = 50
"""Of a run before its speed says anything: the first ones wait for what is compiled and read."""

SECONDS_FOR_A_SCHEDULER = 5.0


@router.get("")
def studies(desk: Desk) -> StudyList:
    """Every study, the one that was at work last first."""
    found = []
    for store in desk.all():
        try:
            found.append(StudyInfo(**desk.info(store)))
        except StudyError as error:
            found.append(
                StudyInfo(
                    name=store.name, state="failed", words=sentence(error), done=0, trials=0,
                    touched=store.touched(), seconds_left=None, objective="", best=None,
                    default=None,
                )
            )  # fmt: skip
    return StudyList(folder=str(desk.folder), studies=found)


@router.get("/draft")
def draft(
    desk: Desk,
    bench: Bench,
    keys: Annotated[str | None, Query(description="Parameters, with commas between.")] = None,
) -> StudyDraft:
    """A study of what is open, its ranges around today's values."""
    snapshot, sequence = opened(bench)
    wanted = None if keys is None else [key for key in keys.split(",") if key]
    has_truth = sequence.ground_truth is not None
    return StudyDraft(
        name=free_name(sequence.name, desk.folder),
        recordings=[place_of(sequence.folder)],
        has_truth=has_truth,
        parameters=ranges_of(snapshot, wanted),
        objectives=list(WITH_TRUTH if has_truth else SELF_CONSISTENCY),
        choices=[
            objective_of(one) for one in OBJECTIVES.values() if has_truth or one.of != "truth"
        ],
        workers=available_cores(),
        words=_left_out(snapshot),
    )


def _left_out(snapshot: Snapshot) -> str:
    if snapshot.sequence is not snapshot.saved:
        return "What was taught since it was saved is not in the study: save it first."
    return ""


def _definition(wish: StudyWish, bench: Bench) -> StudyDefinition:
    """The study that is wished for, from what is on the sliders.

    Raises:
        StudyError: If something in it does not do.
    """
    snapshot, sequence = opened(bench)
    own = changed_values(snapshot.parameters, snapshot.defaults)
    ranges = {key: one.model_dump(exclude_none=True) for key, one in wish.parameters.items()}
    return definition_of(
        {
            "name": wish.name,
            "recordings": wish.recordings or [place_of(sequence.folder)],
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
def estimate(wish: CostWish, desk: Desk, bench: Bench) -> StudyCost:
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
        return StudyCost(runs=0, seconds=None, bytes=0, words="", error=sentence(error))
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
    return StudyCost(runs=runs, seconds=seconds, bytes=size, words=words, error=None)


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
def define(wish: StudyWish, desk: Desk, bench: Bench) -> Study:
    """Make a study; it is started by a call of its own."""
    try:
        return study_of(desk, desk.define(_definition(wish, bench)))
    except StudyError as error:
        raise ApiError(422, "bad_study", f"{sentence(error)}.") from None


@router.post("/scheduler")
def scheduler(wish: SchedulerWish) -> SchedulerInfo:
    """Whether a Dask scheduler answers at an address, and who works for it."""
    from tracker.studies.cluster import scheduler_numbers

    try:
        found = scheduler_numbers(wish.address, SECONDS_FOR_A_SCHEDULER)
    except StudyError as error:
        return SchedulerInfo(
            address=wish.address, workers=0, threads=0, machines=[], error=sentence(error)
        )
    return SchedulerInfo(address=wish.address, **found, error=None)


@router.post("/tune")
def tune(wish: TuneWish, desk: Desk, bench: Bench) -> Study:
    """Define and start the study that tunes the open recording from today's values."""
    snapshot, sequence = opened(bench)
    desk.check_place(wish.workers, wish.scheduler)
    definition = tuning(
        free_name(f"tune {sequence.name}", desk.folder),
        [place_of(sequence.folder)],
        minutes=wish.minutes,
        changes=changed_values(snapshot.parameters, snapshot.defaults),
        ignore_truth=wish.without_truth,
    )
    desk.define(definition)
    return study_of(desk, desk.start(definition.name, wish.workers, wish.scheduler))


@router.get("/{name}", operation_id="get_study")
def study(store: Named, desk: Desk) -> Study:
    """Everything of a study but its trials."""
    return study_of(desk, store)


@router.post("/{name}/start")
def start(store: Named, desk: Desk, wish: StartWish | None = None) -> Study:
    """Start a study, or go on with it."""
    wish = wish or StartWish()
    return study_of(desk, desk.start(store.name, wish.workers, wish.scheduler))


@router.post("/{name}/stop")
def stop(store: Named, desk: Desk) -> Study:
    """Stop a study, or pause it: everything is kept, and starting it goes on."""
    return study_of(desk, desk.stop(store.name))


@router.delete("/{name}")
def remove(store: Named, desk: Desk) -> StudyList:
    """Delete a study with everything in it."""
    try:
        desk.remove(store.name)
    except OSError as error:
        raise StudyError(sentence(error)) from error
    return studies(desk)


KINDS = {
    "report.html": "text/html; charset=utf-8",
    "trials.csv": "text/csv; charset=utf-8",
    "study.json": "application/json",
}
"""What a study is exported as, and the kind of each file."""


@router.get("/{name}/trials")
def trials(
    store: Named, after: Annotated[float, Query(description="Seconds since 1970.")] = 0.0
) -> TrialList:
    """The trials that ended, or those since a moment."""
    found = store.trials(after)
    return TrialList(
        trials=[trial_of(one) for one in found],
        last=max((one.ended for one in found), default=after),
    )


@router.get("/{name}/trials/{number}", operation_id="get_studies_trial")
def trial(store: Named, number: int) -> TrialDetail:
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
                TrialRun(
                    key=row.key, recording=row.recording, seed=row.seed,
                    figures=dict(outcome.figures), seconds=outcome.seconds, worker=outcome.worker,
                    machine=outcome.machine, tracks=outcome.tracks,
                )
            )  # fmt: skip
    return TrialDetail(trial=trial_of(found), runs=runs, commands=commands)


@router.get("/{name}/tuned")
def tuned(store: Named) -> Tuned:
    """What a study proposes at its end."""
    found = store.fact("tuned")
    return tuned_of(found)


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
    return download(data, name, KINDS[file])
