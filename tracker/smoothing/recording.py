"""All boxes of a recording, camera by camera, and the measurements that they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.target_model import TargetModel
from tracker.kernels.gating import Measurements
from tracker.single_view.protocol import ViewResult
from tracker.steps import Steps


@dataclass(frozen=True, slots=True, eq=False)
class CameraBoxes:
    """The B boxes of one camera over T steps, step after step."""

    starts: Int[ndarray, " T1"]
    """Index of the first box of each step, and B at the end."""
    blind: Bool[ndarray, " T"]
    """Whether the camera had no frame at each step."""
    boxes: Float[ndarray, "B 4"]
    """Centre and half sizes, pixels."""
    sigmas: Float[ndarray, "B 4"]
    """Standard deviations of the same, pixels."""
    clutter_factors: Float[ndarray, " B"]
    """Factor on κ, :attr:`tracker.single_view.protocol.ViewResult.clutter_factors`."""
    measured: Callable[[ndarray, ndarray], Measurements]
    """Converts boxes and their standard deviations to measurements of the target model."""

    def measurements(self, chosen: ndarray | slice) -> Measurements:
        """Some of the boxes as measurements, pixels and squared pixels.

        Their noises take as much memory as all else of a box, so that only those of a few boxes
        are made at a time.
        """
        return self.measured(self.boxes[chosen], self.sigmas[chosen])

    @staticmethod
    def of(
        views: Steps[tuple[ViewResult, ...]], camera: int, model: TargetModel, factor: float
    ) -> CameraBoxes:
        """Collect the boxes of all steps of one camera.

        Args:
            views: The results of stage 1 for each step.
            camera: Index of the camera.
            model: The measurement model of a target.
            factor: Factor on the standard deviations of the boxes.
        """
        found, sigmas = views.column("boxes", camera), views.column("sigmas", camera)
        boxes = found.values.reshape(-1, 4)
        blind = np.fromiter(views.values("blind", camera), bool, len(views))
        factors = np.ones(len(boxes))
        ratios = views.column("log_ratios", camera)
        factors[np.repeat(ratios.counts > 0, found.counts)] = np.exp(-ratios.values)
        measured = partial(model.measured_boxes, factor=factor)
        return CameraBoxes(
            found.starts, blind, boxes, sigmas.values.reshape(-1, 4), factors, measured
        )
