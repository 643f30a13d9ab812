"""Elements of the sheet, and how its controls say what they wish.

A control with ``data-wish`` has the changes that it makes of the wish, as JSON; in them ``"$"``
stands for the control's value and ``"#"`` for its number times ``data-scale``. A control with
``data-do`` does what the page has under that name.
"""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any


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


def joined(*cells: Cell) -> Markup:
    """Several things in one cell."""
    return Markup("".join(written(cell) for cell in cells))


Child = Cell | bool | Iterable[Markup]

VOID = frozenset({"input", "img"})


def element(tag: str, *children: Child, **attributes: Any) -> Markup:
    """An element; names of attributes have ``_`` for ``-``, and ``class_`` is ``class``.

    Args:
        tag: Its name.
        children: Texts are escaped; None and False are left out.
        attributes: True is an attribute without a value, None and False are none; what is no text
            or number becomes JSON.
    """
    written_attributes = []
    for name, value in attributes.items():
        if value is None or value is False:
            continue
        name = name.rstrip("_").replace("_", "-")
        if value is True:
            written_attributes.append(f" {name}")
            continue
        text = value if isinstance(value, str | int | float) else json.dumps(value)
        written_attributes.append(f' {name}="{escaped(text)}"')
    begin = f"<{tag}{''.join(written_attributes)}>"
    if tag in VOID:
        return Markup(begin)
    return Markup(f"{begin}{''.join(_children(children))}</{tag}>")


def _children(children: Iterable[Child]) -> Iterable[str]:
    for child in children:
        if child is None or isinstance(child, bool):
            continue
        if isinstance(child, Markup | str | int | float):
            yield written(child)
        else:
            yield from (one.html for one in child)


def icon(name: str, kind: str = "") -> Markup:
    """A symbol of the page."""
    return Markup(f'<svg class="i {kind}"><use href="#i-{name}" /></svg>')


def button(words: Child, do: str, kind: str = "box", **attributes: Any) -> Markup:
    """A button that does something of the page's."""
    return element("button", words, class_=f"btn {kind}", data_do=do, **attributes)


def wishing(words: Child, wish: dict[str, Any], kind: str = "box", **attributes: Any) -> Markup:
    """A button that changes the wish."""
    return element("button", words, class_=f"btn {kind}", data_wish=wish, **attributes)


def field(name: str, label: str, value: object, wish: dict[str, Any], **attributes: Any) -> Markup:
    """A field that changes the wish."""
    return element(
        "input", id=name, aria_label=label, value=value, data_wish=wish, autocomplete="off",
        **{"type": "text"} | attributes,
    )  # fmt: skip


def number_field(
    name: str, label: str, value: float, wish: dict[str, Any], digits: int = 2, **attributes: Any
) -> Markup:
    """A field for a number that changes the wish."""
    return field(
        name, label, f"{value:.{digits}f}", wish, **{"type": "number", "step": "any"} | attributes
    )


def select(
    name: str,
    label: str,
    choices: Iterable[tuple[str, str]],
    now: str,
    wish: dict[str, Any],
    off: Mapping[str, str] | None = None,
) -> Markup:
    """A choice that changes the wish.

    Args:
        name: Of the element.
        label: What is chosen.
        choices: Values and words.
        now: The value.
        wish: As of every control.
        off: Values that cannot be chosen, each with the reason.
    """
    why = off or {}
    options = [
        element(
            "option", words, value=value, selected=value == now, disabled=value in why,
            title=why.get(value),
        )
        for value, words in choices
    ]  # fmt: skip
    return element("select", options, id=name, aria_label=label, data_wish=wish)


def segment(label: str, choices: Iterable[str], now: str, wish: str) -> Markup:
    """Buttons beside each other, one of them pressed."""
    buttons = [
        element(
            "button", one.replace("-", "−"), aria_pressed=str(one == now).lower(),
            data_wish={wish: one},
        )
        for one in choices
    ]  # fmt: skip
    return element("div", buttons, class_="seg", role="group", aria_label=label)


def heading(words: str, *beside: Child) -> Markup:
    """The head of a part, and what stands beside it."""
    return element("h3", words, *beside, class_="h")


def small(text: Child, **attributes: Any) -> Markup:
    """Text that stands back."""
    return element("span", text, **{"class_": "small"} | attributes)


GROW = Markup('<span class="grow"></span>')
CLOSE = Markup(
    '<button class="btn icon" aria-label="Close" data-do="close">'
    '<svg class="i"><use href="#i-close" /></svg></button>'
)


def size_text(bytes_: float) -> str:
    """Bytes as a person reads them."""
    return f"{bytes_ / 1e6:.1f} MB" if bytes_ < 1e9 else f"{bytes_ / 1e9:.1f} GB"
