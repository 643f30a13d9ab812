"""The application: its routes and their description, the page's files, and where it listens."""

from __future__ import annotations

import asyncio
import logging
import re
import socket as sockets
from collections.abc import Callable
from typing import Any

import h11
import uvicorn
from fastapi import FastAPI, Request
from fastapi.responses import Response
from fastapi.routing import APIRoute, iter_route_contexts
from fastapi.staticfiles import StaticFiles
from fastapi_offline import FastAPIOffline
from starlette.types import Scope
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from app import errors
from app.errors import PROBLEM
from app.paths import static_folder
from app.web import (
    api,
    commands,
    corrections,
    courses,
    evaluation,
    exports,
    identity,
    importing,
    library,
    overlays,
    pictures,
    stream,
    studies,
    teaching,
)
from app.web.access import gateway
from app.web.access.gateway import LARGEST_MESSAGE
from app.web.access.security import CONTENT_POLICY, Guard, OnlyLooking, allowed_hosts, is_loopback
from app.web.access.tokens import Access
from app.web.dependencies import Settings
from app.web.manual import Manual
from app.web.running import lifespan
from tracker import __version__
from tracker.library.records import Result

FAILURES = ("4XX", "5XX")
MADE_BY_THE_FRAMEWORK = "422"
"""Its own error, in another shape than ours."""

METHODS = ("get", "put", "post", "delete", "patch")


def operation_id(route: APIRoute) -> str:
    """A route's name for programs: its method and its address, such as ``get_step_step``."""
    (method,) = route.methods or ("get",)
    return "_".join([method.lower(), *re.findall(r"\w+", route.path_format)[1:]])


def describe_truly(app: FastAPI) -> None:
    """Have the description tell the truth of failures, and of who may ask."""
    describe = app.openapi

    def described() -> dict[str, Any]:
        if app.openapi_schema is None:
            _amend(describe())
        assert app.openapi_schema is not None
        return app.openapi_schema

    app.openapi = described  # type: ignore[method-assign]


def _amend(schema: dict[str, Any]) -> None:
    for path in schema["paths"].values():
        for method in METHODS:
            answers: dict[str, Any] = path.get(method, {}).get("responses", {})
            answers.pop(MADE_BY_THE_FRAMEWORK, None)
            for failure in FAILURES:
                if failure in answers:
                    problem = {"schema": {"$ref": "#/components/schemas/Problem"}}
                    answers[failure]["content"] = {PROBLEM: problem}
    components = schema["components"]
    for shape in ("HTTPValidationError", "ValidationError"):
        components["schemas"].pop(shape, None)
    components["securitySchemes"] = {
        "token": {
            "type": "http",
            "scheme": "bearer",
            "description": "The token of the printed link; its page has it as a cookie.",
        }
    }
    schema["security"] = [{"token": []}, {}]


MOST = 384
"""Connections at once. A page has some ten; a process may mostly have a thousand descriptors."""

SECONDS_TO_ASK = 10.0
"""From the connection, or its first byte of a further request, to the end of the request's head."""

SECONDS_TO_READ = 20.0
"""For what the system has not taken from us, at most some 64 kB, to get less."""


class _Reader:
    """Of either protocol: whoever does not read what was sent is dropped."""

    loop: asyncio.AbstractEventLoop
    transport: asyncio.Transport
    _unread: asyncio.TimerHandle | None = None

    def pause_writing(self) -> None:
        super().pause_writing()  # type: ignore[misc]
        if self._unread is None:
            self._unread = self.loop.call_later(SECONDS_TO_READ, self.transport.abort)

    def resume_writing(self) -> None:
        self._read()
        super().resume_writing()  # type: ignore[misc]

    def _read(self) -> None:
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None


class Requests(_Reader, H11Protocol):
    """uvicorn's HTTP, with an end to patience."""

    _asking: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > MOST:
            transport.abort()
        else:
            self._wait()

    def data_received(self, data: bytes) -> None:
        """Take some bytes; whoever has begun to ask has so long to finish."""
        super().data_received(data)
        if self.conn.their_state is h11.IDLE and self.conn.trailing_data[0]:
            self._wait()
        elif self.conn.their_state is not h11.IDLE:
            self._asked()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        self._asked()
        self._read()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        self._asked()
        self._read()
        super().connection_lost(exc)

    def _wait(self) -> None:
        if self._asking is None:
            self._asking = self.loop.call_later(SECONDS_TO_ASK, self.transport.abort)

    def _asked(self) -> None:
        if self._asking is not None:
            self._asking.cancel()
            self._asking = None


class Sockets(_Reader, WebSocketsSansIOProtocol):
    """uvicorn's WebSockets, with an end to patience."""

    def connection_lost(self, exc: Exception | None) -> None:
        self._read()
        super().connection_lost(exc)


ROUTERS = (
    api.router,
    commands.router,
    overlays.router,
    pictures.router,
    teaching.router,
    corrections.router,
    evaluation.router,
    identity.router,
    courses.router,
    importing.router,
    library.router,
    exports.router,
    studies.router,
    stream.router,
    gateway.router,
)
"""What is served, the page's files apart; the page's types are made from their answers."""

ASK_AGAIN = "no-cache"
"""The page's files are kept by the browser but checked by their ETag each time."""

ICON, A_DAY = "icon.svg", "max-age=86400"
"""The icon is not checked for a day: browsers want it again with every change of the address."""


def create_app(settings: Settings) -> FastAPI:
    """The whole application; it owns threads from its start to its end."""
    app: FastAPI = FastAPIOffline(
        title="multiview-phd",
        version=__version__,
        description="Tracks of several people in 3D from calibrated cameras, and their tuning.",
        redoc_url=None,
        static_url="/docs-files",  # the page of the routes loads nothing from another host
        generate_unique_id_function=operation_id,
        lifespan=lifespan,
    )
    describe_truly(app)
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
    app.mount("/manual", Manual(), name="manual")
    return app


class _PageFiles(StaticFiles):
    """The page's files with an ETag, checked each time: an update shows at once."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = A_DAY if path == ICON else ASK_AGAIN
        return response


UNREAD = 1 << 18
"""Bytes."""


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
    meanwhile, with a filter that any other thread which handles warnings may take away. Their
    description, which takes several times as long, is made when it is asked for.
    """
    for _ in iter_route_contexts(app.routes):
        pass


class _Server(uvicorn.Server):
    def __init__(self, config: uvicorn.Config, on_ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._on_ready = on_ready

    async def startup(self, sockets: list[sockets.socket] | None = None) -> None:
        await super().startup(sockets=sockets)
        if self.started:
            self._on_ready()

    async def shutdown(self, sockets: list[sockets.socket] | None = None) -> None:
        logger = logging.getLogger("uvicorn.error")
        logger.addFilter(_is_failure)
        try:
            await super().shutdown(sockets=sockets)
        finally:
            logger.removeFilter(_is_failure)


def _is_failure(record: logging.LogRecord) -> bool:
    """Whether a log entry says more than that whoever was still served at the end is cancelled."""
    error = record.exc_info[0] if record.exc_info else None
    cancelled = error is not None and issubclass(error, asyncio.CancelledError)
    return not (cancelled or str(record.msg).startswith("Cancel "))
