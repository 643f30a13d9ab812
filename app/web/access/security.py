"""Who may talk to the server: known hosts, writes and sockets of our own page, small bodies.

Loopback keeps other machines out. The Host check keeps out pages whose domain name was
re-pointed to this machine (DNS rebinding); the Origin check keeps out writes and sockets of
other pages in the same browser (cross-site requests), those of the embedded 3D view included;
what browsers say of who asks keeps them from having pictures, scripts or frames of ours.
"""

from __future__ import annotations

import asyncio
import ipaddress
import json
import socket
from collections.abc import Iterable
from urllib.parse import urlsplit

from fastapi import HTTPException
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import PROBLEM, ErrorDetail, body

LARGEST_BODY = 1 << 20
"""Bytes of a request's body; what people send are a few numbers."""

SECONDS_TO_SEND = 60.0
"""For a request's body."""

READING = frozenset({"GET", "HEAD", "OPTIONS"})
LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})

CONTENT_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' blob: data:; connect-src 'self'; frame-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; "
    "require-trusted-types-for 'script'; trusted-types 'none'"
)
"""Of the page itself: no script or style in it, nothing from another host, and no other page may
frame it. No text becomes an element or a script (Trusted Types): the page makes its elements one
by one."""

NOTHING = (
    "default-src 'none'; style-src 'unsafe-inline'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; sandbox"
)
"""Of whatever is no page: where a browser opens it as one, nothing in it runs."""

