"""viser behind our port: its page under ``/viser/``, its socket proxied from ``/viser``.

viser checks neither Host nor Origin and asks nobody who he is: whoever reaches its port reads the
scene, moves sliders and uploads files. So it gets no port where the system has sockets that no page
of a browser and no other machine can reach (Linux, by an abstract address that nothing of the file
system is left of), and everywhere it answers to those alone who say a secret in the request to
connect; all others are turned away before viser hears of them. Its own pages are not served:
everything reaches it through here, past our own checks. Its client asks for its socket at the
address of its own page without the last slash.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import hmac
import http
import json
import logging
import secrets
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import RedirectResponse, Response

from app.colours import PALETTES
from app.errors import ApiError

if TYPE_CHECKING:
    import viser
    from viser.infra import WebsockMessageHandler
    from websockets import http11
    from websockets.asyncio.client import ClientConnection
    from websockets.asyncio.server import ServerConnection

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

    def _admit(
        self, connection: ServerConnection, request: http11.Request
    ) -> http11.Response | None:
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


CONTENT_POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}' 'unsafe-eval'; "
    "style-src 'unsafe-inline'; img-src 'self' blob: data:; font-src data:; media-src blob: data:; "
    "connect-src 'self' blob: data:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""Of viser's page: its own scripts, which have a number that is another at each start, and nothing
from another host. It makes styles as it goes, and functions of its own from words."""

HAS_FOCUS = b"<script>Document.prototype.hasFocus=()=>true</script>"
"""Makes ``document.hasFocus()`` true: viser's client reconnects only while its document has the
focus, which inside a frame it mostly has not."""

RENDERER_IS_TOLD_OUTSIDE = b"""<script>if (parent !== window) {
const gl = WebGL2RenderingContext.prototype;
const { getExtension } = gl;
gl.getExtension = function (name) {
  return name === "WEBGL_debug_renderer_info" ? null : getExtension.call(this, name);
};
}</script>"""
"""viser warns of rendering in software at each load; the page around it says so once, and in its
own words."""

BACKS_WRITE_NO_DEPTH = b"""<script>{
const gl = WebGL2RenderingContext.prototype;
const { enable, disable, frontFace, depthMask, drawElementsInstanced } = gl;
const [BLEND, BACKS] = [gl.BLEND, gl.CW];
gl.enable = function (what) {
  if (what === BLEND) this.seenThrough = true;
  enable.call(this, what);
};
gl.disable = function (what) {
  if (what === BLEND) this.seenThrough = false;
  disable.call(this, what);
};
gl.frontFace = function (which) {
  this.backs = which === BACKS;
  frontFace.call(this, which);
};
gl.depthMask = function (on) {
  this.writesDepth = on;
  depthMask.call(this, on);
};
gl.drawElementsInstanced = function (...what) {
  const without = this.seenThrough && this.backs && this.writesDepth !== false;
  if (without) depthMask.call(this, false);
  drawElementsInstanced.apply(this, what);
  if (without) depthMask.call(this, true);
};
}</script>"""
"""viser's copies of a mesh write depth however much one sees through them, and cannot be told not
to: a body would hide whatever ellipsoid is behind it. Those of which the backs alone are drawn, as
bodies are, do not so here."""

LABELS_WEAR_THE_THEME = b"""<script>{
const gl = WebGL2RenderingContext.prototype;
const { shaderSource, useProgram } = gl;
const THEMES = {};
const PAINTED = [
  ["ink", "gl_FragColor = vec4(0.0, 0.0, 0.0, "],
  ["ground", "gl_FragColor = vec4(1.0, 1.0, 1.0, "],
];
gl.shaderSource = function (shader, text) {
  if (text.includes("varying float vAlpha;"))
    for (const [name, paints] of PAINTED)
      if (text.includes(paints))
        text = text
          .replace("void main", `uniform vec3 ${name};\nvoid main`)
          .replace(paints, `gl_FragColor = vec4(${name}, `);
  shaderSource.call(this, shader, text);
};
const places = new WeakMap();
gl.useProgram = function (program) {
  useProgram.call(this, program);
  if (!program) return;
  if (!places.has(program))
    places.set(program, PAINTED.map(([name]) => [name, this.getUniformLocation(program, name)])
      .filter(([, place]) => place));
  const theme = document.documentElement.dataset.mantineColorScheme;
  for (const [name, place] of places.get(program))
    this.uniform3fv(place, (THEMES[theme] ?? THEMES.dark)[name]);
};
}</script>""".replace(
    b"{};",
    json.dumps(
        {
            theme: {
                name: [round(value / 255.0, 4) for value in colour]
                for name, colour in (("ink", palette.ink), ("ground", palette.canvas))
            }
            for theme, palette in PALETTES.items()
        }
    ).encode()
    + b";",
    1,
)
"""viser writes its labels black on white in both themes, which glares on a dark ground: here their
two shaders take ink and ground of the theme."""

