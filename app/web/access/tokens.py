"""Who may use the workbench: whoever came by the link that its start prints.

Other people of the same machine reach its port as well as its owner does, so every start makes a
token. The link carries it once; the browser then keeps it as a cookie that no script reads and
that no other site's request is sent with. Programs send it as ``Authorization: Bearer TOKEN``.
A link on another page is followed only when the person says so: it may open another recording
and set values.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Mapping
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.errors import ErrorDetail
from app.web.access import pages
from app.web.access.security import comes_from_elsewhere, goes_to_a_page, refuse

PARAMETER = "token"
"""Of the address in the printed link."""

VARIABLE = "MULTIVIEW_PHD_TOKEN"
"""Environment variable: a token of one's own, the same at every start."""

FEWEST = 16
"""Characters of a token of one's own: fewer may be guessed."""


def new_token() -> str:
    """256 random bits as letters that an address takes."""
    return secrets.token_urlsafe(32)


def own_token(environment: Mapping[str, str]) -> str | None:
    """The token that the environment sets, if it does.

    Raises:
        ValueError: If it is too short, or has letters that an address would change.
    """
    token = environment.get(VARIABLE)
    if token is not None and not re.fullmatch(rf"[A-Za-z0-9_.~-]{{{FEWEST},}}", token):
        raise ValueError(
            f"${VARIABLE}: expected {FEWEST} or more of the letters a to z, A to Z, 0 to 9, -, _, "
            f". and ~, found {len(token)} characters"
            + ("" if len(token) < FEWEST else " with others among them")
            + "; leave it unset to have a new one made at each start"
        )
    return token


class Keys:
    """What opens the workbench: its token, and tickets that open it once."""

    def __init__(self, token: str) -> None:
        self.token = token
        self._digest = _digest(token)
        self._tickets: set[bytes] = set()

    def ticket(self) -> str:
        """A key for one use: what starts a browser shows its address to the whole machine."""
        ticket = new_token()
        self._tickets.add(_digest(ticket))
        return ticket

    def fits(self, told: str) -> bool:
        """Whether it is the token; takes as long for any other one."""
        return hmac.compare_digest(_digest(told), self._digest)

    def opens(self, told: str) -> bool:
        """Whether it is the token, or a ticket, which is used up by it."""
        if self.fits(told):
            return True
        ticket = _digest(told)
        used = ticket in self._tickets  # of 256 bits: how long this takes tells nobody a ticket
        self._tickets.discard(ticket)
        return used


def _digest(words: str) -> bytes:
    return hashlib.sha256(words.encode(errors="surrogatepass")).digest()


class Access:
    """ASGI middleware that lets in whoever has a key, and asks who was led here by another page."""

    def __init__(self, app: ASGIApp, keys: Keys | None) -> None:
        """
        Args:
            app: What is entered.
            keys: None lets everybody in, but still asks.
        """
        self._app = app
        self._keys = keys

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or answer with a page or an error that says what to do."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        known = self._knows(headers)
        looks = scope["type"] == "http" and goes_to_a_page(scope, headers)
        answer: Response | None = None
        if looks:
            query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
            others = [(name, value) for name, value in query if name != PARAMETER]
            # one slash: two would begin the name of another host
            path = "/" + quote(scope["path"].lstrip("/"))
            address = path + (f"?{urlencode(others)}" if others else "")
            told = [value for name, value in query if name == PARAMETER]
            if told and (known or (self._keys is not None and self._keys.opens(told[-1]))):
                answer = self._welcome(address, headers)
            elif (others or not known) and comes_from_elsewhere(headers):
                answer = HTMLResponse(pages.asks(address, dict(others).get("sequence")), 403)
            elif not known:
                answer = HTMLResponse(pages.closed(others, bool(told)), 401)
        if answer is not None:
            answer.headers["content-security-policy"] = pages.CONTENT_POLICY
            answer.headers["cache-control"] = "no-store"
            await answer(scope, receive, send)
        elif known:
            await self._app(scope, receive, send)
        else:
            detail = ErrorDetail(
                code="no_token",
                message="This workbench answers only to whoever has its token.",
                hint="Open the link that its start printed, or send the token as "
                "Authorization: Bearer TOKEN.",
            )
            await refuse(scope, receive, send, 401, detail)

    def _knows(self, headers: Headers) -> bool:
        if self._keys is None:
            return True
        kind, _, token = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and self._keys.fits(token.strip()):
            return True
        name = cookie_name(headers.get("host", ""))
        pairs = [pair.strip().partition("=") for pair in headers.get("cookie", "").split(";")]
        return any(self._keys.fits(value) for key, _, value in pairs if key == name)

    def _welcome(self, address: str, headers: Headers) -> Response:
        """A page that goes on by itself: after a redirect a cookie as strict would not be sent."""
        answer = HTMLResponse(pages.welcome(address))
        if self._keys is not None:
            answer.set_cookie(
                cookie_name(headers.get("host", "")),
                self._keys.token,
                httponly=True,
                samesite="strict",
            )
        return answer


def cookie_name(host: str) -> str:
    """Of a workbench: a browser keeps cookies by host name, whatever the port."""
    return f"multiview-phd-{urlsplit(f'//{host}').port or 80}"
