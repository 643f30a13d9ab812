"""What a connection may cost: how many there are, how long one may take to ask, and to read.

uvicorn keeps a connection that never asks anything, and an answer that nobody reads, for ever.
Some hundred of them would take all descriptors that a process has.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

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
