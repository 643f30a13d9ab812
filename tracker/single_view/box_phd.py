"""The GM-PHD filter over the boxes of one camera.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
[RCVV12] Ristic, Clark, Vo, Vo, "Adaptive target birth intensity for PHD and CPHD
filters", IEEE TAES 48(2), 2012.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.filters import gaussian_mixture, models, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.kernels.kalman import Expected
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.detections import DetectionPhdParams

EXPLAINED = 0.5
"""Expected number of targets at a measurement from which it is more likely a target than not;
below, it may be of a new one."""


@dataclass(frozen=True, slots=True, eq=False)
class BoxPhdState:
    """The intensity of a step and all that the next step needs of it."""

    mixture: GaussianMixture
    """The intensity over boxes."""
    unexplained: Float[ndarray, "B 4"]
    """Measurements that no component explained, at which targets may be born, pixels."""
    next_label: int
    """The first label that is free."""


class BoxPhd:
    """The GM-PHD recursion ([VM06]_) over boxes {x_c, y_c, H_x, H_y}, pixels.

    The motion is a random walk in half sizes, since a person nearby moves more pixels; boxes are
    measured as they are, H = I. Targets are born at boxes of the step before that no component
    explained ([RCVV12]_), so a new target is updated from its second box on.
    """

    def __init__(
        self,
        parameters: ColourPhdParams | DetectionPhdParams,
        step_time: float,
        *,
        upright: bool = False,
    ) -> None:
        """Set the parameters.

        Args:
            parameters: Those of the motion, the update and the reduction.
            step_time: Time between two steps, seconds.
            upright: Whether the displacement across is in half heights, as that down is, and not
                in half widths.
        """
        self._parameters = p = parameters
        self._step_time = step_time
        self._scale = [1, 1] if upright else [0, 1]
        self._gate = gaussian_mixture.gate_distance(p.gate_probability, 4)

    def start(self) -> BoxPhdState:
        """The state without targets, before the first step."""
        return BoxPhdState(GaussianMixture.empty(4), np.zeros((0, 4)), next_label=1)

    def walk_variances(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Variances of one step of the random walk of each box, squared pixels."""
        p, sizes = self._parameters, np.maximum(boxes[:, 2:], 0.5)
        shifts = p.motion_sigma * sizes[:, self._scale]
        return np.concatenate([shifts, p.growth_sigma * sizes], axis=1) ** 2 * self._step_time

    def births(
        self, boxes: Float[ndarray, "B 4"], variances: Float[ndarray, "B 4"]
    ) -> GaussianMixture:
        """The birth components of one step around boxes, without labels.

        Args:
            boxes: The means, pixels.
            variances: Variances of their four numbers, squared pixels.
        """
        return GaussianMixture(
            weights=np.full(len(boxes), min(1.0, self._parameters.birth_rate * self._step_time)),
            means=boxes,
            covariances=variances[:, :, None] * np.eye(4),
            labels=np.zeros(len(boxes), dtype=np.int64),
        )

    def predict(self, state: BoxPhdState, births: GaussianMixture) -> BoxPhdState:
        """Predict one step, and add births, which get the next labels.

        Args:
            state: The state after the step before.
            births: Birth components, as of :meth:`births`.
        """
        born = models.label_births(births, state.next_label)
        noise = self.walk_variances(state.mixture.means)[:, :, None] * np.eye(4)
        surviving = gaussian_mixture.predict(
            state.mixture, np.eye(4), noise, self._parameters.survival_probability
        )
        mixture = gaussian_mixture.concatenate([surviving, born])
        return BoxPhdState(mixture, np.zeros((0, 4)), state.next_label + born.size)

    def update(
        self,
        predicted: BoxPhdState,
        boxes: Float[ndarray, "M 4"],
        sigmas: Float[ndarray, "M 4"],
        clutter_intensity: float | Float[ndarray, " M"],
    ) -> tuple[BoxPhdState, PhdUpdate]:
        """Update by measured boxes, and prune and merge.

        Args:
            predicted: The prediction of :meth:`predict`.
            boxes: M boxes, pixels.
            sigmas: Standard deviations of their four numbers, pixels.
            clutter_intensity: κ(z) of all or of each, per pixel to the fourth.
        """
        updated = phd.update(
            predicted.mixture,
            boxes,
            expected=Expected.of(predicted.mixture.means, np.eye(4)[None]),
            noise=sigmas[:, :, None] ** 2 * np.eye(4),
            detection_probability=self._parameters.detection_probability,
            clutter_intensity=clutter_intensity,
            gate=self._gate,
        )
        after = self.reduce(replace(predicted, mixture=updated.posterior))
        unexplained = boxes[updated.measurement_weights < EXPLAINED]
        return replace(after, unexplained=unexplained), updated

    def reduce(self, state: BoxPhdState) -> BoxPhdState:
        """Prune and merge the components."""
        p = self._parameters
        mixture, _ = gaussian_mixture.reduce(
            state.mixture,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        return replace(state, mixture=mixture)

    def estimates(self, mixture: GaussianMixture) -> GaussianMixture:
        """The components above the extraction threshold."""
        return mixture.take(phd.extract(mixture, self._parameters.extraction_threshold))
