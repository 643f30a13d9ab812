"""When cameras took their frames: Caliscope's ``timestamps.csv`` and ``frame_time_history.csv``.

A row a frame with its ``frame_time`` in seconds; cameras are told apart by ``cam_id`` or, in
files of earlier versions, ``port``. The k-th row of a camera by time is frame k of its video.

Source: Caliscope, "Synchronized recordings" (columns of its recordings' time stamps).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator

import numpy as np

from tracker.io.read.pieces import Piece, TimesPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.sequences.clock import CAMERAS, STAMP

NAME = "Caliscope time stamps"
KIND: Kind = "time"
SERIES = False


def recognise(file: SourceFile) -> Certainty:
    """A header with ``frame_time``."""
    names = file.head_text.partition("\n")[0].strip().split(",")
    return Certainty.SURE if STAMP in [name.strip() for name in names] else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece a camera."""
    rows = csv.DictReader(io.StringIO(file.text()), skipinitialspace=True)
    own = next((name for name in CAMERAS if name in (rows.fieldnames or ())), None)
    times: dict[str, list[float]] = {}
    for row in rows:
        try:
            time = float(row[STAMP] or "")
        except ValueError:
            time = np.nan
        if not np.isfinite(time):
            raise file.error(
                f"expected seconds, found {row[STAMP]!r}; correct or remove the row",
                f"line {rows.line_num}, {STAMP}",
            )
        times.setdefault("" if own is None else str(row[own]).strip(), []).append(time)
    for camera, found in times.items():
        yield TimesPiece(file.path, camera, np.sort(np.array(found)))
