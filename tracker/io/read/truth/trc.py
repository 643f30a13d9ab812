"""TRC: the markers or joints of one person in 3D, as OpenSim and Pose2Sim write them; y up.

The person's place is the mid of the hips where joints are named so, else the mid of all.

Source: OpenSim, "Marker (.trc) files".
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.io.read.pieces import Piece, TruthPiece, unit_named
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile

NAME = "TRC markers or joints"
KIND: Kind = "truth"
SERIES = False

HIPS = {"rhip", "lhip", "hip", "midhip", "pelvis", "rasis", "lasis", "rpsis", "lpsis"}

_PERSON = re.compile(r"(?:person|people|player|id|track|target|p)[\W_]*(\d{1,9})")
"""A marker that is a person, one of several, and the person's number."""

_MOST_FRAMES = 1e9
"""Of one file: a year at 30 a second."""


def recognise(file: SourceFile) -> Certainty:
    """The word PathFileType, with which every TRC begins."""
    return Certainty.SURE if file.head_text.startswith("PathFileType") else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece: the place of the one person, whose id is 1, or of each marker that is a person,
    whose number is the id."""
    lines = file.lines()
    if len(lines) < 5:
        raise file.error("expected five lines of a header, found fewer; it is cut short")
    facts = dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=False))
    names = lines[3].rstrip().split("\t")[2::3]
    rows = [line.split("\t") for line in lines[5:] if line.strip()]
    width = 2 + 3 * len(names)
    table = np.full((len(rows), width), np.nan)
    for place, row in enumerate(rows):
        if len(row) < 2 or len(row) > width + 1:
            raise file.error(
                f"row {place + 1}: expected {width} columns by the header, found {len(row)}"
            )
        try:
            values = [float(cell) if cell.strip() else np.nan for cell in row[:width]]
        except ValueError:
            raise file.error(f"expected numbers, found {shown(row)}", f"row {place + 1}") from None
        table[place, : len(values)] = values
    joints = table[:, 2:].reshape(len(rows), len(names), 3)
    names = [name.strip().lower() for name in names]
    found = [int(match[1]) for name in names if (match := _PERSON.fullmatch(name))]
    if names and len(set(found)) == len(names):
        people, own_ids = [joints[:, n] for n in range(len(names))], found
    else:
        people, own_ids = [_middle(joints, names)], [1]
    ids = np.repeat(np.array(own_ids, dtype=np.int64), len(rows))
    place_of, numbers = np.concatenate(people), np.tile(table[:, 0], len(people))
    # of a number that is no frame's nothing is known
    good = np.isfinite(place_of).all(axis=1) & (np.abs(numbers) < _MOST_FRAMES)
    try:
        rate = float(facts.get("DataRate", "nan"))
    except ValueError:
        rate = float("nan")
    frames = numbers[good].astype(np.int64)
    yield TruthPiece(
        source=file.path,
        format=NAME,
        frames=frames,
        ids=ids[good],
        positions=place_of[good],
        unit=unit_named(facts.get("Units", "")),
        up="y",
        fps=rate if np.isfinite(rate) and rate > 0.0 else None,
        first_index=1 if len(frames) == 0 or frames.min() > 0 else 0,
    )


def _middle(joints: Float[ndarray, "F J 3"], names: list[str]) -> Float[ndarray, "F 3"]:
    """The mean of the hips, else of all joints that are there."""
    hips = [n for n, name in enumerate(names) if name.replace("_", "") in HIPS]
    chosen = joints[:, hips] if hips else joints
    there = np.isfinite(chosen).all(axis=2)
    count = there.sum(axis=1)[:, None]
    total = np.where(there[:, :, None], chosen, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
