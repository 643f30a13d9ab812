"""What a camera's box should be, given where an upright target stands: the measurement model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.camera import NEAREST_DEPTH, Camera
from tracker.kernels import measurement
from tracker.kernels.kalman import Alternative
from tracker.single_view.protocol import ViewResult

MeasurementKind = Literal["centre", "box", "box_and_width"]
UpdateKind = Literal["extended", "unscented"]

SIZES: dict[MeasurementKind, int] = {"centre": 2, "box": 3, "box_and_width": 4}
"""How many numbers of a box each kind of measurement uses."""

# from (centre_x, centre_y, half_width, half_height) to what each kind measures
_FROM_BOX: dict[MeasurementKind, Float[ndarray, "m 4"]] = {
    "centre": np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]]),
    "box": np.array([[1.0, 0, 0, 0], [0, 1.0, 0, -1.0], [0, 1.0, 0, 1.0]]),
    "box_and_width": np.array(
        [[1.0, 0, 0, 0], [0, 1.0, 0, -1.0], [0, 1.0, 0, 1.0], [0, 0, 2.0, 0]]
    ),
}

# a person who lies or bends, seen in perspective and from any side, against one who stands: in
# half heights of the standing one, what his box should be and how far it may be off
_LOW_HALF_HEIGHT, _LOW_HALF_WIDTH = 0.5, 0.6
_LOW_SIGMAS = np.array([0.15, 0.15, 0.5, 0.25])  # centre across and down, half width, half height
_DROP = 0.3  # how far his middle moves from one camera's box to the next

_NO_COVARIANCES = np.zeros((0, 3, 3))


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedBoxes:
    """What one camera should measure of J states."""

    values: Float[ndarray, "J m"]
    """Centre (x, y), or horizontal centre, top, bottom (and width), in pixels."""
    jacobians: Float[ndarray, "J m d"]
    """Derivative by the state, pixels a metre; zero for velocities."""
    spreads: Float[ndarray, "K m m"]
    """What the bend of the projection adds to the noise, squared pixels: one each (K = J),
    or nothing (K = 0)."""
    boxes: Float[ndarray, "J 4"]
    """left, top, right, bottom in pixels, not clipped."""
    depths: Float[ndarray, " J"]
    """Distance from the lens, metres."""
    valid: Bool[ndarray, " J"]
    """Whether middle, head and foot lie in front of the lens."""
    other: Alternative | None = None
    """The box of the same person lying or bent, where that is asked for."""


class TargetModel:
    """An upright target of known size, seen through calibrated cameras.

    The box is predicted from the target's vertical axis: top and bottom are the
    projected ends of the axis, the horizontal centre lies between them, the
    width is that of a cylinder of the target's mean half width. On boxes of a
    real person detector this agrees with the truth to a few hundredths of the
    box's height, where the bounds of a projected cuboid are off by a sixth at
    the feet.

    The projection bends. ``extended`` takes it as straight at the mean. With
    ``unscented`` the values are the mean over the state's uncertainty, the
    Jacobian is that of the best straight line through it (statistical linear
    regression) and ``spreads`` holds what is left. Against a particle reference, as
    medians: of a person who is followed (a place known to 0.08 m) both updates are
    within 3 mm, at any distance. Of a newcomer (known to 0.4 m) the unscented one is
    nearer: its mean is off by 5 to 6 cm at 1.2 m from the camera, as much as or a little
    less than the extended one's, with two thirds of the divergence; by 2 cm against
    4 cm at 3 m; by 2 cm against 3 cm at 5 m. On recordings nothing of that is left, for
    a newcomer is one for a step only, and it takes about a third more time: so the
    extended update is the default.

    A person may also lie, crouch or bend, or half of him is behind a table. Then the
    box is of another shape: with ``low_share`` a box is one of two kinds, and
    ``other`` holds the second, low and broad and known loosely.
    """

    def __init__(
        self,
        half_extents: Float[ndarray, " 3"],
        kind: MeasurementKind,
        update: UpdateKind = "extended",
        low_share: float = 0.0,
    ) -> None:
        """Prepare for targets of one size.

        Args:
            half_extents: Half width, depth and height, metres.
            kind: What is used of a box.
            update: How the bend of the projection is met.
            low_share: Share of the boxes that show a person low: lying, crouching, bent.
        """
        self.kind: MeasurementKind = kind
        self.size = SIZES[kind]
        self.unscented = update == "unscented"
        # a centre alone looks the same in any posture
        self.low_share = low_share if kind != "centre" else 0.0
        self.half_height = float(half_extents[2])
        self.half_width = float(np.mean(half_extents[:2]))
        transform = _FROM_BOX[kind]
        # R = T diag(σ²) Tᵀ is linear in σ²
        products = np.einsum("pa,qa->apq", transform, transform).reshape(4, self.size**2).copy()
        self.transforms = transform, products
        """T (m, 4) and (4, m²), as :func:`tracker.kernels.measurement.measured_boxes` has them."""
        low_noise = (_LOW_SIGMAS**2 @ products).reshape(self.size, self.size)
        self.numbers = (
            self.half_height,
            self.half_width,
            _LOW_HALF_HEIGHT * self.half_height,
            _LOW_HALF_WIDTH * self.half_height,
            low_noise if self.low_share else np.zeros((0, 0)),
            self.size,
        )
        """The target as :func:`tracker.kernels.measurement.expected_measurements` knows it."""

    def expected(
        self,
        camera: Camera,
        states: Float[ndarray, "J d"],
        covariances: Float[ndarray, "J d d"] | None = None,
    ) -> ExpectedBoxes:
        """Predict the box of each state.

        Args:
            camera: The calibrated camera.
            states: Position first, metres, world frame.
            covariances: Their uncertainty, for the unscented kind; none is taken as 0.
        """
        bends = self.unscented and covariances is not None
        (
            values, jacobians, spreads, boxes, depths, valid,
            low_values, low_jacobians, low_spreads,
        ) = measurement.expected_measurements(
            np.ascontiguousarray(states, dtype=float),
            np.ascontiguousarray(covariances) if bends else _NO_COVARIANCES,
            bends,
            *self.numbers,
            camera.image_size,
            *camera.numbers,
            NEAREST_DEPTH,
            camera.largest_radius,
        )  # fmt: skip
        low = None
        if self.low_share:
            drift = self.drift(states.shape[1])
            low = Alternative(low_values, low_jacobians, low_spreads, drift, self.low_share)
        return ExpectedBoxes(values, jacobians, spreads, boxes, depths, valid, low)

    def drift(self, dimension: int) -> Float[ndarray, "d d"]:
        """How far a state may have moved with a change of posture from one box to the next: P."""
        drift = np.zeros((dimension, dimension))
        drift[2, 2] = (_DROP * self.half_height) ** 2
        return drift

    def measured(
        self, view: ViewResult, factor: float
    ) -> tuple[Float[ndarray, "M m"], Float[ndarray, "M m m"]]:
        """The boxes of a camera as measurements z, and their noise R in squared pixels.

        Args:
            view: Boxes and how far each is to be trusted.
            factor: On the standard deviations.
        """
        return self.measured_all(view.boxes, view.sigmas, factor)

    def measured_all(
        self, boxes: Float[ndarray, "M 4"], sigmas: Float[ndarray, "M 4"], factor: float
    ) -> tuple[Float[ndarray, "M m"], Float[ndarray, "M m m"]]:
        """As :meth:`measured`, of boxes and their standard deviations, pixels."""
        measured: tuple[ndarray, ndarray] = measurement.measured_boxes(
            np.ascontiguousarray(boxes, dtype=float),
            np.ascontiguousarray((factor * sigmas) ** 2, dtype=float),
            *self.transforms,
        )
        return measured
