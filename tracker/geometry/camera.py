"""A calibrated camera: projection, its derivative, back-projection, the box of an upright target.

World: metres, z up, right-handed. Camera: OpenCV axes (x right, y down, z ahead),
``x_camera = R @ x_world + t``. Image: pixels, origin at the centre of the top-left
pixel, x right, y down. Lens: OpenCV's radial-tangential model (k1 k2 p1 p2 k3), its rational
model (k4 k5 k6 as well), or its fisheye; the equations are those of OpenCV's calib3d module
(Brown, "Close-range camera calibration", Photogrammetric Engineering 37(8), 1971; Kannala, Brandt,
IEEE TPAMI 28(8), 2006).
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.kernels import lens
from tracker.kernels.lens import Calibration, Calibrations

NEAREST_DEPTH = 0.05
"""Depth below which a point counts as behind the camera, metres."""

_LENS_ITERATIONS = 12
"""Largest number of Newton iterations, each of which doubles the correct digits."""

_CORNER_SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics, lens and pose of one camera."""

    name: str
    """Name of the camera in the sequence."""
    image_size: tuple[int, int]
    """Width and height in pixels."""
    intrinsics: Float[ndarray, "3 3"]
    """K, upper triangular, in pixels."""
    rotation: Float[ndarray, "3 3"]
    """R, from world to camera axes."""
    translation: Float[ndarray, " 3"]
    """t, in metres, in camera axes."""
    distortion: Float[ndarray, " n"]
    """k1, k2, p1, p2, k3, zeros for a pinhole; with k4, k5, k6 of the rational model; or
    k1, k2, k3, k4 of a fisheye."""
    fisheye: bool = False
    """Whether the lens projects by the angle (OpenCV's fisheye model), not by its tangent."""

    @staticmethod
    def from_projection(
        name: str, image_size: tuple[int, int], projection: Float[ndarray, "3 4"]
    ) -> Camera:
        """Split P = K [R | t] into its parts, by an RQ decomposition.

        Args:
            name: Name of the camera.
            image_size: Width and height, pixels.
            projection: P, world metres to pixels, up to scale; without distortion.

        Raises:
            ValueError: If the left 3×3 part of P is singular.
        """
        left = projection[:, :3]
        # P may have any scale, so the determinant is compared with the entries
        if abs(np.linalg.det(left)) <= 1e-12 * float(np.abs(left).max()) ** 3:
            raise ValueError("its left 3×3 part is singular, so it is not a camera")
        # RQ decomposition through QR of the row-reversed transpose
        q, r = np.linalg.qr(left[::-1].T)
        intrinsics, rotation = r.T[::-1, ::-1], q.T[::-1]
        signs = np.diag(np.sign(np.diag(intrinsics)))
        intrinsics, rotation = intrinsics @ signs, signs @ rotation
        translation = np.linalg.solve(intrinsics, projection[:, 3])
        if np.linalg.det(rotation) < 0.0:  # P and -P are the same camera
            rotation, translation = -rotation, -translation
        return Camera(
            name,
            image_size,
            intrinsics / intrinsics[2, 2],
            rotation,
            translation,
            np.zeros(5),
        )

    @cached_property
    def centre(self) -> Float[ndarray, " 3"]:
        """The position of the lens, world metres."""
        return np.asarray(-self.rotation.T @ self.translation)

    @cached_property
    def is_pinhole(self) -> bool:
        """Whether the lens has no distortion."""
        return not self.fisheye and not np.any(self.distortion)

    @cached_property
    def largest_radius(self) -> float:
        """The radius, in units of the depth, up to which the lens model is one-to-one.

        Beyond the first extremum of r (1 + k1 r² + k2 r⁴ + k3 r⁶) the polynomial
        folds back and would project points far outside the view inside the image.
        """
        if len(self._lens) == lens.GENERAL:
            angles = np.linspace(0.0, np.pi / 2.0, 2000)[1:-1]
            radii = np.tan(angles)
            drawn = np.array([r * lens.bend(r * r, self._lens)[0] for r in radii])
            folds = np.flatnonzero(np.diff(drawn) <= 0.0)
            return float(radii[folds[0]]) if len(folds) else np.inf
        # a tiny coefficient has no effect, and is a divisor below
        k1, k2, _, _, k3 = np.where(np.abs(self._lens) < 1e-30, 0.0, self._lens)
        roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])  # in r²
        real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)].real
        return float(np.sqrt(real.min())) if len(real) else np.inf

    @cached_property
    def _lens(self) -> Float[ndarray, " n"]:
        """The distortion in the form that the kernels take: 5 coefficients where they suffice."""
        given = np.asarray(self.distortion, dtype=float)
        if self.fisheye:
            k1, k2, k3, k4 = given[:4]
            return np.array([k1, k2, 0.0, 0.0, k3, k4, 0.0, 0.0, 1.0])
        if not given[5:].any():
            return np.ascontiguousarray(given[:5])
        return np.array([*given, *np.zeros(lens.GENERAL - len(given))])

    @cached_property
    def calibration(self) -> Calibration:
        """The camera in the form that the compiled kernels take."""
        return Calibration(
            np.array(self.image_size, dtype=float),
            np.ascontiguousarray(self.rotation, dtype=float),
            np.ascontiguousarray(self.translation, dtype=float),
            np.ascontiguousarray(self.intrinsics, dtype=float),
            self._lens,
            NEAREST_DEPTH,
            self.largest_radius,
        )

    def to_camera(self, points: Float[ndarray, "N 3"]) -> Float[ndarray, "N 3"]:
        """Transform world points (metres) to camera axes."""
        return np.asarray(points @ self.rotation.T + self.translation)

    def project(
        self, points: Float[ndarray, "N 3"]
    ) -> tuple[Float[ndarray, "N 2"], Bool[ndarray, " N"]]:
        """Project world points (metres) to pixels, and return whether each projection is valid.

        Points behind the camera, and points so far aside that the lens model is not valid
        (:attr:`largest_radius`), result in NaN and False.
        """
        places = np.ascontiguousarray(points, dtype=float)
        projection = lens.project_points(places, self.calibration, False)
        return projection.pixels, projection.valid

    def back_project(self, pixels: Float[ndarray, "N 2"]) -> Float[ndarray, "N 3"]:
        """The unit directions, in world axes, of the rays from :attr:`centre` through the pixels.

        The lens model is inverted by Newton's method, to a thousandth of a pixel
        inside the image.
        """
        rays: ndarray = lens.directions(
            np.ascontiguousarray(pixels, dtype=float),
            self.calibration,
            0 if self.is_pinhole else _LENS_ITERATIONS,
        )
        return rays

    def contains(self, pixels: Float[ndarray, "N 2"]) -> Bool[ndarray, " N"]:
        """Whether each pixel lies inside the image; NaN does not."""
        size = np.array(self.image_size)
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= -0.5) & (pixels < size - 0.5)).all(axis=1))

    def sees(self, points: Float[ndarray, "N 3"]) -> Bool[ndarray, " N"]:
        """Whether each world point (metres) is projected inside the image."""
        pixels, _ = self.project(points)
        return self.contains(pixels)

    def project_boxes(
        self, centres: Float[ndarray, "N 3"], half_extents: Float[ndarray, " 3"]
    ) -> tuple[Float[ndarray, "N 4"], Bool[ndarray, " N"]]:
        """Project upright targets to boxes: the bounds of the eight projected corners.

        Args:
            centres: Centres of N targets, world metres.
            half_extents: Half width, depth and height of a target, metres.

        Returns:
            ``left, top, width, height`` in pixels, not clipped, NaN where invalid;
            and whether the target is wholly in front of the lens and its box
            overlaps the image.
        """
        count = len(centres)
        corners = (centres[:, None, :] + _CORNER_SIGNS * half_extents).reshape(-1, 3)
        pixels, valid = self.project(corners)
        pixels = pixels.reshape(count, 8, 2)
        whole = valid.reshape(count, 8).all(axis=1)
        boxes = np.full((count, 4), np.nan)
        low, high = pixels[whole].min(axis=1), pixels[whole].max(axis=1)
        boxes[whole, :2], boxes[whole, 2:] = low, high - low
        width, height = self.image_size
        visible = np.zeros(count, dtype=bool)
        visible[whole] = (
            (high > -0.5).all(axis=1) & (low[:, 0] < width - 0.5) & (low[:, 1] < height - 0.5)
        )
        return boxes, visible


def stacked(cameras: Many[Camera]) -> Calibrations:
    """Stack C cameras in the form that the compiled kernels take.

    The shorter distortions are padded with zeros; without cameras all arrays are empty.
    """
    each = [camera.calibration for camera in cameras]
    longest = max((len(one.distortion) for one in each), default=5)
    return Calibrations(
        np.array([one.image_size for one in each]),
        np.array([one.rotation for one in each]),
        np.array([one.translation for one in each]),
        np.array([one.intrinsics for one in each]),
        np.array([[*one.distortion, *np.zeros(longest - len(one.distortion))] for one in each]),
        NEAREST_DEPTH,
        np.array([one.largest_radius for one in each]),
    )
