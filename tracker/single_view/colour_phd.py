"""The published single-view filter: a GM-PHD over boxes, fed by peaks of the colour likelihood.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.1–2.3.
[RCVV12] Ristic, Clark, Vo, Vo, "Adaptive target birth intensity for PHD and CPHD
filters", IEEE TAES 48(2), 2012.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from scipy.stats import chi2

from tracker import colour, foreground, gaussian_mixture, mean_shift, models, phd
from tracker.foreground import BackgroundModel
from tracker.gaussian_mixture import GaussianMixture
from tracker.parameters import ColourPhdParams
from tracker.sequences.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes, entrance_boxes
from tracker.single_view.protocol import ViewResult
from tracker.single_view.templates import read_templates

BACKGROUND_PICTURES = 32
"""Pictures spread over the clip that the background is learnt from."""

GATE = float(chi2.ppf(0.9999, df=4))
"""Squared Mahalanobis distance: a person's own peak lies inside with this probability."""

MERGE_DISTANCE = 0.8
"""Peaks closer than this, in half sizes, are one."""

SAME_PERSON_DISTANCE = 1.5
"""Peaks of the same person's colours closer than this, in half sizes, are one."""

SIZE_JITTER = 0.1
"""Relative spread around the size that the target has at a place of the room: people differ."""

# in half sizes from a box's centre, left, top, right, bottom: inside, above, left and right
_PARTS = np.array(
    [
        [-1.0, -1.0, 1.0, 1.0],
        [-1.0, -2.0, 1.0, -1.3],
        [-2.2, -1.0, -1.4, 0.3],
        [1.4, -1.0, 2.2, 0.3],
    ]
)


