"""The size of each camera's pictures, and its calibration brought to that size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.io.conventions.reading import lens_of, read_boxes, stretched
from tracker.io.importing.finding.matching import MatchedCamera, same_aspect
from tracker.io.read.pieces import DetectionPiece, FormatError, RawCamera

COMMON_SIZES = (
    (320, 240), (352, 288), (360, 288), (640, 360), (640, 480), (720, 576), (768, 576), (800, 600),
    (848, 480), (960, 540), (1024, 768), (1280, 720), (1280, 960), (1280, 1024), (1600, 1200),
    (1920, 1080), (1920, 1200), (2048, 1536), (2560, 1440), (2592, 1944), (2704, 1520),
    (3840, 2160), (4000, 3000), (4096, 2160),
)  # fmt: skip
"""Pixels, of cameras; where no file says the size."""

_OFF_CENTRE = 0.25
"""By how much, as a logarithm, twice a principal point may differ from the size."""


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


def exchange_by_shape(cameras: Sequence[MatchedCamera], found: list[tuple[str, str]]) -> None:
    """Exchange calibrations that have the shape of each other's pictures and not of their own.

    Where pictures of several of these cameras have one shape, nothing is exchanged: whose is whose
    is not told by shapes.

    Args:
        cameras: The cameras, whose calibrations are replaced.
        found: What was found out is added.
    """
    whose = {camera.raw.name: camera.calibration_of for camera in cameras}
    wrong = [
        (camera, camera.raw, camera.raw.image_size, camera.picture_size)
        for camera in cameras
        if camera.raw.image_size is not None
        and camera.picture_size is not None
        and not same_aspect(camera.raw.image_size, camera.picture_size)
    ]
    owners = [
        [
            k
            for k, (_, _, calibrated, _) in enumerate(wrong)
            if calibrated is not None and known is not None and same_aspect(calibrated, known)
        ]
        for _, _, _, known in wrong
    ]
    if (
        not wrong
        or {len(own) for own in owners} != {1}
        or len({own[0] for own in owners}) < len(wrong)
    ):
        return
    for (camera, raw, _, known), (owner,) in zip(wrong, owners, strict=True):
        assert known is not None
        found.append(
            (
                f"{raw.name} exchanged",
                f"has the calibration of {wrong[owner][1].name}, whose shape its pictures of "
                f"{known[0]}×{known[1]} have",
            )
        )
        camera.raw = replace(wrong[owner][1], name=raw.name)
        camera.calibration_of = whose[wrong[owner][1].name]


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
    """The camera for pictures of another size."""
    if raw.image_size is None or raw.image_size == size:
        return replace(raw, image_size=size)
    across, down = size[0] / raw.image_size[0], size[1] / raw.image_size[1]
    return replace(stretched(raw, across, down), image_size=size)


def _likely(cameras: Sequence[MatchedCamera]) -> tuple[int, int]:
    """The common size that has the principal points nearest to its middle and holds the boxes."""
    middle = np.median([lens_of(c.raw, (1, 1)).intrinsics[:2, 2] for c in cameras], axis=0)
    begins = [_begins(c.detections) for c in cameras if c.detections is not None]
    least = np.max(begins, axis=0) if begins else np.ones(2)
    sizes = np.array([[size, size[::-1]] for size in COMMON_SIZES], dtype=float).reshape(-1, 2)
    off = np.abs(np.log(sizes / np.maximum(2.0 * middle, 1.0))).max(axis=1)
    off[(sizes < least).any(axis=1)] = np.inf
    best = int(np.argmin(off))
    if off[best] <= _OFF_CENTRE:
        return int(sizes[best, 0]), int(sizes[best, 1])
    guess = np.ceil(np.maximum(2.0 * middle, least))
    return int(guess[0]), int(guess[1])


def _begins(piece: DetectionPiece) -> Float[ndarray, " 2"]:
    """How far right and down boxes begin, but for a few; their ends may lie beyond the picture."""
    if not len(piece.boxes) or piece.normalised:
        return np.ones(2)
    boxes = read_boxes(piece.boxes, piece.layout or "ltwh")
    return np.asarray(np.quantile(boxes[:, :2], 0.99, axis=0))
