"""Stabilisation of a camera that shakes: every image is aligned to the most frequent view.

The static parts of a room move in the images of a camera on a weak stand, by a few
pixels; a background learnt from these is blurred, and every edge is foreground. Corners of the
static scene are tracked from the scene of most images into each image ([LK81]_ in
pyramids), and the shift and rotation on which most of them agree are inverted.

[LK81] Lucas, Kanade, "An iterative image registration technique with an application to stereo
vision", IJCAI 1981.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray

from tracker.sequences.pictures.frames import Picture, Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.pictures.background import median
from tracker.single_view.pictures.foreground import spread_steps
from tracker.single_view.rectification.view import RectifiedView

_Made = TypeVar("_Made")

LINES = 320
"""Length of the shorter side to which an image is reduced for the tracking, pixels."""

CORNERS, APART = 160, 1.0 / 30.0
"""Largest number of corners, and their least distance in shorter sides."""

LEAST_CORNERS = 12
"""Least number of corners that agree."""

LARGEST = 0.05
"""Largest shift, in shorter sides: beyond it is another view and no shake."""

_WINDOW = 15
_AGREES = 0.6
"""Distance within which a corner agrees with the others, reduced pixels."""

_SMOOTH, _CONTRAST = 12, 4.0
"""Scale in pixels on which brightness and contrast are normalised, and the noise in levels."""

_STILL = 3
"""Distance in images of those that are checked for a shake at all."""

_MEDIAN_OF_SQUARE = 2.0 * np.log(2.0)
"""Median of the square of a shift in both axes of standard deviation 1."""


@dataclass(frozen=True, slots=True, eq=False)
class StaticScene:
    """The static scene of one camera, and the deviation of its images from it."""

    scene: UInt8[ndarray, "h w"]
    """The reduced and normalised scene."""
    corners: Float32[ndarray, "N 1 2"]
    """Corners of the scene, reduced pixels."""
    reduction: float
    """Reduced pixels per pixel."""
    shake: float
    """Standard deviation of the shift of images along an axis, pixels; 0 if unknown."""

    @staticmethod
    def learn(
        pictures: Iterable[UInt8[ndarray, "h w 3"]],
        shown: UInt8[ndarray, "h w"] | None,
        least: float,
        check: Callable[[], None] = lambda: None,
    ) -> StaticScene | None:
        """Learn the static scene of a camera; None without images.

        Args:
            pictures: Images, BGR, spread over the clip; people may be on them.
            shown: Not 0 where an image shows the camera's view; None for everywhere.
            least: Shake below which the scene is not computed precisely, pixels.
            check: A function that is called now and then; an exception of it ends the work.
        """
        whole = list(pictures)
        if not whole:
            return None
        reduction = min(1.0, LINES / min(whole[0].shape[:2]))
        some = [_normalise(picture, reduction) for picture in whole[::_STILL]]
        first = _scene_and_shake(some, shown, reduction, check=check)
        if first.shake < least:
            return first
        # the median of aligned images is sharp
        every = [_normalise(picture, reduction) for picture in whole]
        calm = []
        for picture in every:
            check()
            calm.append(first._align_reduced(picture))
        return _scene_and_shake(calm, shown, reduction, every, check)

    def align(self, picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w 3"]:
        """Align an image with the scene; an image whose shift is unknown is not changed."""
        moved = self._shift_of(_normalise(picture, self.reduction))
        return picture if moved is None else _back(picture, moved, self.reduction)

    def _align_reduced(self, normalised: UInt8[ndarray, "h w"]) -> UInt8[ndarray, "h w"]:
        moved = self._shift_of(normalised)
        return normalised if moved is None else _back(normalised, moved, 1.0)

    def _shift_of(self, normalised: UInt8[ndarray, "h w"]) -> Float[ndarray, " 3"] | None:
        """Shift to the right and down, reduced pixels, and rotation about the middle, radians."""
        if len(self.corners) < LEAST_CORNERS:
            return None
        found, there, _ = cv2.calcOpticalFlowPyrLK(
            self.scene,
            normalised,
            self.corners,
            self.corners.copy(),
            winSize=(_WINDOW, _WINDOW),
            maxLevel=3,
        )
        followed = there.ravel() > 0
        height, width = self.scene.shape
        places = self.corners[followed, 0].astype(float) - [(width - 1) / 2, (height - 1) / 2]
        return consensus_shift(
            places, (found - self.corners)[followed, 0].astype(float), min(height, width)
        )


def _scene_and_shake(
    pictures: list[UInt8[ndarray, "h w"]],
    shown: UInt8[ndarray, "h w"] | None,
    reduction: float,
    measured: list[UInt8[ndarray, "h w"]] | None = None,
    check: Callable[[], None] = lambda: None,
) -> StaticScene:
    """Compute the static scene of images, and the shake of these, or of others, against it.

    Args:
        pictures: Reduced and normalised images, aligned as far as known.
        shown: Not 0 where an image shows the camera's view; None for everywhere.
        reduction: Reduced pixels per pixel.
        measured: Images whose shake is measured; None for ``pictures``.
        check: A function that is called now and then; an exception of it ends the work.
    """
    scene = median(pictures, check)
    height, width = scene.shape
    mask = None
    if shown is not None:
        shown = cv2.resize(shown, (width, height), interpolation=cv2.INTER_NEAREST)
        mask = cv2.erode(shown, np.ones((2 * _WINDOW + 1, 2 * _WINDOW + 1), dtype=np.uint8))
    corners = cv2.goodFeaturesToTrack(scene, CORNERS, 0.05, APART * min(height, width), mask=mask)
    if corners is None:
        corners = np.zeros((0, 1, 2))
    found = StaticScene(scene, corners.astype(np.float32), reduction, 0.0)
    shifts = []
    for picture in pictures if measured is None else measured:
        check()
        moved = found._shift_of(picture)
        if moved is not None:
            shifts.append(moved[:2])
    if 2 * len(shifts) < len(pictures):  # a scene that less than half of them show is not static
        return found
    square = float(np.median((np.array(shifts) ** 2).sum(axis=1)))
    shake = float(np.sqrt(square / _MEDIAN_OF_SQUARE)) / reduction
    return StaticScene(scene, found.corners, reduction, shake)


def consensus_shift(
    places: Float[ndarray, "N 2"], shifts: Float[ndarray, "N 2"], side: float
) -> Float[ndarray, " 3"] | None:
    """Find the shift and rotation on which most corners agree: d and θ of s = d + θ J p.

    Args:
        places: p, from the middle of the image, reduced pixels.
        shifts: s, reduced pixels.
        side: Shorter side of the image, reduced pixels.

    Returns:
        d_x, d_y and θ; None if too few corners agree, or the shift is too large.
    """
    if len(places) < LEAST_CORNERS:
        return None
    across = np.stack([-places[:, 1], places[:, 0]], axis=1)
    columns = np.zeros((len(places), 2, 3))
    columns[:, 0, 0] = columns[:, 1, 1] = 1.0
    columns[:, :, 2] = across
    moved = np.array([*np.median(shifts, axis=0), 0.0])
    near = np.zeros(0)
    for _ in range(4):
        left = np.linalg.norm(shifts - columns @ moved, axis=1)
        # at least the nearer half, until the rotation is known
        near = left <= max(_AGREES, float(np.median(left)))
        rows = columns[near].reshape(-1, 3)
        moved = np.linalg.lstsq(rows, shifts[near].reshape(-1), rcond=None)[0]
    agree = np.linalg.norm(shifts - columns @ moved, axis=1) <= _AGREES
    if agree.sum() < max(LEAST_CORNERS, 0.3 * len(places)):
        return None
    return moved if np.abs(moved[:2]).max() <= LARGEST * side else None


def _normalise(picture: UInt8[ndarray, "h w 3"], reduction: float) -> UInt8[ndarray, "h2 w2"]:
    """Normalise mean and contrast of the grey levels locally, against changes of light."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    grey = cv2.resize(grey, None, fx=reduction, fy=reduction, interpolation=cv2.INTER_AREA)
    level = grey.astype(np.float32)
    size = (2 * _SMOOTH + 1, 2 * _SMOOTH + 1)
    mean = cv2.blur(level, size)
    spread = np.sqrt(np.maximum(cv2.blur(level * level, size) - mean * mean, 0.0))
    normalised = 128.0 + 42.0 * (level - mean) / (spread + _CONTRAST)
    return np.asarray(np.clip(normalised, 0.0, 255.0), dtype=np.uint8)


