"""Parquet of boxes or places: the columns are those of a CSV. Needs the extra ``parquet``.

Source: Apache Parquet, "File format"; read by pyarrow.
"""

from __future__ import annotations

from collections.abc import Iterator

from tracker.io.read.columns import is_table, read_table
from tracker.io.read.pieces import Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import MOST_BYTES, SourceFile

NAME = "table of boxes or places (Parquet)"
KIND: Kind = "detections"
SERIES = False

MOST_CELLS = 50_000_000


def recognise(file: SourceFile) -> Certainty:
    """The signature of the format."""
    return Certainty.SURE if file.head.startswith(b"PAR1") else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece a camera."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise file.error(
            "is a Parquet file, which is read with pyarrow; pip install 'multiview-phd[parquet]', "
            "or save it as CSV"
        ) from None
    if file.size > MOST_BYTES:
        file.bytes()  # says so
    try:
        with pq.ParquetFile(file.path) as opened:
            names = list(opened.schema_arrow.names)
            if opened.metadata.num_rows * max(len(names), 1) > MOST_CELLS:
                raise file.error(
                    f"has more than {MOST_CELLS:,} cells; leave out what is not needed"
                )
            columns = opened.read().to_pydict()
    except (pa.ArrowException, OSError, EOFError) as error:
        reason = str(error).splitlines()[0]
        raise file.error(f"cannot be read as Parquet ({reason}); get the file again") from None
    if not is_table(names):
        raise file.error(
            f"expected columns of boxes or of places with frame and id, found {', '.join(names)}"
        )
    yield from read_table(file, NAME, columns)
