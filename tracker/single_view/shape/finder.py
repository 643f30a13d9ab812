"""Detection of people in one camera by the shape of head and trunk, without colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import geometry_key
from tracker.single_view.pictures.foreground import learn_background
from tracker.single_view.shape.channels import Channels, ChannelState
from tracker.single_view.shape.trees import Trees
from tracker.single_view.shape.windows import Windows

PIXELS_PER_METRE = 48.0
"""Resolution to which images are reduced, at people in the middle of the room: that of the training
set. Images of lower resolution are not changed."""

SAME_PERSON = np.array([0.35, 0.5])
"""Distance across and down within which two places in an image are of one person, metres."""

_NEAR = 2.0
"""Log odds below the best of a person's windows at which others do not contribute to the place."""


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """N people that were detected in one image."""

    boxes: Float[ndarray, "N 4"]
    """Boxes of the target: centre and half sizes, pixels."""
    log_odds: Float[ndarray, " N"]
    """Log odds of a person in each box."""
    sizes: Float[ndarray, "N 2"]
    """Pixels per metre at each box, across and down."""
    unlikely: Float[ndarray, "U 4"]
    """Boxes with log odds below the threshold."""
    windows: Windows
    """The W windows that were not rejected."""
    odds: Float[ndarray, " W"]
    """Log odds of a person in each of these windows."""

    def support(self, boxes: Float[ndarray, "M 4"]) -> Float[ndarray, " M"]:
        """Log odds of a person in each of M boxes: those of the best window there, -inf for none.

        Args:
            boxes: Centre and half sizes of the target's boxes, pixels.
        """
        apart = np.abs(boxes[:, None, :2] - self.windows.boxes[None, :, :2])
        there = (apart < SAME_PERSON * self.windows.sizes).all(axis=2)
        return np.asarray(np.where(there, self.odds, -np.inf).max(axis=1, initial=-np.inf))


class ShapeFinder:
    """A sliding-window detector over the possible windows, with non-maximum suppression."""

    def __init__(self, sequence: Sequence, camera_index: int, reader: Pictures) -> None:
        """Learn the background of one camera.

        Args:
            sequence: The sequence, with upright cameras.
            camera_index: Index of the camera.
            reader: Reader of the images.
        """
        camera = sequence.cameras[camera_index]
        background = learn_background(sequence, camera_index, reader)
        self._windows = Windows.of(camera, sequence.room, sequence.target_half_extents)
        self._channels: Channels | None = None
        if background is None or not len(self._windows.edges):
            return
        size = float(np.median(self._windows.sizes))
        factor = min(1.0, PIXELS_PER_METRE / size)
        self._channels = Channels(background, factor, size * factor, sequence.step_time)
        across, down = self._channels.factors
        self._edges = (self._windows.edges + 0.5) * [across, down, across, down] - 0.5
        self._trees = Trees.read()

    @staticmethod
    def of(sequence: Sequence, camera_index: int, reader: Pictures) -> ShapeFinder:
        """The detector of a camera, created once, since it has no state.

        Args:
            sequence: The sequence, with upright cameras.
            camera_index: Index of the camera.
            reader: Reader of the images.
        """
        return reader.once(
            (
                "shape finder",
                camera_index,
                sequence.step_time,
                geometry_key(sequence, camera_index),
            ),
            lambda: ShapeFinder(sequence, camera_index, reader),
        )

    def start(self) -> ChannelState | None:
        """The state before the first image."""
        return None if self._channels is None else self._channels.initial()

    def watch(
        self, state: ChannelState | None, picture: UInt8[ndarray, "h w 3"]
    ) -> ChannelState | None:
        """Update the state by an image without detecting people in it.

        Args:
            state: The state after the image before.
            picture: The image, BGR.
        """
        if self._channels is None or state is None:
            return state
        return self._channels.watch(state, picture)

    def find(
        self,
        state: ChannelState | None,
        picture: UInt8[ndarray, "h w 3"],
        least: float,
        overlap: float,
    ) -> tuple[ChannelState | None, Shapes]:
        """Detect the people of one image.

        Args:
            state: The state after the image before.
            picture: The image, BGR.
            least: Log odds from which a person is detected.
            overlap: Intersection over union above which windows are of one person, 0 … 1.
        """
        if self._channels is None or state is None:
            none = np.zeros((0, 4))
            nowhere = Windows(none, none)
            return state, Shapes(none, np.zeros(0), none[:, :2], none, nowhere, np.zeros(0))
        state, sums = self._channels.step(state, picture)
        scores = self._trees.scores(sums, self._edges).astype(float)
        ended = np.flatnonzero(np.isfinite(scores))
        windows, scores = self._windows.take(ended), scores[ended]
        owners, best = strongest(windows.edges, scores, overlap)
        likely = best[scores[best] >= least]
        boxes = windows.boxes[likely].copy()
        for n, i in enumerate(likely):
            own = np.flatnonzero((owners == i) & (scores > scores[i] - _NEAR))
            weights = np.exp(scores[own] - scores[i])
            boxes[n] = weights @ windows.boxes[own] / weights.sum()
        unlikely = windows.boxes[best[scores[best] < least]]
        return state, Shapes(
            boxes, scores[likely], windows.sizes[likely], unlikely, windows, scores
        )


def strongest(
    edges: Float[ndarray, "N 4"], scores: Float[ndarray, " N"], overlap: float
) -> tuple[Int[ndarray, " N"], Int[ndarray, " K"]]:
    """Select windows by greedy non-maximum suppression, the best first.

    Unlike OpenCV's ``NMSBoxes`` it also says which window each of the suppressed ones belongs to.

    Args:
        edges: Left, top, right and bottom of N windows, pixels.
        scores: Score of each window.
        overlap: Intersection over union from which the weaker window is suppressed, 0 … 1.

    Returns:
        Index of the selected window that each belongs to, and the indices of the selected ones.
    """
    areas = (edges[:, 2] - edges[:, 0]) * (edges[:, 3] - edges[:, 1])
    owners = np.full(len(edges), -1)
    best: list[int] = []
    for i in np.argsort(-scores, kind="stable").tolist():
        if owners[i] >= 0:
            continue
        free = np.flatnonzero(owners < 0)
        low = np.maximum(edges[free, :2], edges[i, :2])
        high = np.minimum(edges[free, 2:], edges[i, 2:])
        shared = np.maximum(high - low, 0.0).prod(axis=1)
        owners[free[shared >= overlap * (areas[free] + areas[i] - shared)]] = i
        owners[i] = i
        best.append(i)
    return owners, np.array(best, dtype=np.int64)
