"""The record as one page: every figure of accuracy and of speed over the commits."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from tests.benchmarks.record import Entry

LINES_HIGH = 260
"""Pixels of one plot."""


def write(entries: list[Entry], file: Path) -> None:
    """An HTML file that needs nothing from anywhere else.

    Accuracy by figure, one line a recording; speed as the factor by which each figure differs
    from the first of its kind of machine and form, so that milliseconds and ratios share an axis.

    Raises:
        ValueError: Without entries.
    """
    if not entries:
        raise ValueError("the record is empty: `multiview-phd benchmark --record` begins it")
    accuracy = _lines(entries, lambda entry: entry.accuracy)
    speed = _lines(entries, lambda entry: entry.speed)
    kinds = sorted({_kind(name) for name in accuracy})
    titles = [*kinds, "Speed, by the first entry of each figure"]
    figure = make_subplots(
        rows=len(titles), cols=1, subplot_titles=titles, vertical_spacing=0.25 / len(titles)
    )
    for name, points in accuracy.items():
        recording = name.rpartition(": ")[0]
        figure.add_trace(_trace(recording, points), row=1 + kinds.index(_kind(name)), col=1)
    for name, points in speed.items():
        first = next(value for _, value in points) or 1.0
        shares = [(where, value / first) for where, value in points]
        figure.add_trace(_trace(name, shares), row=len(titles), col=1)
    figure.update_yaxes(type="log", row=len(titles), col=1)
    figure.update_xaxes(type="category", categoryorder="array", categoryarray=_places(entries))
    figure.update_layout(
        title="Accuracy and speed over the commits",
        height=LINES_HIGH * (len(titles) + 1),
        showlegend=False,
        template="plotly_white",
    )
    figure.write_html(file, include_plotlyjs=True)


def _place(entry: Entry) -> str:
    """What stands at the axis."""
    return f"{entry.date} {entry.commit}"


def _places(entries: list[Entry]) -> list[str]:
    return list(dict.fromkeys(_place(entry) for entry in entries))


def _kind(name: str) -> str:
    """The figure of ``recording: figure``."""
    return name.rpartition(": ")[2]


def _lines(
    entries: list[Entry], figures: Callable[[Entry], dict[str, float]]
) -> dict[str, list[tuple[str, float]]]:
    """Each figure with its values over the commits; speeds of other machines are other lines."""
    lines: dict[str, list[tuple[str, float]]] = {}
    for entry in entries:
        machine = f"{entry.machine.get('processor')}, {entry.machine.get('cores')} cores"
        form = "short" if entry.short else "full"
        for name, value in figures(entry).items():
            own = name if name in entry.accuracy else f"{name} ({form}; {machine})"
            lines.setdefault(own, []).append((_place(entry), value))
    return lines


def _trace(name: str, points: list[tuple[str, float]]) -> go.Scatter:
    return go.Scatter(
        x=[where for where, _ in points],
        y=[value for _, value in points],
        name=name,
        mode="lines+markers",
        hovertemplate="%{y:.4g}<br>%{x}<extra>%{fullData.name}</extra>",
    )
