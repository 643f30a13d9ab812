"""The report of an evaluation: one self-contained HTML file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from plotly.offline import get_plotlyjs

from tracker import __version__
from tracker.evaluation import DEFINITIONS, Evaluation
from tracker.evaluation.report.figures import DARK, over_time, top_view
from tracker.evaluation.report.tables import (
    camera_table,
    escaped,
    figure_table,
    parameter_table,
    people_table,
    track_table,
)
from tracker.files.atomic import replacing
from tracker.parameters.catalogue import RunParameters
from tracker.sequences.sequence import LabelledPositions, Sequence

_HERE = Path(__file__).parent


def write_report(
    path: Path | str,
    sequence: Sequence,
    tracks: LabelledPositions,
    parameters: RunParameters | Mapping[str, str] | None,
    evaluation: Evaluation,
    *,
    reference: Evaluation | None = None,
    seed: int | None = None,
) -> None:
    """Write the report atomically.

    Args:
        path: The ``.html`` file to write; an existing one is replaced.
        sequence: The sequence that was tracked.
        tracks: The tracks that were evaluated.
        parameters: The parameters of the run, or the settings that a track file states;
            None if they are not known.
        evaluation: The evaluation of the tracks.
        reference: An earlier evaluation that the figures are compared with.
        seed: The seed of the run.

    Raises:
        OSError: If the file cannot be written; the message says why.
    """
    text = report_html(sequence, tracks, parameters, evaluation, reference=reference, seed=seed)
    with replacing(Path(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")


def report_html(
    sequence: Sequence,
    tracks: LabelledPositions,
    parameters: RunParameters | Mapping[str, str] | None,
    evaluation: Evaluation,
    *,
    reference: Evaluation | None = None,
    seed: int | None = None,
    back: str = "",
) -> str:
    """Return the report as text; see :func:`write_report` for the other arguments.

    Args:
        back: The URL of the page that shows the run; empty if there is none.
    """
    figures = {
        "figure-time": over_time(evaluation),
        "figure-top": top_view(sequence, tracks, evaluation),
    }
    embedded = "".join(
        f'<script type="application/json" id="{name}">{_in_script(figure.to_json())}</script>'
        for name, figure in figures.items()
    )
    title = f"{sequence.name}: tracks against truth"
    script = (_HERE / "report.js").read_text(encoding="utf-8")
    style = (_HERE / "report.css").read_text(encoding="utf-8")
    near = "Truth is dotted, tracks are lines, false tracks are faint; a line breaks at a gap."
    sections = (
        ("figures", "Figures", figure_table(evaluation, reference)),
        ("time", "Over time", _plot("figure-time", "All series over the steps")),
        (
            "paths",
            "From above",
            f"<p class='muted'>{near}</p>" + _plot("figure-top", "Paths on the floor"),
        ),
        ("people", "People", people_table(evaluation)),
        ("tracks", "Tracks", track_table(tracks, evaluation)),
        ("cameras", "Cameras", camera_table(evaluation)),
        ("parameters", "Parameters", parameter_table(parameters, sequence)),
    )
    body = "\n".join(_section(*section) for section in sections)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="multiview-phd {__version__}">
<title>{escaped(title)}</title>
<style>{style}</style>
</head>
<body>
{_head(sequence, evaluation, seed, back)}
{_headline(evaluation)}
{body}
<footer>multiview-phd {__version__}. {_sources()}</footer>
{embedded}
<script type="application/json" id="dark-colours">{json.dumps(DARK)}</script>
<script>{get_plotlyjs()}</script>
<script>{script}</script>
</body>
</html>
"""


def _in_script(text: str) -> str:
    """Escape JSON for a script element, so that no text inside can end the element."""
    return text.replace("<", "\\u003c")


def _section(name: str, title: str, body: str) -> str:
    return f'<section id="{name}"><h2>{title}</h2>{body}</section>'


def _plot(figure: str, label: str) -> str:
    # in a narrow window it scrolls: legends would stand on titles
    return (
        f'<div class="wide" tabindex="0"><div class="plot" data-figure="{figure}" role="img" '
        f'aria-label="{label}"></div></div>'
    )


def _head(sequence: Sequence, evaluation: Evaluation, seed: int | None, back: str) -> str:
    """Return the head of the page: the recording, notes and links."""
    steps = evaluation.steps
    done = f"{steps} steps" if steps == sequence.frames else f"{steps} of {sequence.frames} steps"
    facts = [done, f"{sequence.fps:g} a second", f"{len(sequence.views)} cameras"]
    if seed is not None:
        facts.append(f"seed {seed}")
    links = ("figures", "time", "paths", "people", "tracks", "cameras", "parameters")
    return (
        f"<header><h1>{escaped(sequence.name)}</h1>"
        f"<p>{escaped(sequence.description)}</p><p class='muted'>{escaped(' · '.join(facts))}</p>"
        + "".join(f"<p>{escaped(note)}</p>" for note in evaluation.notes)
        + "<nav>"
        + "".join(f'<a href="#{link}">{link.capitalize()}</a>' for link in links)
        + (f'<a href="{escaped(back)}">Open in the workbench</a>' if back else "")
        + "</nav></header>"
    )


def _headline(evaluation: Evaluation) -> str:
    tiles = "".join(
        f"<div title='{escaped(f.definition.help)} {escaped(f.measured_with)}'>"
        f"<dt>{f.definition.name}</dt><dd>{f.text} <small>{f.unit}</small></dd></div>"
        for f in evaluation.figures
        if f.definition.headline
    )
    return f'<dl class="headline">{tiles}</dl>'


def _sources() -> str:
    sources = dict.fromkeys(one.source for one in DEFINITIONS if one.source)
    return f"Sources: {'; '.join(map(escaped, sources))}."
