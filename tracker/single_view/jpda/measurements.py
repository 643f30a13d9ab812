"""Sources of the measurements: boxes of the foreground, of colour peaks, or of a detector.

Boxes are ``centre_x, centre_y, half_width, half_height`` in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.geometry.boxes import Boxes
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.detections import DetectionBoxParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.jpda import JpdaParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import box_sigmas
from tracker.single_view.colour.peaks import PeakFinder
from tracker.single_view.detector_boxes import DetectorBoxes, detector_sigmas
from tracker.single_view.jpda.crowns import TargetSizes, crowns
from tracker.single_view.pictures.background import ForegroundModel, MovingForeground
from tracker.single_view.pictures.foreground import blobs, box_shares, integral, learn
from tracker.single_view.protocol import UNCERTAINTY, Dropped

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The M measurements of one step, and data about them for display."""

    boxes: Float[ndarray, "M 4"]
    """Boxes of the measurements, pixels."""
    scores: Float[ndarray, " M"]
    """Score of each, 0 … 1."""
    sigmas: Float[ndarray, "M 4"]
    """Standard deviations of the boxes' numbers, pixels."""
    pieces: Float[ndarray, "M 4"]
    """Box of the foreground component around each measurement, pixels: a target that the
    measurement occludes lies inside. Without foreground it is a multiple of the measurement."""
    shown: Float[ndarray, "S 4"] | None = None
    """All boxes of the source for display, those that are no measurements among them, pixels; None
    where these are the measurements."""
    shown_scores: Float[ndarray, " S"] | None = None
    """Score of each box for display, 0 … 1; None where these are the measurements."""
    samples: Float[ndarray, "S 4"] = field(default_factory=lambda: np.zeros((0, 4)))
    """Sampled boxes of the intensity, pixels, where the source has any."""
    sample_weights: Float[ndarray, " S"] = field(default_factory=lambda: np.zeros(0))
    """Weight of each sample relative to the largest, 0 … 1."""
    mask: UInt8[ndarray, "h w"] | None = None
    """The foreground mask, where the source has one."""
    information: dict[str, float] = field(default_factory=dict)
    """Numbers about this step for display, by name."""
    dropped: Dropped = field(default_factory=Dropped.none)
    """Candidates that were rejected."""

    @staticmethod
    def nothing() -> Measured:
        """No measurements, as without an image."""
        none = np.zeros((0, 4))
        return Measured(none, np.zeros(0), none, none)


class Source(Protocol):
    """A source of measurements of one camera."""

    def start(self) -> Any:
        """The state before the first step."""
        ...

    def measure(
        self,
        state: Any,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        expected: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[Any, Measured]:
        """Return the measurements of one step.

        Args:
            state: The state that the step before returned.
            frame: Index of the step, from 0.
            picture: The image, BGR; None where there is none.
            expected: The predicted targets, as an intensity over boxes.
            rng: The only source of randomness.
        """
        ...

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Measurement noise of boxes: standard deviations of their four numbers, pixels."""
        ...


def source_of(
    sequence: Sequence, camera_index: int, parameters: RunParameters, reader: Pictures
) -> Source:
    """Create the chosen source for one camera.

    Without any template the colours are replaced by the foreground.

    Args:
        sequence: The sequence.
        camera_index: Index of the camera.
        parameters: The choice, and the parameters of the source.
        reader: Reader of the images.

    Raises:
        ValueError: If the camera lacks data that the source needs.
    """
    p = parameters.of(JpdaParams)
    if p.measurements == "detections":
        return _Detector(sequence, camera_index, parameters)
    if p.measurements == "colour" and sequence.templates:
        return _Colours(sequence, camera_index, parameters, reader)
    view = sequence.views[camera_index]
    view.need_pictures(sequence.name, ", or set jpda.measurements to detections")
    return _Foreground(sequence, camera_index, p, parameters.foreground, reader)


class _Foreground:
    """Boxes of foreground components, or of a target under each top of a component."""

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: JpdaParams,
        foreground: ForegroundParams,
        reader: Pictures,
    ) -> None:
        self._parameters = parameters
        self._minimum_area = foreground.minimum_area
        self._model: ForegroundModel | None = learn(
            sequence, camera_index, reader, foreground, motion=True
        )
        camera = sequence.views[camera_index].camera
        self._sizes = (
            TargetSizes(
                camera, sequence.room, sequence.target_half_extents, parameters.height_sigmas
            )
            if parameters.foreground_box == "target"
            else None
        )

    def start(self) -> Any:
        return None if self._model is None else self._model.start()

    def measure(
        self,
        state: Any,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        expected: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[Any, Measured]:
        if picture is None or self._model is None:
            return state, Measured.nothing()
        state, found = self._model.step(state, picture)
        information = {
            "foreground share": float(found.mask.mean()),
            UNCERTAINTY: self._model.uncertainty
            if isinstance(self._model, MovingForeground)
            else 0.0,
        }
        dropped = Dropped.none()
        if self._sizes is None:
            boxes = blobs(found.mask, self._minimum_area).boxes
            pieces = boxes
            scores = box_shares(integral(found.mask), Boxes(boxes).corners)
        else:
            targets = crowns(found.mask, self._sizes, self._minimum_area, self._parameters)
            boxes, pieces, scores = targets.boxes, targets.pieces, targets.inside
            dropped = targets.dropped
            information |= dropped.information(len(boxes))
        return state, Measured(
            boxes,
            scores,
            self.sigmas(boxes),
            pieces,
            mask=found.mask,
            information=information,
            dropped=dropped,
        )

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        p = self._parameters
        return box_sigmas(boxes, p.centre_sigma, p.size_sigma, pixels=p.pixel_sigma)


class _Colours:
    """Peaks of the colour likelihood, with the parameters of ``colour_phd``."""

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures,
    ) -> None:
        self._cover = parameters.of(JpdaParams).cover
        self._finder = PeakFinder(
            sequence, camera_index, parameters.of(ColourPhdParams), parameters.foreground, reader
        )

    def start(self) -> Any:
        return self._finder.start()

    def measure(
        self,
        state: Any,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        expected: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[Any, Measured]:
        if picture is None:
            return state, Measured.nothing()
        state, peaks = self._finder.find(state, picture, expected, rng)
        return state, Measured(
            peaks.boxes,
            peaks.scores,
            self.sigmas(peaks.boxes),
            peaks.boxes * [1.0, 1.0, self._cover, self._cover],
            samples=peaks.samples,
            sample_weights=peaks.sample_weights,
            mask=peaks.mask,
            information=peaks.information,
            dropped=peaks.dropped,
        )

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        return self._finder.sigmas(boxes)


class _Detector:
    """The boxes of an external detector, with the parameters of ``detection_boxes``."""

    def __init__(self, sequence: Sequence, camera_index: int, parameters: RunParameters) -> None:
        self._cover = parameters.of(JpdaParams).cover
        self._parameters = parameters.of(DetectionBoxParams)
        self._boxes = DetectorBoxes(sequence, camera_index, self._parameters)

    def start(self) -> None:
        return None

    def measure(
        self,
        state: Any,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        expected: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[Any, Measured]:
        found = self._boxes.at(frame)
        good = found.plausible
        boxes = found.boxes[good]
        return state, Measured(
            boxes,
            found.scores[good],
            found.sigmas[good],
            boxes * [1.0, 1.0, self._cover, self._cover],
            shown=found.boxes,
            shown_scores=found.scores,
            information=found.dropped.information(int(good.sum())),
            dropped=found.dropped,
        )

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        return detector_sigmas(boxes, self._parameters)
