"""Who may use the workbench: whoever came by the link that its start prints.

Other people of the same machine reach its port as well as its owner does, so every start makes a
token. The link carries it once; the browser then keeps it as a cookie that no script reads and
that no other site's request is sent with. Programs send it as ``Authorization: Bearer TOKEN``.
A link on another page is followed only when the person says so: it may open another recording
and set values. The few pages that stand before the workbench are plain, without a script.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import html
import re
import secrets
from collections.abc import Iterable, Mapping
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.responses import HTMLResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.errors import ErrorDetail
from app.web.access.security import comes_from_elsewhere, goes_to_a_page, refuse

STYLE = """
:root { color-scheme: light dark; font: 16px/1.6 system-ui, sans-serif; }
body { max-width: 40rem; margin: 4rem auto; padding: 0 1rem; }
code, input { font: 14px/1.6 ui-monospace, monospace; }
input { width: 24rem; max-width: 100%; }
input, button, .go { padding: 0.3rem 0.6rem; }
.go { border: 1px solid; border-radius: 4px; text-decoration: none; }
"""

CONTENT_POLICY = (
    "default-src 'none'; style-src 'sha256-"
    f"{base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()}'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
"""Of these pages: their own style and nothing else."""

LONGEST = 200
"""Characters of somebody else's words that are shown."""


def _page(title: str, content: str, head: str = "") -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8">{head}'
        f"<title>{title} · multiview-phd</title><style>{STYLE}</style></head>"
        f"<body><h1>{title}</h1>{content}</body></html>"
    )


def closed(others: Iterable[tuple[str, str]], told: bool) -> str:
    """What whoever has no token reads.

    Args:
        others: Of the address, to be gone to with the token.
        told: Whether there was a token, which is not the one of this start.
    """
    hidden = "".join(
        f'<input type="hidden" name="{html.escape(name)}" value="{html.escape(value)}">'
        for name, value in others
    )
    why = (
        "<p>The token in this link is not, or no longer, the one of this workbench: each start "
        "makes another.</p>"
        if told
        else ""
    )
    return _page(
        "This workbench wants its token",
        f"{why}<p>Open the link that <code>multiview-phd serve</code> printed in its terminal when "
        "it started. It ends in <code>?token=…</code>, and this browser then keeps the token until "
        "it is closed. Or put the token in here:</p>"
        f'<form action="/" method="get">{hidden}<p><label>Token <input name="token" '
        'autocomplete="off" autofocus required></label> <button>Open</button></p></form>'
        "<p>This keeps other users of this machine, and other pages in this browser, from reading "
        "and changing your recordings. <code>$MULTIVIEW_PHD_TOKEN</code> chooses a token of your "
        "own, and <code>--no-token</code> does without one.</p>",
    )


def asks(address: str, sequence: str | None) -> str:
    """What is asked of whoever comes by a link on another page.

    Args:
        address: Where it leads: path and query.
        sequence: The recording that it would open, if it names one.
    """
    shown = html.escape((sequence or "")[:LONGEST])
    what = (
        f"It would open the recording <code>{shown}</code>, and may set values."
        if sequence
        else "It may show another place, and set values."
        if "?" in address
        else "It leads to the workbench."
    )
    go, whole = html.escape(address), "" if address == "/" else ' <a href="/">No, as it was</a>'
    return _page(
        "A link on another page led here",
        f"<p>{what} Go on only if that is what you want.</p>"
        f'<p><a class="go" href="{go}">Go on</a>{whole}</p>',
    )


def welcome(address: str) -> str:
    """What is seen for a moment by whoever came with the token: it goes on without it."""
    go = html.escape(address)
    return _page(
        "Opening the workbench",
        f'<p><a class="go" href="{go}">Go on</a></p>',
        f'<meta http-equiv="refresh" content="0;url={go}">',
    )


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
                answer = HTMLResponse(asks(address, dict(others).get("sequence")), 403)
            elif not known:
                answer = HTMLResponse(closed(others, bool(told)), 401)
        if answer is not None:
            answer.headers["content-security-policy"] = CONTENT_POLICY
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
        answer = HTMLResponse(welcome(address))
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
