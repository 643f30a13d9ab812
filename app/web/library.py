"""The routes of the library: recordings, runs, and what a run looks like in small."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Depends, Response
from pydantic import Field

from app.errors import ApiError, as_sentence, sentence
from app.messages import Model, RowNumber, filled
from app.state.keeper import Keeper
from app.web import results
from app.web.dependencies import (
    ERRORS,
    Bench,
    Configured,
    Owned,
    Work,
    a_file,
    begun,
    of_app,
    told_in_the_answer,
)
from app.web.dependencies import opened as opened_sequence
from app.web.results import RoomInfo, State
from app.web.timeline import TrackLife, Window, lives_of
from tracker.fusion.trajectories import Trajectories
from tracker.library.errors import LibraryError
from tracker.library.keeping import (
    CURVE,
    code_version,
    record_of_recording,
    run_for_display,
    stride,
)
from tracker.library.records import KeptRun, Recording, Result
from tracker.library.store import Library
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import value_of
from tracker.sequences import library as sequences
from tracker.sequences.reader import WHERE_NOW


class RecordingInfo(Model):
    """A recording of which runs are kept, or that can be opened."""

    id: int | None
    """Null where it was never opened: it has no runs."""
    place: str
    """What opens it."""
    name: str
    kind: Literal["rendered", "folder"]
    cameras: int
    frames: int
    fps: float
    boxes_only: bool
    people: int | None
    """Of its truth; null without one."""
    opened: float | None
    """Seconds since 1970."""
    runs: int
    has_thumbnail: bool
    missing: str | None
    """Why it cannot be opened now."""


class LibraryInfo(Model):
    """The library."""

    file: str
    bytes: int
    error: str | None
    """Why nothing is kept and nothing listed but what can be opened."""
    read_only: bool
    recordings: list[RecordingInfo]


class ChangeInfo(Model):
    """A value that is not the recording's default."""

    key: str
    symbol: str
    default: str
    value: str


class KeptRunInfo(Model):
    """A run in the library."""

    id: int
    recording: int
    recording_name: str
    began: float
    """When the run was computed first, seconds since 1970."""
    latest: float
    """When the same run was computed last, seconds since 1970."""
    seconds: float
    steps: int
    steps_per_second: float
    single_view: str
    fusion_method: str
    changes: list[ChangeInfo]
    seed: int
    program: str
    """Its version."""
    older_code: bool
    """Whether another version of the program made it: computing it again may give other tracks."""
    source: str
    targets: int
    mota: float | None
    idf1: float | None
    hota: float | None
    ospa: float | None
    position_error: float | None
    misses: int | None
    false_positives: int | None
    id_switches: int | None
    name: str
    star: bool
    note: str
    tags: list[str]
    corrected: int
    """How many corrections of a person it obeys."""
    templates: list[str] | None
    """The colour templates of the run: name, camera and step of each; null where they are not
    known."""
    provisional: bool
    """Whether its figures were made before it was finished; opening it computes them again."""


class KeptRuns(Model):
    """The runs of one recording, the newest first."""

    runs: list[KeptRunInfo]


class Course(Model):
    """Where a track went, seen from above."""

    id: int
    points: list[tuple[float, float]]
    """x and y in metres, a few a second."""


class Preview(Model):
    """A run in small."""

    run: KeptRunInfo
    frames: int
    tracks: list[TrackLife]
    people: list[float]
    """Targets at each of equally many steps, their mean."""
    people_every: int
    """How many steps a value of :attr:`people` stands for."""
    courses: list[Course]
    ospa: list[float]
    """Its mean over equally many steps each, metres; empty without a truth, and where the figures
    are provisional."""
    ospa_every: int
    """How many steps a value of :attr:`ospa` stands for."""
    room: RoomInfo | None
    """The room of its recording, where that is open."""


class Place(Model):
    """Where a recording lies now."""

    place: str = Field(min_length=1, max_length=4096)


BUCKETS = 600
"""Values a curve and a lane: as wide as it is drawn."""

POINTS_A_SECOND = 4
"""Of a track's way."""


def lanes(tracks: Trajectories, steps: int, fps: float) -> list[TrackLife]:
    """The tracks' lives, as wide as they are drawn."""
    return lives_of(tracks, steps, fps, Window.of(steps, buckets=BUCKETS))


