"""Cameras out of fields by their usual names: ``K``, ``camera_matrix``, ``rvec``, ``T_2`` …

What several formats share: a table of fields (of XML, YAML, JSON or MATLAB) whose names
follow OpenCV's papers and examples, one camera a table or a suffix a camera.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.formats.pieces import Convention, RawCamera
from tracker.formats.source import SourceFile
from tracker.formats.values import (
    image_size,
    intrinsics,
    lens,
    matrix,
    number,
    numbers,
    rotation,
    vector,
)

MEANINGS: dict[str, tuple[str, ...]] = {
    "K": ("k", "m", "mtx", "cameramatrix", "cammatrix", "intrinsicmatrix", "intrinsics",
          "intrinsic", "matrix", "intri", "calibrationmatrix"),
    "D": ("d", "dist", "distortion", "distortions", "distortioncoefficients", "distcoeffs",
          "distcoeff", "distcoef", "distcoefs", "distortioncoeffs", "kc", "distortionvector"),
    "radial": ("rdistort", "radialdistortion"),
    "tangential": ("tdistort", "tangentialdistortion"),
    "R": ("r", "rot", "rotation", "rotationmatrix", "rvec", "rotationvector", "rotvec",
          "rodrigues", "rmat", "rmatrix"),
    "T": ("t", "tvec", "translation", "translationvector", "trans", "tvecs"),
    "P": ("p", "projection", "projectionmatrix", "pmat", "projmatrix"),
    "RT": ("rt", "extrinsic", "extrinsics", "extrinsicmatrix", "worldtocamera", "w2c"),
    "size": ("size", "imagesize", "imgsize", "resolution", "imsize", "imageresolution"),
    "width": ("width", "imagewidth", "w", "imgwidth"),
    "height": ("height", "imageheight", "h", "imgheight"),
    "name": ("name", "cameraname", "cam", "id", "serial", "cameraid", "camid"),
    "fisheye": ("fisheye", "fisheyemodel", "isfisheye"),
}  # fmt: skip
"""The words, without case and underscores, for each part of a camera."""

_BY_WORD = {word: meaning for meaning, words in MEANINGS.items() for word in words}

STEREO_WORLD = "1"
"""Of the two cameras of a stereo calibration the one whose axes are the world's."""


def split(key: str) -> tuple[str, str] | None:
    """What a field's name means, and the camera it names: ``K_cam1`` → ``("K", "cam1")``."""
    places = [len(key), *(m.start() for m in re.finditer(r"[_\-]|(?<=\D)\d", key))]
    for place in sorted(set(places), reverse=True):
        meaning = _BY_WORD.get(re.sub(r"[_\-\s]", "", key[:place]).lower())
        if meaning is not None:
            return meaning, key[place:].lstrip("_-")
    return None


