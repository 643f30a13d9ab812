"""The HTML report of a run whose sequence has ground truth."""

from __future__ import annotations

from pathlib import Path

from tracker.evaluation import evaluate_sequence
from tracker.export.written import Options, Written


def write(path: Path, written: Written, options: Options) -> None:
    """Evaluate the tracks and write the report."""
    from tracker.evaluation.report.page import report_html  # brings plotly

    sequence = written.sequence
    evaluation = evaluate_sequence(sequence, written.tracks, steps=written.steps)
    text = report_html(
        sequence,
        written.tracks,
        written.parameters,
        evaluation,
        seed=written.seed,
        back=written.back,
    )
    path.write_text(text, encoding="utf-8")
    options.at(written.steps, written.steps)
