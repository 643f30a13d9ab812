"""A camera that shakes, held still: every picture is brought to where most of them look.

What does not move in a room does so in the pictures of a camera on a weak stand, by a few
pixels; a background learnt of them is blurred, and every edge is foreground. Corners of the
still scene are followed from the scene as most pictures show it into each picture ([LK81]_ in
pyramids), and the shift and turn on which most of them agree are undone.

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
from tracker.single_view.pictures.foreground import spread_steps
from tracker.single_view.pictures.foreground.exposure import median
from tracker.single_view.working.view import WorkingView

_Made = TypeVar("_Made")

LINES = 320
"""Pixels of the shorter side down to which a picture is reduced to be followed."""

CORNERS, APART = 160, 1.0 / 30.0
"""Corners that are followed, at most, and how far they lie apart, in shorter sides."""

LEAST_CORNERS = 12
"""Fewer that agree say nothing."""

LARGEST = 0.05
"""Shorter sides: what moved further is another view and no shake."""

_WINDOW = 15
_AGREES = 0.6
"""Reduced pixels within which a corner agrees with the others."""

_SMOOTH, _CONTRAST = 12, 4.0
"""Pixels over which brightness and contrast are evened out, and the levels that are noise."""

_STILL = 3
"""Of so many pictures one is looked at to tell whether a camera shakes at all."""

_MEDIAN_OF_SQUARE = 2.0 * np.log(2.0)
"""Median of the square of a shift in both axes of standard deviation 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Steadying:
    """The still scene of one camera, and how far its pictures are from it."""

    scene: UInt8[ndarray, "h w"]
    """Reduced and evened out."""
    corners: Float32[ndarray, "N 1 2"]
    """Reduced pixels."""
    reduction: float
    """Reduced pixels in a pixel."""
    shake: float
    """Standard deviation of a picture's place along an axis, pixels; 0 where nothing is known."""

    @staticmethod
    def learn(
        pictures: Iterable[UInt8[ndarray, "h w 3"]],
        shown: UInt8[ndarray, "h w"] | None,
        least: float,
        check: Callable[[], None] = lambda: None,
    ) -> Steadying | None:
        """Where a camera looks; None where there are no pictures.

        Args:
            pictures: BGR, spread over the clip; people may be on them.
            shown: Not 0 where a picture shows what the camera sees; None for everywhere.
            least: Pixels of shake below which nobody asks for more than that.
            check: Called every so often; what it raises ends the work.
        """
        whole = list(pictures)
        if not whole:
            return None
        reduction = min(1.0, LINES / min(whole[0].shape[:2]))
        some = [_evened(picture, reduction) for picture in whole[::_STILL]]
        first = _looked_at(some, shown, reduction, check=check)
        if first.shake < least:
            return first
        # of pictures brought to one place the median is sharp
        every = [_evened(picture, reduction) for picture in whole]
        calm = []
        for picture in every:
            check()
            calm.append(first._undone(picture))
        return _looked_at(calm, shown, reduction, every, check)

    def still(self, picture: UInt8[ndarray, "h w 3"]) -> UInt8[ndarray, "h w 3"]:
        """The picture as the camera would have taken it at rest; as it is where nobody can tell."""
        moved = self._moved(_evened(picture, self.reduction))
        return picture if moved is None else _back(picture, moved, self.reduction)

    def _undone(self, evened: UInt8[ndarray, "h w"]) -> UInt8[ndarray, "h w"]:
        moved = self._moved(evened)
        return evened if moved is None else _back(evened, moved, 1.0)

    def _moved(self, evened: UInt8[ndarray, "h w"]) -> Float[ndarray, " 3"] | None:
        """How far right and down, reduced pixels, and turned, radians, about the middle."""
        if len(self.corners) < LEAST_CORNERS:
            return None
        found, there, _ = cv2.calcOpticalFlowPyrLK(
            self.scene,
            evened,
            self.corners,
            self.corners.copy(),
            winSize=(_WINDOW, _WINDOW),
            maxLevel=3,
        )
        followed = there.ravel() > 0
        height, width = self.scene.shape
        places = self.corners[followed, 0].astype(float) - [(width - 1) / 2, (height - 1) / 2]
        return agreed(places, (found - self.corners)[followed, 0].astype(float), min(height, width))


def _looked_at(
    pictures: list[UInt8[ndarray, "h w"]],
    shown: UInt8[ndarray, "h w"] | None,
    reduction: float,
    measured: list[UInt8[ndarray, "h w"]] | None = None,
    check: Callable[[], None] = lambda: None,
) -> Steadying:
    """The scene of pictures, and how far these, or others, are from it."""
    scene = median(pictures, check)
    height, width = scene.shape
    mask = None
    if shown is not None:
        shown = cv2.resize(shown, (width, height), interpolation=cv2.INTER_NEAREST)
        mask = cv2.erode(shown, np.ones((2 * _WINDOW + 1, 2 * _WINDOW + 1), dtype=np.uint8))
    corners = cv2.goodFeaturesToTrack(scene, CORNERS, 0.05, APART * min(height, width), mask=mask)
    if corners is None:
        corners = np.zeros((0, 1, 2))
    found = Steadying(scene, corners.astype(np.float32), reduction, 0.0)
    shifts = []
    for picture in pictures if measured is None else measured:
        check()
        moved = found._moved(picture)
        if moved is not None:
            shifts.append(moved[:2])
    if 2 * len(shifts) < len(pictures):  # what half of them do not show is no still scene
        return found
    square = float(np.median((np.array(shifts) ** 2).sum(axis=1)))
    shake = float(np.sqrt(square / _MEDIAN_OF_SQUARE)) / reduction
    return Steadying(scene, found.corners, reduction, shake)


