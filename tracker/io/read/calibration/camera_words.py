"""What fields of a camera are called, and one table of fields however they are written down.

K may be a matrix, or fx fy cx cy; a lens its numbers by name; a pose a matrix, a quaternion, or
the camera's place; and any of these may lie in a table of its own (``intrinsics``, ``pose`` …).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.read.calibration.euler import FULL_TURN, KINDS, ORDERS
from tracker.io.read.values import numbers_in, plain

MEANINGS: dict[str, tuple[str, ...]] = {
    "K": ("k", "m", "mtx", "cameramatrix", "cammatrix", "intrinsicmatrix", "intrinsics",
          "intrinsic", "matrix", "intri", "calibrationmatrix", "cameraintrinsic"),
    "D": ("d", "dist", "distortion", "distortions", "distortioncoefficients", "distcoeffs",
          "distcoeff", "distcoef", "distcoefs", "distortioncoeffs", "kc", "distortionvector",
          "disccoef", "distortionparameters"),
    "radial": ("rdistort", "radialdistortion"),
    "tangential": ("tdistort", "tangentialdistortion"),
    "R": ("r", "rot", "rotation", "rotationmatrix", "rmat", "rmatrix", "extrinsicr"),
    "rvec": ("rvec", "rotationvector", "rotvec", "rodrigues"),
    "rxyz": ("rxyz",),
    "euler": ("euler", "eulerangles", "angles", "rotationangles"),
    **{f"euler{order}": (f"euler{order}", f"eulerangles{order}") for order in ORDERS},
    "blender": ("rotationeuler",),
    "ypr": ("ypr", "yawpitchroll"), "rpy": ("rpy", "rollpitchyaw"),
    "opk": ("opk", "omegaphikappa"),
    "T": ("t", "tvec", "translation", "translationvector", "trans", "tvecs", "extrinsict"),
    "centre": ("center", "centre", "cameracenter", "cameracentre", "c"),
    "place": ("position", "cameraposition", "campos", "location", "cameralocation"),
    "P": ("p", "projection", "projectionmatrix", "pmat", "projmatrix", "cameraprojectionmatrix"),
    "RT": ("rt", "extrinsic", "extrinsics", "extrinsicmatrix", "worldtocamera", "w2c", "world2cam",
           "world2camera", "worldtocam", "tcamworld", "tcameraworld", "camerafromworld"),
    "inverse": ("c2w", "cam2world", "camera2world", "camtoworld", "cameratoworld", "tworldcam",
                "tworldcamera", "worldfromcamera"),
    "matrix_world": ("matrixworld",),
    "pose": ("pose", "camerapose", "cameraposematrix", "posematrix"),
    "quaternion": ("quaternion", "quat", "orientation", "qvec", "quaternionwxyz",
                   "quaternionxyzw", "quatwxyz", "quatxyzw"),
    "size": ("size", "imagesize", "imgsize", "resolution", "imsize", "imageresolution"),
    "width": ("width", "imagewidth", "w", "imgwidth"),
    "height": ("height", "imageheight", "h", "imgheight"),
    "name": ("name", "cameraname", "cam", "id", "serial", "cameraid", "camid", "camera",
             "imgname"),
    "fisheye": ("fisheye", "fisheyemodel", "isfisheye"),
}  # fmt: skip
"""The words, without case and underscores, for each part of a camera."""

_BY_WORD = {word: meaning for meaning, words in MEANINGS.items() for word in words}

_PARTS = ("intrinsics", "intrinsic", "intrinsicparameters", "extrinsics", "extrinsic", "lens",
          "extrinsicparameters", "pose", "distortion", "distortioncoefficients", "calibration",
          "parameters", "params", "transform", "transformation", "camerapose")  # fmt: skip
"""Tables among a camera's fields that hold some of them."""

