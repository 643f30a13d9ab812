"""The export format Parquet: the columns of the track file in full precision, as one table."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tracker import __version__
from tracker.export.exported_run import ExportedRun, Options
from tracker.export.tracks_csv import BOX, COLUMNS, CORRECTION, COVARIANCE, HEIGHT, NAME

_ROWS = 1 << 17
"""Number of rows of a row group, which is held in memory."""


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as a Parquet table, a row group at a time."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    sequence, tracks = run.sequence, run.tracks
    settings = {key: str(value) for key, value in run.settings.items()}
    facts = {"sequence": sequence.name, "fps": sequence.fps, "seed": run.seed}
    metadata = {
        "multiview-phd": json.dumps({"version": __version__, **facts, "parameters": settings})
    }
    values = (
        tracks.frames,
        tracks.frames * sequence.step_time,
        tracks.ids,
        *tracks.positions.T,
        tracks.existences,
        *tracks.sigmas.T,
    )
    columns: dict[str, np.ndarray] = dict(zip(COLUMNS, values, strict=True))
    if run.names:
        called = [run.names.get(track, "") for track in tracks.ids.tolist()]
        columns[NAME] = np.array(called, dtype=object)
    if run.row_corrections:
        columns[CORRECTION] = np.array(run.row_corrections, dtype=object)
    for index, camera in enumerate(sequence.cameras):
        boxes, visible = run.boxes[index]
        columns[f"{camera.name}_seen"] = tracks.seen[:, index]
        for k, side in enumerate(BOX):
            columns[f"{camera.name}_{side}"] = np.where(visible, boxes[:, k], np.nan)
    columns[COVARIANCE] = tracks.covariances_xy
    columns |= dict(zip(HEIGHT, (tracks.heights, tracks.sigma_heights), strict=True))
    kinds = {  # the type of a text column cannot be inferred when it has no rows
        name: pa.string() if values.dtype == object else pa.array(values[:0]).type
        for name, values in columns.items()
    }
    shape = pa.schema(list(kinds.items()), metadata=metadata)
    with pq.ParquetWriter(path, shape, compression="zstd") as file:
        for first in range(0, len(tracks), _ROWS):
            options.at(first, len(tracks))
            part = {
                name: pa.array(values[first : first + _ROWS], from_pandas=True)
                for name, values in columns.items()
            }
            file.write_table(pa.table(part, schema=shape))
    options.at(len(tracks), len(tracks))