def _back(
    picture: UInt8[ndarray, "h w *c"], moved: Float[ndarray, " 3"], reduction: float
) -> UInt8[ndarray, "h w *c"]:
    """Warp a shifted image to the static scene: p → c + R (p - c) + d."""
    height, width = picture.shape[:2]
    middle = np.array([(width - 1) / 2.0, (height - 1) / 2.0])
    cos, sin = np.cos(moved[2]), np.sin(moved[2])
    turn = np.array([[cos, -sin], [sin, cos]])
    matrix = np.column_stack([turn, middle - turn @ middle + moved[:2] / reduction])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(
            picture, matrix, (width, height), flags=flags, borderMode=cv2.BORDER_REPLICATE
        ),
        dtype=np.uint8,
    )


class StabilisedReader:
    """A reader that stabilises the images of cameras that shake."""

    def __init__(
        self,
        sequence: Sequence,
        reader: Pictures,
        views: tuple[RectifiedView | None, ...],
        least: float,
    ) -> None:
        """Wrap a reader; cameras are examined when their images are needed.

        Args:
            sequence: The sequence.
            reader: Reader of its images.
            views: Conversion of each camera's images.
            least: Shake from which a camera is stabilised, pixels.
        """
        self._frames = sequence.frames
        self._reader = reader
        self._views = views
        self._least = least
        self._read: dict[tuple[int, int], Picture | None] = {}
        """Images that were read for the scene and will be needed again, for the background."""

    def shake(self, camera: int) -> float:
        """Standard deviation of the shake that is compensated, pixels, else 0."""
        scene = self._scene_of(camera)
        return 0.0 if scene is None else scene.shake

    def picture(self, camera: int, step: int) -> Picture | None:
        scene = self._scene_of(camera)
        known = (camera, step) in self._read
        picture = self._read.pop((camera, step)) if known else self._reader.picture(camera, step)
        return _aligned(scene, picture)

    def iterate(self, camera: int, first: int = 0) -> Iterator[Picture | None]:
        scene = self._scene_of(camera)
        for key in [key for key in self._read if key[0] == camera]:
            self._read.pop(key, None)
        for picture in self._reader.iterate(camera, first):
            yield _aligned(scene, picture)

    def empty(self, camera: int) -> Picture | None:
        return _aligned(self._scene_of(camera), self._reader.empty(camera))

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        return self._reader.once(("stabilised", self._least, name), make)

    def check(self) -> None:
        self._reader.check()

    def _scene_of(self, camera: int) -> StaticScene | None:
        """The static scene of a camera that shakes, else None."""

        def made() -> StaticScene | None:
            view = self._views[camera]
            shown = None if view is None else view.shown
            return StaticScene.learn(self._spread(camera), shown, self._least, self.check)

        found = self._reader.once(("static scene", camera, self._least), made)
        return None if found is None or found.shake < self._least else found

    def _spread(self, camera: int) -> Iterator[Picture]:
        for step in spread_steps(range(self._frames)):
            picture = self._read[camera, step] = self._reader.picture(camera, step)
            if picture is not None:
                yield picture


def _aligned(scene: StaticScene | None, picture: Picture | None) -> Picture | None:
    return picture if scene is None or picture is None else scene.align(picture)