def agreed(
    places: Float[ndarray, "N 2"], shifts: Float[ndarray, "N 2"], side: float
) -> Float[ndarray, " 3"] | None:
    """The shift and turn on which most corners agree: d and θ of s = d + θ J p.

    Args:
        places: p, from the middle of the picture.
        shifts: s.
        side: The shorter of the picture.

    Returns:
        d_x, d_y and θ; None where too few agree, or they are too far away.
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
        # the nearer half at least, until the turn is known
        near = left <= max(_AGREES, float(np.median(left)))
        rows = columns[near].reshape(-1, 3)
        moved = np.linalg.lstsq(rows, shifts[near].reshape(-1), rcond=None)[0]
    agree = np.linalg.norm(shifts - columns @ moved, axis=1) <= _AGREES
    if agree.sum() < max(LEAST_CORNERS, 0.3 * len(places)):
        return None
    return moved if np.abs(moved[:2]).max() <= LARGEST * side else None


def _evened(picture: UInt8[ndarray, "h w 3"], reduction: float) -> UInt8[ndarray, "h2 w2"]:
    """Grey levels of one mean and contrast everywhere, whatever the light does."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    if reduction < 1.0:
        grey = cv2.resize(grey, None, fx=reduction, fy=reduction, interpolation=cv2.INTER_AREA)
    level = grey.astype(np.float32)
    size = (2 * _SMOOTH + 1, 2 * _SMOOTH + 1)
    mean = cv2.blur(level, size)
    spread = np.sqrt(np.maximum(cv2.blur(level * level, size) - mean * mean, 0.0))
    evened = 128.0 + 42.0 * (level - mean) / (spread + _CONTRAST)
    return np.asarray(np.clip(evened, 0.0, 255.0), dtype=np.uint8)


def _back(
    picture: UInt8[ndarray, "h w *c"], moved: Float[ndarray, " 3"], reduction: float
) -> UInt8[ndarray, "h w *c"]:
    """What the still scene shows where the moved picture shows it: p → c + R (p - c) + d."""
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


class SteadyReader:
    """The pictures of another reader; those of cameras that shake are held still."""

    def __init__(
        self,
        sequence: Sequence,
        reader: Pictures,
        views: tuple[WorkingView | None, ...],
        least: float,
    ) -> None:
        """Nothing is looked at yet.

        Args:
            sequence: Whose pictures.
            reader: Of them.
            views: What each camera's picture is turned by.
            least: From how many pixels of shake on a camera is held still.
        """
        self._frames = sequence.frames
        self._reader = reader
        self._views = views
        self._least = least
        self._read: dict[tuple[int, int], Picture | None] = {}
        """What was looked at and is about to be asked for again: a background is learnt of it."""

    def shake(self, camera: int) -> float:
        """Standard deviation in pixels of a shake that is undone, else 0."""
        steadying = self._steadying(camera)
        return 0.0 if steadying is None else steadying.shake

    def picture(self, camera: int, step: int) -> Picture | None:
        steadying = self._steadying(camera)
        known = (camera, step) in self._read
        picture = self._read.pop((camera, step)) if known else self._reader.picture(camera, step)
        return _held(steadying, picture)

    def iterate(self, camera: int, first: int = 0) -> Iterator[Picture | None]:
        steadying = self._steadying(camera)
        for key in [key for key in self._read if key[0] == camera]:
            self._read.pop(key, None)
        for picture in self._reader.iterate(camera, first):
            yield _held(steadying, picture)

    def empty(self, camera: int) -> Picture | None:
        return _held(self._steadying(camera), self._reader.empty(camera))

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        return self._reader.once(("steady", self._least, name), make)

    def check(self) -> None:
        self._reader.check()

    def _steadying(self, camera: int) -> Steadying | None:
        """That of a camera that shakes."""

        def made() -> Steadying | None:
            view = self._views[camera]
            shown = None if view is None else view.shown
            return Steadying.learn(self._spread(camera), shown, self._least, self.check)

        found = self._reader.once(("steadying", camera, self._least), made)
        return None if found is None or found.shake < self._least else found

    def _spread(self, camera: int) -> Iterator[Picture]:
        for step in spread_steps(range(self._frames)):
            picture = self._read[camera, step] = self._reader.picture(camera, step)
            if picture is not None:
                yield picture


def _held(steadying: Steadying | None, picture: Picture | None) -> Picture | None:
    return picture if steadying is None or picture is None else steadying.still(picture)
