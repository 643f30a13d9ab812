"""The report of a study as a table, as JSON, or as one self-contained HTML file."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tracker import __version__
from tracker.evaluation.report.tables import escaped
from tracker.files.atomic import replacing
from tracker.parameters.catalogue import PARAMETERS
from tracker.sequences.errors import SequenceError
from tracker.studies.judging import usable
from tracker.studies.store import Store, Trial
from tracker.studies.summary import Summary, summary_of, track_commands

_STYLE = """
:root { color-scheme: light dark; --line: #8884; }
body { font: 14px/1.5 system-ui, sans-serif; max-width: 1100px; margin: 2rem auto;
  padding: 0 1rem; overflow-wrap: break-word; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
table { border-collapse: collapse; margin-bottom: 1rem; } td + td { overflow-wrap: anywhere; }
.wide td + td { overflow-wrap: normal; }
th, td { padding: 2px 10px; border-bottom: 1px solid var(--line); text-align: left; }
td { font-variant-numeric: tabular-nums; } .wide { overflow-x: auto; }
pre { overflow-x: auto; border: 1px solid var(--line); padding: .6rem; font-size: 12px; }
pre.command { white-space: pre-wrap; } summary { cursor: pointer; }
.plots { display: grid; gap: 1rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 480px), 1fr)); }
.plots > * { min-width: 0; } .plots > :first-child { grid-column: 1 / -1; }
@media (prefers-color-scheme: dark) { .plots { filter: invert(.93) hue-rotate(180deg); } }
"""

_BEST = 40
"""Largest number of trials in the report's table."""

_HEIGHT = 340
"""Height of a figure, pixels."""

_FAINT, _ACCENT, _DEFAULT = "#6b7a90", "#d9480f", "#1971c2"
_RANGE = 1.5
"""Range of a plot's axis below the best value, as a multiple of the distance between the best value
and the lower quartile, so that a few bad trials do not hide differences between good ones."""

_MOST = 12
"""Largest number of parameters with a plot, the most important ones."""


def study_values(store: Store) -> dict[str, Any]:
    """Return a study as plain values, with its definition, status, trials and best trial."""
    summary = summary_of(store)
    return {
        "program": __version__,
        "code": store.fact("code"),
        "study": summary.name,
        "definition": summary.definition.to_json(),
        "status": asdict(summary.status),
        "recordings": store.fact("recordings"),
        "objectives": [asdict(one) for one in summary.objectives],
        "trials": [one.to_json() for one in summary.trials],
        "best": None if summary.best is None else summary.best.number,
        "front": summary.front,
        "importance": dict(summary.importance),
        "sentences": summary.sentences(),
    }


def write_json(path: Path, store: Store) -> None:
    """Write a study as JSON.

    Raises:
        OSError: If the file cannot be written; the message says why.
    """
    with replacing(path) as begun:
        text = json.dumps(study_values(store), ensure_ascii=False, allow_nan=False, indent=1)
        begun.write_text(text, encoding="utf-8")


def write_csv(path: Path, store: Store) -> None:
    """Write a table with a row for each trial: number, state, values and figures.

    Raises:
        OSError: If the file cannot be written; the message says why.
    """
    with replacing(path) as begun, begun.open("w", newline="", encoding="utf-8") as file:
        file.write(csv_text(store))


def csv_text(store: Store) -> str:
    """Return the table of :func:`write_csv` as text."""
    import io

    summary, file = summary_of(store), io.StringIO(newline="")
    keys = [one.key for one in summary.definition.varied]
    figures = sorted({key for trial in summary.trials for key in trial.figures})
    table = csv.writer(file)
    table.writerow(["trial", "state", "vetoed", "seconds", *keys, *figures, "remark"])
    for trial in summary.trials:
        table.writerow(
            [
                trial.number, trial.state, int(trial.vetoed), round(trial.seconds, 3),
                *(trial.values.get(key, "") for key in keys),
                *(trial.figures.get(key, "") for key in figures), summary.remark(trial),
            ]
        )  # fmt: skip
    return file.getvalue()


def write_report(path: Path, store: Store) -> None:
    """Write the HTML report.

    Raises:
        OSError: If the file cannot be written; the message says why.
    """
    with replacing(path) as begun:
        begun.write_text(report_html(store), encoding="utf-8")


