"""The report's plots: figures over time, the tracks of each person, and the paths from above.

All colours are those of the light theme; :data:`DARK` has the dark partner of each, and the
report's script exchanges them where the reader's system has a dark theme.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float, Int
from numpy import ndarray
from plotly.subplots import make_subplots

from tracker.evaluation import Evaluation
from tracker.sequences.sequence import LabelledPositions, Sequence

INK, MUTED, GRID, LINE = "#1b1b1b", "#707070", "#e9e9e7", "#77777a"
NEAR, COUNT, FALSE = "#8fb2d6", "#d79a45", "#c98a7f"
SURFACE = "#fbfbfa"
LIGHT_IDS = (
    *("#a05300", "#286ec2", "#558452", "#7d2259", "#a28d06", "#402cac", "#039ca6", "#8e0316"),
    *("#c4667b", "#864e53", "#00586d", "#87628c", "#2386ae", "#057664", "#954095", "#89924f"),
    *("#58632f", "#b44366", "#45771f", "#0a9278", "#374386", "#913a03", "#897e34", "#2c5531"),
)
"""Colours of ids on light backgrounds; beyond 24 they repeat, so the id is always written."""
DARK_IDS = (
    *("#e98f48", "#77b1fc", "#98c994", "#b3578b", "#f6dc4d", "#6b65e4", "#78ebf4", "#cb4645"),
    *("#ffbfca", "#c4878c", "#158eac", "#caa3cf", "#76cef8", "#0abba0", "#d780d6", "#d6e19c"),
    *("#909d68", "#fe87a7", "#82b762", "#61ddbe", "#6575bb", "#d86c38", "#d1c57d", "#5c8760"),
)
DARK: dict[str, str] = {
    INK: "#ededed",
    MUTED: "#979797",
    GRID: "#2a2a2a",
    LINE: "#8b8b8b",
    NEAR: "#4a6f94",
    COUNT: "#b98238",
    FALSE: "#8f5a50",
    SURFACE: "#181818",
    **dict(zip(LIGHT_IDS, DARK_IDS, strict=True)),
}
"""The dark partner of every colour."""

MOST_LANES = 30
"""Largest number of people with a lane and a line of errors, since more colours cannot be
distinguished; the tables have all people."""


def colour(name: int) -> str:
    """Return the colour of an id on light backgrounds, the same in all plots and tables."""
    return LIGHT_IDS[(name - 1) % len(LIGHT_IDS)]


def broken(
    frames: Int[ndarray, " N"], *columns: Float[ndarray, " N"]
) -> tuple[Float[ndarray, " M"], ...]:
    """Insert a NaN into columns wherever steps are missing, so that a plotted line breaks there.

    Args:
        frames: The steps, ascending.
        columns: Values at these steps.

    Returns:
        The steps and the columns, with the NaNs.
    """
    gaps = np.flatnonzero(np.diff(frames) > 1) + 1
    return tuple(np.insert(np.asarray(c, dtype=float), gaps, np.nan) for c in (frames, *columns))


def over_time(evaluation: Evaluation) -> go.Figure:
    """Plot people, OSPA, GOSPA, position errors and the tracks of each person over the steps."""
    settings, series = evaluation.settings, evaluation.series
    unit = f" ({settings.unit})" if settings.unit else ""
    cost = settings.in_words(("cutoff", "order"))
    shown = evaluation.people[:MOST_LANES]
    lanes = max(len(shown), 1)
    figure = make_subplots(
        rows=5,
        shared_xaxes=True,
        vertical_spacing=0.045,
        row_heights=[1.0, 1.2, 1.2, 1.3, 0.35 + 0.16 * lanes],
        subplot_titles=[
            "People",
            f"OSPA{unit} · {cost}",
            f"GOSPA{unit if settings.order == 1.0 else ''} · {cost}, α = 2",
            f"Position error (m) · {settings.in_words(('gate',))}",
            f"Who follows whom · {settings.in_words(('gate',))}",
        ],
    )
    steps = np.arange(evaluation.steps)

    def add(row: int, trace: go.Scatter) -> None:
        figure.add_trace(trace.update(legend="legend" if row == 1 else f"legend{row}"), row, 1)

    add(1, _line(steps, series.truth, "truth", MUTED, width=4, shape="hv"))
    add(1, _line(steps, series.estimates, "estimates", INK, shape="hv"))
    stacked = settings.order == 1.0
    for row, parts, total in (
        (
            2,
            [("localisation", series.ospa_localisation, NEAR),
             ("cardinality", series.ospa_cardinality, COUNT)],
            [("OSPA", series.ospa, INK, None),
             (f"OSPA(2), {settings.in_words(('window',))}", series.ospa2, MUTED, "dot")],
        ),
        (
            3,
            [("localisation", series.gospa_localisation, NEAR),
             ("missed", series.gospa_missed, COUNT), ("false", series.gospa_false, FALSE)],
            [("GOSPA", series.gospa, INK, None)],
        ),
    ):  # fmt: skip
        for name, values, tone in parts:
            add(row, _area(steps, values, name, tone, f"parts{row}" if stacked else None))
        for name, values, tone, dash in total:
            add(row, _line(steps, values, name, tone, width=1.2, dash=dash))
    for person in shown:
        errors = evaluation.errors[person.id]
        trace = _line(steps, errors, f"{person.id}", colour(person.id), width=1.2)
        add(4, trace.update(hovertemplate=f"person {person.id}: %{{y:.3~f}}<extra></extra>"))
    for trace in _lanes(evaluation, [person.id for person in shown]):
        figure.add_trace(trace, 5, 1)
    figure.update_yaxes(rangemode="tozero")
    figure.update_yaxes(
        tickmode="array",
        tickvals=np.arange(len(shown)),
        ticktext=[f"person {person.id}" for person in shown],
        range=[lanes - 0.4, -0.6],
        row=5,
    )
    figure.update_xaxes(title_text="step", row=5)
    figure.update_xaxes(range=[-0.5, max(evaluation.steps, 1) - 0.5])
    figure.update_layout(_layout(), height=760 + 22 * lanes, hovermode="x unified")
    _legends(figure)
    return figure


def _lanes(evaluation: Evaluation, people: list[int]) -> list[go.Scatter]:
    """Return the lanes: a line for each person, in the colours of the paired tracks, with marks
    at identity switches."""
    pairs = evaluation.pairs
    lane = {name: k for k, name in enumerate(people)}
    traces = []
    for track in np.unique(pairs.tracks).tolist():
        x, y = [np.zeros(0)], [np.zeros(0)]
        for person in np.unique(pairs.people[pairs.tracks == track]).tolist():
            if person in lane:
                frames = pairs.steps[(pairs.tracks == track) & (pairs.people == person)]
                # half a step to each side, so that a single step shows
                starts = frames[np.diff(frames, prepend=-2) > 1]
                ends = frames[np.diff(frames, append=frames[-1] + 2) > 1]
                spans = np.stack([starts - 0.5, ends + 0.5, np.full(len(starts), np.nan)], axis=1)
                x.append(spans.ravel())
                y.append(np.full(spans.size, float(lane[person])))
        line = _line(np.concatenate(x), np.concatenate(y), f"track {track}", colour(track), width=7)
        traces.append(line.update(showlegend=False, hoverinfo="name", hovertemplate=None))
    switched = pairs.switch & np.isin(pairs.people, people)
    traces.append(
        go.Scatter(
            x=pairs.steps[switched],
            y=[lane[name] for name in pairs.people[switched].tolist()],
            mode="markers",
            name="identity switch",
            marker={"symbol": "x-thin", "size": 9, "line": {"width": 2, "color": INK}},
            showlegend=False,
            text=[f"switch to track {name}" for name in pairs.tracks[switched].tolist()],
            hovertemplate="step %{x}: %{text}<extra></extra>",
        )
    )
    return traces


def top_view(sequence: Sequence, tracks: LabelledPositions, evaluation: Evaluation) -> go.Figure:
    """Plot the paths of people (dotted) and tracks (lines) on the floor, with room and cameras."""
    figure = go.Figure()
    truth = sequence.ground_truth
    if truth is not None:
        for k, name in enumerate(np.unique(truth.ids).tolist()):
            rows = (truth.ids == name) & (truth.frames < evaluation.steps)
            trace = _path(truth.frames[rows], truth.positions[rows], f"person {name}", MUTED, "dot")
            trace.update(name="truth", legendgroup="truth", showlegend=k == 0, line_width=1.2)
            figure.add_trace(trace)
    kinds = {row.id: row for row in evaluation.tracks}
    for name in np.unique(tracks.ids).tolist():
        rows = np.flatnonzero((tracks.ids == name) & (tracks.frames < evaluation.steps))
        rows = rows[np.argsort(tracks.frames[rows], kind="stable")]
        kind = kinds[name].kind if name in kinds else "false"
        trace = _path(tracks.frames[rows], tracks.positions[rows], f"track {name}", colour(name))
        trace.update(opacity=0.45 if kind == "false" else 0.95)
        if kind == "false":
            trace.update(name=f"track {name} (false)")
        figure.add_trace(trace)
    places = np.array([camera.centre for camera in sequence.cameras]).reshape(-1, 3)
    figure.add_trace(
        go.Scatter(
            x=places[:, 0],
            y=places[:, 1],
            mode="markers+text",
            text=[camera.name for camera in sequence.cameras],
            textposition="top center",
            name="cameras",
            marker={"symbol": "square-open", "size": 9, "color": LINE},
            textfont={"color": LINE},
            hovertemplate="%{text}: x %{x:.2f} m, y %{y:.2f} m<extra></extra>",
            showlegend=False,
        )
    )
    low, high = sequence.room.minimum, sequence.room.maximum
    figure.add_shape(
        type="rect", x0=low[0], y0=low[1], x1=high[0], y1=high[1],
        line={"color": LINE, "width": 1}, layer="below",
    )  # fmt: skip
    # a line at zero would cover a wall that stands there
    figure.update_xaxes(title_text="x (m)", zeroline=False)
    figure.update_yaxes(title_text="y (m)", scaleanchor="x", scaleratio=1, zeroline=False)
    figure.update_layout(_layout(), height=620, hovermode="closest")
    figure.update_layout(legend={"x": 1.01, "y": 1.0, "xanchor": "left", "itemsizing": "constant"})
    return figure


def _path(
    frames: ndarray, positions: ndarray, name: str, tone: str, dash: str | None = None
) -> go.Scatter:
    """Return the line of a path from above, with gaps where steps are missing."""
    order = np.argsort(frames, kind="stable")
    step, x, y = broken(frames[order], positions[order, 0], positions[order, 1])
    trace = _line(x.round(4), y.round(4), name, tone, width=1.8, dash=dash)
    return trace.update(
        customdata=step,
        hovertemplate=f"{name}, step %{{customdata}}<br>x %{{x:.2f}} m, y %{{y:.2f}} m"
        "<extra></extra>",
    )


def _line(
    x: ndarray,
    y: ndarray,
    name: str,
    tone: str,
    *,
    width: float = 1.6,
    dash: str | None = None,
    shape: str = "linear",
) -> go.Scatter:
    """Return a line with a name and a colour."""
    return go.Scatter(
        x=x,
        y=y if y.dtype.kind != "f" else y.round(5),
        name=name,
        mode="lines",
        line={"color": tone, "width": width, "dash": dash, "shape": shape},
        hovertemplate="%{y:.3~f}",
    )


def _area(x: ndarray, y: ndarray, name: str, tone: str, stack: str | None) -> go.Scatter:
    trace = _line(x, y, name, tone, width=0.0 if stack else 1.2)
    return trace.update(stackgroup=stack, fillcolor=tone) if stack else trace


def _layout() -> dict[str, Any]:
    """Return the common layout of all figures."""
    axis = {
        "gridcolor": GRID, "zerolinecolor": GRID, "linecolor": GRID, "tickfont": {"color": MUTED},
        "title_font": {"color": MUTED, "size": 11},
    }  # fmt: skip
    template = go.layout.Template(layout={"xaxis": axis, "yaxis": axis})
    return {
        "template": template,
        "paper_bgcolor": SURFACE,
        "plot_bgcolor": SURFACE,
        "font": {"color": INK, "size": 11},
        "margin": {"l": 70, "r": 20, "t": 58, "b": 44},
        "hoverlabel": {"bgcolor": SURFACE, "bordercolor": GRID, "font": {"color": INK}},
        "dragmode": "pan",
    }


def _legends(figure: go.Figure) -> None:
    """Put the titles at the left, and the legend of each plot at the right of its title."""
    for row, title in enumerate(figure.layout.annotations, start=1):
        title.update(x=0.0, xanchor="left", font={"size": 12, "color": INK})
        if row < 5:
            figure.update_layout(
                {
                    "legend" if row == 1 else f"legend{row}": {
                        "orientation": "h", "x": 1.0, "xanchor": "right", "y": title.y,
                        "yanchor": "bottom", "font": {"size": 10, "color": MUTED},
                        "bgcolor": "rgba(0,0,0,0)", "itemsizing": "constant",
                        "title": {
                            "text": "person " if row == 4 else "",
                            "font": {"size": 10, "color": MUTED},
                        },
                    }
                }
            )  # fmt: skip
