"""What a server is started with, and what runs as long as it does: all who follow the workbench."""

from __future__ import annotations

import asyncio
import logging
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fastapi import FastAPI

from app.errors import sentence
from app.state import opening_step
from app.state.compiling import Compiling
from app.state.correcting import Correcting, Doubting
from app.state.crashes import Crash, Crashes
from app.state.edits import Edits
from app.state.evaluator import Evaluator
from app.state.history import History
from app.state.importing import Desk
from app.state.jobs import Jobs
from app.state.keeper import Keeper, Marking
from app.state.presets import OwnPresets
from app.state.recents import Recents
from app.state.sensitivity import Sensitivity
from app.state.snapshot import Notice
from app.state.studies import StudyDesk
from app.state.tasks import DetectorFetching, Exporter, IdentityCheck
from app.state.teaching import Teaching
from app.state.threads import in_background
from app.state.workbench import Workbench
from app.web import library as library
from app.web.access.gateway import Entrance, Gateway, start_viser
from app.web.dependencies import Owners, Settings
from app.web.overlays import Likelihoods
from app.web.pictures import Pictures
from app.web.stream import Stream
from app.web.timeline import Timelines, names_of
from tracker.files.folders import settings_folder
from tracker.library.records import Result
from tracker.parameters.presets import presets_file
from tracker.runs.pipeline import Cancelled
from tracker.runs.stage_cache import MEMORY_BYTES, StageCache
from tracker.sequences.pictures.frames import CACHE_BYTES
from tracker.studies.store import studies_folder

if TYPE_CHECKING:
    from app.scene.scene import Scene

LEAST_BYTES = 64 << 20
"""Less keeps no second of pictures, and everything is computed twice."""


@dataclass(frozen=True, slots=True)
class Budget:
    """Bounds, in bytes, that add up to three quarters of the whole; a run takes the rest."""

    pictures: int
    """Decoded pictures."""
    columns: int
    """Columns of runs."""

    @staticmethod
    def of(total: int | None = None) -> Budget:
        """The parts of a budget.

        Args:
            total: Bytes; None for half of the machine's memory, of which the caches then take no
                more than is usual.
        """
        if total is not None:
            return Budget(max(LEAST_BYTES, total) // 4, max(LEAST_BYTES, total) // 2)
        half = max(LEAST_BYTES, machine_memory() // 2)
        return Budget(min(CACHE_BYTES, half // 4), min(MEMORY_BYTES, half // 2))


def machine_memory() -> int:
    """Bytes of memory that this machine has; 8 GB where it does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 8 << 30


logger = logging.getLogger("app")


class Room:
    """viser's server with what is in it."""

    def __init__(self, workbench: Workbench, teaching: Teaching) -> None:
        self._workbench = workbench
        self._teaching = teaching
        self.scene: Scene | None = None
        self._parts: list[Callable[[], object]] = []

    def open(self, entrance: Entrance) -> None:
        """Start viser behind its entrance and build scene and sliders in it."""
        from app.scene.editing import RoomEditing
        from app.scene.panel import Panel
        from app.scene.scene import Scene

        server = start_viser(entrance)
        self._parts.append(server.stop)
        self.scene = Scene(server, self._workbench)
        self._parts.append(self.scene.close)
        self._parts.append(RoomEditing(server, self._workbench, self._teaching).close)
        self._parts.append(Panel(server, self._workbench).close)

    def close(self) -> None:
        """Take it down in the opposite order."""
        for part in reversed(self._parts):
            part()


async def start_room(room: Room, door: Gateway, workbench: Workbench) -> None:
    """Start it in the background; whoever waits for it is told, and of a failure the page."""
    try:
        await asyncio.to_thread(room.open, door.entrance)
        door.started()
    except Exception as error:
        logger.exception("the 3D view did not start")
        workbench.notify(
            "error",
            f"The 3D view did not start: {sentence(error)}",
            "Cameras, timeline and export work without it.",
        )


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
    pictures = app.state.pictures = Pictures(workbench)
    app.state.timelines = Timelines()
    history = History(workbench)
    edits = Edits(
        workbench,
        settings_folder() / "edits" if kept else None,
        settings_folder() / "corrections" if kept else None,
    )
    own_presets = presets_file() if kept else None
    presets = app.state.presets = OwnPresets(workbench, edits, own_presets)
    app.state.likelihoods = Likelihoods()
    teaching = Teaching(
        workbench, edits, settings.data, settings_folder() / "unsaved" if kept else None
    )
    correcting = Correcting(workbench, edits)
    edits.follow()
    # after those who take up what was not saved: the first run is of that, and begins once
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
        draft_of=teaching.draft_of,
        left_with=edits.parameters_of,
        compiling=Compiling(settings.say) if kept and not looked_at else None,
        computes=not looked_at,
    )
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
