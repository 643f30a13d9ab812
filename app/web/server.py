"""The application: routes, page, 3D view and jobs, put together for as long as it runs."""

from __future__ import annotations

import asyncio
import logging
import socket as sockets
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import Response
from fastapi.staticfiles import StaticFiles
from fastapi_offline import FastAPIOffline
from starlette.types import Scope

from app import errors
from app.errors import sentence
from app.paths import static_folder
from app.state import opening_step
from app.state.correcting import Correcting
from app.state.doubting import Doubting
from app.state.importing.desk import Desk
from app.state.kept.crashes import Crash, Crashes
from app.state.kept.history import History
from app.state.kept.presets import OwnPresets
from app.state.kept.recents import Recents
from app.state.memory import Budget
from app.state.snapshot import Notice
from app.state.studies.desk import StudyDesk
from app.state.teaching import Teaching
from app.state.workbench import Workbench
from app.state.workers.compiling import Compiling
from app.state.workers.evaluator import Evaluator
from app.state.workers.exporter import Exporter
from app.state.workers.identity_check import IdentityCheck
from app.state.workers.jobs import Jobs
from app.state.workers.keeper import Keeper
from app.state.workers.sensitivity import Sensitivity
from app.state.workers.threads import in_background
from app.web import api, description, stream, teaching_routes
from app.web.access import gateway
from app.web.access.connections import Requests, Sockets
from app.web.access.gateway import Gateway
from app.web.access.security import CONTENT_POLICY, Guard, OnlyLooking, allowed_hosts, is_loopback
from app.web.access.tokens import Access, Keys
from app.web.access.viewer import LARGEST_MESSAGE, Entrance, start_viser
from app.web.corrections import routes as corrections
from app.web.evaluation import course_routes, identity_routes
from app.web.evaluation import routes as evaluation
from app.web.importing import routes as importing
from app.web.library import export_routes
from app.web.library import routes as library
from app.web.manual import Manual
from app.web.pictures import foreground, likelihood_routes, view_routes
from app.web.pictures.jpegs import Pictures
from app.web.pictures.likelihood import Likelihoods
from app.web.pictures.swatches import Swatches
from app.web.stream import Stream
from app.web.studies import routes as studies
from app.web.tables import event_tables, tables, teaching_tables
from app.web.views.timeline import Timelines
from tracker import __version__
from tracker.folders import settings_folder
from tracker.library import KEEP
from tracker.library.records import Result
from tracker.pipeline import Cancelled
from tracker.runs.stage_cache import StageCache
from tracker.studies.kept.store import studies_folder

if TYPE_CHECKING:
    from app.scene.scene import Scene

logger = logging.getLogger("app")

UNREAD = 1 << 18
"""Bytes."""

ROUTERS = (
    api.router,
    foreground.router,
    likelihood_routes.router,
    view_routes.router,
    tables.router,
    event_tables.router,
    teaching_routes.router,
    teaching_tables.router,
    corrections.router,
    evaluation.router,
    identity_routes.router,
    course_routes.router,
    importing.router,
    library.router,
    export_routes.router,
    studies.router,
    stream.router,
    gateway.router,
)
"""What is served, the page's files apart; the page's types are made from their answers."""

ASK_AGAIN = "no-cache"
"""The page's files are kept by the browser but checked by their ETag each time."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What a server is started with."""

    host: str = "127.0.0.1"
    keys: Keys | None = None
    """What lets in; None: whoever reaches it."""
    sequence: str | None = None
    """Opened at once, in the background."""
    data: Path | None = None
    """Its folders are sequences that can be chosen."""
    detector: Path | None = None
    """A detection network (ONNX) that may be run on the pictures of each."""
    seed: int = 0
    with_viser: bool = True
    keep_on_disk: bool = False
    """Whether what was compiled and what the cameras found is kept for the next start."""
    library: Path | None = None
    """The file that keeps runs; None: they are not kept."""
    keep: int = KEEP
    """How many untouched runs stay in it."""
    memory: int | None = None
    """Bytes that may be kept for speed; None for half of the machine, or less."""
    run: int | Result | None = None
    """A run of it that is shown at once, instead of a sequence; or one that lies elsewhere, which
    is only looked at: nothing is computed, and nothing can be changed."""
    say: Callable[[str], None] = lambda words: None
    """Told what somebody in front of the terminal should know."""
    ended: tuple[int, int] | None = None
    """Process and signal of the start before this one, where it crashed."""


