"""Every command that the manual and the README print is one that the program takes."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
from collections.abc import Iterator

import pytest

from app.command.flags import parse
from tests.manual.places import PAGES, ROOT

PROGRAM = re.compile(r"(?:^|&& )(?:\S+=\S+ )*(?:\.venv/bin/)?multiview-phd (.+)$")
MADE = ("command-line.md", "tuning.md")
"""Pages that are made from what the program answers itself."""


def commands() -> Iterator[str]:
    """The arguments of each command in a block of shell, without its comment."""
    for path in [ROOT / "README.md", *sorted(PAGES.glob("*.md"))]:
        if path.name in MADE:
            continue
        for block in re.findall(r"```sh\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL):
            for line in block.replace("\\\n", " ").splitlines():
                if found := PROGRAM.search(line):
                    yield found[1]


def answer_to(arguments: str) -> tuple[object, str]:
    """The status at which the arguments are refused, 0 where they are taken, and what is said."""
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()) as said,
    ):
        try:
            parse(shlex.split(arguments, comments=True))
        except SystemExit as ended:
            return ended.code, said.getvalue()
    return 0, ""


@pytest.mark.parametrize("arguments", sorted(set(commands())))
def test_the_program_takes_it(arguments: str) -> None:
    status, said = answer_to(arguments)
    assert status == 0, said
