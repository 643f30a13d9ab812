"""Export of corrected tracks as ground truth, for the steps that a user has checked."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from typing import TextIO

import numpy as np

from tracker.corrections.kinds import Correction, CorrectionError
from tracker.sequences.sequence import LabelledPositions
from tracker.sequences.tables import KNOWN_STEPS


def checked_ranges(corrections: Iterable[Correction]) -> list[tuple[int, int]]:
    """The checked steps as ranges without overlap, ascending, both ends included."""
    found: list[tuple[int, int]] = []
    for first, last in sorted(one.steps for one in corrections if one.kind == "checked"):
        if found and first <= found[-1][1] + 1:
            found[-1] = found[-1][0], max(found[-1][1], last)
        else:
            found.append((first, last))
    return found


def write_truth(
    stream: TextIO, tracks: LabelledPositions, corrections: Iterable[Correction]
) -> None:
    """Write the tracks of the checked steps in the form of a sequence's ground truth.

    A comment at the top names these steps: other steps have no truth and are not evaluated.

    Args:
        stream: Text stream, opened with ``newline=""``.
        tracks: Tracks of a run with the corrections, by step and then id.
        corrections: The corrections, among them those of kind ``checked``.

    Raises:
        CorrectionError: If no step was checked.
    """
    ranges = checked_ranges(corrections)
    if not ranges:
        raise CorrectionError("no step was checked yet: look at some, and mark them as checked")
    known = np.zeros(len(tracks.frames), dtype=bool)
    for first, last in ranges:
        known |= (tracks.frames >= first) & (tracks.frames <= last)
    spans = " ".join(f"{first}-{last}" for first, last in ranges)
    stream.write(f"# {KNOWN_STEPS} = {spans}\n")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(("frame", "id", "x", "y", "z"))
    for row in np.flatnonzero(known).tolist():
        place = (f"{value + 0.0:.4f}" for value in tracks.positions[row].tolist())
        writer.writerow((int(tracks.frames[row]), int(tracks.ids[row]), *place))
