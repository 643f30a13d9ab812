"""GM-PHD filter in one camera on the boxes of an external detector."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.filters.phd import PhdUpdate
from tracker.parameters.groups.detections import DetectionBoxParams, DetectionPhdParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_phd import EXPLAINED, BoxPhd, BoxPhdState
from tracker.single_view.detector_boxes import Detected, DetectorBoxes, detector_sigmas
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.pictures.frames import Pictures


class DetectionPhd:
    """The GM-PHD filter of a single view, with a detector's boxes instead of colour peaks.

    The clutter intensity of a box falls with its score s,

        κ(z) = λ_c exp(2 b_s (½ − s)) / V

    with V the volume of the image and the sizes. Boxes that contradict the room are reported
    and not used.
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
        self._box_parameters = parameters.of(DetectionBoxParams)
        self._boxes = DetectorBoxes(sequence, camera_index, self._box_parameters)
        self._filter = BoxPhd(p, sequence.step_time, upright=True)
        width, height = sequence.cameras[camera_index].image_size
        # half sizes up to half of the image's, as in the fusion's clutter
        self._clutter = p.clutter_rate / (width * height * width / 2.0 * height / 2.0)

    def start(self) -> BoxPhdState:
        """The state without targets, before the first step."""
        return self._filter.start()

    def step(
        self,
        state: BoxPhdState,
        frame: int,
        picture: ndarray | None,
        rng: np.random.Generator,
    ) -> tuple[BoxPhdState, ViewResult]:
        """Predict one step, update by the boxes, and prune and merge."""
        p, found = self._parameters, self._boxes.at(frame)
        good = np.flatnonzero(found.plausible)
        births = state.unexplained
        variances = detector_sigmas(births, self._box_parameters) ** 2
        variances += self._filter.walk_variances(births)
        after, updated = self._filter.update(
            self._filter.predict(state, self._filter.births(births, variances)),
            found.boxes[good],
            found.sigmas[good],
            self._clutter * np.exp(2.0 * p.score_clutter * (0.5 - found.scores[good])),
        )
        return after, self._result(found, good, updated, after.mixture)

    def _result(
        self, found: Detected, good: ndarray, updated: PhdUpdate, mixture: GaussianMixture
    ) -> ViewResult:
        """Return the result of a step."""
        estimates = self._filter.estimates(mixture)
        if self._parameters.output == "estimates":
            boxes, box_weights, box_labels = estimates.means, estimates.weights, estimates.labels
            embeddings = np.zeros((0, 0), np.float16)  # an estimate has no single box
            sigmas = np.sqrt(np.diagonal(estimates.covariances, axis1=1, axis2=2))
        else:
            believed = updated.measurement_weights > EXPLAINED
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
            estimates=estimates.means,
            estimate_weights=estimates.weights,
            estimate_labels=estimates.labels,
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
