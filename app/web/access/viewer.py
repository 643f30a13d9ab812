"""viser on a socket of its own that the gateway alone may enter.

viser asks nobody who he is: whoever reaches its port reads the scene, moves sliders and uploads
files. So it gets no port where the system has sockets that no page of a browser and no other
machine can reach (Linux, by an abstract address that nothing of the file system is left of), and
everywhere it answers to those alone who say a secret in the request to connect; all others are
turned away before viser hears of them. Its own pages are not served: the gateway has them.
"""

from __future__ import annotations

import hmac
import http
import logging
import secrets
import sys
import threading
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import viser
    from viser.infra import WebsockMessageHandler
    from websockets.asyncio.client import ClientConnection
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response

SECRET_HEADER = "X-Entrance"
"""Of the request to connect. A browser lets no page add a header to one."""

OPEN_SECONDS = 5.0

LARGEST_MESSAGE = 1 << 20
"""Bytes of a page's message to viser: where its camera is, or what a slider says."""

_starting = threading.Lock()
_quiet = logging.getLogger("app.viser")
_quiet.setLevel(logging.CRITICAL)  # what a connection says may be garbage, which is no news


class Entrance:
    """Where viser listens, and what it wants to hear."""

    def __init__(self, *, port: bool = sys.platform != "linux") -> None:
        """
        Args:
            port: On a port of this machine, instead of at an abstract address.
        """
        self.path = None if port else f"\0multiview-phd-{secrets.token_hex(8)}"
        self.port = 0
        self._secret = secrets.token_urlsafe(32)

    async def connect(self, subprotocols: list[str]) -> ClientConnection:
        """Enter, with what the browser's side asked for.

        Raises:
            OSError, TimeoutError, websockets.InvalidHandshake: If viser does not answer.
        """
        from websockets import Subprotocol
        from websockets.asyncio.client import connect, unix_connect

        options: dict[str, Any] = {
            "subprotocols": [Subprotocol(name) for name in subprotocols],
            "additional_headers": {SECRET_HEADER: self._secret},
            # viser's messages are compressed already and may have many megabytes
            "compression": None,
            "ping_interval": None,
            "max_size": None,
            "open_timeout": OPEN_SECONDS,
            "proxy": None,
        }
        if self.path is None:
            return await connect(f"ws://127.0.0.1:{self.port}", **options)
        return await unix_connect(self.path, "ws://127.0.0.1", **options)

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        told = request.headers.get_all(SECRET_HEADER)
        # as bytes, also those that are no text
        said = [words.encode(errors="surrogateescape") for words in told]
        if len(said) == 1 and hmac.compare_digest(said[0], self._secret.encode()):
            return None
        return connection.respond(http.HTTPStatus.FORBIDDEN, "Only the workbench may enter.\n")


def start_viser(entrance: Entrance | None = None) -> viser.ViserServer:
    """viser behind its entrance, silent, without its public tunnel and without uploads.

    Args:
        entrance: Of whoever is to connect to it; of nobody, if none.

    Raises:
        RuntimeError: If viser would listen somewhere else.
    """
    import rich
    import viser
    import websockets.asyncio.server
    from viser import _messages

    way = entrance or Entrance()
    serve, asked = websockets.asyncio.server.serve, 0

    def behind_the_entrance(handler: Any, host: str, port: int, **options: Any) -> Any:
        nonlocal asked
        asked += 1
        options |= {
            "process_request": way._admit,
            "max_size": LARGEST_MESSAGE,
            "logger": _quiet,
        }
        if way.path is None:
            return serve(handler, "127.0.0.1", 0, **options)
        return serve(handler, unix=True, path=way.path, **options)

    rich.get_console().quiet = True  # it would print its private address, and when it ends
    with _starting:  # viser has no setting for where and how it listens
        websockets.asyncio.server.serve = behind_the_entrance  # type: ignore[assignment, misc]
        try:
            server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        finally:
            websockets.asyncio.server.serve = serve  # type: ignore[misc]
    if not asked:
        server.stop()
        raise RuntimeError("viser listens by other means than the ones it is guarded by")
    way.port = server.get_port()
    refused = (
        _messages.ShareUrlRequest,
        _messages.ShareUrlDisconnect,
        _messages.FileTransferStartUpload,
        _messages.FileTransferPart,
    )

    def refuse(connection: WebsockMessageHandler) -> None:
        for message in refused:
            connection._incoming_handlers.pop(message, None)

    # a page may ask for a public address through a third party's server, and send files of any
    # size into memory: never here
    refuse(server._websock_server)
    server._websock_server.on_client_connect(refuse)  # each has handlers of its own
    return server
