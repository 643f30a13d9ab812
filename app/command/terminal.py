"""What every command does with a terminal: say a sentence, show a bar, print a table."""

from __future__ import annotations

import json
import shutil
import sys
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tracker.files.text import visible
from tracker.parameters.values import ParameterError

FAILURE = 1
"""The status of a command that could not do what was asked, or found what must not be."""

ASKED = 3
"""The status of an import whose files leave open how they are meant."""

REFUSED = 4
"""The status of an import whose boxes no interpretation explains."""


class CommandError(Exception):
    """A failure with its sentence."""


def check_data(data: Path | None) -> None:
    """Whether ``--data`` names a folder.

    Raises:
        CommandError: If not.
    """
    if data is not None and not data.is_dir():
        raise CommandError(f"--data {data}: expected a folder, found none")


def say(text: str) -> None:
    """One line on standard error; what of names and paths cannot be printed is written out."""
    sys.stderr.write(f"multiview-phd: {visible(text)}\n")
    sys.stderr.flush()


def rate(value: float) -> str:
    """A rate in whole numbers from 10 on, below in two significant figures: 0.43, not 0."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


class Bar:
    """A progress bar on standard error, from the first step on, and only on a terminal."""

    def __init__(self, words: str, unit: str) -> None:
        self._words = words
        self._unit = unit
        self._bar: Any = None

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def at(self, done: int, total: int | None) -> None:
        """Show that ``done`` of ``total`` units are done; None where nobody knows how many."""
        if self._bar is None:
            from tqdm import tqdm

            self._bar = tqdm(
                total=total, desc=self._words, unit=self._unit, disable=None, file=sys.stderr
            )
        self._bar.update(done - self._bar.n)


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Aligned columns; on a terminal the last one is wrapped, in a file every row is a line.

    Args:
        head: The columns' names; one that begins with ``>`` stands over numbers.
        rows: Cells of text.
    """
    rows = [[visible(cell) for cell in row] for row in rows]
    head = [visible(name) for name in head]
    right = [name.startswith(">") for name in head]
    names = [name.removeprefix(">") for name in head]
    widths = [max(map(len, column)) for column in zip(names, *rows, strict=True)]
    if not right[-1]:
        widths[-1] = 0
    indent = sum(widths) + 2 * (len(widths) - 1)
    wrap: Callable[[str], list[str]] = lambda text: [text]  # noqa: E731
    if sys.stdout.isatty() and not right[-1]:
        room = shutil.get_terminal_size().columns - indent - 1
        wrap = lambda text: textwrap.wrap(text, max(room, 30)) or [""]  # noqa: E731
    for row in (names, *rows):
        first, *others = wrap(row[-1])
        cells = [
            cell.rjust(width) if numbers else cell.ljust(width)
            for cell, width, numbers in zip([*row[:-1], first], widths, right, strict=True)
        ]
        sys.stdout.write("  ".join(cells).rstrip() + "\n")
        sys.stdout.writelines(" " * indent + line + "\n" for line in others)


def print_json(value: Any) -> None:
    """One line on standard output, for programs; characters that cannot be printed as escapes."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=False)
    if not text.isprintable():
        text = json.dumps(value, allow_nan=False)
    sys.stdout.write(text + "\n")


def check_keep(keep: int) -> None:
    if keep < 0:
        raise ParameterError("--keep", f"expected a whole number from 0, got {keep}")


def check_seed(seed: int, flag: str = "--seed") -> None:
    if seed < 0:
        raise ParameterError(flag, f"expected a whole number from 0, got {seed}")
