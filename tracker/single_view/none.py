"""No filter in the picture: an outside detector's boxes, as they are."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from tracker.parameters import DetectionBoxParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.detector_boxes import DetectorBoxes
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters import RunParameters
    from tracker.sequences.pictures.frames import Pictures


class DetectionBoxes:
    """The boxes of the sequence's ``detections``, with the noise that the parameters state.

    Boxes that contradict the room stay among the measurements and go no further.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures | None = None,
    ) -> None:
        """Prepare for one camera.

        Raises:
            ValueError: If the camera has no detections.
        """
        self._boxes = DetectorBoxes(sequence, camera_index, parameters.of(DetectionBoxParams))

    def start(self) -> None:
        """There is no state."""

    def step(
        self, state: None, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[None, ViewResult]:
        """The boxes of one step whose score is high enough and whose place is possible."""
        found = self._boxes.at(frame)
        good = found.plausible
        result = ViewResult.of_boxes(found.boxes[good], found.scores[good], found.sigmas[good])
        result = replace(result, looks=found.looks_of(good))
        if good.all():
            return None, result
        return None, replace(
            result,
            measurements=found.boxes,
            measurement_scores=found.scores,
            information={"boxes outside the room": float((~good).sum())},
        )
