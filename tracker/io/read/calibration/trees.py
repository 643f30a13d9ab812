"""The calibrations in JSON, YAML, TOML and XML whose fields are declared.

Sources: aniposelib, ``CameraGroup.dump`` (Karashchuk et al., "Anipose", Cell Reports 2021); Pagnon,
Domalain, Reveret, "Pose2Sim", JOSS 2022; Caliscope, ``camera_array.toml``; Qualisys, "QTM Real-time
Server Protocol", calibration packet; ROS, ``camera_calibration_parsers`` and
``sensor_msgs/CameraInfo``; Furgale, Rehder, Siegwart, "Unified temporal and spatial calibration for
multi-sensor systems", IROS 2013, and Kalibr, "YAML formats"; Joo et al., "Panoptic Studio", IEEE
TPAMI 41(1), 2019, and its toolbox; Tu, Wang, Zeng, "VoxelPose", ECCV 2020, and its data sets;
camera-intrinsic-calibration (``ccrs``), ``types.rs`` and ``camera-intrinsic-model``; NVIDIA,
Physical AI Smart Spaces data set (AI City Challenge) and AutoMagicCalib, "Ground truth data
format"; Intel, SceneScape, tracker metric set.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from tracker.io.read import values
from tracker.io.read.pieces import Convention
from tracker.io.read.tree_format import (
    Node,
    TreeFormat,
    image_size,
    intrinsics,
    lens,
    name,
    number,
    only,
    pose,
    pose_at,
    pose_matrix,
    step_from_last,
)

_WORLD_TO_CAMERA = Convention(direction="world-to-camera", axes="opencv")


def _of_toml(node: Node) -> Mapping[str, Any]:
    """The unit: Anipose's is the one that its board was given in, the others write metres.

    Caliscope counts turns of the picture; Pose2Sim says of every camera whether it is one of a
    fisheye, Anipose only of those that are.
    """
    tables = node.file.toml
    inner = tables.get("cameras")
    tables = {**tables, **inner} if isinstance(inner, dict) else tables
    own = [table for table in tables.values() if isinstance(table, dict) and "matrix" in table]
    metres = any(
        "rotation_count" in table or "grid_count" in table or table.get("fisheye") is False
        for table in own
    )
    return {"convention": replace(_WORLD_TO_CAMERA, unit="m" if metres else None)}


ANIPOSE = TreeFormat(
    "Anipose, Pose2Sim or Caliscope TOML",
    "toml",
    cameras="cameras/*|*",
    required=("matrix", "distortions"),
    parts=(
        name("name"),
        image_size("size"),
        intrinsics("matrix"),
        lens("distortions", model="fisheye", fisheyes={False: False, True: True}),
        pose("rotation", "translation", optional=True),
        _of_toml,
    ),
    choose=lambda nodes: [node for node in nodes if node.find("ignore") is not True],
)


def _qualisys_lens(node: Node) -> Mapping[str, Any]:
    """K and size of the recorded part of the sensor; lengths are in 1/64 pixel from its corner."""
    left, top, right, bottom = (
        number(node, f"fov_video/{side}") for side in ("left", "top", "right", "bottom")
    )
    fx, fy, cx, cy = (
        number(node, f"intrinsic/{part}") / 64.0
        for part in ("focalLengthU", "focalLengthV", "centerPointU", "centerPointV")
    )
    return {
        "image_size": (round(right - left) + 1, round(bottom - top) + 1),
        "intrinsics": values.focal_and_centre(fx, fy, cx - left, cy - top),
    }


def _qualisys_pose(node: Node) -> Mapping[str, Any]:
    """r11 r12 r13 is the first column of the rotation from camera to world."""
    turned = [[number(node, f"transform/r{row}{column}") for row in "123"] for column in "123"]
    return {
        "rotation": values.rotation(node.file, node.where("transform"), turned),
        "translation": np.array([number(node, f"transform/{axis}") for axis in "xyz"]),
    }


def _of_video(nodes: list[Node]) -> list[Node]:
    """The cameras that record video; all, where none says so."""
    films = ("Miqus Video", "none")
    return [n for n in nodes if str(n.find("model") or "none").startswith(films)] or nodes


QUALISYS = TreeFormat(
    "Qualisys .qca.txt",
    "xml",
    cameras="cameras/camera",
    required=("fov_video", "transform", "intrinsic/focalLengthU"),
    parts=(
        name("serial"),
        _qualisys_lens,
        lens(
            *(
                f"intrinsic/{part}"
                for part in (
                    "radialDistortion1",
                    "radialDistortion2",
                    "tangentalDistortion1",
                    "tangentalDistortion2",
                    "radialDistortion3",
                )
            ),
        ),
        _qualisys_pose,
    ),
    convention=Convention(unit="mm", direction="camera-to-world", axes="opengl", up="z"),
    choose=_of_video,
)

ROS = TreeFormat(
    "ROS camera_info YAML",
    "yaml",
    cameras=".",
    required=(
        "image_width", "image_height", "camera_matrix/data", "distortion_coefficients/data",
    ),
    parts=(
        name("camera_name"),
        image_size("image_width", "image_height"),
        intrinsics("camera_matrix/data"),
        lens(
            "distortion_coefficients/data",
            model="distortion_model",
            fisheyes={
                "plumb_bob": False, "rational_polynomial": False, "equidistant": True,
                "fisheye": True,
            },
        ),
    ),
    convention=Convention(axes="opencv"),
)  # fmt: skip

KALIBR = TreeFormat(
    "Kalibr camchain YAML",
    "yaml",
    cameras="*",
    required=("intrinsics", "resolution", "distortion_coeffs", "distortion_model"),
    parts=(
        name(),
        only("camera_model", "pinhole"),
        image_size("resolution"),
        intrinsics("intrinsics"),
        lens(
            "distortion_coeffs",
            model="distortion_model",
            fisheyes={"radtan": False, "equidistant": True, "none": False},
        ),
        # the world is the first camera: up has to be found out
        step_from_last("T_cn_cnm1"),
    ),
    convention=Convention(unit="m", direction="world-to-camera", axes="opencv"),
)

PANOPTIC = TreeFormat(
    "Panoptic Studio JSON",
    "json",
    cameras="cameras/*",
    required=("name", "panel", "node", "resolution", "K", "distCoef", "R", "t"),
    parts=(
        name("name"),
        image_size("resolution"),
        intrinsics("K"),
        lens("distCoef"),
        pose("R", "t"),
    ),
    convention=Convention(unit="cm", direction="world-to-camera", axes="opencv", up="-y"),
)

VOXELPOSE = TreeFormat(
    "VoxelPose calibration JSON",
    "json",
    cameras="*",
    required=("R", "T", "fx", "fy", "cx", "cy", "k", "p"),
    parts=(
        name(),
        intrinsics("fx", "fy", "cx", "cy"),
        lens("k/0", "k/1", "p/0", "p/1", "k/2"),
        pose_at("R", "T"),
    ),
    convention=_WORLD_TO_CAMERA,
)


def _ccrs_lens(node: Node) -> Mapping[str, Any]:
    """k1 … of OpenCV's plain lens or of its fisheye; the other models have no counterpart."""
    if node.key == "OpenCVModel5":
        return lens("k1", "k2", "p1", "p2", "k3")(node)
    if node.key == "KannalaBrandt4":
        return lens("k1", "k2", "k3", "k4", fisheyes={"": True})(node)
    raise node.file.error(
        f"has a lens of the model {node.key}, expected OpenCVModel5 or KannalaBrandt4; calibrate "
        "again with --model opencv5 or --model kb4"
    )


