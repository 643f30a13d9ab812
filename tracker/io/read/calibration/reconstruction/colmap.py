"""COLMAP's text model: ``images.txt`` with the poses, ``cameras.txt`` beside it with the lenses.

Poses lead from world to camera in OpenCV's axes; the scale and the direction of up are
arbitrary. Pixels have their origin at the corner of the top-left pixel.

Source: Schönberger, Frahm, "Structure-from-Motion Revisited", CVPR 2016; COLMAP, "Output
format" and "Camera models".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.files.text import shown
from tracker.io.read.pieces import CalibrationPiece, Convention, Lens, Piece, RawCamera
from tracker.io.read.protocol import Certainty, Kind
from tracker.io.read.source import SourceFile
from tracker.io.read.values import focal_and_centre, image_size, numbers

NAME = "COLMAP text model"
KIND: Kind = "calibration"
SERIES = False

CORNER = 0.5
"""Pixels from the corner of a pixel to its centre."""

MOST_IMAGES = 100
"""Cameras that stand still have one image each; a model of more is that of a moving camera."""

_ROUNDED = 1e-3
"""By how much the numbers of a rounded unit quaternion may exceed 1."""

MODELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "SIMPLE_PINHOLE": ("pinhole", ("f", "cx", "cy")),
    "PINHOLE": ("pinhole", ("fx", "fy", "cx", "cy")),
    "SIMPLE_RADIAL": ("pinhole", ("f", "cx", "cy", "k1")),
    "RADIAL": ("pinhole", ("f", "cx", "cy", "k1", "k2")),
    "OPENCV": ("pinhole", ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")),
    "FULL_OPENCV": (
        "rational",
        ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    ),
    "OPENCV_FISHEYE": ("fisheye", ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")),
    "SIMPLE_RADIAL_FISHEYE": ("fisheye", ("f", "cx", "cy", "k1")),
    "RADIAL_FISHEYE": ("fisheye", ("f", "cx", "cy", "k1", "k2")),
}
"""Lens and parameters of each model that OpenCV has too."""

ORDER: dict[str, tuple[str, ...]] = {
    "pinhole": ("k1", "k2", "p1", "p2", "k3"),
    "rational": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}

_CONVENTION = Convention(direction="world-to-camera", axes="opencv")
_POSE = re.compile(r"\d+(\s+-?[\d.]+(e[-+]?\d+)?){7}\s+\d+\s+\S.*", re.IGNORECASE)
_LENS = re.compile(r"\d+\s+[A-Z_]{3,}\s+\d+\s+\d+(\s+-?[\d.]+(e[-+]?\d+)?)+\s*", re.IGNORECASE)


def recognise(file: SourceFile) -> Certainty:
    """Lines of a pose and an image's name, or lines of a model's name and its parameters."""
    rows = _rows(file.head_text.splitlines()[:20])
    if not rows:
        return Certainty.NO
    is_it = _LENS.fullmatch(rows[0]) or (_POSE.fullmatch(rows[0]) and _is_turned(rows[0]))
    return Certainty.SURE if is_it else Certainty.NO


def _is_turned(row: str) -> bool:
    """Whether the four numbers after the first may be a unit quaternion, and are no box."""
    return all(abs(float(number)) <= 1.0 + _ROUNDED for number in row.split()[1:5])


def read(file: SourceFile) -> Iterator[Piece]:
    """One piece with a camera an image, from ``images.txt``; ``cameras.txt`` is read with it."""
    rows = _rows(file.lines())
    if _LENS.fullmatch(rows[0]):
        if not any(_is_poses(file.member(path)) for path in _beside(file)):
            raise file.error(
                "has COLMAP's lenses, but images.txt with the poses is not beside it; "
                "export the model as text (model_converter --output_type TXT)"
            )
        return
    lenses = [path for path in _beside(file) if _is_lenses(file.member(path))]
    if not lenses:
        raise file.error("has COLMAP's poses, but cameras.txt with the lenses is not beside it")
    by_id = _lenses(file.member(lenses[0]))
    cameras = [_camera(file, row, by_id) for row in rows if _POSE.fullmatch(row)]
    if len(cameras) > MOST_IMAGES:
        raise file.error(
            f"has {len(cameras)} images, expected one image a camera that stands still, "
            f"at most {MOST_IMAGES}; export the model of one moment"
        )
    yield CalibrationPiece(file.path, NAME, tuple(cameras))


def model_lens(
    file: SourceFile, field: str, model: str, values: dict[str, float]
) -> tuple[Float[ndarray, "3 3"], Float[ndarray, " n"], Lens]:
    """K, with the pixel's origin at its centre, and the lens of a model by its name.

    Raises:
        FormatError: If OpenCV has no such model.
    """
    if model not in MODELS:
        known = ", ".join(MODELS)
        raise file.error(
            f"has a lens of the model {shown(model)}, expected one of {known}; "
            "reconstruct with one of those",
            field,
        )
    name, _ = MODELS[model]
    kind: Lens = "rational" if name == "rational" else "fisheye" if name == "fisheye" else "pinhole"
    fx = values["f"] if "f" in values else values["fx"]
    fy = values["f"] if "f" in values else values["fy"]
    k = focal_and_centre(fx, fy, values["cx"] - CORNER, values["cy"] - CORNER)
    return k, np.array([values.get(part, 0.0) for part in ORDER[kind]]), kind


def _rows(lines: list[str]) -> list[str]:
    return [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]


def _beside(file: SourceFile) -> list[Path]:
    """The other text files of the folder."""
    return [p for p in sorted(file.path.parent.glob("*.txt")) if p != file.path]


def _is_poses(file: SourceFile) -> bool:
    rows = _rows(file.head_text.splitlines()[:20])
    return bool(rows) and _POSE.fullmatch(rows[0]) is not None


def _is_lenses(file: SourceFile) -> bool:
    rows = _rows(file.head_text.splitlines()[:20])
    return bool(rows) and _LENS.fullmatch(rows[0]) is not None


ColmapLens = tuple[tuple[int, int], Float[ndarray, "3 3"], Float[ndarray, " n"], Lens]


def _lenses(file: SourceFile) -> dict[str, ColmapLens]:
    found: dict[str, ColmapLens] = {}
    for row in _rows(file.lines()):
        key, model, width, height, *parameters = row.split()
        found[key] = read_lens(file, key, model, [width, height], parameters)
    return found


def read_lens(
    file: SourceFile, key: str, model: str, size: list[str], parameters: list[str]
) -> ColmapLens:
    """The size of the pictures and the lens of a camera by its number, model and parameters.

    Raises:
        FormatError: If OpenCV has no such model, or it has another count of parameters.
    """
    field = f"camera {key}"
    names = MODELS.get(model, ("", ()))[1]
    values = numbers(file, field, parameters)
    if names and len(values) != len(names):
        raise file.error(f"expected {len(names)} parameters of {model}, found {len(values)}", field)
    by_name = dict(zip(names, values.tolist(), strict=False))
    return (image_size(file, field, size), *model_lens(file, field, model, by_name))


def _camera(file: SourceFile, row: str, lenses: dict[str, ColmapLens]) -> RawCamera:
    words = row.split(maxsplit=9)
    return posed(file, words[9], words[1:8], words[8], lenses)


def posed(
    file: SourceFile, name: str, pose: list[str], key: str, lenses: dict[str, ColmapLens]
) -> RawCamera:
    """The camera of an image.

    Args:
        file: For the messages.
        name: Of the image.
        pose: Quaternion w x y z and translation.
        key: Of its lens.
        lenses: All of them.

    Raises:
        FormatError: If its lens is not there, or the pose is none.
    """
    from scipy.spatial.transform import Rotation  # a server starts without it

    w, x, y, z, *translation = numbers(file, f"image {name}", pose).tolist()
    if key not in lenses:
        raise file.error(f"camera {key} is not among the lenses", f"image {name}")
    size, k, distortion, kind = lenses[key]
    return RawCamera(
        name=PurePosixPath(name).with_suffix("").as_posix(),
        image_size=size,
        intrinsics=k,
        distortion=distortion,
        lens=kind,
        rotation=np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix()),
        translation=np.array(translation),
        convention=_CONVENTION,
    )
