"""Tables as HTML: everything that comes from outside is escaped here and nowhere else."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from app.colours import track_index


@dataclass(frozen=True, slots=True)
class Markup:
    """Text that is HTML already."""

    html: str


Cell = Markup | str | int | float | None


def escaped(value: object) -> str:
    """Anything as text of a page."""
    return html.escape(str(value))


def written(cell: Cell) -> str:
    """A cell's content as HTML; a dash where there is nothing."""
    if isinstance(cell, Markup):
        return cell.html
    return "–" if cell is None else escaped(cell)


def number(value: float | None, digits: int, *, signed: bool = False) -> str:
    """A number with fixed digits and a true minus; a dash where there is none."""
    if value is None or value != value:
        return "–"
    text = f"{abs(value):.{digits}f}"
    if float(text) == 0.0:
        return text
    return f"−{text}" if value < 0 else f"+{text}" if signed else text


def value_text(value: Any) -> str:
    """A parameter's value as a person reads it; methods and choices by their own names."""
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, float):
        return f"{value:.5g}".replace("-", "−")
    return "–" if value is None else str(value)


def vector(values: Iterable[float]) -> str:
    """Coordinates in metres."""
    return "  ".join(number(value, 2) for value in values)


def id_tag(track: int) -> Markup:
    """The coloured number of a track."""
    n = track_index(track) + 1
    return Markup(
        f'<span class="id" style="--c:var(--id-{n});--on-id:var(--on-{n})">{int(track)}</span>'
    )


def symbol(text: str) -> Markup:
    """A symbol such as ``p_S`` with its subscript."""
    base, _, index = text.partition("_")
    lowered = f"<sub>{escaped(index)}</sub>" if index else ""
    return Markup(f"<i>{escaped(base)}</i>{lowered}")


def quiet(text: object) -> Markup:
    """Text in a muted colour."""
    return Markup(f'<span class="q">{escaped(text)}</span>')


def joined(*cells: Cell) -> Markup:
    """Several things in one cell."""
    return Markup("".join(written(cell) for cell in cells))


def button(words: Cell, action: str, value: object = "", *, label: str = "") -> Markup:
    """A button that does one of the page's actions with a value.

    Args:
        words: What is written on it.
        action: A name of the page's actions.
        value: Its argument.
        label: What it is called, where its words do not say it.
    """
    name = f' aria-label="{escaped(label)}"' if label else ""
    return Markup(
        f'<button class="btn" data-do="{escaped(action)}" data-value="{escaped(value)}"{name}>'
        f"{written(words)}</button>"
    )


def table(label: str, heads: Sequence[str], rows: Iterable[Sequence[Cell]]) -> str:
    """A table.

    Args:
        label: What it is a table of.
        heads: Words of the columns; a ``#`` in front means numbers, at the right.
        rows: One cell a column.
    """
    kinds = ["num" if head.startswith("#") else "" for head in heads]
    top = "".join(
        f'<th scope="col" class="{kind}">{escaped(head.removeprefix("#"))}</th>'
        if head.strip("#")
        else '<th scope="col"><span class="vh">Actions</span></th>'
        for head, kind in zip(heads, kinds, strict=True)
    )
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="{kind}">{written(cell)}</td>'
            for cell, kind in zip(row, kinds, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    return (
        f'<table aria-label="{escaped(label)}"><thead><tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table>"
    )


def line(*cells: Cell) -> str:
    """A line of words above or below a table."""
    return f'<p class="words">{joined(*cells).html}</p>'


def blank(title: str, text: str) -> str:
    """What stands where there is nothing to list: what belongs here, or what to do."""
    return f'<div class="blank"><h3>{escaped(title)}</h3><p>{escaped(text)}</p></div>'