CCRS_LENS = TreeFormat(
    "camera-intrinsic-calibration lens JSON",
    "json",
    cameras="OpenCVModel5|KannalaBrandt4|UCM|EUCM|EUCMT|Ftheta|FovCamera|DoubleSphere",
    required=("cx", "cy", "width", "height"),
    parts=(_ccrs_lens, image_size("width", "height"), intrinsics("fx", "fy", "cx", "cy")),
    convention=Convention(axes="opencv"),
)

CCRS_POSES = TreeFormat(
    "camera-intrinsic-calibration extrinsics.json",
    "json",
    cameras="rtvecs/*",
    required=("rvec", "tvec"),
    # the lenses lie beside it as cam0.json, cam1.json …; the world is cam0
    parts=(lambda node: {"name": f"cam{node.key}"}, pose("rvec", "tvec")),
    convention=Convention(unit="m", direction="world-to-camera", axes="opencv"),
)


def _nvidia_size(node: Node) -> Mapping[str, Any]:
    """The picture's size among the attributes, a list of names and values."""
    rows = node.find("attributes")
    given = {
        row.get("name"): row.get("value")
        for row in (rows if isinstance(rows, list) else ())
        if isinstance(row, Mapping)
    }
    sides = [given.get(side) for side in ("frameWidth", "frameHeight")]
    if not all(sides):
        return {}
    return {"image_size": values.image_size(node.file, node.where("attributes"), sides)}


NVIDIA = TreeFormat(
    "NVIDIA calibration.json (AI City)",
    "json",
    cameras="sensors/*",
    required=("id", "intrinsicMatrix", "extrinsicMatrix"),
    parts=(
        name("id"),
        _nvidia_size,
        intrinsics("intrinsicMatrix"),
        pose_matrix("extrinsicMatrix", 3),
    ),
    convention=Convention(unit="m", direction="world-to-camera", axes="opencv", up="z"),
)


def _of_points(node: Node) -> Mapping[str, Any]:
    """The pose in which points of the picture are the points of the map."""
    where = node.where("camera points")
    pixels = values.numbers(node.file, where, node.get("camera points"))
    places = values.numbers(node.file, node.where("map points"), node.get("map points"))
    count = len(pixels) // 2
    if count < 4 or len(pixels) != 2 * count or len(places) != 3 * count:
        raise node.file.error(
            f"expected four or more points of x y, and as many of x y z, found {len(pixels)} and "
            f"{len(places)} numbers",
            where,
        )
    k = intrinsics("intrinsics")(node)["intrinsics"]
    flat = not places[2::3].any()
    try:
        solved, turned, moved = cv2.solvePnP(
            places.reshape(-1, 1, 3), pixels.reshape(-1, 1, 2), k, None,
            flags=cv2.SOLVEPNP_IPPE if flat else cv2.SOLVEPNP_SQPNP,
        )  # fmt: skip
    except cv2.error:
        solved = False
    if not solved or not np.isfinite([turned, moved]).all():
        raise node.file.error("expected points that are not all on one line", where)
    return {
        "rotation": values.rotation(node.file, where, turned),
        "translation": moved.ravel(),
        "intrinsics": k,
    }


SCENESCAPE = TreeFormat(
    "SceneScape config.json",
    "json",
    cameras="sensors/*",
    required=("camera points", "map points", "intrinsics"),
    parts=(name(), image_size("width", "height"), _of_points),
    convention=Convention(unit="m", direction="world-to-camera", axes="opencv", up="z"),
)

FORMATS = (
    ANIPOSE, QUALISYS, ROS, KALIBR, PANOPTIC, VOXELPOSE, CCRS_LENS, CCRS_POSES, NVIDIA, SCENESCAPE,
)  # fmt: skip
"""All of them; of two that fit a file, the later one reads it."""
