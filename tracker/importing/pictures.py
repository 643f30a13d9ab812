"""The size of each camera's pictures, and its calibration brought to that size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.checks.reading import lens_of, read_boxes
from tracker.formats.pieces import DetectionPiece, FormatError, RawCamera
from tracker.importing.matching import MatchedCamera, same_aspect

COMMON_SIZES = (
    (320, 240), (352, 288), (360, 288), (640, 360), (640, 480), (720, 576), (768, 576), (800, 600),
    (848, 480), (960, 540), (1024, 768), (1280, 720), (1280, 960), (1280, 1024), (1600, 1200),
    (1920, 1080), (1920, 1200), (2048, 1536), (2560, 1440), (2592, 1944), (2704, 1520),
    (3840, 2160), (4000, 3000), (4096, 2160),
)  # fmt: skip
"""Pixels, of cameras; where no file says the size."""

_OFF_CENTRE = 0.25
"""Part of the size by which a principal point may lie beside the picture's middle."""


def picture_sizes(
    cameras: Sequence[MatchedCamera], found: list[tuple[str, str]]
) -> list[tuple[int, int]]:
    """Of the pictures; else of the boxes' file, else of the calibration, else a likely one.

    Cameras of which nothing says it are taken to be alike.

    Raises:
        FormatError: If calibration and pictures have another shape.
    """
    sizes = [_size(camera, found) for camera in cameras]
    unknown = [camera for camera, size in zip(cameras, sizes, strict=True) if size is None]
    likely = _likely(unknown) if unknown else (1, 1)
    if unknown:
        found.append(("image size", f"{likely[0]}×{likely[1]}, by principal points and boxes"))
    return [size or likely for size in sizes]


def _size(camera: MatchedCamera, found: list[tuple[str, str]]) -> tuple[int, int] | None:
    known = camera.picture_size
    calibrated = camera.raw.image_size
    name = camera.raw.name
    if known is not None:
        if calibrated is not None and not same_aspect(calibrated, known):
            turned = same_aspect(calibrated, known[::-1])
            raise FormatError(
                f'camera "{name}": calibrated for {calibrated[0]}×{calibrated[1]}, but its '
                f"pictures have {known[0]}×{known[1]}"
                + (
                    "; they are turned: turn the video, or calibrate with turned pictures"
                    if turned
                    else ": another shape, so it is another camera or a cut picture"
                )
            )
        if calibrated is not None and calibrated != known:
            found.append(
                (
                    f"{name} scaled",
                    f"calibrated for {calibrated[0]}×{calibrated[1]}, scaled to the pictures' "
                    f"{known[0]}×{known[1]}",
                )
            )
        return known
    return calibrated


def scaled(raw: RawCamera, size: tuple[int, int]) -> RawCamera:
    """The camera for pictures of another size: pixels' corners, not centres, are scaled."""
    if raw.image_size is None or raw.image_size == size:
        return replace(raw, image_size=size)
    across, down = size[0] / raw.image_size[0], size[1] / raw.image_size[1]
    scale = np.array(
        [[across, 0.0, 0.5 * across - 0.5], [0.0, down, 0.5 * down - 0.5], [0.0, 0.0, 1.0]]
    )
    if raw.projection is not None:
        return replace(raw, image_size=size, projection=scale @ raw.projection)
    assert raw.intrinsics is not None
    return replace(raw, image_size=size, intrinsics=scale @ raw.intrinsics)


def _likely(cameras: Sequence[MatchedCamera]) -> tuple[int, int]:
    """The smallest common size that holds the boxes, with principal points near its middle."""
    middle = np.median([lens_of(c.raw, (1, 1)).intrinsics[:2, 2] for c in cameras], axis=0)
    ends = [_ends(c.detections) for c in cameras if c.detections is not None]
    least = np.max(ends, axis=0) if ends else np.ones(2)
    for common in sorted(COMMON_SIZES):
        for size in (common, common[::-1]):
            half = np.array(size) / 2.0
            if (np.array(size) >= least).all() and (
                np.abs(middle - half) <= _OFF_CENTRE * half
            ).all():
                return int(size[0]), int(size[1])
    guess = np.maximum(2.0 * middle, least)
    return int(np.ceil(guess[0])), int(np.ceil(guess[1]))


def _ends(piece: DetectionPiece) -> Float[ndarray, " 2"]:
    """How far right and down the boxes reach, but for a few outliers."""
    if not len(piece.boxes) or piece.normalised:
        return np.ones(2)
    layout = piece.layout or "xyxy"
    boxes = read_boxes(piece.boxes, layout)
    return np.asarray(np.quantile(boxes[:, :2] + boxes[:, 2:], 0.99, axis=0))
