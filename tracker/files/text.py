"""Text of others: where it is none, and as a terminal or a message may show it.

What cannot be printed is written out: a name may hold escape sequences that move a terminal's
cursor, or signs that turn the direction of writing, and then what is read is not what is there.
"""

from __future__ import annotations

from typing import Any


def visible(text: str) -> str:
    """The text on one line, every character that cannot be printed as its escape, ``\\x1b``."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escaped(c) for c in text)


def shown(value: Any) -> str:
    """A value as a message shows it: short, in TOML's notation."""
    try:
        text = "true" if value is True else "false" if value is False else repr(value)
    except ValueError:  # Python writes no whole number of thousands of digits
        return "a number with thousands of digits"
    if isinstance(value, str):
        text = f'"{value}"'
    return text if len(text) <= 60 else f"{text[:57]}…"


def not_utf_8(error: UnicodeDecodeError) -> str:
    """What a message says of a file that is no text, after the file's name and a comma."""
    line = error.object.count(b"\n", 0, error.start) + 1
    found = f"found byte 0x{error.object[error.start]:02x}"
    return f"line {line}: expected text in UTF-8, {found}; save the file as UTF-8"


def _escaped(character: str) -> str:
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