def create_app(settings: Settings) -> FastAPI:
    """The whole application; it owns threads from its start to its end."""
    app: FastAPI = FastAPIOffline(
        title="multiview-phd",
        version=__version__,
        description="Tracks of several people in 3D from calibrated cameras, and their tuning.",
        redoc_url=None,
        static_url="/docs-files",  # the page of the routes loads nothing from another host
        generate_unique_id_function=description.operation_id,
        lifespan=_lifespan,
    )
    description.install(app)
    app.state.settings = settings
    if isinstance(settings.run, Result):
        app.add_middleware(OnlyLooking)
    app.add_middleware(Access, keys=settings.keys)
    app.add_middleware(  # the last one is the first that sees a request
        Guard,
        hosts=allowed_hosts(settings.host),
        addresses_are_fine=not is_loopback(settings.host),
    )
    errors.install(app)
    for router in ROUTERS:
        app.include_router(router)
    files = _PageFiles(directory=static_folder())

    @app.get("/", include_in_schema=False)
    async def page(request: Request) -> Response:
        response = await files.get_response("index.html", request.scope)
        response.headers["content-security-policy"] = CONTENT_POLICY
        return response

    app.mount("/static", files, name="static")
    app.mount("/plotly", StaticFiles(directory=_plotly()), name="plotly")
    app.mount("/manual", Manual(), name="manual")
    return app


def _plotly() -> Path:
    """The folder of the script that draws figures; it is found without reading the package."""
    found = find_spec("plotly")
    assert found is not None
    assert found.origin is not None
    return Path(found.origin).parent / "package_data"


class _PageFiles(StaticFiles):
    """The page's files with an ETag, checked each time: an update shows at once."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = ASK_AGAIN
        return response


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
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
        cache=StageCache.on_disk(in_background, budget.columns)
        if kept
        else StageCache(memory_bytes=budget.columns),
        picture_bytes=budget.pictures,
        crashes=crashes,
        draft_of=lambda folder: teaching.draft_of(folder),
        compiling=Compiling(settings.say) if kept and not looked_at else None,
        computes=not looked_at,
    )
    pictures = app.state.pictures = Pictures(workbench)
    app.state.timelines = Timelines()
    app.state.history = History(workbench)
    own_presets = settings_folder() / "presets.json" if kept else None
    app.state.presets = OwnPresets(workbench, own_presets)
    app.state.likelihoods = Likelihoods()
    app.state.swatches = Swatches()
    teaching = app.state.teaching = Teaching(
        workbench, settings.data, settings_folder() / "unsaved" if kept else None
    )
    correcting = app.state.correcting = Correcting(
        workbench, settings_folder() / "corrections" if kept else None
    )
    app.state.doubting = Doubting()
    given = Path(settings.sequence or "").expanduser()
    roots = [given] if settings.sequence and given.is_dir() else []
    desk = app.state.desk = Desk(settings.data, roots)
    recents = app.state.recents = Recents(
        workbench, settings_folder() / "recent.json" if kept else None
    )
    evaluator = app.state.evaluator = Evaluator(workbench)
    identity_check = app.state.identity_check = IdentityCheck(workbench)
    exporter = app.state.exporter = Exporter()
    sensitivity = app.state.sensitivity = Sensitivity(workbench, settings.seed)
    keeper = app.state.keeper = Keeper(workbench, settings.library, settings.keep)
    study_desk = app.state.studies = StudyDesk(workbench, studies_folder())
    told = app.state.stream = Stream(workbench)
    door = app.state.gateway = Gateway()
    told.start(_of_crash(crashed[-1], settings.ended is not None) if crashed else None)
    for crash in crashed:
        settings.say(crash.words)
    opening_step.follow(workbench)
    room = app.state.room = _Room(workbench, teaching, sensitivity)
    if settings.with_viser:
        door.prepare()
        # the page is served meanwhile; requests for the 3D view wait
        starting = asyncio.create_task(_start_viser(room, door, workbench))
    if settings.run is not None:
        result = (
            settings.run
            if isinstance(settings.run, Result)
            else keeper.library().result(settings.run)
        )
        opening = jobs.open(result.place)
        library.then_show(opening, jobs, workbench, result).add_done_callback(
            _say_failure(result.run.title)
        )
    elif settings.ended is not None and crashed and (note := crashed[-1].note).place:
        jobs.take_up(note).add_done_callback(_say_failure(note.place))
    elif settings.sequence is not None:
        jobs.open(settings.sequence).add_done_callback(_say_failure(settings.sequence))
    try:
        yield
    finally:
        if settings.with_viser:
            await asyncio.gather(starting, return_exceptions=True)
        told.stop()
        teaching.close()
        correcting.close()
        recents.close()
        desk.close()
        pictures.close()
        await asyncio.gather(
            *(
                asyncio.to_thread(part.close)
                for part in (
                    identity_check,
                    exporter,
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


def _say_failure(name: str) -> Callable[..., None]:
    def say(future: object) -> None:
        error = future.exception()  # type: ignore[attr-defined]
        # an opening that another one or the end took over from has not failed
        if error is not None and not isinstance(error, Cancelled):
            logger.error("%s cannot be opened: %s", name, sentence(error))

    return say


async def _start_viser(room: _Room, door: Gateway, workbench: Workbench) -> None:
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


class _Room:
    """viser's server with what is in it."""

    def __init__(self, workbench: Workbench, teaching: Teaching, sensitivity: Sensitivity) -> None:
        self._workbench = workbench
        self._sensitivity = sensitivity
        self._teaching = teaching
        self.scene: Scene | None = None
        self._parts: list[Callable[[], object]] = []

    def open(self, entrance: Entrance) -> None:
        """Start viser behind its entrance and build scene and sliders in it."""
        from app.scene.panel.controls import Controls
        from app.scene.room.editing import RoomEditing
        from app.scene.scene import Scene

        server = start_viser(entrance)
        self._parts.append(server.stop)
        self.scene = Scene(server, self._workbench)
        self._parts.append(self.scene.close)
        self._parts.append(RoomEditing(server, self._workbench, self._teaching).close)
        self._parts.append(Controls(server, self._workbench, self._sensitivity).close)

    def close(self) -> None:
        """Take it down in the opposite order."""
        for part in reversed(self._parts):
            part()


