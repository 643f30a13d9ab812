"""The calibration of one camera in ``sequence.toml``, with its validation."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tracker.files.text import shown
from tracker.geometry.calibration import (
    check_focal_lengths,
    checked_distortion,
    checked_intrinsics,
    checked_rotation,
)
from tracker.geometry.camera import Camera
from tracker.sequences.errors import SequenceError
from tracker.sequences.fields import LARGEST, Fields, listed
from tracker.sequences.sequence import Room

POSE = ("K", "distortion", "lens", "R", "t")
"""The fields of a calibration without ``projection``."""


def read_camera(name: str, image_size: tuple[int, int], fields: Fields) -> Camera:
    """Read the calibration of one ``[[camera]]`` table.

    Args:
        name: The camera's name.
        image_size: Width and height of its pictures, pixels.
        fields: The table.

    Raises:
        SequenceError: If the calibration is incomplete, of the wrong shape, or impossible.
    """
    if "projection" in fields:
        both = [key for key in POSE if key in fields]
        if both:
            raise fields.error(
                "projection", f"stands in place of {listed(both)}; remove one or the other"
            )
        projection = fields.matrix("projection", 3, 4)
        try:
            with np.errstate(all="ignore"):
                camera = Camera.from_projection(name, image_size, projection)
        except ValueError as error:
            raise fields.error("projection", str(error)) from None
        fields.checked("projection", check_focal_lengths, camera.intrinsics)
        if not np.abs(camera.translation).max() <= LARGEST:
            raise fields.error(
                "projection",
                f"expected a camera within {LARGEST:g} m of the origin, found one at "
                f"{np.abs(camera.translation).max():.4g} m",
            )
        return camera
    missing = [key for key in ("K", "R", "t") if key not in fields]
    if missing:
        raise SequenceError(
            f"{fields.where}: the calibration is incomplete: expected K, R and t, or projection; "
            f"{listed(missing)} {'is' if len(missing) == 1 else 'are'} missing"
        )
    lens = fields.text("lens", "plain")
    if lens not in ("plain", "fisheye"):
        raise fields.error("lens", f'expected "plain" or "fisheye", found {shown(lens)}')
    intrinsics = fields.checked("K", checked_intrinsics, fields.matrix("K", 3, 3))
    fields.checked("K", check_focal_lengths, intrinsics)
    distortion, _ = fields.checked(
        "distortion", checked_distortion, fields.numbers("distortion"), fisheye=lens == "fisheye"
    )
    return Camera(
        name,
        image_size,
        intrinsics,
        fields.checked("R", checked_rotation, fields.matrix("R", 3, 3)),
        fields.vector("t", 3, "metres, in camera axes"),
        distortion,
        fisheye=lens == "fisheye",
    )


def check_view_of_room(camera: Camera, room: Room) -> Iterator[str]:
    """Yield a warning if a camera sees nothing of the room, usually since its pose is inverted."""
    steps = np.linspace(0.0, 1.0, 13)
    grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    if not camera.sees(room.minimum + grid * (room.maximum - room.minimum)).any():
        yield (
            f'camera "{camera.name}" sees nothing of the room: check that R and t lead from world '
            "to camera (x_cam = R x_world + t), that t is in metres, and [room]"
        )
