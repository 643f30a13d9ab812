"""The published single-view filter: a GM-PHD over boxes on peaks of the colour likelihood.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.1–2.3.
[RCVV12] Ristic, Clark, Vo, Vo, "Adaptive target birth intensity for PHD and CPHD
filters", IEEE TAES 48(2), 2012.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from tracker.filters import gaussian_mixture
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_phd import BoxPhd, BoxPhdState
from tracker.single_view.box_sizes import entrance_boxes
from tracker.single_view.colour.peaks import PeakFinder, Peaks
from tracker.single_view.pictures.background import pack
from tracker.single_view.protocol import Dropped, ViewResult, pack_samples

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters


@dataclass(frozen=True, slots=True, eq=False)
class ColourPhdState:
    """The state after a step."""

    targets: BoxPhdState
    """The state of the filter."""
    foreground: Any
    """The state of the foreground model."""


class ColourPhd:
    """Colour-likelihood GM-PHD filter in one camera ([ZW21] §2.3).

    State {x_c, y_c, H_x, H_y}: a box by its centre and half sizes, in pixels;
    random walk. Per step: the surviving intensity and the births make v(x); boxes
    are sampled from it and weighted by the likelihood, ṽ = l_z(x) v(x); the peaks
    of ṽ, found by mean shift, are the measurement set of a GM-PHD update with
    H = I. Means of components above the extraction threshold are the estimates.

    Beyond the paper, and switched off by the preset ``published``: part of the
    samples is drawn from the foreground, with the sizes that the calibrated camera
    allows there; the likelihood is multiplied by that of the foreground in the
    box; peaks must exceed a threshold; births are at unexplained peaks ([RCVV12]); the
    peaks themselves are passed to the fusion.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: RunParameters,
        reader: Pictures,
    ) -> None:
        """Read the templates and learn the background of one camera.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters = p = parameters.of(ColourPhdParams)
        self._finder = PeakFinder(sequence, camera_index, p, parameters.foreground, reader)
        self._filter = BoxPhd(p, sequence.step_time)
        camera = sequence.cameras[camera_index]
        births = GaussianMixture.empty(4)
        if p.birth != "peaks":
            births = entrance_boxes(
                camera, sequence.room, sequence.target_half_extents, p.birth_rate
            )
        self._entrances = GaussianMixture(
            births.weights * sequence.step_time, births.means, births.covariances, births.labels
        )
        width, height = camera.image_size
        # uniform over the image and the range of half sizes, each of at least a pixel
        possible = self._finder.sizes
        sizes = np.maximum(possible.largest - possible.smallest, 1.0)
        volume = width * height * float(np.prod(sizes))
        self._clutter = p.clutter_rate / volume

    def start(self) -> ColourPhdState:
        """The state without targets, before the first step."""
        return ColourPhdState(self._filter.start(), self._finder.start())

    def step(
        self,
        state: ColourPhdState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[ColourPhdState, ViewResult]:
        """Predict one step, and update by the peaks of the image, if there is one."""
        predicted = self._filter.predict(state.targets, self._births(state.targets.unexplained))
        if picture is None:
            targets = self._filter.reduce(predicted)
            return ColourPhdState(targets, state.foreground), self._result(targets.mixture)
        background, peaks = self._finder.find(state.foreground, picture, predicted.mixture, rng)
        targets, _ = self._filter.update(
            predicted, peaks.boxes, self._finder.sigmas(peaks.boxes), self._clutter
        )
        return ColourPhdState(targets, background), self._result(targets.mixture, peaks)

    def _births(self, unexplained: Float[ndarray, "B 4"]) -> GaussianMixture:
        """Return the birth components: around unexplained peaks, at the entrances, or both."""
        if self._parameters.birth == "entrances":
            return self._entrances
        around = self._filter.births(unexplained, self._finder.sigmas(unexplained) ** 2)
        return gaussian_mixture.concatenate([around, self._entrances])

    def _result(self, mixture: GaussianMixture, peaks: Peaks | None = None) -> ViewResult:
        """Return the result of a step."""
        p = self._parameters
        found = np.zeros((0, 4)) if peaks is None else peaks.boxes
        ratios = np.zeros(0)
        scores = np.zeros(0) if peaks is None else peaks.scores
        estimates = self._filter.estimates(mixture)
        if p.output == "estimates":
            boxes, box_weights, box_labels = estimates.means, estimates.weights, estimates.labels
            sigmas = self._finder.sigmas(boxes)
        else:
            boxes, box_weights, sigmas = found, scores, self._finder.sigmas(found)
            if peaks is not None and peaks.passed is not None:
                passed = peaks.passed
                boxes, box_weights, sigmas = passed.boxes, passed.scores, passed.sigmas
                ratios = passed.log_ratios
            box_labels = np.full(len(boxes), -1, dtype=np.int64)
        samples = np.zeros((0, 4)) if peaks is None else peaks.samples
        sample_weights = np.zeros(0) if peaks is None else peaks.sample_weights
        information = {} if peaks is None else peaks.information
        return ViewResult(
            boxes=boxes,
            weights=box_weights,
            labels=box_labels,
            sigmas=sigmas,
            log_ratios=ratios,
            estimates=estimates.means,
            estimate_weights=estimates.weights,
            estimate_labels=estimates.labels,
            measurements=found,
            measurement_scores=scores,
            samples=pack_samples(samples, sample_weights),
            information={**information, "cardinality": mixture.cardinality},
            dropped=Dropped.none() if peaks is None else peaks.dropped,
            foreground=None if peaks is None or peaks.mask is None else pack(peaks.mask),
        )
