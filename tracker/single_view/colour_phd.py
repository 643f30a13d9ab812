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

from tracker.filters import gaussian_mixture, models, phd
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels.kalman import Expected
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import entrance_boxes
from tracker.single_view.colour.peaks import PeakFinder, Peaks
from tracker.single_view.dropped import Dropped
from tracker.single_view.pictures.foreground import pack
from tracker.single_view.protocol import ViewResult, pack_samples

if TYPE_CHECKING:
    from tracker.parameters.catalogue import RunParameters

EXPLAINED = 0.5
"""Expected number of targets below which a peak may be of a new target: it is more likely
unexplained than not."""


@dataclass(frozen=True, slots=True, eq=False)
class ColourPhdState:
    """The posterior of a step and all that the next step needs of it."""

    mixture: GaussianMixture
    """The intensity over boxes."""
    unexplained: Float[ndarray, "B 4"]
    """Peaks that no component explained, at which targets may be born."""
    next_label: int
    """The first label that is free."""
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
        self._gate = gaussian_mixture.gate_distance(p.gate_probability, 4)
        self._step_time = sequence.step_time
        camera = sequence.cameras[camera_index]
        births = GaussianMixture.empty(4)
        if p.birth != "peaks":
            births = entrance_boxes(
                camera, sequence.room, sequence.target_half_extents, p.birth_rate
            )
        self._entrances = GaussianMixture(
            births.weights * self._step_time, births.means, births.covariances, births.labels
        )
        width, height = camera.image_size
        # uniform over the image and the range of half sizes, each of at least a pixel
        possible = self._finder.sizes
        sizes = np.maximum(possible.largest - possible.smallest, 1.0)
        volume = width * height * float(np.prod(sizes))
        self._clutter = p.clutter_rate / volume

    def start(self) -> ColourPhdState:
        """The state without targets, before the first step."""
        return ColourPhdState(GaussianMixture.empty(4), np.zeros((0, 4)), 1, self._finder.start())

    def step(
        self,
        state: ColourPhdState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[ColourPhdState, ViewResult]:
        """Predict one step, and update by the peaks of the image, if there is one."""
        p = self._parameters
        births = models.label_births(self._births(state.unexplained), state.next_label)
        predicted = gaussian_mixture.concatenate([self._predict(state.mixture), births])
        next_label = state.next_label + births.size
        if picture is None:
            mixture = self._reduce(predicted)
            after = ColourPhdState(mixture, np.zeros((0, 4)), next_label, state.foreground)
            return after, self._result(mixture)

        background, peaks = self._finder.find(state.foreground, picture, predicted, rng)
        noise = self._finder.sigmas(peaks.boxes)[:, :, None] ** 2 * np.eye(4)
        updated = phd.update(
            predicted,
            peaks.boxes,
            expected=Expected.of(predicted.means, np.eye(4)[None]),
            noise=noise,
            detection_probability=p.detection_probability,
            clutter_intensity=self._clutter,
            gate=self._gate,
        )
        mixture = self._reduce(updated.posterior)
        unexplained = peaks.boxes[updated.measurement_weights < EXPLAINED]
        after = ColourPhdState(mixture, unexplained, next_label, background)
        return after, self._result(mixture, peaks)

    def _births(self, unexplained: Float[ndarray, "B 4"]) -> GaussianMixture:
        """Return the birth components: around unexplained peaks, at the entrances, or both."""
        p = self._parameters
        if p.birth == "entrances":
            return self._entrances
        around = GaussianMixture(
            weights=np.full(len(unexplained), min(1.0, p.birth_rate * self._step_time)),
            means=unexplained,
            covariances=self._finder.sigmas(unexplained)[:, :, None] ** 2 * np.eye(4),
            labels=np.zeros(len(unexplained), dtype=np.int64),
        )
        return gaussian_mixture.concatenate([around, self._entrances])

    def _predict(self, mixture: GaussianMixture) -> GaussianMixture:
        """Predict by a random walk, in half sizes: a person nearby moves more pixels."""
        p = self._parameters
        half_sizes = np.maximum(mixture.means[:, 2:], 0.5)
        sigmas = np.concatenate([p.motion_sigma * half_sizes, p.growth_sigma * half_sizes], axis=1)
        noise = sigmas[:, :, None] ** 2 * np.eye(4) * self._step_time
        return gaussian_mixture.predict(mixture, np.eye(4), noise, p.survival_probability)

    def _reduce(self, mixture: GaussianMixture) -> GaussianMixture:
        p = self._parameters
        reduced, _ = gaussian_mixture.reduce(
            mixture,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        return reduced

    def _result(self, mixture: GaussianMixture, peaks: Peaks | None = None) -> ViewResult:
        """Return the result of a step."""
        p = self._parameters
        found = np.zeros((0, 4)) if peaks is None else peaks.boxes
        ratios = np.zeros(0)
        scores = np.zeros(0) if peaks is None else peaks.scores
        chosen = phd.extract(mixture, p.extraction_threshold)
        estimates, weights = mixture.means[chosen], mixture.weights[chosen]
        labels = mixture.labels[chosen]
        if p.output == "estimates":
            boxes, box_weights, box_labels = estimates, weights, labels
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
            estimates=estimates,
            estimate_weights=weights,
            estimate_labels=labels,
            measurements=found,
            measurement_scores=scores,
            samples=pack_samples(samples, sample_weights),
            information={**information, "cardinality": mixture.cardinality},
            dropped=Dropped.none() if peaks is None else peaks.dropped,
            foreground=None if peaks is None or peaks.mask is None else pack(peaks.mask),
        )
