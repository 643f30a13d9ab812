"""The HTML report of a run whose sequence has ground truth."""

from __future__ import annotations

from pathlib import Path

from tracker.evaluation import evaluate_sequence
from tracker.export.exported_run import ExportedRun, Options


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Evaluate the tracks, and write the report."""
    from tracker.evaluation.report.page import report_html  # imports plotly

    sequence = run.sequence
    evaluation = evaluate_sequence(sequence, run.tracks, steps=run.steps)
    text = report_html(
        sequence,
        run.tracks,
        run.parameters,
        evaluation,
        seed=run.seed,
        back=run.back,
    )
    path.write_text(text, encoding="utf-8")
    options.at(run.steps, run.steps)
