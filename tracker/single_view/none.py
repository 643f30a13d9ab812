"""No filter in the picture: an outside detector's boxes, as they are."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from tracker.parameters import DetectionBoxParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.protocol import ViewResult


class DetectionBoxes:
    """The boxes of the sequence's ``detections``, with the trust that the parameters state."""

    needs_pictures = False

    def __init__(
        self, sequence: Sequence, camera_index: int, parameters: DetectionBoxParams
    ) -> None:
        """Prepare for one camera.

        Raises:
            ValueError: If the camera has no detections.
        """
        view = sequence.views[camera_index]
        if view.detections is None:
            raise ValueError(
                f'camera "{view.camera.name}" of {sequence.name} has no detections; name a CSV '
                "file as its `detections` in sequence.toml, or choose single_view colour_phd"
            )
        self._detections = view.detections
        self._parameters = parameters

    def start(self) -> None:
        """There is no state."""

    def step(
        self, state: None, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[None, ViewResult]:
        """The boxes of one step whose score is high enough."""
        rows = self._detections.at(frame)
        scores = self._detections.scores[rows]
        good = scores >= self._parameters.score_threshold
        half_sizes = self._detections.boxes[rows][good, 2:] / 2.0
        centres = self._detections.boxes[rows][good, :2] + half_sizes
        sigmas = np.concatenate(
            [self._parameters.centre_sigma * half_sizes, self._parameters.size_sigma * half_sizes],
            axis=1,
        )
        boxes = np.concatenate([centres, half_sizes], axis=1)
        return None, ViewResult.of_boxes(boxes, scores[good], sigmas)
