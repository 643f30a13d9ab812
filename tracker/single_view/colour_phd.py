"""The published single-view filter: a GM-PHD over boxes, fed by peaks of the colour likelihood.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.1–2.3.
[RCVV12] Ristic, Clark, Vo, Vo, "Adaptive target birth intensity for PHD and CPHD
filters", IEEE TAES 48(2), 2012.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.stats import chi2

from tracker import gaussian_mixture, mean_shift, models, phd
from tracker.foreground import pack
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import ColourPhdParams, ForegroundParams
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.appearance import Appearance, Scene
from tracker.single_view.box_sizes import entrance_boxes
from tracker.single_view.protocol import ViewResult

GATE = float(chi2.ppf(0.9999, df=4))
"""Squared Mahalanobis distance: a person's own peak lies inside with this probability."""

MERGE_DISTANCE = 0.8
"""Peaks closer than this, in half sizes, are one."""

SAME_PERSON_DISTANCE = 1.5
"""Peaks of the same person's colours closer than this, in half sizes, are one."""


@dataclass(frozen=True, slots=True, eq=False)
class ColourPhdState:
    """The posterior of the step before, what it left unexplained, and the next free label."""

    mixture: GaussianMixture
    unexplained: Float[ndarray, "B 4"]
    """Peaks that no component explained: where somebody may have appeared."""
    next_label: int
    foreground: Any
    """Of the foreground model."""


