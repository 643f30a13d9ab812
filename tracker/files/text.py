"""Untrusted text made safe for a terminal or a message.

Characters that cannot be printed are escaped: a name may contain escape sequences that move the
cursor of a terminal, or characters that reverse the direction of writing, and would then be
displayed as something else than it is.
"""

from __future__ import annotations

from typing import Any


def visible(text: str) -> str:
    """Return the text on one line, with characters that cannot be printed as escapes, ``\\x1b``."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escaped(c) for c in text)


def shown(value: Any) -> str:
    """Format a value for a message: at most 60 characters, in TOML's notation."""
    try:
        text = "true" if value is True else "false" if value is False else repr(value)
    except ValueError:  # Python refuses to write integers of thousands of digits
        return "a number with thousands of digits"
    if isinstance(value, str):
        text = f'"{visible(value)}"'
    return text if len(text) <= 60 else f"{text[:57]}…"


def not_utf_8(error: UnicodeDecodeError) -> str:
    """Describe where a file is not UTF-8; a message puts it after the file's name and a comma."""
    line = error.object.count(b"\n", 0, error.start) + 1
    found = f"found byte 0x{error.object[error.start]:02x}"
    return f"line {line}: expected text in UTF-8, {found}; save the file as UTF-8"


def _escaped(character: str) -> str:
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
