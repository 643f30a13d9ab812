"""What a camera's box should be, given where an upright target stands: the measurement model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from tracker.camera import Camera
from tracker.single_view.protocol import ViewResult

MeasurementKind = Literal["centre", "box", "box_and_width"]

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


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedBoxes:
    """What one camera should measure of J states."""

    values: Float[ndarray, "J m"]
    """Centre (x, y), or horizontal centre, top, bottom (and width), in pixels."""
    jacobians: Float[ndarray, "J m d"]
    """Derivative by the state, pixels a metre; zero for velocities."""
    boxes: Float[ndarray, "J 4"]
    """left, top, right, bottom in pixels, not clipped."""
    depths: Float[ndarray, " J"]
    """Distance from the lens, metres."""
    valid: Bool[ndarray, " J"]
    """Whether head and foot lie in front of the lens."""

    def take(self, indices: ndarray) -> ExpectedBoxes:
        """Some of them, in that order."""
        return ExpectedBoxes(
            self.values[indices],
            self.jacobians[indices],
            self.boxes[indices],
            self.depths[indices],
            self.valid[indices],
        )


class TargetModel:
    """An upright target of known size, seen through calibrated cameras.

    The box is predicted from the target's vertical axis: top and bottom are the
    projected ends of the axis, the horizontal centre lies between them, the
    width is that of a cylinder of the target's mean half width. On boxes of a
    real person detector this agrees with the truth to a few hundredths of the
    box's height, where the bounds of a projected cuboid are off by a sixth at
    the feet.
    """

    def __init__(self, half_extents: Float[ndarray, " 3"], kind: MeasurementKind) -> None:
        self.kind: MeasurementKind = kind
        self.size = SIZES[kind]
        self._half_height = np.array([0.0, 0.0, float(half_extents[2])])
        self._half_width = float(np.mean(half_extents[:2]))

    def expected(self, camera: Camera, states: Float[ndarray, "J d"]) -> ExpectedBoxes:
        """Predict the box of each state (position first, metres, world frame)."""
        count, dimension = states.shape
        centres = states[:, :3]
        points = np.concatenate([centres, centres - self._half_height, centres + self._half_height])
        pixels, slopes, valid = camera.project_with_jacobian(points)
        pixels = np.where(valid[:, None], pixels, 0.0).reshape(3, count, 2)
        slopes = slopes.reshape(3, count, 2, 3)
        whole = np.asarray(valid.reshape(3, count).all(axis=0))
        (middle, foot, head), (d_middle, d_foot, d_head) = pixels, slopes

        offsets = centres - camera.centre
        depths = np.sqrt(np.einsum("ji,ji->j", offsets, offsets))
        height = np.abs(foot[:, 1] - head[:, 1])
        width = height * (self._half_width / self._half_height[2])
        across = (head[:, 0] + foot[:, 0]) / 2.0
        boxes = np.stack(
            [across - width / 2.0, head[:, 1], across + width / 2.0, foot[:, 1]], axis=1
        )
        jacobians = np.zeros((count, self.size, dimension))
        if self.kind == "centre":
            values = middle
            jacobians[:, :, :3] = d_middle
        else:
            values = np.empty((count, self.size))
            values[:, 0], values[:, 1], values[:, 2] = across, head[:, 1], foot[:, 1]
            jacobians[:, 0, :3] = (d_head[:, 0] + d_foot[:, 0]) / 2.0
            jacobians[:, 1, :3] = d_head[:, 1]
            jacobians[:, 2, :3] = d_foot[:, 1]
            if self.kind == "box_and_width":
                values[:, 3] = width
                share = self._half_width / self._half_height[2]
                jacobians[:, 3, :3] = share * (d_foot[:, 1] - d_head[:, 1])
            # a box ends at the picture's edge, and what lies beyond tells nothing of depth
            bottom = float(camera.image_size[1] - 1)
            for row in (1, 2):
                outside = (values[:, row] < 0.0) | (values[:, row] > bottom)
                values[outside, row] = np.clip(values[outside, row], 0.0, bottom)
                jacobians[outside, row] = 0.0
        return ExpectedBoxes(values, jacobians, boxes, depths, whole)

    def measured(
        self, view: ViewResult, factor: float
    ) -> tuple[Float[ndarray, "M m"], Float[ndarray, "M m m"]]:
        """The boxes of a camera as measurements z, and their noise R in squared pixels.

        Args:
            view: Boxes and how far each is to be trusted.
            factor: On the standard deviations.
        """
        transform = _FROM_BOX[self.kind]
        variances = (factor * view.sigmas) ** 2
        noise = np.einsum("pa,na,qa->npq", transform, variances, transform)
        return view.boxes @ transform.T, noise
