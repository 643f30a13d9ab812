"""Text of others as a terminal or a message may show it: what cannot be printed is written out.

A name may hold escape sequences that move a terminal's cursor, or signs that turn the direction
of writing: then what is read is not what is there.
"""

from __future__ import annotations


def visible(text: str) -> str:
    """The text on one line, every character that cannot be printed as its escape, ``\\x1b``."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    code = ord(character)
    if code < 0x100:
        return f"\\x{code:02x}"
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
