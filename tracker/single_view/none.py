"""No filter in the camera: the boxes of an external detector are passed on."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from tracker.parameters.groups.detections import DetectionBoxParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.detector_boxes import DetectorBoxes
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.pictures.frames import Pictures


class UnfilteredBoxes:
    """The boxes of the sequence's ``detections``, with the noise of the parameters.

    Boxes that contradict the room remain among the measurements and are not passed on.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures | None = None,
    ) -> None:
        """Prepare the boxes of one camera.

        Raises:
            ValueError: If the camera has no detections.
        """
        self._boxes = DetectorBoxes(sequence, camera_index, parameters.of(DetectionBoxParams))

    def start(self) -> None:
        """The method has no state."""

    def step(
        self, state: None, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[None, ViewResult]:
        """Return the boxes of one step with a sufficient score and a possible place."""
        found = self._boxes.at(frame)
        good = found.plausible
        result = ViewResult.of_boxes(found.boxes[good], found.scores[good], found.sigmas[good])
        dropped = found.dropped
        return None, replace(
            result,
            embeddings=found.embeddings_of(good),
            measurements=found.boxes,
            measurement_scores=found.scores,
            information=dropped.information(int(good.sum())),
            dropped=dropped,
        )