INSIDE = b'e.type="module";'
"""Where viser's client, which travels packed, puts itself into its page as a script."""

START_SECONDS = 15.0
"""How long a request waits for viser while it starts."""

router = APIRouter(include_in_schema=False)


class Gateway:
    """viser's server, its page, and where its socket is."""

    def __init__(self) -> None:
        self.entrance = Entrance()
        self._ready: asyncio.Event | None = None
        self._page = b""
        self._policy = ""
        self._etag = ""

    def prepare(self) -> None:
        """Called on the event loop that serves, before viser is there."""
        self._ready = asyncio.Event()

    def started(self) -> None:
        """viser listens; called on the event loop."""
        import viser

        page = Path(viser.__file__).parent / "client" / "build" / "index.html"
        head, mark, rest = page.read_bytes().partition(b"<head>")
        scripts = (
            HAS_FOCUS + RENDERER_IS_TOLD_OUTSIDE + BACKS_WRITE_NO_DEPTH + LABELS_WEAR_THE_THEME
        )
        whole = head + mark + scripts + rest
        nonce = secrets.token_urlsafe(16)
        said = f'nonce="{nonce}"'.encode()
        self._page = whole.replace(b"<script", b"<script " + said).replace(
            INSIDE, INSIDE + b"e." + said + b";"
        )
        self._policy = CONTENT_POLICY.format(nonce=nonce)
        self._etag = f'"{hashlib.sha256(self._page).hexdigest()[:20]}"'
        if self._ready is not None:
            self._ready.set()

    async def there(self) -> None:
        """Done as soon as viser listens.

        Raises:
            ApiError: If it does not in time.
        """
        try:
            if self._ready is None:
                raise TimeoutError
            await asyncio.wait_for(self._ready.wait(), START_SECONDS)
        except TimeoutError:
            raise ApiError(
                503,
                "viser_not_running",
                "The 3D view is not running.",
                hint="Look at the terminal for the reason, then start the workbench again.",
            ) from None

    async def page(self, request: Request) -> Response:
        """viser's client, which is one file."""
        await self.there()
        headers = {
            "cache-control": "no-cache",
            "etag": self._etag,
            "content-security-policy": self._policy,
        }
        if request.headers.get("if-none-match") == self._etag:
            return Response(status_code=304, headers=headers)
        return Response(self._page, media_type="text/html; charset=utf-8", headers=headers)

    async def relay(self, socket: WebSocket) -> None:
        """Pass messages both ways until either side ends."""
        from websockets.exceptions import InvalidHandshake

        try:
            await self.there()
            upstream = await self.entrance.connect(socket.scope["subprotocols"])
        except (ApiError, OSError, TimeoutError, InvalidHandshake):
            await socket.close(1013, "the 3D view is not running")
            return
        try:
            async with upstream:
                await socket.accept(upstream.subprotocol)
                up = asyncio.create_task(_to_viser(socket, upstream))
                down = asyncio.create_task(_to_browser(upstream, socket))
                try:
                    await asyncio.wait({up, down}, return_when=asyncio.FIRST_COMPLETED)
                finally:  # also where a server that ends cancels this
                    up.cancel()
                    down.cancel()
                    await asyncio.gather(up, down, return_exceptions=True)
        finally:  # a server that ends cancels this even while it says goodbye
            upstream.transport.abort()
            await asyncio.sleep(0)
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # the browser went first
            code = upstream.close_code
            await socket.close(
                code if code not in (None, 1005, 1006) else 1001, upstream.close_reason or ""
            )


async def _to_viser(socket: WebSocket, upstream: ClientConnection) -> None:
    while (message := await socket.receive())["type"] == "websocket.receive":
        data = message.get("bytes")
        await upstream.send(data if data is not None else message["text"])


async def _to_browser(upstream: ClientConnection, socket: WebSocket) -> None:
    async for message in upstream:
        if isinstance(message, bytes):
            await socket.send_bytes(message)
        else:
            await socket.send_text(message)


@router.get("/viser")
async def _redirect() -> RedirectResponse:
    return RedirectResponse("/viser/", 307)


@router.get("/viser/")
async def _page(request: Request) -> Response:
    gateway: Gateway = request.app.state.gateway
    return await gateway.page(request)


@router.websocket("/viser")
async def _socket(socket: WebSocket) -> None:
    gateway: Gateway = socket.app.state.gateway
    await gateway.relay(socket)


@router.websocket("/viser/")
async def _socket_with_slash(socket: WebSocket) -> None:
    await _socket(socket)
