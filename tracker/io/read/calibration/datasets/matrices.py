"""Text files of data sets with a lens K and a pose, without distortion.

The pose leads from the world to the camera: a point is seen at K (R x + t); the unit is the data
set's own.

Sources: Seitz et al., "A comparison and evaluation of multi-view stereo reconstruction
algorithms", CVPR 2006, and the README of its data sets; Yao et al., "MVSNet", ECCV 2018, and the
files of its data sets (DTU, BlendedMVS).
"""

from __future__ import annotations

from typing import Any

from tracker.io.read import values
from tracker.io.read.pieces import Convention
from tracker.io.read.source import SourceFile
from tracker.io.read.tree_format import TreeFormat, intrinsics, name, pose, pose_matrix, stem

MOST_BYTES = 2**22
_WORLD_TO_CAMERA = Convention(direction="world-to-camera", axes="opencv")
_NUMBERS = 21
"""K, R and t of a row."""


def _is_middlebury(file: SourceFile) -> bool:
    """The count of rows, and a first one with a picture's name and 21 numbers."""
    first, *rest = file.head_text.split("\n", 2)
    row = rest[0].split() if rest else []
    return first.strip().isdigit() and len(row) == 1 + _NUMBERS and "." in row[0]


def _rows(file: SourceFile) -> list[tuple[str, Any]]:
    """A row a picture: its name, K, R and t."""
    first, *lines = file.text(MOST_BYTES).splitlines()
    rows = [line.split() for line in lines if line.strip()]
    if not first.strip().isdigit() or int(first) != len(rows):
        raise file.error(f"line 1: expected the count of rows below it, found {first.strip()[:20]}")
    found = []
    for number, (picture, *cells) in enumerate(rows, 2):
        given = values.vector(file, f"line {number}", cells, _NUMBERS, "K, R and t")
        found.append((picture, {"K": given[:9], "R": given[9:18], "t": given[18:]}))
    return found


MIDDLEBURY = TreeFormat(
    "Middlebury _par.txt",
    _rows,
    marks=_is_middlebury,
    cameras=iter,
    required=("K", "R", "t"),
    parts=(stem(), intrinsics("K"), pose("R", "t")),
    convention=_WORLD_TO_CAMERA,
)


def _is_mvsnet(file: SourceFile) -> bool:
    """Both words, each before its numbers."""
    words = file.head_text[:4096].split()
    return words[:1] == ["extrinsic"] and "intrinsic" in words


def _words(file: SourceFile) -> dict[str, Any]:
    """The pose, and K, after which come depths, which are not used."""
    words = file.text(MOST_BYTES).split()
    middle = words.index("intrinsic")
    return {"extrinsic": words[1:middle], "intrinsic": words[middle + 1 : middle + 10]}


MVSNET = TreeFormat(
    "MVSNet cam.txt",
    _words,
    marks=_is_mvsnet,
    cameras=".",
    required=("extrinsic", "intrinsic"),
    parts=(name(), intrinsics("intrinsic"), pose_matrix("extrinsic")),
    convention=_WORLD_TO_CAMERA,
)

FORMATS = (MVSNET, MIDDLEBURY)