def people(tracks: Trajectories, steps: int) -> list[float]:
    """The mean number of targets in each of equally many steps."""
    count = np.bincount(tracks.frames, minlength=steps)[:steps]
    starts = np.arange(0, steps, stride(steps, BUCKETS))
    sizes = np.diff(np.append(starts, steps))
    mean: list[float] = (np.add.reduceat(count, starts) / sizes).round(2).tolist() if steps else []
    return mean


def courses(tracks: Trajectories, fps: float) -> list[Course]:
    """Each track's way, a few points a second."""
    every = max(1, round(fps / POINTS_A_SECOND))
    found = []
    for number in np.unique(tracks.ids).tolist():
        rows = np.flatnonzero(tracks.ids == number)
        points = tracks.positions[rows[:: every if len(rows) > every else 1], :2].round(2)
        found.append(Course(id=number, points=[(x, y) for x, y in points.tolist()]))
    return found


router = APIRouter(prefix="/api/library", responses=ERRORS)


Kept = Annotated[Keeper, of_app("keeper")]


def _library(keeper: Kept) -> Library:
    return keeper.library()


Opened = Annotated[Library, Depends(_library)]


@router.get("")
def library(settings: Configured, keeper: Kept) -> LibraryInfo:
    """The recordings that were opened or can be, and how much is kept."""
    known: list[Recording] = []
    size, error, read_only = 0, None, False
    try:
        opened = keeper.library()
        known, size, read_only = opened.recordings(), opened.size(), opened.read_only
    except LibraryError as failure:
        error = sentence(failure)
    told = [_recording(recording) for recording in known]
    places = {recording.place for recording in told}
    for entry in sequences.available(settings.data):
        place = entry.name if entry.kind == "rendered" else str(entry.folder)
        if place not in places:
            told.append(
                RecordingInfo(
                    id=None, place=place, name=entry.name, kind=entry.kind,
                    cameras=entry.cameras, frames=entry.frames, fps=0.0, boxes_only=False,
                    people=None, opened=None, runs=0, has_thumbnail=False, missing=entry.error,
                )
            )  # fmt: skip
    return LibraryInfo(
        file=str(keeper.path or ""), bytes=size, error=error, read_only=read_only, recordings=told
    )


def _recording(recording: Recording) -> RecordingInfo:
    return filled(
        RecordingInfo,
        recording,
        kind="rendered" if recording.kind == "rendered" else "folder",
        boxes_only=not recording.has_pictures,
        has_thumbnail=bool(recording.has_pictures),
        missing=recording.missing,
    )


@router.get("/thumbnail/{recording}.jpg", **a_file("image/jpeg", "The picture."))
def thumbnail(recording: RowNumber, opened: Opened) -> Response:
    """A recording in one picture."""
    picture = opened.thumbnail(recording)
    if picture is None:
        raise ApiError(404, "no_picture", f"Recording {recording} has no picture.")
    return Response(picture, media_type="image/jpeg", headers={"cache-control": "max-age=60"})


@router.get("/recordings/{recording}/runs")
def runs(recording: RowNumber, opened: Opened) -> KeptRuns:
    """The kept runs of a recording, the newest first."""
    return KeptRuns(runs=[_info(run) for run in opened.runs(recording)])


@router.post("/recordings/{recording}/place")
async def move(recording: int, wish: Place, opened: Opened, owners: Owned) -> RecordingInfo:
    """Say where a recording lies now, of which only the runs were still there."""
    folder = Path(wish.place).expanduser()
    known = next((r for r in opened.recordings() if r.id == recording), None)
    if known is None:
        raise ApiError(404, "no_recording", f"There is no recording {recording}.")
    with told_in_the_answer(known.name, field="place", hint="Its runs stay readable all the same."):
        sequence = await asyncio.to_thread(sequences.open_sequence, str(folder))
        # that of a run is another where it was made with what was taught and not saved
        if sequence.digest not in {known.digest, *(run.digest for run in opened.runs(recording))}:
            raise ValueError(
                f"{folder}: expected the recording of which these runs are, found another "
                f"content ({sequence.name})"
            )
    opened.move(recording, str(sequence.folder.absolute()))
    owners.teaching.move_draft(Path(known.place), sequence.folder)
    return _recording(opened.recording(recording))


