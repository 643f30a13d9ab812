"""Corrected tracks as a truth: of the steps that a person has looked at, and of no other."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from typing import Protocol, TextIO

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.corrections.kinds import Correction, CorrectionError
from tracker.sequences.tables import KNOWN_STEPS


class Tracks(Protocol):
    """Labelled positions by columns, by step and then id."""

    @property
    def frames(self) -> Int[ndarray, " N"]:
        """The step of each row."""

    @property
    def ids(self) -> Int[ndarray, " N"]:
        """The target of each row."""

    @property
    def positions(self) -> Float[ndarray, "N 3"]:
        """World metres."""


def checked_ranges(corrections: Iterable[Correction]) -> list[tuple[int, int]]:
    """The steps that somebody has looked at: ranges without overlap, both ends included."""
    found: list[tuple[int, int]] = []
    for first, last in sorted(one.steps for one in corrections if one.kind == "checked"):
        if found and first <= found[-1][1] + 1:
            found[-1] = found[-1][0], max(found[-1][1], last)
        else:
            found.append((first, last))
    return found


def write_truth(stream: TextIO, tracks: Tracks, corrections: Iterable[Correction]) -> None:
    """Write the tracks of the checked steps in the form of a sequence's ground truth.

    A comment at the top says which steps these are: of others nothing is known, and nothing
    counts there.

    Args:
        stream: Text, opened with ``newline=""``.
        tracks: Of the run that obeys the corrections.
        corrections: With those that say what was checked.

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
