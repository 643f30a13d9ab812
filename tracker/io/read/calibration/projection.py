"""3×4 projection matrices, poses [R | t] or lenses K, as text or ``.npy``.

Text: twelve numbers a camera, in three lines or in one, with or without a name before them
(KITTI's ``P0: …``). A left part that is a rotation makes it a pose without a lens; nine numbers
that are a K make a lens without a pose. A rotation in a file of its own, ``R.txt`` or
``cam1_rvec.txt``, is a pose with the translation in the file beside it, ``t.txt`` or
``cam1_tvec.txt``.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.geometry.calibration import is_rotation
from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import NPY, SourceFile, npy_header, read_npy
from tracker.io.read.values import NUMBER, intrinsics

NAME = "matrices P, [R | t] or K"
KIND: Kind = "calibration"
SERIES = False

MOST_CAMERAS = 1000

_TURNED = re.compile(r"(?<![A-Za-z])(r|rot|rotation|rvec|rotation_?matrix)$", re.IGNORECASE)
_MOVED = re.compile(r"(?<![A-Za-z])(t|trans|translation|tvec)$", re.IGNORECASE)
"""What the names of files of a rotation, and of a translation, end with."""

_SHORT = 2000
"""Bytes that up to nine numbers take."""

_ROW = re.compile(
    rf"\s*(?:([A-Za-z_]\w*)\s*[:=,\s]\s*)?[\[(\s]*({NUMBER}(?:[\s,;]+{NUMBER})*)[\])\s,;]*"
)


def recognise(file: SourceFile) -> Certainty:
    """A NumPy array of 3×4, 4×4 or K matrices, or a text of nothing but rows of them."""
    if file.head.startswith(NPY):
        return Certainty.LIKELY if _shape(file) else Certainty.NO
    if file.size > 2**20 or not file.is_text:
        return Certainty.NO
    known = _blocks(file.head_text) or _halves(file) is not None
    return Certainty.LIKELY if known else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with every camera."""
    if file.head.startswith(NPY):
        array = read_npy(file.bytes(2**20)).astype(float)
        array = array.reshape(-1, *array.shape[-2:])[:, :3]
        found = [("" if len(array) == 1 else str(n), matrix) for n, matrix in enumerate(array)]
    elif (halves := _halves(file)) is not None:
        if not _MOVED.search(file.path.stem):  # the other half is read with it
            camera = RawCamera("", rotation=halves[0], translation=halves[1])
            yield CalibrationPiece(file.path, NAME, (camera,))
        return
    else:
        found = _blocks(file.text(2**20)) or []
    yield CalibrationPiece(file.path, NAME, tuple(_camera(file, *item) for item in found))


def _camera(file: SourceFile, name: str, matrix: Float[ndarray, "3 n"]) -> RawCamera:
    if not np.isfinite(matrix).all():
        raise file.error(
            f"expected finite numbers, found {shown(matrix.tolist())}; calibrate again",
            f"camera {name}".strip(),
        )
    if matrix.shape == (3, 3) and is_rotation(matrix):
        raise file.error(
            "is a rotation alone, expected [R | t] or a lens; save K, R and t of a camera "
            "together as .npz"
        )
    if matrix.shape == (3, 3):
        return RawCamera(name, intrinsics=intrinsics(file, f"camera {name}".strip(), matrix))
    if is_rotation(matrix[:, :3]):
        return RawCamera(name, rotation=matrix[:, :3], translation=matrix[:, 3])
    convention = Convention(direction="world-to-camera", axes="opencv")
    return RawCamera(name, projection=matrix, convention=convention)


def _halves(file: SourceFile) -> tuple[Float[ndarray, "3 3"], Float[ndarray, " 3"]] | None:
    """Rotation and translation in two files, of which this is one; None for any other file."""
    turned, moved = _TURNED.search(file.path.stem), _MOVED.search(file.path.stem)
    if turned is None and moved is None:
        return None
    values = []
    for own, other in ((_TURNED, _MOVED), (_MOVED, _TURNED)):
        member = file
        if own.search(file.path.stem) is None:
            stem = other.sub("", file.path.stem)
            beside = (
                path
                for path in sorted(file.path.parent.glob(f"*{file.path.suffix}"))
                if own.search(path.stem)
                and own.sub("", path.stem) == stem
                and not path.is_symlink()
            )
            path = next(beside, None)
            if path is None:
                return None
            member = file.member(path)
            file.companions.append(path)
        words = re.findall(NUMBER, member.head_text) if member.size < _SHORT else []
        if re.sub(rf"{NUMBER}|[\s,;\[\]]", "", member.head_text) or len(words) not in (3, 9):
            return None
        values.append(np.array(words, dtype=float))
    rotation, translation = values
    if len(translation) != 3 or (len(rotation) == 9 and not is_rotation(rotation.reshape(3, 3))):
        return None
    matrix = cv2.Rodrigues(rotation)[0] if len(rotation) == 3 else rotation.reshape(3, 3)
    return np.asarray(matrix), translation


def _is_lens(matrix: Float[ndarray, "3 3"]) -> bool:
    """Whether it is upper triangular with focal lengths of some pixels, as no rotation is."""
    return (
        bool(np.abs(matrix[[1, 2, 2], [0, 0, 1]]).max() < 1e-9)
        and matrix[2, 2] == 1.0
        and bool((np.diag(matrix)[:2] > 10.0).all())
    )


def _shape(file: SourceFile) -> tuple[int, ...] | None:
    """The shape of an array of matrices, from its header alone."""
    try:
        shape, kind = npy_header(io.BytesIO(file.head))
    except ValueError:
        return None
    fits = len(shape) in (2, 3) and shape[-2:] in ((3, 3), (3, 4), (4, 4)) and kind.kind in "fiu"
    return shape if fits and (len(shape) == 2 or shape[0] <= MOST_CAMERAS) else None


def _blocks(text: str) -> list[tuple[str, Float[ndarray, "3 n"]]] | None:
    """Name and matrix of every camera; None where the text has anything else."""
    rows: list[tuple[str, list[float]]] = []
    for line in text.splitlines():
        if not line.strip() or line.lstrip().startswith(("#", "%", "//")):
            continue
        match = _ROW.fullmatch(line)
        if match is None or len(rows) > 4 * MOST_CAMERAS:
            return None
        values = [float(word) for word in re.split(r"[\s,;]+", match[2])]
        rows.append((match[1] or "", values))
    lengths = {len(values) for _, values in rows}
    if lengths == {12}:
        names = [name or (str(n) if len(rows) > 1 else "") for n, (name, _) in enumerate(rows)]
        return [(n, np.reshape(v, (3, 4))) for n, (_, v) in zip(names, rows, strict=True)]
    if lengths == {3} and len(rows) == 3:
        lens = np.array([values for _, values in rows])
        return [("", lens)] if _is_lens(lens) else None
    if lengths != {4}:
        return None
    table = np.array([values for _, values in rows])
    if len(table) % 4 == 0 and (np.abs(table[3::4] - [0.0, 0.0, 0.0, 1.0]) < 1e-12).all():
        table = np.delete(table, np.s_[3::4], axis=0)
    if len(table) % 3 or len(table) == 0:
        return None
    count = len(table) // 3
    return [
        ("" if count == 1 else str(n), block) for n, block in enumerate(table.reshape(-1, 3, 4))
    ]