def bind(host: str, port: int) -> sockets.socket:
    """A listening socket.

    Raises:
        OSError: If the port is taken or the host is not this machine's.
    """
    family, _, _, _, address = sockets.getaddrinfo(
        host, port, type=sockets.SOCK_STREAM, flags=sockets.AI_PASSIVE
    )[0]
    # asyncio switches Nagle's algorithm off only on sockets that say they are TCP; with it each
    # small answer waits for the browser's delayed acknowledgement, some 40 ms
    listener = sockets.socket(family, sockets.SOCK_STREAM, sockets.IPPROTO_TCP)
    try:
        listener.setsockopt(sockets.SOL_SOCKET, sockets.SO_REUSEADDR, 1)
        # what the system keeps for somebody who does not read; else it grows to megabytes
        listener.setsockopt(sockets.SOL_SOCKET, sockets.SO_SNDBUF, UNREAD)
        listener.bind(address)
        listener.listen(128)
    except OSError:
        listener.close()
        raise
    return listener


def serve(app: FastAPI, listener: sockets.socket, on_ready: Callable[[], None]) -> None:
    """Serve until Ctrl-C, which ends it within a second or two.

    Args:
        app: From :func:`create_app`.
        listener: From :func:`bind`.
        on_ready: Called as soon as requests are answered.
    """
    build_routes(app)
    config = uvicorn.Config(
        app,
        log_level="error",
        access_log=False,
        lifespan="on",
        http=Requests,
        ws=Sockets,
        # viser's messages are packed already, ours are small: compressing only costs time
        ws_per_message_deflate=False,
        ws_max_size=LARGEST_MESSAGE,
        timeout_graceful_shutdown=1,
        server_header=False,
    )
    _Server(config, on_ready).run(sockets=[listener])


def build_routes(app: FastAPI) -> None:
    """Have all routes built before another thread runs.

    FastAPI builds a route when it is first needed, and silences a warning of pydantic's
    meanwhile, with a filter that any other thread which handles warnings may take away.
    """
    app.openapi()


class _Server(uvicorn.Server):
    def __init__(self, config: uvicorn.Config, on_ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_ready = on_ready

    async def startup(self, sockets: list[sockets.socket] | None = None) -> None:
        await super().startup(sockets=sockets)
        if self.started:
            self._on_ready()
