"""The report's tables, as HTML."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from tracker.evaluation import Evaluation
from tracker.evaluation.difference import Difference, compare
from tracker.evaluation.figures import number
from tracker.evaluation.report.figures import DARK, colour
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import (
    ParameterError,
    changed_values,
    stage_values,
    value_of,
    with_current_keys,
    with_values,
)
from tracker.runs.fitting import default_parameters
from tracker.sequences.sequence import LabelledPositions, Sequence

MOST_ROWS = 60
"""Most rows of a table that does not scroll."""


def escaped(value: object) -> str:
    """Convert a value to text and escape it for HTML."""
    return html.escape(str(value))


def _table(heads: Iterable[str], rows: Iterable[str]) -> str:
    """Return a table; a head that begins with > is that of a column of numbers."""
    head = "".join(
        f'<th scope="col" class="n">{name[1:]}</th>'
        if name.startswith(">")
        else f'<th scope="col">{name}</th>'
        for name in heads
    )
    body = list(rows)
    tall = ' tall" tabindex="0' if len(body) > MOST_ROWS else ""
    return (
        f'<div class="wide{tall}"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table></div>"
    )


def _row(first: str, *cells: str, kind: str = "") -> str:
    """Return a row whose first cell is its head; a cell that begins with > is a number."""
    body = "".join(
        f'<td class="n">{cell[1:]}</td>' if cell.startswith(">") else f"<td>{cell}</td>"
        for cell in cells
    )
    return f'<tr class="{kind}"><th scope="row">{first}</th>{body}</tr>'


_SIGNS = {"higher": "higher is better", "lower": "lower is better", "zero": "nearer to 0 is better"}


def figure_table(evaluation: Evaluation, reference: Evaluation | None) -> str:
    """Return the table of all figures with their settings and definitions.

    Args:
        evaluation: The evaluation.
        reference: An earlier evaluation, whose values and differences are shown as well; None for
            none.
    """
    differences = compare(reference, evaluation) if reference else evaluation.figures
    heads = ["", ">value", "unit", "measured with", "definition"]
    if reference:
        heads[1:2] = [">reference", ">value", ">difference", "is"]
    rows, group = [], ""
    for figure, difference in zip(evaluation.figures, differences, strict=True):
        definition = figure.definition
        if definition.group != group:
            group = definition.group
            rows.append(
                f'<tr class="group"><th colspan="{len(heads)}" scope="rowgroup">{group}</th></tr>'
            )
        cells = [f">{figure.text}"]
        if isinstance(difference, Difference):
            cells = _difference_cells(difference)
        about = definition.help
        if definition.direction in _SIGNS:
            about += f" {_SIGNS[definition.direction].capitalize()}."
        rows.append(
            _row(
                definition.name,
                *cells,
                escaped(figure.unit),
                f"<span class='stated'>{escaped(figure.measured_with)}</span>",
                f"<span class='muted'>{escaped(about)}</span>",
            )
        )
    return _table(heads, rows)


def _difference_cells(row: Difference) -> list[str]:
    sign = {"better": "▲ better", "worse": "▼ worse"}.get(row.verdict, row.verdict)
    note = "" if row.comparable else " <span class='stated'>(other settings)</span>"
    digits = row.definition.digits
    return [
        f">{number(row.a, digits)}",
        f">{number(row.b, digits)}",
        f">{number(row.difference, digits, sign=True)}",
        f"<span class='{row.verdict}'>{sign}</span>{note}",
    ]


def _name(word: str, identifier: int) -> str:
    tone = colour(identifier)
    return (
        f'<span class="dot" style="--id:{tone};--id-dark:{DARK[tone]}"></span>{word} {identifier}'
    )


def people_table(evaluation: Evaluation) -> str:
    """Return the table of people."""
    if not evaluation.people:
        return "<p class='muted'>There is nobody in the truth.</p>"
    near = evaluation.settings.in_words(("near",))
    heads = ("", ">first step", ">last", ">steps", ">tracked", "status", f">found {near}",
             ">error (m)", ">95 % (m)", ">switches", ">fragmentations", "own track")  # fmt: skip
    return _table(
        heads,
        (
            _row(
                f"person {row.id}", f">{row.first}", f">{row.last}", f">{row.steps}",
                f">{row.tracked}", row.status, f">{_share(row.found_share)}",
                f">{number(row.error, 3)}", f">{number(row.error_95, 3)}", f">{row.switches}",
                f">{row.fragmentations}",
                "–" if row.track is None else _name("track", row.track),
            )
            for row in evaluation.people
        ),
    )  # fmt: skip


def track_table(tracks: LabelledPositions, evaluation: Evaluation) -> str:
    """Return the table of tracks; false tracks are faded."""
    if not evaluation.tracks:
        return "<p class='muted'>There are no tracks.</p>"
    existences = getattr(tracks, "existences", None)
    ids = np.asarray(tracks.ids)
    unit = f" ({evaluation.settings.unit})" if evaluation.settings.unit else ""
    heads = ["", "is", ">first step", ">last", ">steps", ">with a person", ">don't care",
             ">with this person", f">distance{unit}"]  # fmt: skip
    if existences is not None:
        heads.append(">mean existence")
    rows = []
    for row in evaluation.tracks:
        cells = [
            f"person {row.person}" if row.kind == "person" else row.kind,
            f">{row.first}", f">{row.last}", f">{row.steps}", f">{row.matched}",
            f">{row.ignored}", f">{_share(row.person_share)}", f">{number(row.error, 3)}",
        ]  # fmt: skip
        if existences is not None:
            cells.append(f">{number(float(existences[ids == row.id].mean()), 2)}")
        kind = "" if row.kind == "person" else "faded"
        rows.append(_row(_name("track", row.id), *cells, kind=kind))
    return _table(heads, rows)


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100.0 * value:.1f} %"


def camera_table(evaluation: Evaluation) -> str:
    """Return the table of cameras."""
    if not evaluation.cameras:
        return "<p class='muted'>No cameras were scored.</p>"
    overlap = escaped(evaluation.settings.in_words(("overlap",)))
    heads = ("", ">true boxes", ">boxes", f">found, {overlap}", ">false a picture",
             ">centre error (px)", ">95 % (px)", ">mean IoU")  # fmt: skip
    return _table(
        heads,
        (
            _row(
                escaped(score.camera), f">{score.people}", f">{score.estimates}",
                f">{_share(score.found_share)}", f">{number(score.false_per_step, 3)}",
                f">{number(score.error, 1)}", f">{number(score.error_95, 1)}",
                f">{number(score.overlap, 3)}",
            )
            for score in evaluation.cameras
        ),
    )  # fmt: skip


def parameter_table(
    parameters: RunParameters | Mapping[str, str] | None, sequence: Sequence
) -> str:
    """Return the table of the parameters that the run depends on.

    Values that differ from the recording's defaults are marked.
    """
    if parameters is None:
        return "<p class='muted'>The parameters of these tracks are not known.</p>"
    if isinstance(parameters, RunParameters):
        return _changed_table(parameters, _defaults(sequence))
    parameters = with_current_keys(parameters)
    known = {k: v for k, v in parameters.items() if k in PARAMETERS or k in METHODS}
    try:
        defaults = _defaults(sequence)
        return _changed_table(with_values(defaults, known), defaults)
    except ParameterError:  # the file is of another version: show its text
        return _table(("", "value"), [_row(escaped(k), escaped(v)) for k, v in parameters.items()])


def _defaults(sequence: Sequence) -> RunParameters:
    try:
        return default_parameters(sequence)
    except ValueError:  # the sequence has truth alone, to evaluate tracks from elsewhere
        return RunParameters()


def _changed_table(parameters: RunParameters, defaults: RunParameters) -> str:
    """Return the table of all parameters with an effect; those that differ from the defaults are
    marked."""
    used: dict[str, Any] = {key: value_of(parameters, key) for key in METHODS}
    for stage in ("single_view", "fusion", "smoothing", "tracks"):
        used |= stage_values(parameters, stage)
    changed = changed_values(parameters, defaults)
    rows, group = [], ""
    for key in used:
        parameter = PARAMETERS.get(key)
        if parameter and parameter.group != group:
            group = parameter.group
            own = group in METHODS["single_view"]
            words = group if own else group.replace("_", " ").capitalize()
            rows.append(f'<tr class="group"><th colspan="6" scope="rowgroup">{words}</th></tr>')
        rows.append(
            _row(
                parameter.label if parameter else key.replace("_", " ").capitalize(),
                escaped(parameter.symbol) if parameter else "",
                f">{_value(used[key])}",
                escaped(parameter.unit) if parameter else "",
                f">{_value(value_of(defaults, key))}",
                f"<span class='muted'>{escaped(parameter.help)}</span>" if parameter else "",
                kind="changed" if key in changed else "",
            )
        )
    count = sum(key in changed for key in used)
    text = "all at their defaults" if not count else f"{count} changed from the default, marked"
    heads = ("", "symbol", ">value", "unit", ">default", "")
    return f"<p class='muted'>{len(used)} parameters, {text}.</p>" + _table(heads, rows)


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else escaped(value)