def report_html(store: Store) -> str:
    """Return the HTML report: the settings, the results, and how to reproduce them."""
    from plotly.offline import get_plotlyjs

    summary = summary_of(store)
    recordings = store.fact("recordings") or []
    definition = summary.definition
    sentences = "".join(f"<p>{escaped(one)}.</p>" for one in summary.sentences())
    figures = [objective_figure(summary), importance_figure(summary)]
    plots = "".join(
        one.to_html(
            full_html=False,
            include_plotlyjs=False,
            config={"displaylogo": False, "responsive": True},
        )
        for one in [*figures, *parameter_figures(summary)]
        if one is not None
    )
    status = summary.status
    facts = [
        ("Trials", f"{len(summary.trials)} {definition.within()}, {status.state}"),
        ("Seeds", ", ".join(map(str, definition.seeds))),
        ("Search", f"{definition.search}, sampler's seed {definition.seed}"),
        ("Objectives", ", ".join(one.name for one in summary.objectives)),
        *((f"Recording {r['name']}", f"{r['place']}, content {r['content']}") for r in recordings),
        ("Program", f"multiview-phd {__version__}, code {store.fact('code')}"),
    ]
    return "\n".join(
        [
            "<!doctype html>",
            f'<html lang="en"><head><meta charset="utf-8"><title>{escaped(summary.name)}</title>',
            '<meta name="viewport" content="width=device-width">',
            f"<style>{_STYLE}</style><script>{get_plotlyjs()}</script></head><body>",
            f"<h1>Study {escaped(summary.name)}</h1>",
            sentences,
            _table(("", ""), facts),
            _proposed(store.fact("tuned")),
            "<h2>Figures</h2>",
            f'<div class="plots">{plots}</div>',
            "<h2>Best trials</h2>",
            f'<div class="wide">{_trials(summary)}</div>',
            "<h2>Repeat the best one</h2>",
            f'<pre class="command">{escaped(_commands(summary))}</pre>',
            "<h2>Definition</h2>",
            "<details><summary>As a file that starts it again</summary>",
            f"<pre>{escaped(definition.to_toml())}</pre></details>",
            "</body></html>",
        ]
    )


def _proposed(found: dict[str, Any] | None) -> str:
    """Return the section on the proposal; empty if there is none."""
    if found is None:
        return ""
    parts = ["<h2>Proposed</h2>", f"<p>{escaped(found['words'])}.</p>"]
    if found["rows"]:
        rows = [
            (
                row["key"],
                *(_value(row[key]) for key in ("before", "default", "after")),
                "–" if row["brought"] is None else f"{row['brought']:+.4f}",
            )
            for row in found["rows"]
        ]
        head = ("parameter", "before", "default", "now", "brings")
        parts.append(f'<div class="wide">{_table(head, rows)}</div>')
    if found["figures"]:
        figures = [
            (row["name"], *(_value(row[key]) for key in ("default", "before", "after")))
            for row in found["figures"]
        ]
        head_of_figures = ("figure", "default", "before", "now")
        parts.append(f'<div class="wide">{_table(head_of_figures, figures)}</div>')
    return "\n".join(parts)


def _commands(summary: Summary) -> str:
    """Return the commands that reproduce the best trial."""
    if summary.best is None:
        return "no trial has ended"
    try:
        return "\n".join(track_commands(summary.definition, summary.best))
    except SequenceError as error:
        return f"a recording cannot be read any more: {error}"


def _trials(summary: Summary) -> str:
    """Return the table of the best trials."""
    keys = [one.key for one in summary.definition.varied]
    beside = summary.beside
    named = [one.name for one in (*summary.objectives, *beside)]
    head = ["trial", *named, *keys, "runs' seconds", "remark"]
    rows = []
    for trial in summary.ranked[:_BEST]:
        rows.append(
            (
                str(trial.number),
                *_measured(summary, trial),
                *(
                    "–" if (v := trial.figures.get(one.key)) is None else one.words(v, None)
                    for one in beside
                ),
                *(_value(trial.values.get(key)) for key in keys),
                f"{trial.seconds:.1f}",
                summary.remark(trial),
            )
        )
    return _table(head, rows)