DOCS = (
    "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Of the page of the routes: its frame, which FastAPI writes, has a script in it."""


def is_loopback(host: str) -> bool:
    """Whether a server bound to ``host`` is reached from this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def allowed_hosts(host: str) -> frozenset[str]:
    """The names under which a server bound to ``host`` may be asked."""
    if is_loopback(host):
        return LOOPBACK_NAMES | {host}
    return LOOPBACK_NAMES | {host, socket.gethostname().lower(), socket.getfqdn().lower()}


class Guard:
    """ASGI middleware that refuses what is not ours, before anything else sees it."""

    def __init__(
        self, app: ASGIApp, *, hosts: Iterable[str], addresses_are_fine: bool = False
    ) -> None:
        """
        Args:
            app: What is guarded.
            hosts: Names in the Host header that are answered, without port.
            addresses_are_fine: Answer to any numeric address too: a server that others may
                reach does not know all of its own, and DNS rebinding needs a name.
        """
        self._app = app
        self._hosts = frozenset(hosts)
        self._addresses_are_fine = addresses_are_fine

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers, send = Headers(scope=scope), _framed(scope, send)
        refusal = self._refusal(scope, headers)
        if refusal is None and scope["type"] == "http" and scope["method"] not in READING:
            length = headers.get("content-length", "0")
            if length.isdigit() and int(length) > LARGEST_BODY:
                refusal = (413, _too_large())
            receive = _limited(receive)
        if refusal is not None:
            await refuse(scope, receive, send, *refusal)
            return
        await self._app(scope, receive, send)

    def _refusal(self, scope: Scope, headers: Headers) -> tuple[int, ErrorDetail] | None:
        host = headers.get("host", "")
        if not self._is_known(host):
            return 421, ErrorDetail(
                code="foreign_host",
                message=f"This server does not answer to the host {host[:100]!r}.",
                field="Host",
                hint="Open it as http://localhost with its port, or start it with --host.",
            )
        origin = headers.get("origin")
        writes = scope["type"] == "websocket" or scope["method"] not in READING
        foreign = writes and origin is not None and not _same_place(origin, host)
        if scope["type"] == "http" and not goes_to_a_page(scope, headers):
            # pictures, scripts and frames of other pages, which send no Origin
            foreign = foreign or comes_from_elsewhere(headers)
        if foreign:
            return 403, ErrorDetail(
                code="foreign_origin",
                message=f"A page of {(origin or 'another site')[:100]!r} may not use this server.",
                field="Origin",
                hint="Use the workbench's own page.",
            )
        return None

    def _is_known(self, host: str) -> bool:
        try:
            place = urlsplit(f"//{host}")
            name, _ = place.hostname, place.port
        except ValueError:
            return False
        if name is None or "@" in host:
            return False
        if name in self._hosts:
            return True
        if not self._addresses_are_fine:
            return False
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return True


def goes_to_a_page(scope: Scope, headers: Headers) -> bool:
    """Whether a window goes somewhere, and a person will read the answer."""
    if scope["method"] not in ("GET", "HEAD"):
        return False
    mode = headers.get("sec-fetch-mode")
    if mode is not None:
        return mode == "navigate" and headers.get("sec-fetch-dest", "document") == "document"
    return scope["path"] == "/" or "text/html" in headers.get("accept", "")


def comes_from_elsewhere(headers: Headers) -> bool:
    """Whether a page of another origin made the browser ask.

    Browsers say so (https://www.w3.org/TR/fetch-metadata/); those that do not may name the page.
    """
    site = headers.get("sec-fetch-site")
    if site is not None:
        return site in ("cross-site", "same-site")
    referrer = urlsplit(headers.get("referer", ""))
    return bool(referrer.netloc) and referrer.netloc.lower() != headers.get("host", "").lower()


def _same_place(origin: str, host: str) -> bool:
    """Whether an Origin header names the same host and port as the Host header."""
    scheme, _, place = origin.partition("://")
    return scheme in ("http", "https") and place.lower() == host.lower()


def _too_large() -> ErrorDetail:
    return ErrorDetail(
        code="too_large",
        message=f"The request's body is larger than {LARGEST_BODY} bytes.",
        hint="Send the changes only.",
    )


class BodyTooLarge(HTTPException):
    """A body without a stated length went past the limit, while somebody was reading it."""

    def __init__(self) -> None:
        super().__init__(413, _too_large().message)


class BodyTooSlow(HTTPException):
    """A body that is not there in time."""

    def __init__(self) -> None:
        super().__init__(408, f"The request's body took longer than {SECONDS_TO_SEND:g} s.")


def _limited(receive: Receive) -> Receive:
    received, there = 0, False
    until = asyncio.get_running_loop().time() + SECONDS_TO_SEND

    async def counted() -> Message:
        nonlocal received, there
        if there:  # what is waited for now is that the other side goes
            return await receive()
        try:
            async with asyncio.timeout_at(until):
                message = await receive()
        except TimeoutError:
            raise BodyTooSlow from None
        received += len(message.get("body", b""))
        there = not message.get("more_body", False)
        if received > LARGEST_BODY:
            raise BodyTooLarge
        return message

    return counted


FOR_ALL = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "SAMEORIGIN",
    "referrer-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=(), payment=(), usb=()",
}


def _framed(scope: Scope, send: Send) -> Send:
    """Tell the browser to take types as stated, to run nothing that is not meant to be run, and
    to let no other page frame ours or reach into it."""
    policy = DOCS if scope["path"] == "/docs" else NOTHING

    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.update(FOR_ALL)
            if message["status"] != 304:  # what the browser has keeps the policy that it came with
                headers.setdefault("content-security-policy", policy)
        await send(message)

    return with_headers


async def refuse(
    scope: Scope, receive: Receive, send: Send, status: int, detail: ErrorDetail
) -> None:
    """Answer with an error, or let a socket end before it begins."""
    if scope["type"] == "websocket":
        await receive()  # the request to connect
        await send({"type": "websocket.close", "code": 1008, "reason": detail.code})
        return
    payload = json.dumps(body(status, detail)).encode()
    headers = [
        (b"content-type", PROBLEM.encode()),
        (b"content-length", str(len(payload)).encode()),
        (b"connection", b"close"),
    ]
    if status == 401:
        headers.append((b"www-authenticate", b"Bearer"))
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": payload})


LOOKING = ("/api/seek", "/api/select", "/api/layers", "/api/view", "/api/theme", "/api/exports")
"""What may be written to where a run is only looked at: how it is looked at, and its export."""


class OnlyLooking:
    """Refuses every change of what is shown."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if (
            scope["type"] == "http"
            and scope["method"] not in READING
            and scope["path"].startswith("/api/")
            and scope["path"] not in LOOKING
        ):
            detail = ErrorDetail(
                code="read_only",
                message="This run came in a bundle and is only looked at: nothing can be changed.",
                hint="Serve its sequence folder, or another recording, to compute.",
            )
            await refuse(scope, receive, send, 403, detail)
            return
        await self._app(scope, receive, send)