@dataclass(frozen=True, slots=True, eq=False)
class ColourPhdState:
    """The posterior of the step before, what it left unexplained, and the next free label."""

    mixture: GaussianMixture
    unexplained: Float[ndarray, "B 4"]
    """Peaks that no component explained: where somebody may have appeared."""
    next_label: int


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """One picture, prepared for the comparison of many boxes."""

    bins: ndarray
    mask: ndarray | None
    sums: ndarray | None


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
        reader: FrameReader,
    ) -> None:
        """Read the templates and learn the background.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        view = sequence.views[camera_index]
        if not view.has_pictures:
            raise ValueError(
                f'camera "{view.camera.name}" of {sequence.name} has no pictures; give it a video '
                "or images in sequence.toml, or choose single_view none to use its detections"
            )
        self._parameters = parameters
        self._model = read_templates(sequence, parameters, reader)
        self._sizes = BoxSizes.of(view.camera, sequence.room, sequence.target_half_extents)
        self._image_size = view.camera.image_size
        self._step_time = sequence.step_time
        self._background: BackgroundModel | None = None
        if self._needs_foreground:
            count = min(BACKGROUND_PICTURES, sequence.frames)
            steps = np.linspace(0, sequence.frames - 1, count).astype(int)
            pictures = (reader.picture(camera_index, int(step)) for step in steps)
            self._background = BackgroundModel.learn(p for p in pictures if p is not None)
        births = GaussianMixture.empty(4)
        if parameters.birth != "peaks":
            births = entrance_boxes(
                view.camera, sequence.room, sequence.target_half_extents, parameters.birth_rate
            )
        self._entrances = GaussianMixture(
            births.weights * self._step_time, births.means, births.covariances, births.labels
        )
        width, height = self._image_size
        # uniform over the picture and the range of half sizes, of which a pixel each at least
        sizes = np.maximum(self._sizes.largest - self._sizes.smallest, 1.0)
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
        return ColourPhdState(GaussianMixture.empty(4), np.zeros((0, 4)), next_label=1)

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
            return ColourPhdState(mixture, np.zeros((0, 4)), next_label), self._result(mixture)

        scene = self._look(picture)
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
            samples=samples,
            sample_weights=np.exp(scores.max(axis=1) - scores.max()) if len(scores) else None,
            information={
                "peaks before acceptance": float(len(candidates)),
                "least distance": float(distances.min()) if len(distances) else 1.0,
                "foreground share": float(scene.mask.mean()) if scene.mask is not None else 0.0,
                "cardinality": mixture.cardinality,
            },
        )
        return ColourPhdState(mixture, unexplained, next_label), result

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

    def _look(self, picture: UInt8[ndarray, "h w 3"]) -> _Scene:
        bins = colour.bin_map(picture, self._parameters.colour_space)
        if self._background is None:
            return _Scene(bins, None, None)
        mask = self._background.foreground(picture, self._parameters.foreground_threshold)
        return _Scene(bins, mask, foreground.integral(mask))

    def _sample(
        self, predicted: GaussianMixture, scene: _Scene, rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Boxes from the predicted intensity and from the foreground."""
        p = self._parameters
        everywhere = round(p.samples * p.foreground_samples)
        if predicted.size == 0 and p.foreground_samples > 0.0:
            everywhere = p.samples
        parts = [self._sample_foreground(everywhere, scene, rng)]
        count = p.samples - everywhere
        if predicted.size and count:
            chosen = rng.choice(
                predicted.size, count, p=predicted.weights / predicted.weights.sum()
            )
            factors = np.linalg.cholesky(predicted.covariances)
            offsets = np.einsum("nab,nb->na", factors[chosen], rng.standard_normal((count, 4)))
            parts.append(predicted.means[chosen] + offsets)
        samples = np.concatenate(parts)
        samples[:, 2:] = np.clip(samples[:, 2:], self._sizes.smallest, self._sizes.largest)
        last = np.array(self._image_size) - 1
        inside = ((samples[:, :2] >= 0.0) & (samples[:, :2] <= last)).all(axis=1)
        return np.asarray(samples[inside])

    def _sample_foreground(
        self, count: int, scene: _Scene, rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Boxes centred on foreground pixels, of the sizes that a target can have there."""
        if scene.mask is None or count == 0:
            return np.zeros((0, 4))
        pixels = np.flatnonzero(scene.mask)
        if not len(pixels):
            return np.zeros((0, 4))
        rows, columns = np.divmod(rng.choice(pixels, count), scene.mask.shape[1])
        centres = np.stack([columns, rows], axis=1) + rng.uniform(-0.5, 0.5, (count, 2))
        sizes, possible = self._sizes.draw(centres, rng)
        sizes *= np.exp(SIZE_JITTER * rng.standard_normal((count, 1)))
        return np.concatenate([centres[possible], sizes[possible]], axis=1)

    def _score(
        self, scene: _Scene, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, "N G"], Float[ndarray, "N G"], Float[ndarray, " N"]]:
        """Log-likelihood and distance D of each box for each person, and share of foreground."""
        p = self._parameters
        distances = self._model.distances(scene.bins, boxes)
        if not p.peaks_per_person:
            distances = distances.min(axis=1, keepdims=True)
        scores = -0.5 * (distances / p.likelihood_sigma) ** 2
        if scene.sums is None:
            return scores, distances, np.ones(len(boxes))
        middles, half_sizes = boxes[:, [0, 1, 0, 1]], boxes[:, [2, 3, 2, 3]]
        inside, above, left, right = (
            foreground.box_shares(scene.sums, middles + part * half_sizes) for part in _PARTS
        )
        around = above + (left + right) / 2.0
        factors = p.foreground_weight * np.log(inside + 0.02) - p.surroundings_weight * around
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
        self, scene: _Scene, candidates: Float[ndarray, "M 4"]
    ) -> tuple[Float[ndarray, "K 4"], Float[ndarray, " K"]]:
        """The peaks that look enough like a person, and their distances; one at each place."""
        p = self._parameters
        scores, distances, inside = self._score(scene, candidates)
        best, nearest, person = scores.max(axis=1), distances.min(axis=1), scores.argmax(axis=1)
        good = best >= -0.5 * (p.acceptance_distance / p.likelihood_sigma) ** 2
        if scene.sums is not None:
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
        )
