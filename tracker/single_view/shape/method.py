"""People by shape: tracked in one camera by data association, with likelihood ratios.

[LBS93] Lerro, Bar-Shalom, "Interacting multiple model tracking with target amplitude feature",
IEEE TAES 29(2), 1993.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.special import expit, logit

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.parameters.groups.detections import ShapesParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.jpda.measurements import Measured
from tracker.single_view.jpda.method import Jpda, JpdaState
from tracker.single_view.protocol import Dropped, ViewResult
from tracker.single_view.shape.channels import ChannelState
from tracker.single_view.shape.finder import ShapeFinder, log_ratios, shape_sigmas

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


class ShapesInCamera:
    """The tracker :class:`~tracker.single_view.jpda.method.Jpda` on people by shape.

    Everything that is slightly similar to a person is passed to the fusion, with the log
    likelihood ratio of its shape ([LBS93]_),

        ln Λ = min(a (ln o - ln o_0), ln Λ_max),

    of the log odds ln o by shape: weak evidence in one camera may be a person where
    others agree.
    """

    def __init__(
        self, sequence: Sequence, camera_index: int, parameters: RunParameters, reader: Pictures
    ) -> None:
        """Learn the background of one camera.

        Raises:
            ValueError: If the camera has no pictures.
        """
        view = sequence.views[camera_index]
        view.need_pictures(sequence.name)
        self._parameters = parameters.of(ShapesParams)
        self._source = ShapeSource(sequence, camera_index, self._parameters, reader)
        self._tracking = Jpda(sequence, camera_index, parameters, reader, source=self._source)

    def start(self) -> JpdaState:
        """The state without targets, before the first step."""
        return self._tracking.start()

    def step(
        self,
        state: JpdaState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[JpdaState, ViewResult]:
        """Process one step; without an image there are no measurements."""
        p = self._parameters
        state, result = self._tracking.step(state, frame, picture, rng)
        boxes, probabilities = result.measurements, result.measurement_scores
        same = (boxes[:, None] == result.boxes[None]).all(axis=2)
        labels = np.where(same, result.labels, -1).max(axis=1, initial=-1)
        return state, replace(
            result,
            boxes=boxes,
            weights=probabilities,
            labels=labels,
            sigmas=self._source.sigmas(boxes),
            log_ratios=log_ratios(
                logit(probabilities), p.even_odds, p.odds_weight, p.largest_ratio
            ),
        )


class ShapeSource:
    """People by the shape of head and trunk, anywhere on the room's floor."""

    def __init__(
        self, sequence: Sequence, camera_index: int, parameters: ShapesParams, reader: Pictures
    ) -> None:
        """Learn the background of one camera."""
        self._parameters = parameters
        self._half_extents = sequence.target_half_extents
        self._finder = ShapeFinder.of(sequence, camera_index, reader)

    def start(self) -> ChannelState | None:
        """The state before the first step."""
        return self._finder.start()

    def measure(
        self,
        state: ChannelState | None,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        expected: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[ChannelState | None, Measured]:
        """Detect the people of one image; none without an image."""
        if picture is None:
            return state, Measured.nothing()
        p = self._parameters
        least = min(p.passed_odds, p.least_odds)
        state, found = self._finder.find(state, picture, least, p.overlap)
        rejected = np.ones(len(found.unlikely), dtype=bool)
        dropped = Dropped.of(found.unlikely, {"shape": rejected})
        probabilities = expit(found.log_odds)
        likely = np.flatnonzero(found.log_odds >= p.least_odds)
        return state, Measured(
            found.boxes[likely],
            probabilities[likely],
            self.sigmas(found.boxes[likely]),
            found.boxes[likely] * [1.0, 1.0, p.cover, p.cover],
            shown=found.boxes,
            shown_scores=probabilities,
            information=dropped.information(len(found.boxes)),
            dropped=dropped,
        )

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Measurement noise: see :func:`~tracker.single_view.shape.finder.shape_sigmas`."""
        return shape_sigmas(boxes, self._half_extents, self._parameters)
