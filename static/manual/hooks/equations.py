"""Equations: ``$…$`` and ```` ```math ```` become MathML, which browsers draw without a script."""

from __future__ import annotations

import re
from typing import Any

from latex2mathml.converter import convert

_CODE = re.compile(
    r"^(?P<fence>`{3,})(?P<kind>\S*)[^\n]*\n(?P<body>.*?)^(?P=fence)$|`[^`\n]+`", re.M | re.S
)
_INLINE = re.compile(r"(?<![\\$])\$(?!\s)([^$\n]+?)(?<!\s)\$(?!\d)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """MkDocs asks this of every page before it reads the Markdown."""
    parts, at = [], 0
    for code in _CODE.finditer(markdown):
        parts.append(_inline(markdown[at : code.start()]))
        if code["kind"] == "math":
            parts.append(
                f'<div class="equation">{convert(code["body"].strip(), display="block")}</div>\n'
            )
        else:
            parts.append(code[0])
        at = code.end()
    parts.append(_inline(markdown[at:]))
    return "".join(parts)


def _inline(text: str) -> str:
    # in a span: Markdown takes an element that it does not know for a block of its own
    return _INLINE.sub(lambda found: f"<span>{convert(found[1])}</span>", text)
