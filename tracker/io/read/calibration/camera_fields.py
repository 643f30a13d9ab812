"""Cameras out of fields by their usual names: ``K``, ``camera_matrix``, ``rvec``, ``T_2`` …

What several formats share: a table of fields (of XML, YAML, JSON or MATLAB) whose names
follow OpenCV's papers and examples, one camera a table or a suffix a camera.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.calibration import is_rotation
from tracker.io.read.calibration import euler
from tracker.io.read.calibration.camera_words import count, fields_by_camera
from tracker.io.read.calibration.euler import KINDS, NAMED_AXES
from tracker.io.read.pieces import Convention, Direction, RawCamera
from tracker.io.read.source import SourceFile
from tracker.io.read.values import (
    image_size,
    intrinsics,
    lens,
    matrix,
    number,
    numbers,
    numbers_in,
    rotation,
    vector,
)

_POSES = ("RT", "inverse", "matrix_world", "pose")
"""Parts that are a whole pose, a 3×4 or a 4×4 matrix."""


def by_camera(table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The fields of every camera that the names of a flat table tell apart."""
    cameras = fields_by_camera(table)
    if {"1", "2"} <= cameras.keys() and "" in cameras and "T" in cameras[""]:
        return _stereo(cameras)
    own = {name: fields for name, fields in cameras.items() if name and is_camera(fields)}
    if own:  # what names no camera is the picture's size, or nothing of a camera
        return {name: {**cameras.get("", {}), **fields} for name, fields in own.items()}
    return {name: fields for name, fields in cameras.items() if is_camera(fields)}


def is_camera(fields: Mapping[str, Any]) -> bool:
    """Whether there is a lens or a pose among the fields, of the right count of numbers."""
    turned = (
        count(fields.get("R")) in (3, 4, 9)
        or count(fields.get("quaternion")) == 4
        or any(count(fields.get(kind)) == 3 for kind in KINDS)
    )
    moved = any(count(fields.get(place)) == 3 for place in ("T", "centre", "place"))
    return (
        count(fields.get("K")) in (9, 16)
        or (turned and moved)
        or count(fields.get("P")) == 12
        or any(_is_pose(fields.get(part)) for part in _POSES)
    )


def _is_pose(value: Any) -> bool:
    """Whether twelve or sixteen numbers begin with a rotation; rows of angles do not."""
    found = numbers_in(value) if count(value) in (12, 16) else None
    return found is not None and is_rotation(found.reshape(-1, 4)[:3, :3])


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
    if count(fields.get("K")) in (9, 16):
        side = 3 if count(fields["K"]) == 9 else 4
        given = matrix(file, at("K"), fields["K"], side, side)[:3, :3]
        k = intrinsics(file, at("K"), given.T if transposed else given)
    if size is not None and k is not None and "size" in fields:
        size = _width_first(size, k)
    distortion, model = lens(
        file,
        at("distortion"),
        _distortion(file, name, fields),
        fisheye=_is_set(fields.get("fisheye")),
    )
    turned, translation, convention = _pose(file, at, fields, convention)
    by_angles: Mapping[str, Float[ndarray, "3 3"]] = {}
    if turned is None:
        by_angles, translation, convention = _turned(file, at, fields, convention)
        turned = next(iter(by_angles.values()), None)
    if transposed and turned is not None and count(fields.get("R")) == 9:
        turned = turned.T
    projection = None
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
        turns=by_angles,
        projection=projection,
    )


def _turned(
    file: SourceFile, at: Callable[[str], str], fields: Mapping[str, Any], convention: Convention
) -> tuple[Mapping[str, Float[ndarray, "3 3"]], Float[ndarray, " 3"] | None, Convention]:
    """The rotations that a camera's angles, or its quaternion, may be, and its place, where these
    are its pose."""
    place = next((part for part in ("place", "centre", "T") if count(fields.get(part)) == 3), None)
    if place is None:
        return {}, None, convention
    named = next((kind for kind in NAMED_AXES if kind in fields), None)
    by_angles = _of_quaternion(file, at, fields) or euler.turns(
        file, at("angles"), fields, inverse=place != "T"
    )
    if not by_angles:
        return {}, None, convention
    moved = vector(file, at(place), fields[place], 3, "x y z")
    if named is not None:
        convention = replace(convention, direction="camera-to-world", axes="opengl")
    elif place != "T":
        convention = replace(convention, direction="camera-to-world")
    return by_angles, moved, convention


