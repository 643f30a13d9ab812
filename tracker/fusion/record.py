"""The evidence of each camera for each component, carried along with the components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.protocol import Associations, FusionResult
from tracker.kernels.linear_algebra import sum_pairs

REPORTING_THRESHOLD = 0.01
"""Association probability below which a pair is left out of the result, to keep it small."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """The evidence of C cameras for J components, of which a :class:`FusionResult` is made."""

    detection_probabilities: Float[ndarray, "C J"]
    """p_D of each component in each camera."""
    sources: Int[ndarray, "C J"]
    """Index of the box associated with each component, -1 for none."""
    source_weights: Float[ndarray, "C J"]
    """Association probability of the component and that box, 0 … 1."""
    hidden_by: Int[ndarray, "C J"]
    """Label of the target that occludes the component, -1 for none."""

    @staticmethod
    def blank(cameras: int, size: int) -> Record:
        """The record without evidence, of C cameras and J components."""
        none = np.full((cameras, size), -1, dtype=np.int64)
        return Record(np.zeros((cameras, size)), none, np.zeros((cameras, size)), none.copy())

    def take(self, indices: ndarray) -> Record:
        """Copy the columns of some components, in that order."""
        return Record(
            self.detection_probabilities.take(indices, 1),
            self.sources.take(indices, 1),
            self.source_weights.take(indices, 1),
            self.hidden_by.take(indices, 1),
        )

    def extended(self, count: int) -> Record:
        """Append blank columns for ``count`` more components."""
        blank = Record.blank(len(self.sources), count)
        return Record(
            np.concatenate([self.detection_probabilities, blank.detection_probabilities], axis=1),
            np.concatenate([self.sources, blank.sources], axis=1),
            np.concatenate([self.source_weights, blank.source_weights], axis=1),
            np.concatenate([self.hidden_by, blank.hidden_by], axis=1),
        )

    def result(self, posterior: GaussianMixture, associations: Associations) -> FusionResult:
        """Make the result of the step, whose posterior has the components of this record."""
        return FusionResult(
            posterior,
            self.detection_probabilities,
            self.sources,
            self.source_weights,
            self.hidden_by,
            associations,
        )


class Ledger:
    """A collection of one step's association probabilities by label, while components still
    change."""

    def __init__(self) -> None:
        """Begin a step without any pair."""
        self._cameras: list[ndarray] = []
        self._labels: list[ndarray] = []
        self._boxes: list[ndarray] = []
        self._probabilities: list[ndarray] = []

    def add(
        self,
        camera: int,
        labels: Int[ndarray, " A"],
        boxes: Int[ndarray, " A"],
        probabilities: Float[ndarray, " A"],
    ) -> None:
        """Add one camera's pairs of label and box of at least :data:`REPORTING_THRESHOLD`.

        Args:
            camera: Index of the camera.
            labels: Label of each of A pairs.
            boxes: Index of the box of each pair, in the camera.
            probabilities: Association probability of each pair, 0 … 1.
        """
        reported = (probabilities >= REPORTING_THRESHOLD).nonzero()[0]
        if not len(reported):
            return
        self._cameras.append(np.full(len(reported), camera, dtype=np.int64))
        self._labels.append(labels.take(reported))
        self._boxes.append(boxes.take(reported))
        self._probabilities.append(probabilities.take(reported))

    def associations(self, labels: Int[ndarray, " J"]) -> Associations:
        """Sum the pairs by label and box, as :func:`sum_associations` does.

        Args:
            labels: Labels of the posterior's components, the heaviest first.
        """
        if not self._cameras:
            return Associations.none()
        return sum_associations(
            labels,
            np.concatenate(self._cameras),
            np.concatenate(self._labels),
            np.concatenate(self._boxes),
            np.concatenate(self._probabilities),
        )


def sum_associations(
    labels: Int[ndarray, " J"],
    cameras: Int[ndarray, " A"],
    pair_labels: Int[ndarray, " A"],
    boxes: Int[ndarray, " A"],
    probabilities: Float[ndarray, " A"],
) -> Associations:
    """Sum association probabilities by label and box, for the labels that are in the posterior.

    Args:
        labels: Labels of the posterior's J components, the heaviest first.
        cameras: Camera of each of A pairs.
        pair_labels: Label of each pair.
        boxes: Index of the box of each pair, in its camera.
        probabilities: Association probability of each pair, 0 … 1.
    """
    found = sum_pairs(labels, cameras, pair_labels, boxes, probabilities)
    return Associations(found.cameras, found.components, found.boxes, found.probabilities)
