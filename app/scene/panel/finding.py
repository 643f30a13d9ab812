"""Which parameters somebody looks for: the words of a filter over all that a parameter says."""

from __future__ import annotations

from tracker.parameters.catalogue import PARAMETERS, Parameter


def matches(parameter: Parameter, text: str) -> bool:
    """Whether a parameter's name, symbol, key, unit or help has all words of a text."""
    said = " ".join(
        (parameter.label, parameter.symbol, parameter.key, parameter.unit, parameter.help)
    ).lower()
    return all(word in said for word in text.lower().split())


def found(shown: set[str], changed: set[str], text: str, *, only_changed: bool) -> set[str]:
    """The keys to list; all that are shown where nothing is asked for.

    Args:
        shown: Keys that have an effect now.
        changed: Keys whose value is not the default.
        text: Of the filter.
        only_changed: Whether the others are left out.
    """
    keys = {key for key in shown if key in PARAMETERS}
    if only_changed:
        keys &= changed
    return {key for key in keys if matches(PARAMETERS[key], text)}


def title(words: str, count: int, changed: int) -> str:
    """Of a folder: what it is about, how much is in it, how much was changed."""
    return f"{'• ' if changed else ''}{words} · {count}" + (
        f", {changed} changed" if changed else ""
    )
