"""How well people are found: the figures that a change must not make worse.

Of every recording at hand a piece is tracked with the defaults, real ones where they lie
beside the checkout; they are the pieces of the golden tests, in their longer form.
"""

from __future__ import annotations

from collections.abc import Iterator

from tests.benchmarks.engine.pipeline import DATA
from tests.benchmarks.measure import Measurement
from tests.golden.pieces import PIECES, Piece
from tracker.evaluation import BY_KEY, Evaluation, evaluate_sequence
from tracker.runs import pipeline

TOLERANCES = {"mota": 0.01, "idf1": 0.02, "ospa": 0.01, "found_share": 0.01}
"""By how much a figure may be worse than the last one on record: MOTA, IDF1 and the share of
people found as they are, OSPA in metres. One exchange of two ids in a piece, which the last bits
of a processor may decide, is within it in none but the shortest."""


def run(short: bool) -> Iterator[Measurement]:
    """MOTA, IDF1, OSPA and the share of people found, of every recording at hand."""
    for piece in PIECES:
        if not piece.real or (DATA / piece.name).is_dir():
            yield from _of(piece)


def tracked(piece: Piece) -> Evaluation:
    """The piece, tracked with the defaults and scored with them."""
    sequence = piece.open(DATA)
    done = pipeline.compute(
        sequence, pipeline.default_parameters(sequence), steps=piece.long_steps, seed=0
    )
    return evaluate_sequence(sequence, done.tracks, steps=piece.long_steps)


def _of(piece: Piece) -> Iterator[Measurement]:
    found = tracked(piece)
    for key, tolerance in TOLERANCES.items():
        value, definition = found[key], BY_KEY[key]
        assert value is not None
        yield Measurement(
            f"{piece.name}, {piece.long_steps} steps: {definition.name}",
            float(value),
            definition.unit_for(found.settings),
            better="higher" if definition.direction == "higher" else "lower",
            tolerance=tolerance,
        )
