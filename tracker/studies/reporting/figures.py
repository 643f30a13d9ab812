"""The report's plots of a study."""

from __future__ import annotations

from typing import Any

from tracker.parameters import PARAMETERS
from tracker.studies.judging import usable
from tracker.studies.kept.records import Trial
from tracker.studies.reporting.summary import Summary

_HEIGHT = 340
_FAINT, _ACCENT, _DEFAULT = "#6b7a90", "#d9480f", "#1971c2"
_CALM = 1.5
"""Below so many times the distance of the lower quartile from the best, values are not shown: a few
failures would leave no room to tell the good ones apart."""

_MOST = 12
"""Parameters that have a plot each, those that matter most first."""


def objective_figure(summary: Summary) -> Any | None:
    """Two objectives against each other with the front, or one over the trials."""
    import plotly.graph_objects as go

    trials = usable(summary.trials)
    if not trials:
        return None
    figure = go.Figure(layout=_layout())
    several = len(summary.objectives) > 1
    across = summary.objectives[-1] if several else None

    def x(trial: Trial) -> float:
        assert trial.objectives is not None
        return trial.objectives[-1] if several else float(trial.number)

    def points(some: list[Trial], name: str, **marker: Any) -> Any:
        return go.Scatter(
            x=[x(one) for one in some],
            y=[(one.objectives or (0.0,))[0] for one in some],
            text=[f"trial {one.number}" for one in some],
            mode="markers",
            name=name,
            marker=marker,
        )

    figure.add_trace(points(trials, "trials", color=_FAINT, size=6, opacity=0.6))
    if several:
        front = sorted((one for one in trials if one.number in summary.front), key=x)
        ways = points(front, "front", color=_ACCENT, size=7)
        figure.add_trace(ways.update(mode="lines+markers", line_shape="vh", line_color=_ACCENT))
    if summary.default is not None and summary.default.objectives is not None:
        default = points([summary.default], "default", symbol="diamond", size=12, color=_DEFAULT)
        figure.add_trace(default)
    if summary.best is not None:
        ring = {"color": _ACCENT, "width": 2}
        best = points(
            [summary.best], "best", color=_ACCENT, symbol="circle-open", size=15, line=ring
        )
        figure.add_trace(best)
    figure.update_xaxes(title=_axis(across) if across is not None else "trial")
    _calm(figure, summary)
    return figure


def importance_figure(summary: Summary) -> Any | None:
    """Shares of the variance with their standard deviations."""
    import plotly.graph_objects as go

    if not summary.importance:
        return None
    shown = summary.importance[:_MOST][::-1]
    bars = go.Bar(
        x=[share for _, (share, _) in shown],
        y=[key for key, _ in shown],
        error_x={"type": "data", "array": [spread for _, (_, spread) in shown]},
        orientation="h",
        marker_color=_FAINT,
    )
    figure = go.Figure(bars, layout=_layout(90 + 24 * len(shown)) | {"showlegend": False})
    figure.update_xaxes(title="share of the variance", range=[0.0, 1.0])
    return figure


def parameter_figures(summary: Summary) -> list[Any]:
    """Each parameter against the first objective."""
    import plotly.graph_objects as go

    trials = usable(summary.trials)
    if not trials:
        return []
    order = [key for key, _ in summary.importance] or [one.key for one in summary.definition.varied]
    logs = {one.key: one.log for one in summary.definition.varied}
    found = []
    for key in order[:_MOST]:
        some = [one for one in trials if key in one.values]
        dots = go.Scatter(
            x=[one.values[key] for one in some],
            y=[(one.objectives or (0.0,))[0] for one in some],
            text=[f"trial {one.number}" for one in some],
            mode="markers",
            marker={"color": _FAINT, "size": 6, "opacity": 0.6},
            name="trials",
        )
        figure = go.Figure(dots, layout=_layout(260))
        for trial, name, colour in (
            (summary.default, "default", _DEFAULT), (summary.best, "best", _ACCENT),
        ):  # fmt: skip
            if trial is not None and key in trial.values and trial.objectives is not None:
                marker: dict[str, Any] = {"color": colour, "size": 12, "symbol": "diamond"}
                if name == "best":
                    marker |= {"symbol": "circle-open", "line": {"color": colour, "width": 2}}
                figure.add_trace(
                    go.Scatter(
                        x=[trial.values[key]], y=[trial.objectives[0]], mode="markers", name=name,
                        marker=marker,
                    )
                )  # fmt: skip
        unit = PARAMETERS[key].unit if key in PARAMETERS else ""
        figure.update_xaxes(
            title=f"{key}{f' [{unit}]' if unit else ''}", type="log" if logs.get(key) else None
        )
        _calm(figure, summary)
        found.append(figure)
    return found


def _calm(figure: Any, summary: Summary) -> None:
    """Name the axis of the first objective, and show the values that tell something."""
    lead = summary.objectives[0]
    sign = 1.0 if lead.higher else -1.0
    values = sorted(sign * one.objectives[0] for one in usable(summary.trials) if one.objectives)
    best, quartile = values[-1], values[len(values) // 4]
    least = best - max(_CALM * (best - quartile), 1e-6 * abs(best), 1e-9)
    if summary.default is not None and summary.default.objectives is not None:
        least = min(least, sign * summary.default.objectives[0])
    beyond = sum(value < least for value in values)
    if not beyond:
        figure.update_yaxes(title=_axis(lead))
        return
    margin = 0.06 * (best - least)
    ends = sign * (least - margin), sign * (best + margin)
    words = f"{beyond} trial{'s' if beyond > 1 else ''} {'below' if lead.higher else 'above'}"
    figure.update_yaxes(title=f"{_axis(lead)}<br><sub>{words}</sub>", range=sorted(ends))


def _axis(objective: Any) -> str:
    return f"{objective.name}{f' [{objective.unit}]' if objective.unit else ''}"


def _layout(height: int = _HEIGHT) -> dict[str, Any]:
    return {
        "template": "plotly_white",
        "height": height,
        "margin": {"l": 70, "r": 20, "t": 40, "b": 50},
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0.0, "y": 1.0, "yanchor": "bottom"},
    }
