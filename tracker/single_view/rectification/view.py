"""Conversion of one camera for stage 1: its image and calibration are reduced and rotated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.parameters.groups.foreground import PictureParams
from tracker.sequences.sequence import Room
from tracker.single_view.box_sizes import BoxSizes

_SMALLER = 0.95
"""Factor of the reduction above which an image is not reduced."""


@dataclass(frozen=True, slots=True, eq=False)
class RectifiedView:
    """The mapping between a camera's pixels and those of stage 1.

    An image is reduced by the factors s along its axes and then rotated by the camera's
    roll θ, so that people are upright in the image. Both are exact for the
    calibration: with K of square pixels after the reduction, and Q the rotation,

        K' = T diag(s, 1) K,  R' = Q R,  t' = Q t,  (p2', p1') = Q (p2, p1)

    for the lens's radial part is rotation invariant, and its tangential one is a vector.
    A box retains its centre; its sizes are those of the upright target, and in the camera's
    own image it extends as far as the axes of that target.
    """

    camera: Camera
    """The calibration of the rectified image."""
    full: Camera
    """The calibration of the camera's own image."""
    factors: Float[ndarray, " 2"]
    """s, horizontal and vertical."""
    turn: Float[ndarray, "2 3"] | None
    """Affine map from the reduced image's pixels to the rectified image's; None for no rotation."""
    roll: float
    """θ, clockwise rotation of the image, radians."""

    @property
    def scale(self) -> float:
        """Rectified pixels per full pixel."""
        return float(np.sqrt(self.factors.prod()))

    @property
    def key(self) -> tuple[float, ...]:
        """A key of data that are made from the rectified images."""
        return (*self.camera.image_size, *self.factors.tolist(), self.roll)

    def picture(self, full: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h2 w2 3"]:
        """Compute the rectified image by averages of areas; outside the camera's it is black."""
        reduced = _reduced(full, self._reduced_size)
        if self.turn is not None:
            reduced = cv2.warpAffine(reduced, self.turn, self.camera.image_size)
        return np.asarray(reduced, dtype=np.uint8)

    @property
    def shown(self) -> UInt8[ndarray, "h2 w2"] | None:
        """1 where the rectified image shows the camera's image; None for everywhere."""
        if self.turn is None:
            return None
        width, height = self._reduced_size
        whole = np.ones((height, width), dtype=np.uint8)
        flags = cv2.INTER_NEAREST
        return np.asarray(cv2.warpAffine(whole, self.turn, self.camera.image_size, flags=flags))

    def mask(self, rectified: UInt8[ndarray, "h2 w2"]) -> UInt8[ndarray, "h1 w1"]:
        """Convert a mask of the rectified image to one of the camera's own, reduced."""
        if self.turn is None:
            return rectified
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(rectified, self.turn, self._reduced_size, flags=flags))

    def points(self, full: Float[ndarray, "N 2"]) -> Float[ndarray, "N 2"]:
        """Convert full pixels to rectified pixels."""
        reduced = (full + 0.5) * self.factors - 0.5
        if self.turn is not None:
            reduced = reduced @ self.turn[:, :2].T + self.turn[:, 2]
        return np.asarray(reduced)

    def points_back(self, rectified: Float[ndarray, "N 2"]) -> Float[ndarray, "N 2"]:
        """Convert rectified pixels to full pixels."""
        reduced = rectified
        if self.turn is not None:
            reduced = (rectified - self.turn[:, 2]) @ self.turn[:, :2]
        return np.asarray((reduced + 0.5) / self.factors - 0.5)

    def drawn_box(
        self, box: Float[ndarray, " 4"], half_extents: Float[ndarray, " 3"]
    ) -> Float[ndarray, " 4"]:
        """The upright box of a target around which a box was drawn in the camera's own image.

        A person is more an ellipse than a rectangle. The bounds of one with half axes w and h,
        rotated by θ, are

            W² = w² cos² θ + h² sin² θ,  H² = w² sin² θ + h² cos² θ

        which is inverted for the aspect ratio w / h of the target.

        Args:
            box: Centre and half sizes, pixels.
            half_extents: Half width, depth and height of a target, metres.
        """
        aspect = float(half_extents[:2].mean() / half_extents[2])
        across, along = abs(math.cos(self.roll)), abs(math.sin(self.roll))
        width, height = box[2:] * self.factors
        if across < along:
            width, height, across, along = height, width, along, across
        sizes = [
            width / math.hypot(across, along / aspect),
            height / math.hypot(across, along * aspect),
        ]
        return np.concatenate([self.points(box[None, :2])[0], sizes])

    def boxes_back(self, rectified: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Convert boxes of upright targets to the camera's own image.

        The half sizes are the extent of the longer one of the target's two axes, rotated:
        the fusion expects the ends of the upright axis of a rolled camera's box.
        """
        centres = self.points_back(rectified[:, :2])
        return np.concatenate([centres, self._reach(rectified[:, 2:])], axis=1)

    def sigmas_back(self, rectified: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Convert standard deviations of boxes in the same way."""
        across, along = abs(math.cos(self.roll)), abs(math.sin(self.roll))
        turned = np.array([[across, along], [along, across]])
        centres = np.sqrt(rectified[:, :2] ** 2 @ (turned**2).T) / self.factors
        return np.concatenate([centres, self._reach(rectified[:, 2:])], axis=1)

    def gates_back(self, rectified: Float[ndarray, "G 5"]) -> Float[ndarray, "G 5"]:
        """Convert ellipses, centre and xx, xy, yy of their matrix, in the same way."""
        matrix = rectified[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
        turn = np.eye(2) if self.turn is None else self.turn[:, :2]
        back = turn.T / self.factors[:, None]
        full = back @ matrix @ back.T
        ellipse = full.reshape(-1, 4)[:, [0, 1, 3]]
        return np.concatenate([self.points_back(rectified[:, :2]), ellipse], axis=1)

    def _reach(self, sizes: Float[ndarray, "N 2"]) -> Float[ndarray, "N 2"]:
        across, along = abs(math.cos(self.roll)), abs(math.sin(self.roll))
        turned = np.maximum(sizes * across, sizes[:, ::-1] * along)
        return np.asarray(turned / self.factors)

    @property
    def _reduced_size(self) -> tuple[int, int]:
        width, height = self.full.image_size
        return round(width * self.factors[0]), round(height * self.factors[1])


def rectified_view(
    camera: Camera,
    room: Room,
    half_extents: Float[ndarray, " 3"],
    parameters: PictureParams,
    *,
    reduced: bool = True,
) -> RectifiedView | None:
    """The conversion of a camera for stage 1; None where its own images are suitable.

    Args:
        camera: The calibrated camera.
        room: The tracked volume.
        half_extents: Half width, depth and height of a target, metres.
        parameters: The resolution, and the least roll that is compensated.
        reduced: Whether the images are reduced to that resolution.
    """
    scale = _scale(camera, room, half_extents, parameters) if reduced else 1.0
    roll = _roll(camera)
    turned = abs(roll) > parameters.level_from and _can_turn(camera)
    if scale > _SMALLER and not turned:
        return None
    scale = 1.0 if scale > _SMALLER else scale
    width, height = camera.image_size
    square = camera.intrinsics[0, 0] / camera.intrinsics[1, 1] if turned else 1.0
    size = np.maximum(np.rint([width * scale, height * scale * square]), 1.0)
    factors = size / [width, height]
    intrinsics = camera.intrinsics.copy()
    intrinsics[:2, :2] *= factors[:, None]
    intrinsics[:2, 2] = (intrinsics[:2, 2] + 0.5) * factors - 0.5
    smaller = replace(camera, intrinsics=intrinsics, image_size=(int(size[0]), int(size[1])))
    if not turned:
        return RectifiedView(smaller, camera, factors, None, 0.0)
    return _turned(smaller, camera, factors, roll)


def _reduced(full: UInt8[ndarray, "h w 3"], size: tuple[int, int]) -> UInt8[ndarray, "h2 w2 3"]:
    """Average areas: first of whole pixels, which takes a seventh of the time, so that a factor of
    less than three remains for the interpolation."""
    height, width = full.shape[:2]
    whole = min(width // size[0], height // size[1])
    if whole < 2:
        return np.asarray(cv2.resize(full, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    between = width // whole, height // whole
    means = cv2.resize(full, between, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(means, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _turned(
    reduced: Camera, full: Camera, factors: Float[ndarray, " 2"], roll: float
) -> RectifiedView:
    cos, sin = math.cos(roll), math.sin(roll)
    rotation = np.array([[cos, sin], [-sin, cos]])
    width, height = reduced.image_size
    corners = np.array([[x, y] for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)])
    places = corners @ rotation.T
    low = places.min(axis=0)
    size = np.ceil(places.max(axis=0) - low)
    shift = -low - 0.5
    intrinsics = reduced.intrinsics.copy()
    # the pixels are square up to rounding; the rest is shared by both axes
    focal = math.sqrt(intrinsics[0, 0] * intrinsics[1, 1])
    intrinsics[0, 0] = intrinsics[1, 1] = focal
    intrinsics[:2, 2] = rotation @ intrinsics[:2, 2] + shift
    turn = np.eye(3)
    turn[:2, :2] = rotation
    distortion = np.array(full.distortion, dtype=float)
    if not full.fisheye:
        distortion[[3, 2]] = rotation @ distortion[[3, 2]]
    camera = replace(
        reduced,
        image_size=(int(size[0]), int(size[1])),
        intrinsics=intrinsics,
        rotation=turn @ full.rotation,
        translation=turn @ full.translation,
        distortion=distortion,
    )
    return RectifiedView(camera, full, factors, np.column_stack([rotation, shift]), roll)


def _scale(
    camera: Camera, room: Room, half_extents: Float[ndarray, " 3"], parameters: PictureParams
) -> float:
    """The factor by which an image may be reduced."""
    shorter = min(camera.image_size)
    if shorter <= parameters.lines:
        return 1.0
    scale = parameters.lines / shorter
    sizes = BoxSizes.of(camera, room, half_extents).sizes
    if len(sizes):
        height = 2.0 * float(np.median(sizes[:, 1]))
        scale = min(scale, max(parameters.target_height / height, scale / 2.0))
        scale = max(scale, parameters.least_height / height)
    return min(scale, 1.0)


def _can_turn(camera: Camera) -> bool:
    """Whether the lens is rotation invariant, which it is not for a skewed image."""
    return bool(abs(camera.intrinsics[0, 1]) < 1e-6 * camera.intrinsics[0, 0])


def _roll(camera: Camera) -> float:
    """The inclination to the right of a vertical on the optical axis in the image, radians."""
    across, down, _ = camera.rotation[:, 2]
    if math.hypot(across, down) < 0.2:  # seen from above or below there is no vertical
        return 0.0
    return math.atan2(across, -down)
