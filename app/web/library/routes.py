"""The HTTP routes of the library."""

from __future__ import annotations

import asyncio
import os
from concurrent.futures import Future
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response

from app.errors import ApiError, sentence
from app.models import State
from app.models.base import RowNumber
from app.state.workers.keeper import Keeper
from app.web.dependencies import ERRORS, Bench, Work, nothing_open
from app.web.library import models, preview
from app.web.opening import begun, told_in_the_answer
from app.web.views import results
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
from tracker.sequences.reader import FILE

router = APIRouter(prefix="/api/library", responses=ERRORS)


def _keeper(request: Request) -> Keeper:
    keeper: Keeper = request.app.state.keeper
    return keeper


Kept = Annotated[Keeper, Depends(_keeper)]


def _library(keeper: Kept) -> Library:
    return keeper.library()


Opened = Annotated[Library, Depends(_library)]


@router.get("")
def library(request: Request, keeper: Kept) -> models.LibraryInfo:
    """The recordings that were opened or can be, and how much is kept."""
    data: Path | None = request.app.state.settings.data
    known: list[Recording] = []
    size, error, read_only = 0, None, False
    try:
        opened = keeper.library()
        known, size, read_only = opened.recordings(), opened.size(), opened.read_only
    except LibraryError as failure:
        error = sentence(failure)
    told = [_recording(recording) for recording in known]
    places = {recording.place for recording in told}
    for entry in sequences.available(data):
        place = entry.name if entry.kind == "rendered" else str(entry.folder.absolute())
        if place not in places:
            told.append(
                models.RecordingInfo(
                    id=None, place=place, name=entry.name, kind=entry.kind,
                    cameras=entry.cameras, frames=entry.frames, fps=0.0, boxes_only=False,
                    people=None, opened=None, runs=0, has_thumbnail=False, missing=entry.error,
                )
            )  # fmt: skip
    return models.LibraryInfo(
        file=str(keeper.path or ""), bytes=size, error=error, read_only=read_only, recordings=told
    )


def _recording(recording: Recording) -> models.RecordingInfo:
    missing = None
    # of the module, for a method fails at a folder that may not be read any more
    if recording.kind == "folder" and not os.path.isfile(Path(recording.place) / FILE):
        missing = f"there is no {FILE} in {recording.place} any more"
    return models.RecordingInfo(
        id=recording.id,
        place=recording.place,
        name=recording.name,
        kind="rendered" if recording.kind == "rendered" else "folder",
        cameras=recording.cameras,
        frames=recording.frames,
        fps=recording.fps,
        boxes_only=not recording.has_pictures,
        people=recording.people,
        opened=recording.opened,
        runs=recording.runs,
        has_thumbnail=bool(recording.has_pictures),
        missing=missing,
    )


@router.get(
    "/thumbnail/{recording}.jpg",
    response_class=Response,
    responses={200: {"content": {"image/jpeg": {}}, "description": "The picture."}},
)
def thumbnail(recording: RowNumber, opened: Opened) -> Response:
    """A recording in one picture."""
    picture = opened.thumbnail(recording)
    if picture is None:
        raise ApiError(404, "no_picture", f"Recording {recording} has no picture.")
    return Response(picture, media_type="image/jpeg", headers={"cache-control": "max-age=60"})


@router.get("/recordings/{recording}/runs")
def runs(recording: RowNumber, opened: Opened) -> models.KeptRuns:
    """The kept runs of a recording, the newest first."""
    return models.KeptRuns(runs=[_info(run) for run in opened.runs(recording)])


@router.post("/recordings/{recording}/place")
async def move(recording: int, wish: models.Place, opened: Opened) -> models.RecordingInfo:
    """Say where a recording lies now, of which only the runs were still there."""
    folder = Path(wish.place).expanduser()
    known = next((r for r in opened.recordings() if r.id == recording), None)
    if known is None:
        raise ApiError(404, "no_recording", f"There is no recording {recording}.")
    with told_in_the_answer(known.name, field="place", hint="Its runs stay readable all the same."):
        sequence = await asyncio.to_thread(sequences.open_sequence, str(folder))
        if sequence.digest != known.digest:
            raise ValueError(
                f"{folder}: expected the recording of which these runs are, found another "
                f"content ({sequence.name})"
            )
    opened.move(recording, str(sequence.folder.absolute()))
    return next(_recording(r) for r in opened.recordings() if r.id == recording)


@router.get("/runs/{number}")
def run(number: RowNumber, opened: Opened, bench: Bench) -> models.Preview:
    """One kept run in small: its facts, lanes, people and ways from above.

    The room is there where it is known: that of the open recording.
    """
    result, now = opened.result(number), bench.snapshot()
    fps = next((r.fps for r in opened.recordings() if r.id == result.run.recording), 25.0)
    tracks, steps = result.kept.tracks, result.run.steps
    known = now.saved is not None and (
        record_of_recording(now.saved, now.opened_as).place == result.place
    )
    return models.Preview(
        run=_info(result.run),
        frames=steps,
        tracks=preview.lanes(tracks, steps, fps),
        people=preview.people(tracks, steps),
        people_every=stride(steps, preview.BUCKETS),
        courses=preview.courses(tracks, fps),
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
        hint="What was open still is; its tracks can be exported all the same.",
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
    now = bench.snapshot()
    if now.sequence is None or now.saved is None:
        raise nothing_open()
    if record_of_recording(now.saved, now.opened_as).place != result.place:
        raise ApiError(
            409,
            "another_recording",
            f"Run {number} is of {result.run.recording_name}, and {now.sequence.name} is open.",
            hint="Open one of its recording's runs first.",
        )
    try:
        bench.pin_kept(run_for_display(now.sequence, result))
    except ValueError as error:
        raise ApiError(422, "cannot_open", sentence(error), field="number") from None
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


def _info(run: KeptRun) -> models.KeptRunInfo:
    changes = [
        models.ChangeInfo(
            key=key,
            symbol=PARAMETERS[key].symbol if key in PARAMETERS else key,
            default=_text(_default(key)),
            value=_text(value),
        )
        for key, value in run.changes.items()
    ]
    return models.run_info(run, changes, run.code != code_version())


def _default(key: str) -> object:
    """The default of a value; empty for the single-view method, which the recording decides, and
    for what this version does not know."""
    known = key in PARAMETERS or (key in METHODS and key != "single_view")
    return value_of(RunParameters(), key) if known else ""


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)
