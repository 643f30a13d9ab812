"""Detection by an ONNX model while a recording is tracked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from tracker.parameters.groups.detections import DetectionBoxParams, OnnxDetectorParams
from tracker.sequences.sequence import Sequence
from tracker.single_view.detector_boxes import judge_boxes
from tracker.single_view.onnx.network import Network, Settings
from tracker.single_view.protocol import ViewResult

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.pictures.frames import Pictures


class OnnxDetector:
    """A detector on the images of one camera, with measurement noise like that of detections.

    Boxes that contradict the room remain among the measurements and are not passed on. The
    images are those of stage 1, in which people are upright however a
    camera is turned, and one network serves all cameras.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures,
    ) -> None:
        """Prepare the detector for one camera.

        Raises:
            ValueError: If the sequence has no detector or no images, or it cannot be used.
        """
        if not sequence.views[camera_index].has_pictures:
            name = sequence.views[camera_index].camera.name
            raise ValueError(
                f'camera "{name}" of {sequence.name} has no pictures for a detector to look at; '
                "give it a video or images in sequence.toml"
            )
        model = sequence.detector
        if model is None:
            raise ValueError(
                f"{sequence.name} has no detector; fetch one under Teach or by `multiview-phd "
                "detector get`, start with --detector model.onnx, or choose another single_view"
            )
        p, self._box_parameters = (
            parameters.of(OnnxDetectorParams),
            parameters.of(DetectionBoxParams),
        )
        self._sequence, self._camera = sequence, sequence.views[camera_index].camera
        settings = Settings(
            p.person_class, p.score_threshold, p.suppression_overlap, p.input_side, p.pixel_values
        )
        # no parameter has an effect on the model that is loaded, so it is created once
        network = reader.once(
            ("onnx_detector", model.digest), lambda: Network(model.path, Settings())
        )
        self._network = network.with_settings(settings)

    def start(self) -> None:
        """The method has no state."""

    def step(
        self, state: None, frame: int, picture: ndarray | None, rng: np.random.Generator
    ) -> tuple[None, ViewResult]:
        """Detect the people in the image."""
        if picture is None:
            return None, ViewResult.of_no_frame()
        seen = self._network.detect(picture)
        found = judge_boxes(
            self._sequence, self._camera, seen.boxes, seen.scores, self._box_parameters
        )
        return None, found.result
