"""What each camera said of each component, carried along with the components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion.protocol import Associations, FusionResult
from tracker.kernels.linear_algebra import sum_pairs

WORTH_TELLING = 0.01
"""Association probability below which a pair is left out of the result, which it keeps small."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """The evidence of C cameras for J components, of which a :class:`FusionResult` is made."""

    detection_probabilities: Float[ndarray, "C J"]
    sources: Int[ndarray, "C J"]
    source_weights: Float[ndarray, "C J"]
    hidden_by: Int[ndarray, "C J"]

    @staticmethod
    def blank(cameras: int, size: int) -> Record:
        """No evidence yet."""
        nobody = np.full((cameras, size), -1, dtype=np.int64)
        return Record(np.zeros((cameras, size)), nobody, np.zeros((cameras, size)), nobody.copy())

    def take(self, indices: ndarray) -> Record:
        """The columns of some components, in that order, as a copy."""
        return Record(
            self.detection_probabilities.take(indices, 1),
            self.sources.take(indices, 1),
            self.source_weights.take(indices, 1),
            self.hidden_by.take(indices, 1),
        )

    def extended(self, count: int) -> Record:
        """With blank columns for ``count`` more components."""
        blank = Record.blank(len(self.sources), count)
        return Record(
            np.concatenate([self.detection_probabilities, blank.detection_probabilities], axis=1),
            np.concatenate([self.sources, blank.sources], axis=1),
            np.concatenate([self.source_weights, blank.source_weights], axis=1),
            np.concatenate([self.hidden_by, blank.hidden_by], axis=1),
        )

    def result(self, posterior: GaussianMixture, associations: Associations) -> FusionResult:
        """The step's result, these being the components of ``posterior``."""
        return FusionResult(
            posterior,
            self.detection_probabilities,
            self.sources,
            self.source_weights,
            self.hidden_by,
            associations,
        )


class Ledger:
    """The association probabilities of one step, by label, while the components still change."""

    def __init__(self) -> None:
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
        """Note one camera's pairs of label and box, but for those below :data:`WORTH_TELLING`."""
        told = (probabilities >= WORTH_TELLING).nonzero()[0]
        if not len(told):
            return
        self._cameras.append(np.full(len(told), camera, dtype=np.int64))
        self._labels.append(labels.take(told))
        self._boxes.append(boxes.take(told))
        self._probabilities.append(probabilities.take(told))

    def associations(self, labels: Int[ndarray, " J"]) -> Associations:
        """The pairs of those labels that lived on; several of one label and box are summed.

        Args:
            labels: Of the posterior's components, the heaviest first.
        """
        if not self._cameras:
            return Associations.none()
        return summed(
            labels,
            np.concatenate(self._cameras),
            np.concatenate(self._labels),
            np.concatenate(self._boxes),
            np.concatenate(self._probabilities),
        )


def summed(
    labels: Int[ndarray, " J"],
    cameras: Int[ndarray, " A"],
    of_pairs: Int[ndarray, " A"],
    boxes: Int[ndarray, " A"],
    probabilities: Float[ndarray, " A"],
) -> Associations:
    """The pairs of those labels that lived on; several of one label and box are summed.

    Args:
        labels: Of the posterior's components, the heaviest first.
        cameras: Of the pairs, as the further ones.
        of_pairs: Their labels.
        boxes: Their boxes.
        probabilities: Theirs.
    """
    if not len(labels) or not len(cameras):
        return Associations.none()
    found = sum_pairs(labels, cameras, of_pairs, boxes, probabilities)
    return Associations(found.cameras, found.components, found.boxes, found.probabilities)