_Pose = tuple[Float[ndarray, "3 3"] | None, Float[ndarray, " 3"] | None, Convention]


def _pose(
    file: SourceFile, at: Callable[[str], str], fields: Mapping[str, Any], convention: Convention
) -> _Pose:
    """Rotation and translation, and what their fields' names say of how they are meant."""
    part = next((name for name in _POSES if _is_pose(fields.get(name))), None)
    turned = None
    if "R" in fields and count(fields["R"]) != 4:
        turned = rotation(file, at("R"), fields["R"])
    elif len(known := _of_quaternion(file, at, fields)) == 1:
        (turned,) = known.values()
    if turned is not None and "T" in fields:
        return turned, vector(file, at("T"), fields["T"], 3, "x y z"), convention
    if part is not None:
        rows = 4 if count(fields[part]) == 16 else 3
        pose = matrix(file, at(part), fields[part], rows, 4)
        leads: Direction | None = convention.direction if part == "RT" else None
        axes = convention.axes
        if part in ("inverse", "matrix_world"):
            leads = "camera-to-world"
        if part == "matrix_world":  # as Blender has it
            axes = "opengl"
        return (
            rotation(file, at(part), pose[:3, :3]),
            pose[:3, 3],
            replace(convention, direction=leads, axes=axes),
        )
    if turned is not None and "centre" in fields:
        centre = vector(file, at("centre"), fields["centre"], 3, "x y z")
        return turned, -turned @ centre, replace(convention, direction="world-to-camera")
    if turned is not None and "place" in fields:
        place = vector(file, at("position"), fields["place"], 3, "x y z")
        return turned, place, replace(convention, direction="camera-to-world")
    return None, None, convention


def _of_quaternion(
    file: SourceFile, at: Callable[[str], str], fields: Mapping[str, Any]
) -> dict[str, Float[ndarray, "3 3"]]:
    """The rotations that a quaternion may be: one, or by its order two where its name has none.

    Raises:
        FormatError: If all four numbers are zero.
    """
    from scipy.spatial.transform import Rotation  # a server starts without it

    given = fields.get("quaternion", fields.get("R"))
    if count(given) != 4:
        return {}
    four = vector(file, at("rotation"), given, 4, "w x y z")
    if not np.linalg.norm(four) > 1e-6:
        raise file.error("expected a quaternion, found one of zeros", at("rotation"))
    order = fields.get("quaternion order")
    return {
        name: np.asarray(Rotation.from_quat(xyzw).as_matrix())
        for name, xyzw in (("wxyz", np.roll(four, -1)), ("xyzw", four))
        if order in (None, name)
    }


def _is_transposed(k: Any) -> bool:
    """Whether K is written for points in rows, as MATLAB, DANNCE and JARVIS have it; R is then."""
    found = numbers_in(k) if count(k) == 9 else None
    return found is not None and bool(found[6:8].any() and not found[[2, 5]].any())


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
    lenses = {one.name: one for one in found if not one.has_pose}
    # Multical calls the pose of a camera by the one it leads from, too: "cam2_to_cam1"
    poses = {
        one.name.partition("_to_")[0]: one for one in found if one.has_pose and not one.has_lens
    }
    if lenses.keys() == poses.keys() and len(lenses) + len(poses) == len(found):
        # one table of the lenses and one of the poses
        for name, pose in poses.items():
            yield replace(pose, name=name).with_lens_of(lenses[name])
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
    return bool(np.any(np.asarray(value, dtype=float))) if count(value) else value is True
