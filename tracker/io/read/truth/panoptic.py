"""CMU Panoptic Studio's 3D skeletons: ``body3DScene_*.json``, one file a frame, centimetres.

The person's place is the mid of the body's hips (joint 2 of the 19, "BodyCenter").

Source: Joo et al., "Panoptic Studio", IEEE TPAMI 41(1), 2019, and its toolbox.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.io.read.pieces import Piece, TruthPiece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import field_of, numbers, tables

NAME = "Panoptic Studio 3D skeletons"
KIND: Kind = "truth"
SERIES = True

BODY_CENTRE = 2
JOINTS = ("joints19", "joints15")


def recognise(file: SourceFile) -> Certainty:
    """JSON with bodies."""
    head = file.head_text.lstrip()
    if head[:1] != "{" or '"bodies"' not in head:
        return Certainty.NO
    return Certainty.SURE if any(name in head for name in JOINTS) else Certainty.POSSIBLE


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the places of everybody in all frames of the series."""
    rows: list[tuple[int, int]] = []
    places: list[np.ndarray] = []
    for frame, member in file.frames():
        for body in tables(member, "bodies", field_of(member.json, "bodies")):
            given = next((body[name] for name in JOINTS if name in body), None)
            joints = numbers(member, "joints", [] if given is None else given)
            if len(joints) % 4 or len(joints) <= 4 * BODY_CENTRE:
                raise member.error(
                    "expected x, y, z and confidence of 15 or 19 joints, found "
                    f"{len(joints)} numbers; get the file again",
                    "joints",
                )
            if joints.reshape(-1, 4)[BODY_CENTRE, 3] > 0.0:
                rows.append((frame, int(body.get("id", 0))))
                places.append(joints.reshape(-1, 4)[BODY_CENTRE, :3])
    table = np.array(rows, dtype=np.int64).reshape(-1, 2)
    yield TruthPiece(
        source=file.path,
        format=NAME,
        frames=table[:, 0],
        ids=table[:, 1],
        positions=np.array(places).reshape(-1, 3),
        unit="cm",
        up="-y",
        first_index=0,
    )