def _measured(summary: Summary, trial: Trial) -> list[str]:
    """Return the objectives of a trial as text."""
    assert trial.objectives is not None
    pairs = zip(summary.objectives, trial.objectives, trial.spreads, strict=True)
    return [one.words(value, spread) for one, value, spread in pairs]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f'<th scope="col">{escaped(one)}</th>' for one in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escaped(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _value(value: Any) -> str:
    """Return a value as text; a dash for None."""
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def objective_figure(summary: Summary) -> Any | None:
    """Plot the first over the last objective with the Pareto front, or a single objective over the
    number of the trial; None without complete trials."""
    several = len(summary.objectives) > 1

    def x(trial: Trial) -> Any:
        return (trial.objectives or (None,))[-1] if several else trial.number

    figure = _over(summary, x, _axis(summary.objectives[-1]) if several else "trial", _HEIGHT)
    if figure is not None and several:
        front = sorted((one for one in summary.trials if one.number in summary.front), key=x)
        line = {"line_shape": "vh", "line_color": _ACCENT, "mode": "lines+markers"}
        figure.add_trace(_points(front, x, "front", color=_ACCENT, size=7).update(**line))
    return figure


def importance_figure(summary: Summary) -> Any | None:
    """Plot the importance of parameters with standard deviations; None without an estimate."""
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
    """Plot the first objective over each of the most important parameters."""
    order = [key for key, _ in summary.importance] or [one.key for one in summary.definition.varied]
    logs = {one.key: one.log for one in summary.definition.varied}
    found = []
    for key in order[:_MOST]:
        unit = PARAMETERS[key].unit if key in PARAMETERS else ""
        title = f"{key}{f' [{unit}]' if unit else ''}"
        figure = _over(summary, lambda trial, key=key: trial.values.get(key), title, 260)  # type: ignore[misc]
        if figure is not None:
            figure.update_xaxes(type="log" if logs.get(key) else None)
            found.append(figure)
    return found


def _over(summary: Summary, x: Callable[[Trial], Any], title: str, height: int) -> Any | None:
    """Plot the first objective over a figure of the trials, with the default and the best marked;
    None without complete trials.

    Args:
        summary: The summary of the study.
        x: A function that returns the figure of a trial; None leaves the trial out.
        title: The title of the figure's axis.
        height: The height of the plot, pixels.
    """
    import plotly.graph_objects as go

    trials = usable(summary.trials)
    if not trials:
        return None
    figure = go.Figure(layout=_layout(height))
    figure.add_trace(_points(trials, x, "trials", color=_FAINT, size=6, opacity=0.6))
    default = {"symbol": "diamond", "size": 12, "color": _DEFAULT}
    best = {"symbol": "circle-open", "size": 15, "line": {"color": _ACCENT, "width": 2}}
    for trial, name, marker in (
        (summary.default, "default", default), (summary.best, "best", {"color": _ACCENT, **best}),
    ):  # fmt: skip
        if trial is not None and trial.objectives is not None and x(trial) is not None:
            figure.add_trace(_points([trial], x, name, **marker))
    figure.update_xaxes(title=title)
    _limit_range(figure, summary)
    return figure


def _points(trials: Sequence[Trial], x: Callable[[Trial], Any], name: str, **marker: Any) -> Any:
    """Return a trace with a point for each trial that has the figure on the x-axis."""
    import plotly.graph_objects as go

    some = [one for one in trials if x(one) is not None]
    return go.Scatter(
        x=[x(one) for one in some],
        y=[(one.objectives or (0.0,))[0] for one in some],
        text=[f"trial {one.number}" for one in some],
        mode="markers",
        name=name,
        marker=marker,
    )


def _limit_range(figure: Any, summary: Summary) -> None:
    """Set the title of the first objective's axis, and limit its range (see :data:`_RANGE`)."""
    lead = summary.objectives[0]
    sign = 1.0 if lead.higher else -1.0
    values = sorted(sign * one.objectives[0] for one in usable(summary.trials) if one.objectives)
    best, quartile = values[-1], values[len(values) // 4]
    least = best - max(_RANGE * (best - quartile), 1e-6 * abs(best), 1e-9)
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
    """Return the title of an objective's axis."""
    return f"{objective.name}{f' [{objective.unit}]' if objective.unit else ''}"


def _layout(height: int = _HEIGHT) -> dict[str, Any]:
    return {
        "template": "plotly_white",
        "height": height,
        "margin": {"l": 70, "r": 20, "t": 40, "b": 50},
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0.0, "y": 1.0, "yanchor": "bottom"},
    }
