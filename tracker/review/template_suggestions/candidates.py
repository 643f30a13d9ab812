"""Moments at which a track shows somebody well: sure of the place, apart from everybody, whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories
from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.runs.run import Run

STEPS = 200
"""Steps that are looked at, spread over the recording: people look alike from one to the next."""

AGREE = 2
"""Cameras whose boxes must be the person's at the moment."""

LEAST_EXISTENCE = 0.95

LEAST_LIFE = 1.0
"""Seconds for which a track must live: ghosts are short."""

LARGEST_COVER = 0.05
"""Share of a box that another person's may cover."""

SMALLEST = 12.0
"""Pixels that a box must be wide and high: fewer have no colours to speak of."""

EACH = 3
"""Moments of a track that are looked at in each camera."""


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """M moments at which somebody is seen well in a camera."""

    tracks: Int[ndarray, " M"]
    """Ids."""
    cameras: Int[ndarray, " M"]
    """Indices."""
    steps: Int[ndarray, " M"]
    boxes: Float[ndarray, "M 4"]
    """left, top, width, height, pixels: as somebody would draw a box around an upright target."""
    own: Bool[ndarray, " M"]
    """Whether the camera itself has a box of the person."""
    agreeing: Bool[ndarray, "M C"]
    """Whose boxes are the person's."""
    deviations: Float[ndarray, " M"]
    """Standard deviation of the place on the floor, metres."""

    @staticmethod
    def none(cameras: int) -> Moments:
        """Of nobody."""
        whole, real = np.zeros(0, dtype=np.int64), np.zeros(0)
        nobody = np.zeros((0, cameras), dtype=bool)
        return Moments(whole, whole, whole, np.zeros((0, 4)), np.zeros(0, dtype=bool), nobody, real)

    def take(self, rows: ndarray) -> Moments:
        """Some of them, by mask or index."""
        return Moments(*(getattr(self, name)[rows] for name in type(self).__slots__))

    def __len__(self) -> int:
        return len(self.tracks)


def drawn_boxes(
    camera: Camera, positions: Float[ndarray, "N 3"], half_extents: Float[ndarray, " 3"]
) -> Float[ndarray, "N 4"]:
    """left, top, width, height of boxes as somebody draws them around upright targets.

    A person is more an ellipse than a rectangle: with the half axes a across and b along it, in
    pixels, the bounds of one that is drawn slanted reach

        W² = a_x² + b_x²,  H² = a_y² + b_y²

    Args:
        camera: The calibrated camera.
        positions: World metres.
        half_extents: Half width, depth and height of a target, metres.

    Returns:
        Pixels, not cut off at the picture's edge; NaN behind the camera.
    """
    right = camera.rotation[0] * [1.0, 1.0, 0.0]
    norm = float(np.linalg.norm(right))
    if norm < 0.5:  # turned on its side: the room's floor runs down in the picture
        right = camera.rotation[1] * [1.0, 1.0, 0.0]
        norm = float(np.linalg.norm(right))
    across = right / max(norm, 1e-9) * half_extents[:2].mean()
    up = np.array([0.0, 0.0, half_extents[2]])
    ends = np.stack([positions - across, positions + across, positions - up, positions + up])
    pixels, valid = camera.project(ends.reshape(-1, 3))
    left, end, low, high = pixels.reshape(4, -1, 2)
    reach = np.hypot(end - left, high - low) / 2.0
    boxes = Boxes(np.concatenate([(low + high) / 2.0, reach], axis=1)).left_top
    boxes[~valid.reshape(4, -1).all(axis=0)] = np.nan
    return boxes


def moments(run: Run) -> Moments:
    """The best moments of every track in every camera, the best of each first.

    A moment counts where the track lives long enough and surely is, its place is known to half a
    target's width, boxes of :data:`AGREE` cameras are the person's, and the upright box lies whole
    in the picture with nobody else's over it. Those in which the camera has a box of its own come
    first, then those that more cameras agree about, then the larger ones.

    Args:
        run: With all its steps.
    """
    sequence, tracks = run.sequence, _looked_at(run)
    extents = sequence.target_half_extents
    deviations = tracks.sigmas[:, :2].max(axis=1, initial=0.0)
    sure = (tracks.existences >= LEAST_EXISTENCE) & (deviations <= extents[:2].mean())
    sure &= tracks.seen.sum(axis=1) >= AGREE
    sure &= np.isin(tracks.ids, _long_lived(run))
    found = []
    for index, view in enumerate(sequence.views):
        if not view.has_pictures:
            continue
        boxes = drawn_boxes(view.camera, tracks.positions, extents)
        rows = np.flatnonzero(sure & _whole(view.camera, boxes) & _apart(tracks.frames, boxes))
        found.append(
            Moments(
                tracks.ids[rows], np.full(len(rows), index), tracks.frames[rows], boxes[rows],
                tracks.seen[rows, index], tracks.seen[rows], deviations[rows],
            )
        )  # fmt: skip
    if not found:
        return Moments.none(len(sequence.views))
    together = [np.concatenate([getattr(one, name) for one in found]) for name in Moments.__slots__]
    return _best(Moments(*together), sequence.fps)


def _looked_at(run: Run) -> Trajectories:
    tracks = run.tracks
    stride = -(-run.done // STEPS)
    return tracks.take((tracks.frames % max(stride, 1) == 0) & (tracks.frames < run.done))


def _long_lived(run: Run) -> Int[ndarray, " n"]:
    ids, counts = np.unique(run.tracks.ids, return_counts=True)
    return np.asarray(ids[counts >= min(LEAST_LIFE * run.sequence.fps, run.done)])


def _whole(camera: Camera, boxes: Float[ndarray, "N 4"]) -> Bool[ndarray, " N"]:
    with np.errstate(invalid="ignore"):
        inside = (boxes[:, :2] >= -0.5).all(axis=1)
        inside &= (boxes[:, :2] + boxes[:, 2:] <= np.array(camera.image_size) - 0.5).all(axis=1)
        return np.asarray(inside & (boxes[:, 2:] >= SMALLEST).all(axis=1))


def _apart(frames: Int[ndarray, " N"], boxes: Float[ndarray, "N 4"]) -> Bool[ndarray, " N"]:
    """Whether no other box of the same step covers much of each."""
    apart = np.ones(len(frames), dtype=bool)
    for rows in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames)) + 1):
        own = boxes[rows]
        low = np.maximum(own[:, None, :2], own[None, :, :2])
        high = np.minimum((own[:, :2] + own[:, 2:])[:, None], (own[:, :2] + own[:, 2:])[None])
        shared = np.maximum(high - low, 0.0).prod(axis=2) / own[:, None, 2:].prod(axis=2)
        np.fill_diagonal(shared, 0.0)
        # who is behind the camera covers nothing
        apart[rows] = (np.nan_to_num(shared) <= LARGEST_COVER).all(axis=1)
    return apart


def _best(found: Moments, fps: float) -> Moments:
    """At most :data:`EACH` of every track and camera, a second or more from each other."""
    order = np.lexsort(
        (-found.boxes[:, 3], -found.agreeing.sum(axis=1), ~found.own, found.cameras, found.tracks)
    )
    taken: list[int] = []
    already: dict[tuple[int, int], list[int]] = {}
    for row in order.tolist():
        own = already.setdefault((int(found.tracks[row]), int(found.cameras[row])), [])
        step = int(found.steps[row])
        if len(own) < EACH and all(abs(step - other) >= fps for other in own):
            own.append(step)
            taken.append(row)
    return found.take(np.array(taken, dtype=np.int64))
