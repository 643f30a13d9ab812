"""What runs as long as the application does: workbench, jobs, 3D view and all who follow them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

from fastapi import FastAPI

from app.errors import sentence
from app.state import opening_step
from app.state.correcting import Correcting
from app.state.doubting import Doubting
from app.state.edits import Edits
from app.state.importing.desk import Desk
from app.state.kept.crashes import Crash, Crashes
from app.state.kept.history import History
from app.state.kept.presets import OwnPresets
from app.state.kept.recents import Recents
from app.state.marking import Marking
from app.state.memory import Budget
from app.state.snapshot import Notice
from app.state.studies import StudyDesk
from app.state.teaching import Teaching
from app.state.workbench import Workbench
from app.state.workers.compiling import Compiling
from app.state.workers.evaluator import Evaluator
from app.state.workers.exporter import Exporter
from app.state.workers.fetching import DetectorFetching
from app.state.workers.identity_check import IdentityCheck
from app.state.workers.jobs import Jobs
from app.state.workers.keeper import Keeper
from app.state.workers.sensitivity import Sensitivity
from app.state.workers.threads import in_background
from app.web.access.gateway import Gateway
from app.web.commands.command import Owners
from app.web.library import routes as library
from app.web.pictures.jpegs import Pictures
from app.web.pictures.likelihood import Likelihoods
from app.web.pictures.swatches import Swatches
from app.web.server.room import Room, start_room
from app.web.server.settings import Settings
from app.web.stream import Stream
from app.web.views.timeline import Timelines, names_of
from tracker.files.folders import settings_folder
from tracker.library.records import Result
from tracker.runs.pipeline import Cancelled
from tracker.runs.stage_cache import StageCache
from tracker.studies.store import studies_folder

logger = logging.getLogger("app")


@asynccontextmanager
async def lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Start all of it, and end it in order."""
    settings: Settings = app.state.settings
    workbench = app.state.workbench = Workbench()
    kept, looked_at = settings.keep_on_disk, isinstance(settings.run, Result)
    budget = Budget.of(settings.memory)
    crashes = Crashes(settings_folder() / "starts" if kept else None)
    crashed = crashes.tidy(settings.ended)
    crashes.watch()
    jobs = app.state.jobs = Jobs(
        workbench,
        data=settings.data,
        detector=settings.detector,
        seed=settings.seed,
        cache=StageCache.on_disk(in_background, budget.columns, settings.disk)
        if kept
        else StageCache(memory_bytes=budget.columns),
        picture_bytes=budget.pictures,
        crashes=crashes,
        draft_of=lambda folder: teaching.draft_of(folder),
        left_with=lambda folder: edits.parameters_of(folder),
        compiling=Compiling(settings.say) if kept and not looked_at else None,
        computes=not looked_at,
    )
    pictures = app.state.pictures = Pictures(workbench)
    app.state.timelines = Timelines()
    history = History(workbench)
    edits = Edits(
        workbench,
        settings_folder() / "edits" if kept else None,
        settings_folder() / "corrections" if kept else None,
    )
    own_presets = settings_folder() / "presets.json" if kept else None
    presets = app.state.presets = OwnPresets(workbench, edits, own_presets)
    app.state.likelihoods = Likelihoods()
    app.state.swatches = Swatches()
    teaching = Teaching(
        workbench, edits, settings.data, settings_folder() / "unsaved" if kept else None
    )
    correcting = Correcting(workbench, edits)
    edits.follow()
    doubting = Doubting()
    desk = app.state.desk = Desk(workbench, settings.data)
    recents = app.state.recents = Recents(
        workbench, settings_folder() / "recent.json" if kept else None
    )
    evaluator = app.state.evaluator = Evaluator(workbench)
    identity_check = app.state.identity_check = IdentityCheck(workbench)
    exporter = app.state.exporter = Exporter(workbench)
    detector_fetching = app.state.detector_fetching = DetectorFetching(
        workbench, lambda: jobs.use_detector(None)
    )
    sensitivity = app.state.sensitivity = Sensitivity(workbench, settings.seed)
    keeper = app.state.keeper = Keeper(workbench, settings.library, settings.keep, names_of)
    marking = Marking(workbench, edits, keeper.library)
    study_desk = StudyDesk(workbench, studies_folder())
    app.state.owners = Owners(
        workbench, edits, presets, history, teaching, correcting, doubting, marking, study_desk
    )
    told = app.state.stream = Stream(workbench)
    door = app.state.gateway = Gateway()
    told.start(_of_crash(crashed[-1], settings.ended is not None) if crashed else None)
    for crash in crashed:
        settings.say(crash.words)
    opening_step.follow(workbench)
    room = app.state.room = Room(workbench, teaching)
    if settings.with_viser:
        door.prepare()
        # the page is served meanwhile; requests for the 3D view wait
        starting = asyncio.create_task(start_room(room, door, workbench))
    if settings.run is not None:
        result = (
            settings.run
            if isinstance(settings.run, Result)
            else keeper.library().result(settings.run)
        )
        opening = jobs.open(result.place)
        library.then_show(opening, jobs, workbench, result).add_done_callback(
            say_failure(result.run.title)
        )
    elif settings.ended is not None and crashed and (note := crashed[-1].note).place:
        jobs.take_up(note).add_done_callback(say_failure(note.place))
    elif settings.sequence is not None:
        jobs.open(settings.sequence).add_done_callback(say_failure(settings.sequence))
    try:
        yield
    finally:
        if settings.with_viser:
            await asyncio.gather(starting, return_exceptions=True)
        told.stop()
        teaching.close()
        correcting.close()
        edits.close()
        recents.close()
        desk.close()
        pictures.close()
        await asyncio.gather(
            *(
                asyncio.to_thread(part.close)
                for part in (
                    identity_check,
                    exporter,
                    detector_fetching,
                    keeper,
                    jobs,
                    evaluator,
                    sensitivity,
                    room,
                    study_desk,
                )
            )
        )
        crashes.close()


def _of_crash(crash: Crash, restarted: bool) -> Notice:
    """What the pages are told of it."""
    hint = "Everything that was kept is there."
    if restarted and crash.note.opening:
        hint = f"It was opening {crash.note.place}, which is not opened again by itself."
    elif restarted:
        hint = "The workbench was started again where it was."
    return Notice("warn", crash.words, hint, crash.report)


def say_failure(name: str) -> Callable[..., None]:
    """What is called with an opening that has ended: it tells the terminal if it failed."""

    def say(future: object) -> None:
        error = future.exception()  # type: ignore[attr-defined]
        # an opening that another one or the end took over from has not failed
        if error is not None and not isinstance(error, Cancelled):
            logger.error("%s cannot be opened: %s", name, sentence(error))

    return say
