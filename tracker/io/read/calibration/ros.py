"""ROS ``camera_info`` YAML: the lens of one camera, without a pose.

Source: ROS, ``camera_calibration_parsers`` and ``sensor_msgs/CameraInfo``.
"""

from __future__ import annotations

from collections.abc import Iterator

from tracker.io.read.pieces import CalibrationPiece, Convention, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import image_size, intrinsics, lens, need, shown

NAME = "ROS camera_info YAML"
KIND: Kind = "calibration"
SERIES = False

_MODELS = {"plumb_bob": False, "rational_polynomial": False, "equidistant": True, "fisheye": True}
"""Whether each is a fisheye."""


def recognise(file: SourceFile) -> Certainty:
    """YAML with image_width, camera_matrix and distortion_coefficients."""
    head = file.head_text
    marks = ("image_width:", "camera_matrix:", "distortion_coefficients:", "image_height:")
    is_it = all(mark in head for mark in marks) and "opencv-matrix" not in head
    return Certainty.SURE if is_it else Certainty.NO


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with one camera, without a pose."""
    values = file.yaml
    need(file, values, ("image_width", "image_height", "camera_matrix", "distortion_coefficients"))
    model = values.get("distortion_model", "plumb_bob")
    if model not in _MODELS:
        known = ", ".join(_MODELS)
        raise file.error(f"expected one of {known}, found {shown(model)}", "distortion_model")
    for part in ("camera_matrix", "distortion_coefficients"):
        need(file, values[part], ("data",), part)
    distortion, kind = lens(
        file,
        "distortion_coefficients",
        values["distortion_coefficients"]["data"],
        fisheye=_MODELS[model],
    )
    camera = RawCamera(
        name=str(values.get("camera_name", "")),
        image_size=image_size(
            file, "image_width and image_height", [values["image_width"], values["image_height"]]
        ),
        intrinsics=intrinsics(file, "camera_matrix", values["camera_matrix"]["data"]),
        distortion=distortion,
        lens=kind,
        convention=Convention(axes="opencv"),
    )
    yield CalibrationPiece(file.path, NAME, (camera,))