_SCALARS: dict[str, tuple[str, ...]] = {
    "fx": ("fx", "focallengthx", "focalx"), "fy": ("fy", "focallengthy", "focaly"),
    "f": ("f", "focal", "focallength"),
    "f mm": ("fmm", "focalmm", "focallengthmm"),
    "sensor width": ("sensorwidth", "sensorwidthmm"),
    "sensor height": ("sensorheight", "sensorheightmm"),
    "angle x": ("fovx", "fovxdeg", "hfov", "hfovdeg", "horizontalfov", "cameraanglex"),
    "angle y": ("fovy", "fovydeg", "vfov", "vfovdeg", "verticalfov", "cameraangley"),
    "cx": ("cx", "ppx", "u0", "principalpointx"), "cy": ("cy", "ppy", "v0", "principalpointy"),
    **{name: (name,) for name in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")},
    **{f"q{axis}": (f"q{axis}",) for axis in "wxyz"},
    **{f"t{axis}": (f"t{axis}", f"tvec{axis}", f"tvec{number}")
       for number, axis in enumerate("xyz")},
    **{f"r{axis}": (f"r{axis}", f"rot{axis}", f"rotation{axis}") for axis in "xyz"},
    **{f"v{axis}": (f"rvec{axis}", f"rvec{number}") for number, axis in enumerate("xyz")},
    **{f"e{axis}": (f"euler{axis}",) for axis in "xyz"},
    **{f"p{axis}": (f"p{axis}", f"pos{axis}", f"position{axis}", f"location{axis}")
       for axis in "xyz"},
    **{axis: (axis,) for axis in "xyz"},
    **{angle: (angle, *(f"{angle}{unit}" for unit in ("deg", "degrees", "rad", "radians")))
       for angle in ("yaw", "pitch", "roll", "omega", "phi", "kappa")},
    **{f"r{row}{column}": (f"r{row}{column}",) for row in "123" for column in "123"},
}  # fmt: skip
"""Parts of a camera that are one number each."""

_ANGLES = {
    "rxyz": ("rx", "ry", "rz"), "euler": ("ex", "ey", "ez"), "ypr": ("yaw", "pitch", "roll"),
    "opk": ("omega", "phi", "kappa"),
}  # fmt: skip
"""Of three angles by name: what they are called together."""

_TABLES = {
    frozenset(parts): (name, parts)
    for name, parts in {**_ANGLES, "quaternion_wxyz": tuple("wxyz"), "": tuple("xyz")}.items()
}
"""By the names of its parts a vector or a rotation that is a table: what it is, if that differs
from the name of the table, and the order of its parts."""

_SCALAR_OF = {word: name for name, words in _SCALARS.items() for word in words}

_LENGTHS: dict[str, tuple[int, ...]] = {
    "K": (9, 16), "R": (9, 3, 4), "rvec": (3,), "T": (3,), "P": (12,), "RT": (16, 12),
    "inverse": (16, 12), "matrix_world": (16, 12), "pose": (16, 12), "quaternion": (4,),
    "centre": (3,), "place": (3,), **{kind: (3,) for kind in KINDS},
}  # fmt: skip
"""Of each part the counts of numbers that it may have."""

_LONGEST_NAME = 200
"""Signs of a field's name; all its beginnings are looked at."""

_WIDEST = 4.0
"""Width of a picture in focal lengths from which none is in pixels: an angle of 127 degrees."""


def split(key: str) -> tuple[str, str] | None:
    """What a field's name means, and the camera it names: ``K_cam1`` → ``("K", "cam1")``."""
    if len(key) > _LONGEST_NAME:
        return None
    places = [len(key), *(m.start() for m in re.finditer(r"[_\-]|(?<=\D)\d", key))]
    for place in sorted(set(places), reverse=True):
        meaning = _BY_WORD.get(plain(key[:place]))
        if meaning is not None:
            return meaning, key[place:].lstrip("_-")
    if re.search(r"dist(ort)?\w*co?ef|^distort\w*(vec|values)?$", key.lower()):
        return "D", ""
    return None


def count(value: Any) -> int:
    """How many numbers a list of any nesting, or a text of numbers, has; 0 for anything else."""
    if value is None or isinstance(value, Mapping):
        return 0
    found = numbers_in(value)
    return 0 if found is None else len(found)


def fields_by_camera(table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The fields by meaning of every camera that the names of a table tell apart."""
    cameras: dict[str, dict[str, Any]] = {}
    for key, value in _composed(_spread(table)).items():
        found = split(key)
        if found is None or value is None:
            continue
        meaning, camera = found
        meaning = _meant(meaning, value)
        fields = cameras.setdefault(camera, {})
        # what is there twice, as a matrix and as a vector or in another form, is taken once
        if meaning not in fields or _rank(meaning, value) > _rank(meaning, fields[meaning]):
            fields[meaning] = value
            if meaning == "quaternion":
                fields["quaternion order"] = _order(plain(key))
    for fields in cameras.values():
        _settle_rotation(fields)
    return cameras


def _order(name: str) -> str | None:
    """Of a quaternion by its name; COLMAP's ``qvec`` begins with w."""
    if name.endswith("xyzw"):
        return "xyzw"
    return "wxyz" if name.endswith("wxyz") or name.startswith("qvec") else None


def _meant(meaning: str, value: Any) -> str:
    """A lens's name over twelve numbers is that of a pose (OpenPose) or of a projection."""
    if meaning != "K" or count(value) != 12:
        return meaning
    left = _numbers(value).reshape(3, 4)[:, :3]
    return "RT" if np.abs(left @ left.T - np.eye(3)).max() < 0.01 else "P"


def _rank(meaning: str, value: Any) -> int:
    """How well a value fits a part: of those that do, the one with the better form."""
    lengths = _LENGTHS.get(meaning)
    numbers = count(value)
    if lengths is None:
        return numbers
    return len(lengths) - lengths.index(numbers) if numbers in lengths else 0


def _settle_rotation(fields: dict[str, Any]) -> None:
    """One rotation of those that are there: a matrix before a vector."""
    vector = fields.pop("rvec", None)
    if count(fields.get("R")) == 9:
        for kind in KINDS:
            fields.pop(kind, None)
        return
    if vector is None:
        if count(fields.get("R")) == 3:  # "rotation" may be angles as well
            fields["rxyz"] = fields.pop("R")
        return
    if count(vector) == 3:
        turned = _numbers(vector)
        if np.linalg.norm(turned) > FULL_TURN:
            vector = np.radians(turned).tolist()
    fields["R"] = vector


def _numbers(value: Any) -> Float[ndarray, " n"]:
    """The numbers of a value that has some, as :func:`count` counts them."""
    found = numbers_in(value)
    assert found is not None
    return found


def _spread(table: Mapping[str, Any], depth: int = 0) -> dict[str, Any]:
    """A camera's fields with those that lie in tables of their own among them."""
    fields: dict[str, Any] = {}
    for key, value in table.items():
        key = str(key)
        if isinstance(value, Mapping):
            own = {str(name).lower(): one for name, one in value.items()}
            whole = _TABLES.get(frozenset(own))
            if whole is not None:
                key, value = whole[0] or key, [own[part] for part in whole[1]]
            elif plain(key) in _PARTS and depth < 2 and _holds_fields(value):
                for name, inner in _spread(value, depth + 1).items():
                    fields.setdefault(name, inner)
                continue
        fields[key] = value
    return fields


def _holds_fields(table: Mapping[str, Any]) -> bool:
    """Whether a table has fields of one camera, not cameras."""
    for key, value in table.items():
        name, found = plain(str(key)), split(str(key))
        whole = found is not None and not found[1] and found[0] != "name"
        if name in _PARTS or ((whole or name in _SCALAR_OF) and not _is_table(value)):
            return True
    return False


def _is_table(value: Any) -> bool:
    """Whether it has fields of its own, other than the axes of a vector."""
    return isinstance(value, Mapping) and not {str(key).lower() for key in value} <= set("wxyz")


def _composed(fields: dict[str, Any]) -> dict[str, Any]:
    """K, lens and pose out of their numbers by name, where these are there."""
    numbers: dict[str, float] = {}
    used: dict[str, list[str]] = {}
    for key, value in fields.items():
        name = _SCALAR_OF.get(plain(key))
        if name is not None and isinstance(value, int | float | str) and count(value) == 1:
            numbers[name] = float(value)
            used.setdefault(name, []).append(key)
    found: dict[str, Any] = {}

    def take(*names: str) -> list[float] | None:
        if not all(name in numbers for name in names):
            return None
        for name in names:
            for key in used[name]:
                fields.pop(key, None)
        return [numbers[name] for name in names]

    two = take("fx", "fy", "cx", "cy")
    # beside the size of a sensor it is in millimetres
    one = None if numbers.keys() & {"sensor width", "sensor height"} else take("f", "cx", "cy")
    four = two or (one and [one[0], *one]) or _centred(fields, take)
    if four is not None:
        fx, fy, cx, cy = four
        found["K"] = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    lens = _lens(fields, numbers, found)
    if lens is not None:
        found["D"] = lens
        take(*(name for name in numbers if name[0] in "kp" and name[1:].isdigit()))
    found |= _pose(
        take, lens="K" in found or any((split(key) or "")[:1] == ("K",) for key in fields)
    )
    return {**fields, **found}


_Take = Callable[..., list[float] | None]


def _centred(fields: Mapping[str, Any], take: _Take) -> list[float] | None:
    """Focal lengths in any form; without a principal point it is the middle of the picture."""
    by_meaning = {meaning: fields[key] for key in fields for meaning, _ in [split(key) or ("", "")]}
    sides = [by_meaning.get(side) for side in ("width", "height")]
    if any(count(side) != 1 for side in sides):
        return None
    width, height = (float(_numbers(side)[0]) for side in sides)
    focal = take("fx", "fy") or _by_sensor(take, width, height) or _by_angle(take, width, height)
    if focal is None and (one := take("f")) is not None and _WIDEST * one[0] > width:
        focal = [one[0], one[0]]
    middle = [(width - 1.0) / 2.0, (height - 1.0) / 2.0]
    return focal and [*focal, *(take("cx", "cy") or middle)]


def _by_sensor(take: _Take, width: float, height: float) -> list[float] | None:
    """Focal lengths in pixels, of square ones, from millimetres and the size of the sensor."""
    for side, pixels in (("sensor width", width), ("sensor height", height)):
        both = take("f mm", side) or take("f", side)
        if both is not None and both[1] > 0.0:
            return [both[0] * pixels / both[1]] * 2
    return None


def _by_angle(take: _Take, width: float, height: float) -> list[float] | None:
    """Focal lengths in pixels from the angles that a picture covers, degrees, or radians up to pi;
    where one is told pixels are square."""
    found = [
        pixels / 2.0 / math.tan((angle if angle <= math.pi else math.radians(angle)) / 2.0)
        for name, pixels in (("angle x", width), ("angle y", height))
        for angle in take(name) or ()
        if angle > 0.0
    ]
    return [found[0], found[-1]] if found else None


def _lens(
    fields: dict[str, Any], numbers: dict[str, float], found: Mapping[str, Any]
) -> list[float] | None:
    """A lens in OpenCV's order from k1 k2 … by name, or from a list ``k`` and a list ``p``."""
    by_word = {plain(key): key for key in fields}
    if {"k", "p"} <= by_word.keys() and count(fields[by_word["p"]]) == 2:
        radial = [float(each) for each in np.ravel(fields[by_word["k"]])]
        tangential = [float(each) for each in np.ravel(fields[by_word["p"]])]
        if 3 <= len(radial) <= 6:
            fields.pop(by_word["k"])
            fields.pop(by_word["p"])
            return _in_order(radial, tangential)
    if "k1" not in numbers or ("K" not in found and not {"k2", "p1"} & numbers.keys()):
        return None
    radial = [numbers.get(f"k{n}", 0.0) for n in range(1, 7)]
    return _in_order(radial, [numbers.get("p1", 0.0), numbers.get("p2", 0.0)])


def _in_order(radial: list[float], tangential: list[float]) -> list[float]:
    lens = [*radial[:2], *tangential, *radial[2:]]
    return lens if any(lens[5:]) else lens[:5]


def _pose(take: _Take, *, lens: bool) -> Iterator[tuple[str, Any]]:
    """R and t from their elements; beside a lens ``x y z`` alone are the camera's place."""
    matrix = take(*(f"r{row}{column}" for row in "123" for column in "123"))
    quaternion, vector = take("qw", "qx", "qy", "qz"), take("vx", "vy", "vz")
    moved, place = take("tx", "ty", "tz"), take("px", "py", "pz")
    if moved is None and place is None and lens:
        place = take("x", "y", "z")
    if moved is not None:
        yield "T", moved
    elif place is not None:
        yield "position", place
    else:
        return
    if matrix is not None:
        yield "R", matrix
    elif quaternion is not None:
        yield "quaternion_wxyz", quaternion
    elif vector is not None:
        yield "rvec", vector
    else:
        for name, parts in _ANGLES.items():
            three = take(*parts)
            if three is not None:
                yield name, three
