"""The reconstructions in JSON and XML whose fields are declared: one posed picture a camera.

Unit and up are those of the reconstruction, arbitrary unless it has a scale. nerfstudio,
instant-ngp and Metashape have the origin of pixels at the corner of the top-left one, as COLMAP.

Sources: Tancik et al., "Nerfstudio", SIGGRAPH 2023, and its "Data conventions"; Moulon et al.,
"OpenMVG", RRPR 2016, and its "Cameras" and "sfm_data" pages; Agisoft, "Metashape user manual",
appendix D, "Camera models".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from tracker.io.read import values
from tracker.io.read.calibration.reconstruction.colmap import (
    CORNER,
    MODELS,
    MOST_IMAGES,
    model_lens,
)
from tracker.io.read.pieces import Convention
from tracker.io.read.source import listed
from tracker.io.read.tree_format import (
    Node,
    TreeFormat,
    at,
    image_size,
    number,
    pose_at,
    pose_matrix,
    stem,
)


def _frames(tree: Any) -> Iterator[tuple[str, Any]]:
    """The frames of transforms.json, each with what is said of all."""
    frames = tree.get("frames") if isinstance(tree, dict) else None
    for place, frame in enumerate(frames if isinstance(frames, list) else ()):
        if not isinstance(frame, dict):
            yield str(place), frame
        else:
            yield str(frame.get("file_path", place)), {**tree, **frame}


def _nerfstudio_lens(node: Node) -> Mapping[str, Any]:
    """The lens by its model; Blender's scenes for NeRF have an angle and have to be given w, h."""
    values.need(node.file, node.value, ("w", "h"), node.key)
    own = dict(node.value)
    if "camera_angle_x" in own:
        width, height = values.image_size(node.file, node.key, [own["w"], own["h"]])
        own.setdefault("fl_x", width / 2.0 / np.tan(number(node, "camera_angle_x") / 2.0))
        own.setdefault("cx", width / 2.0)
        own.setdefault("cy", height / 2.0)
    values.need(node.file, own, ("fl_x", "cx", "cy"), node.key)
    own |= {"fx": own["fl_x"], "fy": own.get("fl_y", own["fl_x"])}
    model = str(own.get("camera_model", "OPENCV"))
    parts = {*MODELS.get(model, ("", ()))[1], "fx", "fy", "cx", "cy"} - {"f"}
    found = {part: values.number(node.file, node.where(part), own.get(part, 0.0)) for part in parts}
    return model_lens(node.file, node.key, model, found)


NERFSTUDIO = TreeFormat(
    "nerfstudio transforms.json",
    "json",
    marks=('"frames"', '"transform_matrix"'),
    cameras=_frames,
    required=("transform_matrix",),
    parts=(stem(), _nerfstudio_lens, image_size("w", "h"), pose_matrix("transform_matrix")),
    convention=Convention(direction="camera-to-world", axes="opengl"),
    most=MOST_IMAGES,
)


def _by_key(rows: Any) -> dict[Any, dict[str, Any]]:
    """Entries by their key: what their pointers hold, with the fields of the base class."""
    found = {}
    for row in rows if isinstance(rows, list) else ():
        value = row.get("value") if isinstance(row, dict) else None
        data = value.get("ptr_wrapper", {}).get("data", value) if isinstance(value, dict) else None
        if isinstance(data, dict):
            base = data.get("value0")
            found[row.get("key")] = {**base, **data} if isinstance(base, dict) else data
    return found


def _views(tree: Any) -> Iterator[tuple[str, Any]]:
    """The views of sfm_data.json that have a pose, each with its lens and its pose."""
    if not isinstance(tree, dict):
        return
    lenses, poses = _by_key(tree.get("intrinsics")), _by_key(tree.get("extrinsics"))
    for view in _by_key(tree.get("views")).values():
        if view.get("id_pose") in poses:
            lens = lenses.get(view.get("id_intrinsic"), {})
            name = str(view.get("filename", view.get("id_view")))
            yield name, {**view, **lens, **poses[view["id_pose"]]}


_OPENMVG_LENSES: Mapping[str, tuple[int, ...]] = {
    "disto_k1": (0,), "disto_k3": (0, 1, 4), "disto_t2": (0, 1, 4, 2, 3),
}  # fmt: skip
"""Where each number stands in OpenCV's order k1 k2 p1 p2 k3."""


