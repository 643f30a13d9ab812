"""What each camera said of each component, carried along with the components."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from tracker.fusion.protocol import FusionResult
from tracker.gaussian_mixture import GaussianMixture


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """The evidence of C cameras for J components: the why of a :class:`FusionResult`."""

    detection_probabilities: Float[ndarray, "C J"]
    sources: Int[ndarray, "C J"]
    source_weights: Float[ndarray, "C J"]
    hidden_by: Int[ndarray, "C J"]

    @staticmethod
    def blank(cameras: int, size: int) -> Record:
        """Nothing said yet."""
        nobody = np.full((cameras, size), -1, dtype=np.int64)
        return Record(np.zeros((cameras, size)), nobody, np.zeros((cameras, size)), nobody.copy())

    def take(self, indices: ndarray) -> Record:
        """The columns of some components, in that order, as a copy."""
        return Record(
            self.detection_probabilities[:, indices],
            self.sources[:, indices],
            self.source_weights[:, indices],
            self.hidden_by[:, indices],
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

    def result(self, posterior: GaussianMixture) -> FusionResult:
        """The step's result, these being the components of ``posterior``."""
        return FusionResult(
            posterior,
            self.detection_probabilities,
            self.sources,
            self.source_weights,
            self.hidden_by,
        )
