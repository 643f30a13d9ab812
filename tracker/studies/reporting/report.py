"""A study as a table, as JSON, or as one HTML file that needs nothing from anywhere else."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tracker import __version__
from tracker.evaluation.report.tables import escaped
from tracker.files.atomic import replacing
from tracker.sequences.errors import SequenceError
from tracker.studies.kept.records import Trial
from tracker.studies.kept.store import Store
from tracker.studies.reporting.commands import track_commands
from tracker.studies.reporting.figures import importance_figure, objective_figure, parameter_figures
from tracker.studies.reporting.summary import Summary, summary_of

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
"""Trials in the report's table."""


def everything(store: Store) -> dict[str, Any]:
    """A study as plain values: definition, status, trials with the hashes of their runs, best."""
    summary = summary_of(store)
    return {
        "program": __version__,
        "code": store.told("code"),
        "study": summary.name,
        "definition": summary.definition.to_json(),
        "status": asdict(summary.status),
        "recordings": store.told("recordings"),
        "objectives": [asdict(one) for one in summary.objectives],
        "trials": [one.to_json() for one in summary.trials],
        "best": None if summary.best is None else summary.best.number,
        "front": summary.front,
        "importance": dict(summary.importance),
        "sentences": summary.sentences(),
    }


def write_json(path: Path, store: Store) -> None:
    """Everything, as JSON.

    Raises:
        OSError: With a sentence, if the file cannot be written.
    """
    with replacing(path) as begun:
        text = json.dumps(everything(store), ensure_ascii=False, allow_nan=False, indent=1)
        begun.write_text(text, encoding="utf-8")


def write_csv(path: Path, store: Store) -> None:
    """One row a trial: number, state, objectives, values, other figures.

    Raises:
        OSError: With a sentence, if the file cannot be written.
    """
    with replacing(path) as begun, begun.open("w", newline="", encoding="utf-8") as file:
        file.write(csv_text(store))


def csv_text(store: Store) -> str:
    """The table as text."""
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
    """The report.

    Raises:
        OSError: With a sentence, if the file cannot be written.
    """
    with replacing(path) as begun:
        begun.write_text(report_html(store), encoding="utf-8")


def report_html(store: Store) -> str:
    """The report's text: what was sought, what was found, how to repeat it."""
    from plotly.offline import get_plotlyjs

    summary = summary_of(store)
    recordings = store.told("recordings") or []
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
        ("Program", f"multiview-phd {__version__}, code {store.told('code')}"),
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
            _proposed(store.told("tuned")),
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
    """What was measured again on other seeds, and what is proposed after that."""
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
        told = [
            (row["name"], *(_value(row[key]) for key in ("default", "before", "after")))
            for row in found["figures"]
        ]
        head_of_figures = ("figure", "default", "before", "now")
        parts.append(f'<div class="wide">{_table(head_of_figures, told)}</div>')
    return "\n".join(parts)


def _commands(summary: Summary) -> str:
    if summary.best is None:
        return "no trial has ended"
    try:
        return "\n".join(track_commands(summary.definition, summary.best))
    except SequenceError as error:
        return f"a recording cannot be read any more: {error}"


def _trials(summary: Summary) -> str:
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
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
