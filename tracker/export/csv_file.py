"""The export format CSV: the track file, which the program itself reads back."""

from __future__ import annotations

from pathlib import Path

from tracker.export import tracks_csv
from tracker.export.written import Options, Written


def write(path: Path, written: Written, options: Options) -> None:
    """Write a run as a track file."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        tracks_csv.write_tracks_csv(
            stream,
            written.sequence,
            written.tracks,
            written.parameters,
            written.seed,
            done=written.done,
            remarks=written.remarks,
            row_corrections=written.row_corrections,
            names=written.names,
        )
    options.at(written.steps, written.steps)
