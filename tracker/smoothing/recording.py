"""All boxes of a recording as measurements, camera by camera."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.target_model import TargetModel
from tracker.kernels.gating import Measurements
from tracker.single_view.protocol import ViewResult


@dataclass(frozen=True, slots=True, eq=False)
class CameraBoxes:
    """The B boxes of one camera over T steps, step after step."""

    starts: Int[ndarray, " T1"]
    """Index of the first box of each step, and B at the end."""
    blind: Bool[ndarray, " T"]
    """Whether the camera had no frame at each step."""
    measurements: Measurements
    """The boxes as measurements of the target model, pixels and squared pixels."""
    boxes: Float[ndarray, "B 4"]
    """Centre and half sizes, pixels."""
    clutter_factors: Float[ndarray, " B"]
    """Factor on κ, :attr:`tracker.single_view.protocol.ViewResult.clutter_factors`."""

    @staticmethod
    def of(views: Many[ViewResult], model: TargetModel, factor: float) -> CameraBoxes:
        """Collect the boxes of all steps of one camera.

        Args:
            views: The result of stage 1 for each step.
            model: The measurement model of a target.
            factor: Factor on the standard deviations of the boxes.
        """
        counts = [len(view.boxes) for view in views]
        boxes = np.concatenate([np.zeros((0, 4)), *(view.boxes for view in views)])
        sigmas = np.concatenate([np.zeros((0, 4)), *(view.sigmas for view in views)])
        measurements = model.measured_boxes(boxes, sigmas, factor)
        blind = np.array([view.blind for view in views], dtype=bool)
        starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
        factors = np.ones(len(boxes))
        if any(len(view.log_ratios) for view in views):
            factors = np.concatenate([view.clutter_factors for view in views])
        return CameraBoxes(starts, blind, measurements, boxes, factors)
