"""viser behind our port: its page under ``/viser/``, its socket proxied from ``/viser``.

viser checks neither Host nor Origin nor who asks; everything reaches it through here, past our
own checks, by the one entrance that it has. Its client asks for its socket at the address of its
own page without the last slash.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import APIRouter, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import RedirectResponse, Response

from app.colours import PALETTES
from app.errors import ApiError
from app.web.access.viewer import Entrance

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

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
                _, pending = await asyncio.wait({up, down}, return_when=asyncio.FIRST_COMPLETED)
                for task in pending:
                    task.cancel()
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
