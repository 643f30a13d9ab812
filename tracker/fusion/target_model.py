"""The measurement model: the box that a camera gives of an upright target, and when it gives none.

The detection probability depends on the edge of the image and on occlusion. Heights at which a
target can be are a prior of tracks that boxes leave uncertain.

[SS10] D. Simon, D. L. Simon, "Constrained Kalman filtering via density function truncation for
turbofan engine health estimation", International Journal of Systems Science 41(2), 2010.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.camera import Camera
from tracker.kernels import boxes, measurement
from tracker.kernels import boxes as box_kernels
from tracker.kernels.boxes import Hidden, Occlusion
from tracker.kernels.kalman import Measurements
from tracker.kernels.measurement import ExpectedBoxes, Target
from tracker.parameters.groups.fusion import FusionParams
from tracker.sequences.sequence import Room

MeasurementKind = Literal["centre", "box", "box_and_width"]
UpdateKind = Literal["extended", "unscented"]

SIZES: dict[MeasurementKind, int] = {"centre": 2, "box": 3, "box_and_width": 4}
"""Dimension m of each kind of measurement."""

# from (centre_x, centre_y, half_width, half_height) to what each kind measures
_FROM_BOX: dict[MeasurementKind, Float[ndarray, "m 4"]] = {
    "centre": np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]]),
    "box": np.array([[1.0, 0, 0, 0], [0, 1.0, 0, -1.0], [0, 1.0, 0, 1.0]]),
    "box_and_width": np.array(
        [[1.0, 0, 0, 0], [0, 1.0, 0, -1.0], [0, 1.0, 0, 1.0], [0, 0, 2.0, 0]]
    ),
}

_DEFAULTS = FusionParams()
_NO_COVARIANCES = np.zeros((0, 3, 3))


class TargetModel:
    """An upright target of known size, seen through calibrated cameras.

    The box is predicted from the target's vertical axis: top and bottom are the
    projected ends of the axis, the horizontal centre lies between them, the
    width is that of a cylinder of the target's mean half width. The boxes of person
    detectors have these bounds; those of a projected cuboid reach further below the feet.
    The camera may have any roll: in an image turned by a quarter the box is as
    high as the target is wide.

    The projection is nonlinear. ``extended`` linearises it at the mean (extended Kalman
    filter). With ``unscented`` the values are the mean over the state's uncertainty, the
    Jacobian is that of the best linear fit through it (statistical linear regression:
    Lefebvre, Bruyninckx, De Schutter, IEEE Transactions on Automatic Control 47(8), 2002)
    and ``spreads`` is the covariance of the residual. The tests compare both with a particle
    reference: for an established track (σ = 0.08 m) they agree within 5 mm; for a new one
    (σ = 0.4 m) the unscented one is nearer. A track is new for a few steps only, and the
    unscented update takes more time: so the extended one is the default.

    A person may also lie, crouch or bend, or be half occluded by furniture, and the
    box then has another shape: with ``posture_share`` a box is of one of two kinds, and
    ``expected`` includes the second, low and broad and with large noise.
    """

    def __init__(
        self,
        half_extents: Float[ndarray, " 3"],
        kind: MeasurementKind,
        update: UpdateKind = "extended",
        posture_share: float = 0.0,
        parameters: FusionParams = _DEFAULTS,
    ) -> None:
        """Prepare the model for targets of one size.

        Args:
            half_extents: Half width, depth and height of a target, metres.
            kind: The quantities of a box that are measured.
            update: Approximation of the nonlinear projection, extended or unscented.
            posture_share: Share of the boxes that show a person in another posture than upright:
                lying, crouching, bent.
            parameters: Size and noise of the box of such a person.
        """
        self.kind: MeasurementKind = kind
        self.size = SIZES[kind]
        self.unscented = update == "unscented"
        # a centre alone looks the same in any posture
        self.posture_share = posture_share if kind != "centre" else 0.0
        self.half_height = float(half_extents[2])
        self.half_width = float(np.mean(half_extents[:2]))
        transform = _FROM_BOX[kind]
        # R = T diag(σ²) Tᵀ is linear in σ²
        products = np.einsum("pa,qa->apq", transform, transform).reshape(4, self.size**2).copy()
        self.transforms = transform, products
        """T (m, 4) and (4, m²), as :func:`tracker.kernels.measurement.measured_boxes` takes."""
        p = parameters
        sigmas = np.array(
            [
                p.posture_centre_sigma,
                p.posture_centre_sigma,
                p.posture_width_sigma,
                p.posture_height_sigma,
            ]
        )
        noise = (sigmas**2 @ products).reshape(self.size, self.size)
        self._posture_noise = noise if self.posture_share else np.zeros((0, 0))
        self._parameters = p
        self._targets: dict[int, Target] = {}

    def target(self, dimension: int) -> Target:
        """The target in the form that the kernels take, for states of size ``dimension``."""
        if dimension not in self._targets:
            p = self._parameters
            drift = np.zeros((dimension, dimension))
            drift[2, 2] = (p.posture_drop * self.half_height) ** 2
            self._targets[dimension] = Target(
                self.half_height,
                self.half_width,
                self.size,
                self.unscented,
                p.posture_height * self.half_height,
                p.posture_width * self.half_height,
                self._posture_noise,
                drift,
                self.posture_share,
            )
        return self._targets[dimension]

    def expected(
        self,
        camera: Camera,
        states: Float[ndarray, "J d"],
        covariances: Float[ndarray, "J d d"] | None = None,
    ) -> ExpectedBoxes:
        """Predict the box of each state.

        Args:
            camera: The calibrated camera.
            states: J states, position first, metres, world frame.
            covariances: Covariance of each state, for the unscented kind; None stands for 0.
        """
        target = self.target(states.shape[1])
        if covariances is None:
            target, covariances = target._replace(unscented=False), _NO_COVARIANCES
        found: ExpectedBoxes = measurement.expected_measurements(
            np.ascontiguousarray(states, dtype=float),
            np.ascontiguousarray(covariances),
            target,
            camera.calibration,
        )
        return found

    def body_shifts(
        self, camera: Camera, states: Float[ndarray, "J d"], radius: float
    ) -> Float[ndarray, "J 4"]:
        """Compute how far the bounds of a body are from those of its axis, pixels.

        Args:
            camera: The calibrated camera.
            states: J states, position first, metres, world frame.
            radius: Radius of the body, metres.

        Returns:
            As :func:`tracker.kernels.boxes.body_shifts`.
        """
        found = boxes.body_shifts(
            np.ascontiguousarray(states, dtype=float), self.half_height, radius, camera.calibration
        )
        return np.asarray(found)

    def measured(
        self, boxes: Float[ndarray, "M 4"], sigmas: Float[ndarray, "M 4"], factor: float
    ) -> Measurements:
        """Convert M boxes to measurements z with noise R in squared pixels.

        Args:
            boxes: Centre and half sizes of each box, pixels.
            sigmas: Standard deviations of the same, pixels.
            factor: Factor on the standard deviations.
        """
        return measurement.measured_boxes(
            np.ascontiguousarray(boxes, dtype=float),
            np.ascontiguousarray((factor * sigmas) ** 2, dtype=float),
            *self.transforms,
        )


_HEIGHT = 2
"""Index of the height in the state."""

_NEAR = 1.0
"""Distance from a bound, in standard deviations, from which on a track is truncated. A Gaussian is
not zero beyond the bound after a truncation; truncated at every step, a track well inside would
move away from the bound although nothing new is known of it."""


@dataclass(frozen=True, slots=True)
class HeightBounds:
    """Bounds of a target's centre: at the lower one it lies or crouches on the floor.

    One camera measures a target's distance by the size of its box alone, and boxes that are all
    a little too small put it below the floor. With two cameras the rays meet, and the bounds have
    no effect.
    """

    low: float
    """Height of a centre on the floor, world metres."""
    high: float
    """Height of a centre as far below the ceiling as ``low`` is above the floor, world metres."""
    outside: float
    """Density beyond the bounds relative to that between them, 0 … 1."""

    @staticmethod
    def of(room: Room, half_height: float, outside: float) -> HeightBounds:
        """The bounds in a room.

        Args:
            room: The room, from floor to ceiling.
            half_height: Half height of a target on the floor, metres.
            outside: Density beyond the bounds relative to that between them, 0 … 1.
        """
        low = float(room.minimum[_HEIGHT]) + half_height
        return HeightBounds(low, max(low, float(room.maximum[_HEIGHT]) - half_height), outside)

    def truncate(self, tracks: GaussianMixture) -> GaussianMixture:
        """Truncate the tracks whose height is near or beyond a bound ([SS10]_).

        With a = (low − z) / σ and b = (high − z) / σ, the density φ of the standard normal, its
        distribution Φ, and the weight ε outside, the moments of (1 − ε) φ on [a, b] and ε φ
        everywhere are

            m_0 = (1 − ε) (Φ(b) − Φ(a)) + ε
            m_1 = (1 − ε) (φ(a) − φ(b))
            m_2 = (1 − ε) (Φ(b) − Φ(a) + a φ(a) − b φ(b)) + ε

        The rest of the state follows by regression on the height: with the gain g = P_z / σ the
        mean moves by g m_1/m_0, and P becomes P − g gᵀ (1 − m_2/m_0 + (m_1/m_0)²).

        Args:
            tracks: J tracks, positions in world metres.

        Returns:
            The same tracks; those well between the bounds are not changed.
        """
        heights = tracks.means[:, _HEIGHT]
        sigmas = np.sqrt(tracks.covariances[:, _HEIGHT, _HEIGHT])
        margins = np.minimum(heights - self.low, self.high - heights)
        rows = np.flatnonzero((margins < _NEAR * sigmas) & (sigmas > 0.0))
        if not len(rows):
            return tracks
        z, sigma = heights[rows], sigmas[rows]
        moves, shares = self._moments((self.low - z) / sigma, (self.high - z) / sigma)
        gains = tracks.covariances[rows][:, :, _HEIGHT] / sigma[:, None]
        means, covariances = tracks.means.copy(), tracks.covariances.copy()
        means[rows] += gains * moves[:, None]
        lost = gains[:, :, None] * gains[:, None, :]
        covariances[rows] -= lost * (1.0 - shares)[:, None, None]
        return replace(tracks, means=means, covariances=covariances)

    def _moments(
        self, a: Float[ndarray, " K"], b: Float[ndarray, " K"]
    ) -> tuple[Float[ndarray, " K"], Float[ndarray, " K"]]:
        """Mean and variance of the weighted standard normal, bounds in standard deviations."""
        from scipy.special import ndtr  # a server starts without it

        rest = 1.0 - self.outside
        at_a, at_b = (np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi) for x in (a, b))
        between = ndtr(b) - ndtr(a)
        weight = rest * between + self.outside
        # with no density outside, one that has none between either stays as it is
        there = weight > _LEAST
        weight = np.where(there, weight, 1.0)
        mean = rest * (at_a - at_b) / weight
        second = (rest * (between + a * at_a - b * at_b) + self.outside) / weight
        variance = np.maximum(second - mean**2, _LEAST)
        return np.where(there, mean, 0.0), np.where(there, variance, 1.0)


_LEAST = 1e-6
"""Probability, and variance relative to σ², below which rounding would decide."""


REPORTING_SHARE = 0.2
"""Share of a target's box that must be covered for its occluder to be reported. It has no effect
on the tracks."""


def inside_probability(
    camera: Camera,
    expected: ExpectedBoxes,
    covariances: Float[ndarray, "J d d"],
    *,
    soft: bool = True,
) -> Float[ndarray, " J"]:
    """Compute the probability that the centre of each target lies inside the image.

    The predicted position is taken as Gaussian in the image, so the value falls
    smoothly towards the edge, over the width of its own uncertainty and one pixel more;
    it is 0 where head or foot is behind the lens.

    Args:
        camera: The camera, whose image size is used.
        expected: The predicted boxes of J targets in that camera.
        covariances: Covariance of each target's state, metres and seconds.
        soft: False for the published edge: 1 inside, 0 outside.
    """
    inside: ndarray = box_kernels.inside_probability(
        expected.boxes,
        expected.jacobians,
        np.ascontiguousarray(covariances),
        expected.valid,
        camera.calibration.image_size,
        soft,
    )
    return inside


def visibility(
    detection_probabilities: Float[ndarray, " J"],
    expected: ExpectedBoxes,
    mixture: GaussianMixture,
    *,
    occluders: Int[ndarray, " L"],
    weights: Float[ndarray, " L"],
    strength: float,
    near: float,
) -> Hidden:
    """Lower each p_D where other targets stand in front.

        p_j ← p_j Π_l (1 − ρ w_l a(j, l))
        a(j, l) = [l is nearer to the lens than j] · area(box_j ∩ box_l) / area(box_j)

    where l runs over the occluders with another label than j. It is the probability that no
    occluder hides j, if occluders l exist independently with probability w_l.

    Args:
        detection_probabilities: p_j without occlusion, of J components.
        expected: The predicted boxes of the components in this camera.
        mixture: J components, with their labels.
        occluders: Indices of the components that may occlude others: confirmed ones, one a label.
        weights: Existence of each occluder; values above 1 count as 1.
        strength: ρ, 0 for no occlusion, 1 where a covered target is never detected.
        near: Distance within which an occluder may be a duplicate of the target, metres; a
            duplicate does not occlude.
    """
    if strength == 0.0 or not len(occluders):
        unoccluded = np.full(len(detection_probabilities), -1, dtype=np.int64)
        return Hidden(detection_probabilities, unoccluded)
    found: Hidden = box_kernels.hide(
        detection_probabilities,
        expected.boxes,
        expected.depths,
        mixture.means,
        mixture.labels,
        occluders,
        weights,
        Occlusion(near, strength, REPORTING_SHARE),
    )
    return found
