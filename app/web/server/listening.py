"""Where the server listens, and that it serves until somebody ends it."""

from __future__ import annotations

import socket as sockets
from collections.abc import Callable

import uvicorn
from fastapi import FastAPI
from fastapi.routing import iter_route_contexts

from app.web.access.connections import Requests, Sockets
from app.web.access.viewer import LARGEST_MESSAGE

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
