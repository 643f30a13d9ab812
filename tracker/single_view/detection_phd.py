"""GM-PHD filter in one camera on the boxes of an external detector.

[VM06] B.-N. Vo, W.-K. Ma, "The Gaussian mixture probability hypothesis density
filter", IEEE Transactions on Signal Processing 54(11), 2006.
[RCVV12] Ristic, Clark, Vo, Vo, "Adaptive target birth intensity for PHD and CPHD
filters", IEEE TAES 48(2), 2012.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.filters import gaussian_mixture, models, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.kernels.kalman import Expected
from tracker.parameters.groups.detections import DetectionPhdParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.detector_boxes import Detected, DetectorBoxes, trust
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.pictures.frames import Pictures

BELIEVED = 0.5
"""Expected number of targets above which a box is passed to the fusion: it is more likely a target
than clutter."""


@dataclass(frozen=True, slots=True, eq=False)
class DetectionPhdState:
    """The posterior of a step and all that the next step needs of it."""

    mixture: GaussianMixture
    """The intensity over boxes."""
    unexplained: Float[ndarray, "B 4"]
    """Boxes that no component explained, at which targets may be born."""
    next_label: int
    """The first label that is free."""


class DetectionPhd:
    """The GM-PHD filter of a single view, with a detector's boxes instead of colour peaks.

    State {x_c, y_c, H_x, H_y}: a box by its centre and half sizes, in pixels; random
    walk; H = I. The clutter intensity of a box falls with its score s,

        κ(z) = λ_c exp(2 b_s (½ − s)) / V

    with V the volume of the image and the sizes. Targets are born at boxes of the step before
    that no component explained ([RCVV12]), so a new target is updated from its second
    box on. Boxes that contradict the room are reported and not used.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures | None = None,
    ) -> None:
        """Prepare the filter of one camera.

        Raises:
            ValueError: If the camera has no detections.
        """
        self._parameters = p = parameters.of(DetectionPhdParams)
        self._boxes = DetectorBoxes(sequence, camera_index, p)
        self._gate = gaussian_mixture.gate_distance(p.gate_probability, 4)
        self._step_time = sequence.step_time
        width, height = sequence.cameras[camera_index].image_size
        # half sizes up to half of the image's, as in the fusion's clutter
        self._clutter = p.clutter_rate / (width * height * width / 2.0 * height / 2.0)

    def start(self) -> DetectionPhdState:
        """The state without targets, before the first step."""
        return DetectionPhdState(GaussianMixture.empty(4), np.zeros((0, 4)), next_label=1)

    def step(
        self,
        state: DetectionPhdState,
        frame: int,
        picture: ndarray | None,
        rng: np.random.Generator,
    ) -> tuple[DetectionPhdState, ViewResult]:
        """Predict one step, update by the boxes, and prune and merge."""
        p, found = self._parameters, self._boxes.at(frame)
        good = np.flatnonzero(found.plausible)
        births = models.label_births(self._births(state.unexplained), state.next_label)
        predicted = gaussian_mixture.concatenate([self._predict(state.mixture), births])
        updated = phd.update(
            predicted,
            found.boxes[good],
            expected=Expected.of(predicted.means, np.eye(4)[None]),
            noise=found.sigmas[good][:, :, None] ** 2 * np.eye(4),
            detection_probability=p.detection_probability,
            clutter_intensity=self._clutter
            * np.exp(2.0 * p.score_clutter * (0.5 - found.scores[good])),
            gate=self._gate,
        )
        mixture, _ = gaussian_mixture.reduce(
            updated.posterior,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        unexplained = found.boxes[good][updated.measurement_weights < BELIEVED]
        after = DetectionPhdState(mixture, unexplained, state.next_label + births.size)
        return after, self._result(found, good, updated, mixture)

    def _births(self, unexplained: Float[ndarray, "B 4"]) -> GaussianMixture:
        p = self._parameters
        variances = trust(unexplained, p) ** 2 + self._walk(unexplained)
        return GaussianMixture(
            weights=np.full(len(unexplained), min(1.0, p.birth_rate * self._step_time)),
            means=unexplained,
            covariances=variances[:, :, None] * np.eye(4),
            labels=np.zeros(len(unexplained), dtype=np.int64),
        )

    def _walk(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Variances of one step of the random walk: a person nearby moves more pixels."""
        p, sizes = self._parameters, np.maximum(boxes[:, 2:], 0.5)
        across = p.motion_sigma * sizes[:, 1:]
        sigmas = np.concatenate([across, across, p.growth_sigma * sizes], axis=1)
        return sigmas**2 * self._step_time

    def _predict(self, mixture: GaussianMixture) -> GaussianMixture:
        noise = self._walk(mixture.means)[:, :, None] * np.eye(4)
        return gaussian_mixture.predict(
            mixture, np.eye(4), noise, self._parameters.survival_probability
        )

    def _result(
        self, found: Detected, good: ndarray, updated: PhdUpdate, mixture: GaussianMixture
    ) -> ViewResult:
        """Return the result of a step."""
        p = self._parameters
        chosen = phd.extract(mixture, p.extraction_threshold)
        estimates, weights = mixture.means[chosen], mixture.weights[chosen]
        labels = mixture.labels[chosen]
        if p.output == "estimates":
            boxes, box_weights, box_labels = estimates, weights, labels
            embeddings = np.zeros((0, 0), np.float16)  # an estimate has no single box
            sigmas = np.sqrt(np.diagonal(mixture.covariances[chosen], axis1=1, axis2=2))
        else:
            believed = updated.measurement_weights > BELIEVED
            passed = good[believed]
            boxes, sigmas = found.boxes[passed], found.sigmas[passed]
            box_weights = updated.measurement_weights[believed]
            embeddings = found.embeddings_of(passed)
            box_labels = _labels_of_boxes(updated, len(good))[believed]
        return ViewResult(
            boxes=boxes,
            weights=box_weights,
            labels=box_labels,
            sigmas=sigmas,
            estimates=estimates,
            estimate_weights=weights,
            estimate_labels=labels,
            measurements=found.boxes,
            measurement_scores=found.scores,
            dropped=found.dropped,
            information={
                **found.dropped.information(int(found.plausible.sum())),
                "cardinality": mixture.cardinality,
            },
            embeddings=embeddings,
        )


def _labels_of_boxes(updated: PhdUpdate, count: int) -> ndarray:
    """The label that explains most of each box, -1 for a box without any."""
    labels = np.full(count, -1, dtype=np.int64)
    pairs = updated.measurements >= 0
    order = np.argsort(updated.posterior.weights[pairs], kind="stable")
    # the heaviest pair of a box is written last
    labels[updated.measurements[pairs][order]] = updated.posterior.labels[pairs][order]
    return labels
