"""CMU Panoptic Studio's ``calibration_*.json``: centimetres, y down.

Source: Joo et al., "Panoptic Studio", IEEE TPAMI 41(1), 2019, and its toolbox.
"""

from __future__ import annotations

from collections.abc import Iterator

from tracker.io.read.calibration.camera_fields import by_camera, camera
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import need

NAME = "Panoptic Studio JSON"
KIND: Kind = "calibration"
SERIES = False

_CONVENTION = Convention(unit="cm", direction="world-to-camera", axes="opencv", up="-y")


def recognise(file: SourceFile) -> Certainty:
    """JSON with cameras that have a panel, a node and ``distCoef``."""
    head = file.head_text
    if head.lstrip()[:1] != "{" or '"cameras"' not in head:
        return Certainty.NO
    marks = ('"distCoef"', '"panel"', '"node"')
    return Certainty.SURE if all(mark in head for mark in marks) else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera, the hundreds of VGA panels among them."""
    need(file, file.json, ("cameras",))
    found = []
    for place, table in enumerate(file.json["cameras"]):
        where = f"camera {place}"
        need(file, table, ("name", "resolution", "K", "distCoef", "R", "t"), where)
        fields = by_camera({k: v for k, v in table.items() if k not in ("type", "panel", "node")})
        if "" not in fields:
            raise file.error("expected K with 9 numbers, R with 9 and t with 3", where)
        found.append(camera(file, str(table["name"]), fields[""], _CONVENTION))
    yield CalibrationPiece(file.path, NAME, tuple(found))