class ColourPhd:
    """Colour-likelihood GM-PHD filter in one camera ([ZW21] §2.3).

    State {x_c, y_c, H_x, H_y}: a box by its centre and half sizes, in pixels;
    random walk. Per step: the surviving intensity and the births make v(x); boxes
    are sampled from it and weighted by the likelihood, ṽ = l_z(x) v(x); the peaks
    of ṽ, found by mean shift, are the measurement set of a GM-PHD update with
    H = I. Means of components above the extraction threshold are the estimates.

    Beyond the paper, and switched off by the preset ``published``: part of the
    samples is drawn from the foreground, with the sizes that the calibrated camera
    allows there; the likelihood is multiplied by what the foreground says of the
    box; peaks must be good enough; births are at unexplained peaks ([RCVV12]); the
    peaks themselves go to the fusion.
    """

    needs_pictures = True

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: ColourPhdParams,
        foreground: ForegroundParams,
        reader: FrameReader,
    ) -> None:
        """Read the templates and learn the background.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters = parameters
        self._appearance = Appearance(
            sequence,
            camera_index,
            reader,
            colour_space=parameters.colour_space,
            histogram_kernel=parameters.histogram_kernel,
            foreground=foreground if self._needs_foreground else None,
        )
        self._step_time = sequence.step_time
        camera = sequence.cameras[camera_index]
        births = GaussianMixture.empty(4)
        if parameters.birth != "peaks":
            births = entrance_boxes(
                camera, sequence.room, sequence.target_half_extents, parameters.birth_rate
            )
        self._entrances = GaussianMixture(
            births.weights * self._step_time, births.means, births.covariances, births.labels
        )
        width, height = camera.image_size
        # uniform over the picture and the range of half sizes, of which a pixel each at least
        possible = self._appearance.sizes
        sizes = np.maximum(possible.largest - possible.smallest, 1.0)
        volume = width * height * float(np.prod(sizes))
        self._clutter = parameters.clutter_rate / volume

    @property
    def _needs_foreground(self) -> bool:
        p = self._parameters
        return (
            max(
                p.acceptance_foreground,
                p.foreground_weight,
                p.surroundings_weight,
                p.foreground_samples,
            )
            > 0.0
        )

    def start(self) -> ColourPhdState:
        """Nobody is in the picture."""
        return ColourPhdState(
            GaussianMixture.empty(4), np.zeros((0, 4)), 1, self._appearance.start()
        )

    def step(
        self,
        state: ColourPhdState,
        frame: int,
        picture: UInt8[ndarray, "h w 3"] | None,
        rng: np.random.Generator,
    ) -> tuple[ColourPhdState, ViewResult]:
        """One step; without a picture the intensity is predicted only."""
        p = self._parameters
        births = models.label_births(self._births(state.unexplained), state.next_label)
        predicted = gaussian_mixture.concatenate([self._predict(state.mixture), births])
        next_label = state.next_label + births.size
        if picture is None:
            mixture = self._reduce(predicted)
            after = ColourPhdState(mixture, np.zeros((0, 4)), next_label, state.foreground)
            return after, self._result(mixture)

        background, scene = self._appearance.look(state.foreground, picture)
        samples = self._sample(predicted, scene, rng)
        scores, _, _ = self._score(scene, samples)
        candidates = self._climb(samples, scores)
        peaks, distances = self._accept(scene, candidates)

        noise = self._sigmas(peaks)[:, :, None] ** 2 * np.eye(4)
        updated = phd.update(
            predicted,
            peaks,
            expected=predicted.means,
            jacobians=np.broadcast_to(np.eye(4), (predicted.size, 4, 4)),
            noise=noise,
            detection_probability=p.detection_probability,
            clutter_intensity=self._clutter,
            gate=GATE,
        )
        mixture = self._reduce(updated.posterior)
        unexplained = peaks[updated.measurement_weights < 0.5]
        result = self._result(
            mixture,
            peaks=peaks,
            peak_scores=np.exp(-0.5 * (distances / p.likelihood_sigma) ** 2),
            mask=scene.mask,
            samples=samples,
            sample_weights=np.exp(scores.max(axis=1) - scores.max()) if len(scores) else None,
            information={
                "peaks before acceptance": float(len(candidates)),
                "least distance": float(distances.min()) if len(distances) else 1.0,
                "foreground share": scene.foreground_share,
                "cardinality": mixture.cardinality,
            },
        )
        return ColourPhdState(mixture, unexplained, next_label, background), result

    def _births(self, unexplained: Float[ndarray, "B 4"]) -> GaussianMixture:
        p = self._parameters
        if p.birth == "entrances":
            return self._entrances
        around = GaussianMixture(
            weights=np.full(len(unexplained), min(1.0, p.birth_rate * self._step_time)),
            means=unexplained,
            covariances=self._sigmas(unexplained)[:, :, None] ** 2 * np.eye(4),
            labels=np.zeros(len(unexplained), dtype=np.int64),
        )
        return gaussian_mixture.concatenate([around, self._entrances])

    def _predict(self, mixture: GaussianMixture) -> GaussianMixture:
        """Random walk, in half sizes: a person nearby moves further in the picture."""
        p = self._parameters
        half_sizes = np.maximum(mixture.means[:, 2:], 0.5)
        sigmas = np.concatenate([p.motion_sigma * half_sizes, p.growth_sigma * half_sizes], axis=1)
        noise = sigmas[:, :, None] ** 2 * np.eye(4) * self._step_time
        return gaussian_mixture.predict(mixture, np.eye(4), noise, p.survival_probability)

    def _sample(
        self, predicted: GaussianMixture, scene: Scene, rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Boxes from the predicted intensity and from the foreground."""
        p = self._parameters
        everywhere = round(p.samples * p.foreground_samples)
        if predicted.size == 0 and p.foreground_samples > 0.0:
            everywhere = p.samples
        parts = [self._appearance.draw_on_foreground(everywhere, scene, rng)]
        count = p.samples - everywhere
        if predicted.size and count:
            chosen = rng.choice(
                predicted.size, count, p=predicted.weights / predicted.weights.sum()
            )
            factors = np.linalg.cholesky(predicted.covariances)
            offsets = np.einsum("nab,nb->na", factors[chosen], rng.standard_normal((count, 4)))
            parts.append(predicted.means[chosen] + offsets)
        return self._appearance.within(np.concatenate(parts))

    def _score(
        self, scene: Scene, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, "N G"], Float[ndarray, "N G"], Float[ndarray, " N"]]:
        """Log-likelihood and distance D of each box for each person, and share of foreground."""
        p = self._parameters
        distances = self._appearance.distances(scene, boxes)
        if not p.peaks_per_person:
            distances = distances.min(axis=1, keepdims=True)
        scores = -0.5 * (distances / p.likelihood_sigma) ** 2
        factors, inside = self._appearance.shape_scores(
            scene,
            boxes,
            inside_weight=p.foreground_weight,
            around_weight=p.surroundings_weight,
        )
        return scores + factors[:, None], distances, inside

    def _climb(
        self, samples: Float[ndarray, "S 4"], scores: Float[ndarray, "S G"]
    ) -> Float[ndarray, "M 4"]:
        """The peaks of the weighted samples, by each person's colours for themselves."""
        p = self._parameters
        found = [np.zeros((0, 4))]
        for person in range(scores.shape[1] if len(samples) else 0):
            weights = np.exp(scores[:, person] - scores[:, person].max())
            starts = mean_shift.starts(
                samples, weights, p.mean_shift_starts, spread=p.spread_starts
            )
            peaks, _ = mean_shift.modes(
                samples,
                weights,
                samples[starts],
                bandwidth=p.bandwidth,
                merge_distance=MERGE_DISTANCE,
            )
            found.append(peaks)
        return np.concatenate(found)

    def _accept(
        self, scene: Scene, candidates: Float[ndarray, "M 4"]
    ) -> tuple[Float[ndarray, "K 4"], Float[ndarray, " K"]]:
        """The peaks that look enough like a person, and their distances; one at each place."""
        p = self._parameters
        scores, distances, inside = self._score(scene, candidates)
        best, nearest, person = scores.max(axis=1), distances.min(axis=1), scores.argmax(axis=1)
        good = best >= -0.5 * (p.acceptance_distance / p.likelihood_sigma) ** 2
        if scene.mask is not None:
            good &= inside >= p.acceptance_foreground
        kept: list[int] = []
        for i in np.argsort(-best, kind="stable"):
            apart = (candidates[kept, :2] - candidates[i, :2]) / candidates[kept, 2:]
            least = np.where(person[kept] == person[i], SAME_PERSON_DISTANCE, MERGE_DISTANCE)
            if good[i] and np.all((apart**2).sum(axis=1) >= least**2):
                kept.append(int(i))
        return candidates[kept], nearest[kept]

    def _sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Standard deviations of peaks: proportional to the box."""
        p = self._parameters
        half_sizes = np.maximum(boxes[:, 2:], 0.5)
        return np.concatenate([p.centre_sigma * half_sizes, p.size_sigma * half_sizes], axis=1)

    def _reduce(self, mixture: GaussianMixture) -> GaussianMixture:
        p = self._parameters
        reduced, _ = gaussian_mixture.reduce(
            mixture,
            pruning_threshold=p.pruning_threshold,
            merging_threshold=p.merging_threshold,
            max_components=p.max_components,
        )
        return reduced

    def _result(
        self,
        mixture: GaussianMixture,
        *,
        peaks: Float[ndarray, "M 4"] | None = None,
        peak_scores: Float[ndarray, " M"] | None = None,
        mask: UInt8[ndarray, "h w"] | None = None,
        samples: Float[ndarray, "S 4"] | None = None,
        sample_weights: Float[ndarray, " S"] | None = None,
        information: dict[str, float] | None = None,
    ) -> ViewResult:
        p = self._parameters
        peaks = np.zeros((0, 4)) if peaks is None else peaks
        peak_scores = np.zeros(0) if peak_scores is None else peak_scores
        chosen = phd.extract(mixture, p.extraction_threshold)
        estimates, weights = mixture.means[chosen], mixture.weights[chosen]
        labels = mixture.labels[chosen]
        if p.output == "estimates":
            boxes, box_weights, box_labels = estimates, weights, labels
        else:
            boxes, box_weights = peaks, peak_scores
            box_labels = np.full(len(peaks), -1, dtype=np.int64)
        return ViewResult(
            boxes=boxes,
            weights=box_weights,
            labels=box_labels,
            sigmas=self._sigmas(boxes),
            estimates=estimates,
            estimate_weights=weights,
            estimate_labels=labels,
            measurements=peaks,
            measurement_scores=peak_scores,
            samples=np.zeros((0, 4), np.float32) if samples is None else samples.astype(np.float32),
            sample_weights=(
                np.zeros(0, np.float32)
                if sample_weights is None
                else sample_weights.astype(np.float32)
            ),
            information=information or {},
            foreground=None if mask is None else pack(mask),
        )