@router.get("/runs/{number}")
def run(number: RowNumber, opened: Opened, bench: Bench) -> Preview:
    """One kept run in small: its facts, lanes, people and ways from above.

    The room is there where it is known: that of the open recording.
    """
    result, now = opened.result(number), bench.snapshot()
    fps = next((r.fps for r in opened.recordings() if r.id == result.run.recording), 25.0)
    tracks, steps = result.kept.tracks, result.run.steps
    known = now.saved is not None and (
        record_of_recording(now.saved, now.opened_as).place == result.place
    )
    return Preview(
        run=_info(result.run),
        frames=steps,
        tracks=lanes(tracks, steps, fps),
        people=people(tracks, steps),
        people_every=stride(steps, BUCKETS),
        courses=courses(tracks, fps),
        ospa=[] if result.run.provisional else list(result.ospa),
        ospa_every=stride(steps, CURVE),
        room=results.room_of(now.saved.room) if now.saved is not None and known else None,
    )


@router.post("/runs/{number}/open")
async def open_run(number: RowNumber, opened: Opened, bench: Bench, jobs: Work) -> State:
    """Show a run as it was: its tracks at once; its recording is opened first where it is not."""
    result = await asyncio.to_thread(opened.result, number)
    now = bench.snapshot()
    place = "" if now.saved is None else record_of_recording(now.saved, now.opened_as).place
    with told_in_the_answer(
        result.run.title,
        field="number",
        hint="What was open still is; its tracks can be exported all the same: as CSV, JSON, "
        "Parquet or TRC where its recording is gone.",
    ):
        if place == result.place:
            jobs.show_kept(result)
        else:
            await begun(then_show(jobs.open(result.place), jobs, bench, result))
    return results.state_of(bench.snapshot())


@router.post("/runs/{number}/pin")
def pin(number: RowNumber, opened: Opened, bench: Bench) -> State:
    """Pin a kept run of the open recording: others are compared with it."""
    result = opened.result(number)
    now, sequence = opened_sequence(bench)
    if record_of_recording(now.saved or sequence, now.opened_as).place != result.place:
        if why := opened.recording(result.run.recording).missing:
            raise ApiError(
                422, "cannot_pin", as_sentence(why), field="number", hint=as_sentence(WHERE_NOW)
            )
        raise ApiError(
            409,
            "another_recording",
            f"Run {number} is of {result.run.recording_name}, and {sequence.name} is open.",
            hint="Open one of its recording's runs first.",
        )
    try:
        bench.pin_kept(run_for_display(sequence, result))
    except ValueError as error:
        raise ApiError(422, "cannot_pin", as_sentence(sentence(error)), field="number") from None
    return results.state_of(bench.snapshot())


def then_show(opening: Future[None], jobs: Work, bench: Bench, result: Result) -> Future[None]:
    """Done when a run is shown, once its recording is open; what keeps it from that is told."""
    shown: Future[None] = Future()

    def show(opened: Future[None]) -> None:
        error = opened.exception()
        try:
            if error is None:
                jobs.show_kept(result)
        except ValueError as failure:
            bench.notify("error", f"{result.run.title} cannot be shown: {sentence(failure)}")
            error = failure
        if error is None:
            shown.set_result(None)
        else:
            shown.set_exception(error)

    opening.add_done_callback(show)
    return shown


def _info(run: KeptRun) -> KeptRunInfo:
    changes = [
        ChangeInfo(
            key=key,
            symbol=PARAMETERS[key].symbol if key in PARAMETERS else key,
            default=_text(_default(key)),
            value=_text(value),
        )
        for key, value in run.changes.items()
    ]
    return filled(
        KeptRunInfo,
        run,
        changes=changes,
        older_code=run.code != code_version(),
        program=run.version,
        star=bool(run.star),
    )


def _default(key: str) -> object:
    """The default of a value; empty for the single-view method, which the recording decides, and
    for what this version does not know."""
    known = key in PARAMETERS or (key in METHODS and key != "single_view")
    return value_of(RunParameters(), key) if known else ""


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
