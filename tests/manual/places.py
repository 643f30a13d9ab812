"""Where the manual's texts and records are, and its pages that are made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MANUAL = ROOT / "static" / "manual"
PAGES = MANUAL / "pages"
RECORDS = MANUAL / "records"

BEGIN = "<!-- made by python3 -m tests.manual: {} -->"
END = "<!-- end -->"


def between(text: str, name: str, made: str) -> str:
    """A text with what stands between its two marks made anew.

    Raises:
        ValueError: If the text has no such marks.
    """
    head, begin, rest = text.partition(BEGIN.format(name))
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"expected the marks {BEGIN.format(name)} … {END}")
    return f"{head}{begin}\n\n{made.strip()}\n\n{end}{tail}"


def made_pages() -> dict[Path, Callable[[], str]]:
    """Every file that is made, whole or in part, and how."""
    from tests.manual import command_line, commands, packages, tuning
    from tests.manual.records import results
    from tracker.export import json_file

    return {
        PAGES / "command-line.md": command_line.page,
        PAGES / "commands.md": commands.page,
        PAGES / "architecture.md": packages.page,
        PAGES / "tuning.md": tuning.page,
        PAGES / json_file.SCHEMA_PLACE: json_file.published,
        PAGES / "results.md": results.page,
        ROOT / "README.md": results.readme,
    }
