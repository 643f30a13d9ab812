"""Self-calibration of boxes: people's sizes, each camera's offset and noise, hand-marked boxes.

The boxes of stage 1 of a person are a little too high or too low, by the person's clothes, and
equally in every camera, so that the filter estimates another height of the person above the floor.
Only a box that was marked by hand shows where the centre is.

Some constants say what halving and doubling them changes in six scenes: two random crowds of ten
people, 200 steps of ``cmc1``, ``cmc2`` and ``av163-seq45-3p-1111-points``, and 60 steps of
``wildtrack-points-300``. Means are over the six.
"""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.geometry.boxes import Boxes
from tracker.geometry.camera import Camera
from tracker.kernels.kalman import Measurements
from tracker.kernels.measurement import ExpectedBoxes
from tracker.sequences.sequence import Sequence
from tracker.smoothing.noise import NoiseModel
from tracker.smoothing.paths import Paths

_BOX_SIGMA = 0.1
"""Standard deviation of an edge of one box, half heights; only its square times :data:`_ALIKE`
counts, so that the bounds there are the same as 0.05 to 0.2 here."""

_ALIKE = 20.0
"""Number of boxes of neighbouring steps and cameras that count as one, since their errors
correlate. From 5 to 80, recall, false positives and IDF1 change by less than 0.002 in the mean of
six random rooms and of four recordings, and the mean error of positions by at most 1 mm."""

SIZE_SIGMA = 0.1
"""Standard deviation of people's heights, relative to the target's. The mean heights of nations'
women and men are between 1.49 and 1.83 m (NCD Risk Factor Collaboration, eLife 5, 2016), which has
a deviation of 0.06 of their middle; the rest is for the target's height, which a user estimates.
Halved and doubled, it changes mean recall by at most 0.001, mean IDF1 by 0.005, and the mean error
of positions by less than 1 mm in every scene."""

OFFSET_SIGMA = 0.03
"""Standard deviation of the offset of a camera's boxes, half heights: 2.5 cm of a body of 1.7 m.
Halved and doubled, it changes mean recall by at most 0.0005, mean IDF1 by 0.002, and the mean error
of positions by at most 3 mm in every scene."""

SIZE_RIDGE = _ALIKE * (_BOX_SIGMA / SIZE_SIGMA) ** 2
"""Weight of the prior of a person's size, in boxes."""

OFFSET_RIDGE = _ALIKE * (_BOX_SIGMA / OFFSET_SIGMA) ** 2
"""Weight of the prior of a camera's offset, in boxes."""

NARROWEST, WIDEST = 0.15, 1.0
"""Bounds of the estimated noise, as factors of the standard deviation that stage 1 gives, for which
the filter's gates are made. Twice the upper one changes recall and IDF1 in no scene by more than
0.001, and positions by 3 mm; half of it is too low for the boxes of a crowd (IDF1 -0.05). The lower
one is reached by the boxes of ``wildtrack-points-300``, drawn by hand: doubled, it takes 0.007 of
their recall and adds 11 mm to their error; halved, it changes no figure by 0.001."""

ODD = 0.4
"""Residual of a box from which the person is not standing upright, half heights: less than that of
somebody who sits, whose crown is 0.6 half heights lower (1.2 m instead of 1.7 m). Doubled, it takes
0.005 of the recall in ``wildtrack-points-300`` and adds 5 mm to the error there; halved, it changes
recall in no scene, and positions by at most 2 mm."""

FEWEST = 50
"""Number of boxes of a camera below which its noise is not estimated."""

RIDGE = 1.0
"""Weight of the prior of a person's shift, in marked boxes: the shifts of people and the errors of
hand-drawn boxes both have a standard deviation of about 0.1 half heights."""