def _openmvg_lens(node: Node) -> Mapping[str, Any]:
    f = number(node, "focal_length")
    where = node.where("principal_point")
    cx, cy = values.vector(node.file, where, node.get("principal_point"), 2, "x y")
    found: dict[str, Any] = {"intrinsics": values.focal_and_centre(f, f, cx, cy)}
    if node.find("fisheye") is not None:
        four = values.vector(node.file, node.where("fisheye"), node.get("fisheye"), 4, "k1 … k4")
        return {**found, "distortion": four, "lens": "fisheye"}
    distortion = np.zeros(5)
    for field, places in _OPENMVG_LENSES.items():
        given = node.find(field)
        if given is not None:
            own = values.vector(node.file, node.where(field), given, len(places), "lens")
            distortion[list(places)] = own
    return {**found, "distortion": distortion}


OPENMVG = TreeFormat(
    "OpenMVG sfm_data.json",
    "json",
    marks=('"sfm_data_version"',),
    cameras=_views,
    required=("id_view", "rotation", "center"),
    parts=(stem(), image_size("width", "height"), _openmvg_lens, pose_at("rotation", "center")),
    convention=Convention(direction="world-to-camera", axes="opencv"),
    most=MOST_IMAGES,
)


def _aligned(tree: Any) -> Iterator[tuple[str, Any]]:
    """The aligned cameras of a Metashape document, each with its sensor and its chunk's scale."""
    for chunk in listed(tree.get("chunk") if isinstance(tree, dict) else None):
        sensors = {str(one.get("id")): one for one in listed(at(chunk, "sensors/sensor"))}
        scale = at(chunk, "transform/scale")
        for camera in listed(at(chunk, "cameras/camera")):
            if isinstance(camera, dict) and camera.get("transform"):
                sensor = sensors.get(str(camera.get("sensor_id")), {})
                lenses = listed(sensor.get("calibration"))
                lens = [one for one in lenses if one.get("class") == "adjusted"]
                name = str(camera.get("label", camera.get("id", "")))
                yield name, {**camera, "scale": scale, "sensor": sensor, "lens": [*lens, None][0]}


def _metashape_lens(node: Node) -> Mapping[str, Any]:
    """The lens of the sensor.

    With x, y straight in front of the lens and r² = x² + y², a point is drawn at

        u = w/2 + cx + x' f + x' b1 + y' b2,   x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶)
                                                    + p1 (r² + 2 x²) + 2 p2 x y
        v = h/2 + cy + y' f,                   y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶)
                                                    + p2 (r² + 2 y²) + 2 p1 x y

    from the corner of the top-left pixel: p1 and p2 are OpenCV's p2 and p1.
    """
    if node.find("lens") is None:
        raise node.file.error(
            "has no adjusted calibration of its sensor; align the pictures", node.key
        )
    names = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "p1", "p2", "k4", "p3", "p4")
    own = {
        part: number(node, f"lens/{part}")
        for part in names
        if node.find(f"lens/{part}") is not None
    }
    kind = node.find("lens/type") or node.find("sensor/type") or "frame"
    odd = [part for part in ("k4", "p3", "p4") if own.get(part)]
    if kind != "frame" or odd or "f" not in own:
        raise node.file.error(
            'expected a lens of type "frame" with f and at most k1 k2 k3 p1 p2, found '
            f'"{kind}"{" with " + ", ".join(odd) if odd else ""}; optimize the cameras with '
            "those alone",
            node.key,
        )
    size = values.image_size(node.file, node.where("resolution"), node.get("lens/resolution"))
    cx, cy = (
        side / 2.0 + own.get(part, 0.0) - CORNER
        for side, part in zip(size, ("cx", "cy"), strict=True)
    )
    f, b1, b2 = own["f"], own.get("b1", 0.0), own.get("b2", 0.0)
    return {
        "image_size": size,
        "intrinsics": np.array([[f + b1, b2, cx], [0.0, f, cy], [0.0, 0.0, 1.0]]),
        "distortion": np.array([own.get(part, 0.0) for part in ("k1", "k2", "p2", "p1", "k3")]),
    }


def _metashape_pose(node: Node) -> Mapping[str, Any]:
    """The pose from camera to chunk; the chunk's scale leads to metres."""
    found = pose_matrix("transform")(node)
    unscaled = node.find("scale") is None
    return {
        **found,
        "translation": found["translation"] * (1.0 if unscaled else number(node, "scale")),
        "convention": Convention(None if unscaled else "m", "camera-to-world", "opencv"),
    }


METASHAPE = TreeFormat(
    "Metashape cameras XML",
    "xml",
    marks=("<document", "<chunk", "<sensors"),
    cameras=_aligned,
    required=("transform", "sensor"),
    parts=(lambda node: {"name": node.key}, _metashape_lens, _metashape_pose),
    most=MOST_IMAGES,
)

FORMATS = (NERFSTUDIO, OPENMVG, METASHAPE)
