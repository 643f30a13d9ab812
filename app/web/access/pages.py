"""The few pages that stand before the workbench: plain, without a script."""

from __future__ import annotations

import base64
import hashlib
import html
from collections.abc import Iterable

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
