"""What no camera can be, whatever format it came in: refused before anything is computed of it."""

from __future__ import annotations

import numpy as np

from tracker.files.text import shown
from tracker.geometry.calibration import check_focal_lengths
from tracker.geometry.camera import Camera
from tracker.io.read.pieces import CalibrationPiece, RawCamera
from tracker.io.read.source import SourceFile
from tracker.sequences.fields import LARGEST_IN_MATRIX, LONGEST_NAME


def check_cameras(file: SourceFile, piece: CalibrationPiece) -> None:
    """Refuse cameras whose numbers are none of a lens or of a place.

    Raises:
        FormatError: Naming the camera and the field.
    """
    for place, camera in enumerate(piece.cameras):
        if len(camera.name) > LONGEST_NAME:
            raise file.error(
                f"expected a name of at most {LONGEST_NAME} characters, found "
                f"{len(camera.name):,}; shorten it",
                f"camera {place + 1}",
            )
        _check_lens(file, camera)
        _check_pose(file, camera)


def _check_lens(file: SourceFile, camera: RawCamera) -> None:
    try:
        if camera.intrinsics is not None:
            check_focal_lengths(camera.intrinsics)
    except ValueError as error:
        raise file.error(str(error), f"{camera.name} K".strip()) from None


def _check_pose(file: SourceFile, camera: RawCamera) -> None:
    for field, values in (
        ("rotation", camera.rotation),
        ("translation", camera.translation),
        ("projection", camera.projection),
    ):
        if values is not None and not np.abs(values).max() <= LARGEST_IN_MATRIX:
            raise file.error(
                f"expected numbers of at most {LARGEST_IN_MATRIX:g}, "
                f"found {shown(np.asarray(values).tolist())}",
                f"{camera.name} {field}".strip(),
            )
    if camera.projection is not None:
        try:
            Camera.from_projection(camera.name, (1, 1), camera.projection)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise file.error(str(error), f"{camera.name} projection".strip()) from None