_AROUND = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_AROUND), np.sin(_AROUND), np.ones(16)])
_OUTLINE = np.concatenate([[[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], _CIRCLE, _CIRCLE * [1, 1, -1]])
"""Points of an upright cylinder (34, 3): both ends of its axis, and its upper and lower edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Sizes of n people, and offsets and noises of C cameras, for measurements of size m.

    The model of a box of person i in camera c is

        z = h_c(x) + ½ height(h_c(x)) (b_c + s_i u + d_i w) + g_c(x, ρ) + v,   v ~ N(0, f_c² R)

    with u = (0, −1, 1) and w = (0, 1, 1) for horizontal centre, top and bottom: a person taller
    than the target has a taller box without being nearer, and one whose boxes are shifted down is
    not lower. The upper and lower edge are those of a body of radius ρ, g pixels beyond its axis.
    """

    sizes: Float[ndarray, " n"]
    """s: height beyond the target's, as a share of it."""
    offsets: Float[ndarray, "C m"]
    """b: offset of each camera's boxes, half heights."""
    noises: Float[ndarray, " C"]
    """f: factor on the standard deviations of each camera's boxes."""
    shifts: Float[ndarray, " n"]
    """d: distance of the boxes below the person's centre, half heights."""
    noise: NoiseModel | None = None
    """The noise of boxes, where it is not that which stage 1 states."""
    radius: float = 0.0
    """ρ: radius of people's bodies, whose rims the boxes bound, metres; 0 for their axes."""
    level_sigma: float = 0.0
    """σ_ω: standard deviation of the level of the axis at which bodies are widest, half heights
    above its middle."""

    @staticmethod
    def none(people: int, cameras: int, size: int) -> Calibration:
        """The calibration that does not change the boxes.

        Args:
            people: n, the number of people.
            cameras: C, the number of cameras.
            size: m, the size of a measurement.
        """
        return Calibration(
            np.zeros(people), np.zeros((cameras, size)), np.ones(cameras), np.zeros(people)
        )

    def of_people(self, people: ndarray) -> Calibration:
        """Select some of the people, by index, in that order."""
        return replace(self, sizes=self.sizes[people], shifts=self.shifts[people])

    def measured(self, camera: int, measurements: Measurements) -> Measurements:
        """A camera's measurements with the estimated noise, or the stated one by its factor."""
        if self.noise is not None:
            values = measurements.values
            half_heights = np.maximum((values[:, 2] - values[:, 1]) / 2.0, 1.0)
            noises = self.noise.variances(half_heights)
            return measurements._replace(noises=noises[:, :, None] * np.eye(values.shape[1]))
        return measurements._replace(noises=self.noises[camera] ** 2 * measurements.noises)

    def shift(self, camera: int, people: ndarray, expected: ExpectedBoxes) -> Float[ndarray, "L m"]:
        """The correction that is added to the expected measurements of L boxes, pixels.

        It is 0 for an edge of a box that the image's edge clips.

        Args:
            camera: Index of the camera.
            people: Index of the person of each box.
            expected: The expected boxes.
        """
        half_height = (expected.boxes[:, 3] - expected.boxes[:, 1]) / 2.0
        size = self.offsets.shape[1]
        shares = self.offsets[camera] + self.sizes[people, None] * upright(size)
        shares += self.shifts[people, None] * lower(size)
        return np.asarray(half_height[:, None] * shares * free(expected))


def free(expected: ExpectedBoxes) -> Bool[ndarray, "L m"]:
    """Which components of L measurements depend on the state: not edges at the image's edge."""
    moves = expected.jacobians != 0.0
    return np.asarray(moves[:, :, 0] | moves[:, :, 1] | moves[:, :, 2])


def upright(size: int) -> Float[ndarray, " m"]:
    """Return the vector u (m,): the change of a measurement with the person's height."""
    return {
        2: np.zeros(2),
        3: np.array([0.0, -1.0, 1.0]),
        4: np.array([0.0, -1.0, 1.0, 0.0]),
    }[size]


def lower(size: int) -> Float[ndarray, " m"]:
    """Return the vector w (m,): the change of a measurement as the box is shifted down."""
    return {
        2: np.array([0.0, 1.0]),
        3: np.array([0.0, 1.0, 1.0]),
        4: np.array([0.0, 1.0, 1.0, 0.0]),
    }[size]


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """M boxes of people that were marked by hand."""

    steps: Int[ndarray, " M"]
    """Step of each box."""
    cameras: Int[ndarray, " M"]
    """Index of the camera of each box."""
    boxes: Float[ndarray, "M 4"]
    """Centre and half sizes, pixels."""

    @staticmethod
    def of(sequence: Sequence) -> Marks:
        """The templates of a recording."""
        names = [camera.name for camera in sequence.cameras]
        known = [one for one in sequence.templates if one.camera in names]
        return Marks(
            np.array([one.frame for one in known], dtype=np.int64),
            np.array([names.index(one.camera) for one in known], dtype=np.int64),
            Boxes.from_left_top(
                np.array([one.box for one in known], dtype=float).reshape(-1, 4)
            ).centred,
        )


def shifts(
    marks: Marks,
    cameras: Many[Camera],
    half_extents: Float[ndarray, " 3"],
    paths: Paths,
) -> Float[ndarray, " n"]:
    """Estimate d, the distance of stage 1's boxes below each path's centre, in half heights.

    A marked box belongs to the path with the nearest centre at its step. The centre of a path
    fitted to the boxes of stage 1 is shifted as these boxes are, so that

        d = Σ (y − y_m) / h / (M + 1)

    over the M marked boxes of the path, with the marked centre y_m, the centre y of the bounds of
    a cylinder of the target's size there, and half the height h of its axis: a box drawn by hand
    bounds the whole body, which seen from above reaches lower in the image than its axis.

    Args:
        marks: Boxes marked by hand.
        cameras: The cameras of the recording.
        half_extents: Half width, depth and height of the target, metres.
        paths: n paths fitted to the boxes of stage 1 without shifts.
    """
    steps, owners = paths.steps, paths.owners
    total, count = np.zeros(len(paths.labels)), np.zeros(len(paths.labels))
    for step, index, box in zip(marks.steps, marks.cameras, marks.boxes, strict=True):
        rows = np.flatnonzero(steps == step)
        own, half_axes = _bounds(cameras[index], paths.states[rows, :3], half_extents)
        off = (own.centres - box[:2]) / own.half_sizes
        taller = np.abs(box[3] / own.half_sizes[:, 1] - 1.0)
        # the box of a person who lies, bends or stretches is not centred on an upright target
        odd = np.abs(off).max(axis=1)
        standing = (odd < ODD) & (taller < ODD)
        # cameras that view people from above, or are rolled by a quarter, are not used either
        half_heights = half_axes[:, 1]
        standing &= (half_heights > half_axes[:, 0]) & (half_heights > own.half_sizes[:, 1] / 2.0)
        nearest = int(odd.argmin()) if len(rows) else -1
        if nearest >= 0 and standing[nearest]:
            lower = own.centres[nearest, 1] - box[1]
            total[owners[rows[nearest]]] += lower / half_heights[nearest]
            count[owners[rows[nearest]]] += 1.0
    return np.asarray(total / (count + RIDGE))


def _bounds(
    camera: Camera, places: Float[ndarray, "N 3"], half_extents: Float[ndarray, " 3"]
) -> tuple[Boxes, Float[ndarray, "N 2"]]:
    """The bounds of N upright cylinders, and half the extent of their axes along x and y, pixels.

    They are NaN where a cylinder is not wholly in front of the lens.
    """
    outline = _OUTLINE * [*np.full(2, half_extents[:2].mean()), half_extents[2]]
    pixels, _ = camera.project((places[:, None] + outline).reshape(-1, 3))
    pixels = pixels.reshape(len(places), len(outline), 2)
    around = pixels[:, 2:]
    half_axes = np.abs(pixels[:, 0] - pixels[:, 1]) / 2.0
    return Boxes.from_corners(around.min(axis=1), around.max(axis=1)), half_axes
