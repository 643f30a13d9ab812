"""The measurement model: the box that a camera gives of an upright target at a position."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.camera import Camera
from tracker.kernels import boxes, measurement
from tracker.kernels.kalman import Measurements
from tracker.kernels.measurement import ExpectedBoxes, Target
from tracker.parameters.groups.fusion import FusionParams

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
