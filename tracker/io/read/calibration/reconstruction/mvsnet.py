"""MVSNet's ``cam.txt``, a file a camera: a 4×4 pose, K, and depths, which are not used.

The pose leads from the world to the camera; the unit is the reconstruction's own.

Source: Yao et al., "MVSNet", ECCV 2018, and the files of its data sets (DTU, BlendedMVS).
"""

from __future__ import annotations

from collections.abc import Iterator

from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import intrinsics, matrix, rotation

NAME = "MVSNet cam.txt"
KIND: Kind = "calibration"
SERIES = False

_CONVENTION = Convention(direction="world-to-camera", axes="opencv")
MOST_BYTES = 2**16


def recognise(file: SourceFile) -> Certainty:
    """Both words, each before its numbers."""
    words = file.head_text[:4096].split()
    is_it = words[:1] == ["extrinsic"] and "intrinsic" in words
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with the camera, which has the file's name."""
    words = file.text(MOST_BYTES).split()
    middle = words.index("intrinsic")
    pose = matrix(file, "extrinsic", " ".join(words[1:middle]), 4, 4)
    # after K come the least depth and what is between two, and their count
    lens = matrix(file, "intrinsic", " ".join(words[middle + 1 : middle + 10]), 3, 3)
    camera = RawCamera(
        name="",
        intrinsics=intrinsics(file, "intrinsic", lens),
        rotation=rotation(file, "extrinsic", pose[:3, :3]),
        translation=pose[:3, 3],
        convention=_CONVENTION,
    )
    yield CalibrationPiece(file.path, NAME, (camera,))
