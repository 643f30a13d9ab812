"""COLMAP's model as text and as it is written by default, binary: ``images.txt`` or
``images.bin`` with the poses, ``cameras.txt`` or ``cameras.bin`` beside it with the lenses.

Poses lead from world to camera in OpenCV's axes; the scale and the direction of up are
arbitrary. Pixels have their origin at the corner of the top-left pixel.

The binary files are little-endian; a count of records, then: of an image its number, quaternion
w x y z, translation, camera, name ended by a zero, and so many points of 24 bytes; of a camera its
number, model, width, height and the model's parameters.

Source: Schönberger, Frahm, "Structure-from-Motion Revisited", CVPR 2016; COLMAP, "Output
format" and "Camera models".
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tracker.files.text import shown
from tracker.geometry.calibration import Lens
from tracker.io.read import values
from tracker.io.read.pieces import Convention
from tracker.io.read.source import SourceFile
from tracker.io.read.tree_format import TreeFormat, pose_of_quaternion, stem

CORNER = 0.5
"""Pixels from the corner of a pixel to its centre."""

MOST_IMAGES = 100
"""Cameras that stand still have one image each; a model of more is that of a moving camera."""

_ROUNDED = 1e-3
"""By how much the numbers of a rounded unit quaternion may exceed 1."""

MODELS: dict[str, tuple[Lens, tuple[str, ...]]] = {
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
"""LensRow and parameters of each model that OpenCV has too."""

ORDER: dict[Lens, tuple[str, ...]] = {
    "pinhole": ("k1", "k2", "p1", "p2", "k3"),
    "rational": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "fisheye": ("k1", "k2", "k3", "k4"),
}

_POSE = re.compile(r"\d+(\s+-?[\d.]+(e[-+]?\d+)?){7}\s+\d+\s+\S.*", re.IGNORECASE)
_LENS = re.compile(r"\d+\s+[A-Z_]{3,}\s+\d+\s+\d+(\s+-?[\d.]+(e[-+]?\d+)?)+\s*", re.IGNORECASE)


def model_lens(
    file: SourceFile, field: str, model: str, found: Mapping[str, float]
) -> dict[str, Any]:
    """K, with the pixel's origin at its centre, and the lens of a model by its name.

    Raises:
        FormatError: If OpenCV has no such model.
    """
    if model not in MODELS:
        raise file.error(
            f"has a lens of the model {shown(model)}, expected one of {', '.join(MODELS)}; "
            "reconstruct with one of those",
            field,
        )
    kind, names = MODELS[model]
    fx, fy = (found["f"], found["f"]) if "f" in names else (found["fx"], found["fy"])
    return {
        "intrinsics": values.focal_and_centre(fx, fy, found["cx"] - CORNER, found["cy"] - CORNER),
        "distortion": np.array([found.get(part, 0.0) for part in ORDER[kind]]),
        "lens": kind,
    }


LensRow = tuple[str, str, Any, Any]
"""Number, model, width and height, and parameters of a lens as the file has them."""

ImageRow = tuple[str, Any, str]
"""Name, pose and number of the lens of an image as the file has them."""


@dataclass(frozen=True, slots=True)
class _Form:
    """One of the two forms of a model, each of which has the poses in one file, the lenses in
    another."""

    suffix: str
    has_poses: Callable[[SourceFile], bool]
    has_lenses: Callable[[SourceFile], bool]
    images: Callable[[SourceFile], Iterable[ImageRow]]
    lenses: Callable[[SourceFile], Iterable[LensRow]]

    def is_it(self, file: SourceFile) -> bool:
        """Whether a file has the poses or the lenses of a model."""
        return self.has_lenses(file) or self.has_poses(file)

    def tree(self, file: SourceFile) -> list[tuple[str, Any]] | None:
        """The images with their poses and lenses; None for the lenses, which are read with them.

        Raises:
            FormatError: If the other file is not there, or has no lens of an image.
        """
        beside = [
            file.member(path)
            for path in sorted(file.path.parent.glob(f"*{self.suffix}"))
            if path != file.path
        ]
        if self.has_lenses(file):
            if not any(map(self.has_poses, beside)):
                raise file.error(
                    f"has COLMAP's lenses, but images{self.suffix} with the poses is not "
                    "beside it; copy it there"
                )
            return None
        lenses = next(filter(self.has_lenses, beside), None)
        if lenses is None:
            raise file.error(
                f"has COLMAP's poses, but cameras{self.suffix} with the lenses is not "
                "beside it; copy it there"
            )
        file.companions.append(lenses.path)
        try:
            by_key = {key: _lens(lenses, key, *own) for key, *own in self.lenses(lenses)}
            images = list(self.images(file))
        except struct.error:
            raise file.error(
                "ends within a record; it may be cut short: get the file again"
            ) from None
        for name, _, key in images:
            if key not in by_key:
                raise file.error(f"camera {key} is not among the lenses", f"image {name}")
        return [(name, {"pose": pose, "lens": by_key[key]}) for name, pose, key in images]


def _lens(file: SourceFile, key: str, model: str, size: Any, parameters: Any) -> dict[str, Any]:
    """The size of the pictures and the lens of a camera.

    Raises:
        FormatError: If OpenCV has no such model, or it has another count of parameters.
    """
    field = f"camera {key}"
    names = MODELS.get(model, ("", ()))[1]
    found = values.numbers(file, field, parameters)
    if names and len(found) != len(names):
        raise file.error(f"expected {len(names)} parameters of {model}, found {len(found)}", field)
    by_name = dict(zip(names, found.tolist(), strict=False))
    return {
        "image_size": values.image_size(file, field, size),
        **model_lens(file, field, model, by_name),
    }


def _rows(text: str) -> list[str]:
    lines = (line.strip() for line in text.splitlines())
    return [line for line in lines if line and not line.startswith("#")]


def _first_row(file: SourceFile) -> str:
    return next(iter(_rows("\n".join(file.head_text.splitlines()[:20]))), "")


def _has_poses(file: SourceFile) -> bool:
    """Whether the first row is a pose: its quaternion may be one of unit length, and no box."""
    row = _first_row(file)
    return _POSE.fullmatch(row) is not None and all(
        abs(float(number)) <= 1.0 + _ROUNDED for number in row.split()[1:5]
    )


def _images(file: SourceFile) -> Iterator[ImageRow]:
    for row in _rows(file.text()):
        if _POSE.fullmatch(row):
            _, *pose, key, name = row.split(maxsplit=9)
            yield name, pose, key


def _lenses(file: SourceFile) -> Iterator[LensRow]:
    for row in _rows(file.text()):
        key, model, width, height, *parameters = row.split()
        yield key, model, [width, height], parameters


MOST_BYTES = 64 * 2**20
"""Of the binary form: a hundred pictures with a hundred thousand points each have 240 MB; ten
thousand are usual."""

_BY_NUMBER = (
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE",
    "FULL_OPENCV", "FOV", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE",
)  # fmt: skip
"""The names of the models, by their numbers in the binary form."""

_COUNTS = {"FOV": 5, "THIN_PRISM_FISHEYE": 12}
"""The counts of parameters of the models that OpenCV has not."""

_COUNT, _CAMERA = struct.Struct("<Q"), struct.Struct("<IIQQ")
_IMAGE, _POINT = struct.Struct("<I7dI"), 24
_LONGEST_NAME = 1024


def _has_binary_poses(file: SourceFile) -> bool:
    """Whether the first record is an image: its quaternion has the length 1."""
    head = file.head
    if file.is_text or len(head) < _COUNT.size + _IMAGE.size + 2 or file.size > MOST_BYTES:
        return False
    (count,) = _COUNT.unpack_from(head)
    _, *pose, _ = _IMAGE.unpack_from(head, _COUNT.size)
    name = head[_COUNT.size + _IMAGE.size :].partition(b"\0")[0]
    printed = 0 < len(name) < _LONGEST_NAME and min(name) >= 32
    return 0 < count < 2**32 and abs(sum(q * q for q in pose[:4]) - 1.0) < 1e-6 and printed


def _has_binary_lenses(file: SourceFile) -> bool:
    """Whether the first record is a camera of a known model and a size of pictures."""
    head = file.head
    if file.is_text or len(head) < _COUNT.size + _CAMERA.size or file.size > MOST_BYTES:
        return False
    (count,) = _COUNT.unpack_from(head)
    _, model, width, height = _CAMERA.unpack_from(head, _COUNT.size)
    known: bool = model < len(_BY_NUMBER) and 16 <= min(width, height) < 65536
    return known and 0 < count < 2**32


def _binary_lenses(file: SourceFile) -> Iterator[LensRow]:
    data = file.bytes(MOST_BYTES)
    (count,) = _COUNT.unpack_from(data)
    place = _COUNT.size
    for _ in range(count):
        key, number, width, height = _CAMERA.unpack_from(data, place)
        place += _CAMERA.size
        if number >= len(_BY_NUMBER):
            raise file.error(f"has a lens of an unknown model {number}", f"camera {key}")
        model = _BY_NUMBER[number]
        parameters = len(MODELS[model][1]) if model in MODELS else _COUNTS[model]
        yield str(key), model, [width, height], struct.unpack_from(f"<{parameters}d", data, place)
        place += 8 * parameters


def _binary_images(file: SourceFile) -> Iterator[ImageRow]:
    data = file.bytes(MOST_BYTES)
    (count,) = _COUNT.unpack_from(data)
    place = _COUNT.size
    for _ in range(count):
        _, *pose, key = _IMAGE.unpack_from(data, place)
        place += _IMAGE.size
        end = data.find(b"\0", place, place + _LONGEST_NAME)
        if end < 0:
            raise struct.error
        (points,) = _COUNT.unpack_from(data, end + 1)
        name = data[place:end].decode("utf-8", errors="replace")
        place = end + 1 + _COUNT.size + _POINT * points
        yield name, pose, str(key)


FORMATS = tuple(
    TreeFormat(
        name,
        form.tree,
        marks=form.is_it,
        cameras=iter,
        required=("pose", "lens"),
        parts=(stem(), lambda node: node.get("lens"), pose_of_quaternion("pose")),
        convention=Convention(direction="world-to-camera", axes="opencv"),
        most=MOST_IMAGES,
    )
    for name, form in (
        (
            "COLMAP text model",
            _Form(
                ".txt",
                _has_poses,
                lambda file: _LENS.fullmatch(_first_row(file)) is not None,
                _images,
                _lenses,
            ),
        ),
        (
            "COLMAP binary model",
            _Form(".bin", _has_binary_poses, _has_binary_lenses, _binary_images, _binary_lenses),
        ),
    )
)