def by_camera(table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The fields of every camera that the names of a flat table tell apart."""
    cameras: dict[str, dict[str, Any]] = {}
    for key, value in table.items():
        found = split(key)
        if found is None:
            continue
        meaning, camera = found
        fields = cameras.setdefault(camera, {})
        # a rotation may be there twice, as a matrix and as a vector
        if meaning not in fields or _length(value) > _length(fields[meaning]):
            fields[meaning] = value
    if {"1", "2"} <= cameras.keys() and "" in cameras and "T" in cameras[""]:
        return _stereo(cameras)
    if len(cameras) > 1 and "" in cameras:
        shared = cameras.pop("")  # the picture's size, or nothing of a camera
        cameras = {name: {**shared, **fields} for name, fields in cameras.items()}
    return {name: fields for name, fields in cameras.items() if is_camera(fields)}


def is_camera(fields: Mapping[str, Any]) -> bool:
    """Whether there is a lens or a pose among the fields, of the right count of numbers."""
    return (
        _length(fields.get("K")) == 9
        or (_length(fields.get("R")) in (3, 9) and _length(fields.get("T")) == 3)
        or _length(fields.get("P")) == 12
        or _length(fields.get("RT")) in (12, 16)
    )


def camera(
    file: SourceFile, name: str, fields: Mapping[str, Any], convention: Convention
) -> RawCamera:
    """One camera from its fields by meaning; what is missing stays None.

    Raises:
        FormatError: If a field is not of the form that it must have.
    """

    def at(meaning: str) -> str:
        return f"{name} {meaning}".strip()

    size = None
    if "size" in fields:
        size = image_size(file, at("size"), fields["size"])
    elif "width" in fields and "height" in fields:
        both = [number(file, at(side), fields[side]) for side in ("width", "height")]
        size = image_size(file, at("size"), both)
    transposed = _is_transposed(fields.get("K"))
    k = None
    if _length(fields.get("K")) == 9:
        given = matrix(file, at("K"), fields["K"], 3, 3)
        k = intrinsics(file, at("K"), given.T if transposed else given)
    if size is not None and k is not None and "size" in fields:
        size = _width_first(size, k)
    distortion, model = lens(
        file,
        at("distortion"),
        _distortion(file, name, fields),
        fisheye=_is_set(fields.get("fisheye")),
    )
    turned = translation = projection = None
    if "R" in fields and "T" in fields:
        turned = rotation(file, at("R"), fields["R"])
        if transposed and _length(fields["R"]) == 9:
            turned = turned.T
        translation = vector(file, at("T"), fields["T"], 3, "x y z")
    elif "RT" in fields:
        rows = 4 if _length(fields["RT"]) == 16 else 3
        pose = matrix(file, at("[R|t]"), fields["RT"], rows, 4)
        turned, translation = rotation(file, at("[R|t]"), pose[:3, :3]), pose[:3, 3]
    # beside K a 3×4 matrix is that of a rectified picture
    if k is None and turned is None and "P" in fields:
        projection = matrix(file, at("P"), fields["P"], 3, 4)
    return RawCamera(
        name=str(fields.get("name", name)),
        image_size=size,
        intrinsics=k,
        distortion=distortion if k is not None else None,
        lens=model,
        rotation=turned,
        translation=translation,
        convention=convention,
        projection=projection,
    )


def _is_transposed(k: Any) -> bool:
    """Whether K is written for points in rows, as MATLAB, DANNCE and JARVIS have it; R is then."""
    if _length(k) != 9:
        return False
    given = np.asarray(k if not isinstance(k, str) else k.replace(",", " ").split(), dtype=float)
    found = given.reshape(3, 3)
    return bool(found[2, :2].any() and not found[:2, 2].any())


def _distortion(file: SourceFile, name: str, fields: Mapping[str, Any]) -> Any:
    """The lens in OpenCV's order, also where radial and tangential parts stand by themselves."""
    if "D" in fields or "radial" not in fields:
        return fields.get("D")
    radial = numbers(file, f"{name} radial", fields["radial"])
    tangential = numbers(file, f"{name} tangential", fields.get("tangential", [0.0, 0.0]))
    if len(radial) > 3 or len(tangential) != 2:
        raise file.error(
            f"expected up to 3 radial and 2 tangential numbers, found {len(radial)} and "
            f"{len(tangential)}",
            f"{name} distortion".strip(),
        )
    padded = [*radial, 0.0, 0.0][:3]
    return [*padded[:2], *tangential, padded[2]]


def _width_first(size: tuple[int, int], k: Float[ndarray, "3 3"]) -> tuple[int, int]:
    """A size as width and height: MATLAB and NumPy count rows first, which a principal point far
    from the middle of the one and near that of the other tells."""

    def off(width: int, height: int) -> float:
        return float(np.abs(k[:2, 2] / (width, height) - 0.5).max())

    width, height = size
    given, exchanged = off(width, height), off(height, width)
    return (height, width) if given > 0.15 and exchanged < 0.5 * given else size


def cameras(file: SourceFile, values: Any, convention: Convention) -> Iterator[RawCamera]:
    """Every camera of a tree of tables and lists: flat with suffixes, or a table a camera."""
    found = [camera(file, name, fields, convention) for name, fields in _tables(values, "", 0)]
    lenses = {one.name: one for one in found if one.rotation is None and one.projection is None}
    poses = {one.name: one for one in found if one.rotation is not None and one.intrinsics is None}
    if lenses.keys() == poses.keys() and len(lenses) + len(poses) == len(found):
        # one table of the lenses and one of the poses
        yield from (
            replace(lenses[name], rotation=pose.rotation, translation=pose.translation)
            for name, pose in poses.items()
        )
    else:
        yield from found


def has_cameras(values: Any) -> bool:
    """Whether a tree of tables and lists holds a camera."""
    return any(True for _ in _tables(values, "", 0))


def _tables(values: Any, name: str, depth: int) -> Iterator[tuple[str, dict[str, Any]]]:
    if depth > 3:
        return
    if isinstance(values, Mapping):
        flat = by_camera(values)
        for suffix, fields in flat.items():
            yield suffix or name, fields
        if not flat:
            for key, value in values.items():
                if isinstance(value, Mapping | list):
                    yield from _tables(value, str(key), depth + 1)
    elif isinstance(values, list) and all(isinstance(item, Mapping) for item in values):
        for place, item in enumerate(values):
            yield from _tables(item, str(place), depth + 1)


def _stereo(cameras: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """A stereo calibration: the world is the first camera, R and T lead to the second.

    Its R1, R2, P1 and P2 belong to the rectified pictures.
    """
    shared = {k: v for k, v in cameras[""].items() if k in ("size", "width", "height")}
    lenses = {
        side: {k: v for k, v in cameras[side].items() if k in ("K", "D", "fisheye")}
        for side in ("1", "2")
    }
    poses: dict[str, dict[str, Any]] = {
        "1": {"R": np.eye(3), "T": np.zeros(3)},
        "2": {key: cameras[""][key] for key in ("R", "T") if key in cameras[""]},
    }
    return {side: {**shared, **lenses[side], **poses[side]} for side in ("1", "2")}


def _is_set(value: Any) -> bool:
    """A flag: true, or a number other than 0."""
    return bool(np.any(np.asarray(value, dtype=float))) if _length(value) else value is True


def _length(value: Any) -> int:
    """How many numbers a list of any nesting, or a text of numbers, has; 0 for anything else."""
    if value is None or isinstance(value, Mapping):
        return 0
    if isinstance(value, str):
        value = value.replace(",", " ").split()
    try:
        return int(np.asarray(value, dtype=float).size)
    except (ValueError, TypeError):
        return 0
