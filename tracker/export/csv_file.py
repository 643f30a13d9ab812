"""The export format CSV: the track file, which the program itself reads back."""

from __future__ import annotations

from pathlib import Path

from tracker.export import tracks_csv
from tracker.export.exported_run import ExportedRun, Options


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as a track file."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        tracks_csv.write_tracks_csv(
            stream,
            run.sequence,
            run.tracks,
            run.parameters,
            run.seed,
            done=run.done,
            remarks=run.remarks,
            row_corrections=run.row_corrections,
            names=run.names,
        )
    options.at(run.steps, run.steps)
