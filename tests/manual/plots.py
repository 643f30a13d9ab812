"""Small drawings of a record, as SVG that takes its colours from the page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import log10
from typing import Any

from app.command.flags import show
from tracker.parameters.catalogue import Parameter

PANELS = ("found", "false a step", "error, m")
LOWEST_TOP = (1.0, 0.1, 0.1)
"""A panel's scale begins at 0 and reaches at least so far: noise must not look like an effect."""

WIDTH, HEIGHT = 540, 122
PANEL, GAP, TOP, BOTTOM = 150, 30, 22, 90


def picture(parameter: Parameter, sweep: dict[str, Any]) -> str:
    """Three panels side by side over the values that were tried.

    Args:
        parameter: Whose values.
        sweep: ``points``: value, found share, false a step, error in metres, of each run; with
            the ``sequence`` and the number of ``steps``.
    """
    values = [point[0] for point in sweep["points"]]
    places = _places(parameter, values)
    words = f"{parameter.label}: {sweep['steps']} steps of {sweep['sequence']}"
    parts = [
        f'<svg class="sweep" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(words)}"><title>{escape(words)}</title>'
    ]
    for index, title in enumerate(PANELS):
        left = 8 + index * (PANEL + GAP)
        column = [point[index + 1] for point in sweep["points"]]
        parts += _panel(parameter, title, left, places, values, column, LOWEST_TOP[index])
    return "".join([*parts, "</svg>"])


def _places(parameter: Parameter, values: Sequence[Any]) -> list[float]:
    """Where values stand on a panel's width, 0 … 1."""
    if parameter.kind in ("bool", "choice") or len(values) == 1:
        return [(k + 0.5) / len(values) for k in range(len(values))]
    scaled = [log10(value) if parameter.log else float(value) for value in values]
    low, high = min(scaled), max(scaled)
    return [(value - low) / (high - low) for value in scaled]


def _panel(
    parameter: Parameter,
    title: str,
    left: float,
    places: list[float],
    values: Sequence[Any],
    column: Sequence[float | None],
    lowest_top: float,
) -> list[str]:
    top = max([lowest_top, *(value for value in column if value is not None)])
    known = [
        (left + place * PANEL, BOTTOM - value / top * (BOTTOM - TOP), value)
        for place, value in zip(places, column, strict=True)
        if value is not None
    ]
    parts = [
        f'<text x="{left}" y="12">{escape(title)}</text>',
        f'<text x="{left + PANEL}" y="12" text-anchor="end" opacity=".6">{top:.3g}</text>',
        f'<path class="axis" d="M{left} {TOP}V{BOTTOM}H{left + PANEL}"/>',
    ]
    if parameter.default in values:
        x = left + places[list(values).index(parameter.default)] * PANEL
        parts.append(f'<path class="default" d="M{x:.1f} {TOP}V{BOTTOM}"/>')
    if parameter.kind in ("float", "int") and known:
        line = "L".join(f"{x:.1f} {y:.1f}" for x, y, _ in known)
        parts.append(f'<path class="curve" d="M{line}"/>')
    parts += [
        f'<circle class="dot" cx="{x:.1f}" cy="{y:.1f}" r="3"><title>{value:g}</title></circle>'
        for x, y, value in known
    ]
    return [*parts, *_scale(parameter, left, places, values)]


def _scale(
    parameter: Parameter, left: float, places: list[float], values: Sequence[Any]
) -> list[str]:
    """Words below: the ends of a range, or every choice."""
    y = BOTTOM + 14
    if parameter.kind in ("float", "int"):
        ends = ((0, "start", values[0]), (PANEL, "end", values[-1]))
        return [
            f'<text x="{left + x}" y="{y}" text-anchor="{side}">{show(value)}</text>'
            for x, side, value in ends
        ]
    # choices stand on two lines in turn, since their words are longer than their places
    return [
        f'<text x="{left + place * PANEL:.1f}" y="{y + 12 * (k % 2)}" text-anchor="middle" '
        f'font-size="9">{escape(show(value).replace("_", " "))}</text>'
        for k, (place, value) in enumerate(zip(places, values, strict=True))
    ]
