"""Peaks of the colour likelihood in an image, as measurements of people with templates.

They are modes of a weighted sample of boxes ``centre_x, centre_y, half_width, half_height`` in
pixels, by mean shift; distances are in half sizes of the current box, so that the result does not
depend on scale.

[ZW21] Zhu, Wang, "3D target position tracking based on probability hypothesis
density filtering", 2021, §2.2.
[CM02] Comaniciu, Meer, "Mean shift: a robust approach toward feature space analysis",
IEEE TPAMI 24(5), 2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray
from scipy.special import expit

from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.kernels.pictures import images
from tracker.parameters.groups.colour_phd import ColourPeakParams
from tracker.parameters.groups.detections import ShapesParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes, box_sigmas
from tracker.single_view.colour.appearance import Appearance, Scene
from tracker.single_view.colour.trust import shapes_of_templates, template_trust, templates_suffice
from tracker.single_view.pictures.foreground import LEAST_SHARE
from tracker.single_view.protocol import TRUST, Dropped
from tracker.single_view.shape.finder import (
    SAME_PERSON,
    ShapeFinder,
    Shapes,
    log_ratios,
    shape_sigmas,
)

ITERATIONS = 30
"""Largest number of steps of a climb; most converge well before."""

TOLERANCE = 0.01
"""Length of a step in half sizes below which a climb ends: far below any peak's deviation."""


def heaviest_samples(
    boxes: Float[ndarray, "S 4"], weights: Float[ndarray, " S"], most: int, *, spread: bool
) -> Int[ndarray, " K"]:
    """Select the indices of the heaviest samples as starts, at most ``most``.

    Args:
        boxes: Samples, pixels.
        weights: Weights, not negative; samples of weight 0 are never selected.
        most: Largest number of starts.
        spread: Whether a start is at least half a box away from heavier ones. Without,
            all starts may be at the one target that fits best.
    """
    order = np.argsort(-weights, kind="stable")
    if not spread:
        chosen = order[:most]
        return chosen[weights[chosen] > 0.0]
    indices: ndarray = images.keep_apart(boxes, weights, order, 1.0, most)
    return indices


def modes(
    boxes: Float[ndarray, "S 4"],
    weights: Float[ndarray, " S"],
    start_boxes: Float[ndarray, "K 4"],
    *,
    bandwidth: float,
    merge_distance: float,
) -> tuple[Float[ndarray, "M 4"], Float[ndarray, " M"]]:
    """Climb from each start to a mode of the density Σ_i w_i k(x - x_i), [CM02].

    The kernel is Gaussian, with a bandwidth of ``bandwidth`` half sizes of the current
    box, in the centre and in the half sizes alike.

    Args:
        boxes: Samples x_i, pixels.
        weights: w_i, not negative.
        start_boxes: Boxes at which the climbs start; there may be none.
        bandwidth: Bandwidth in half sizes.
        merge_distance: Distance of centres, in half sizes, below which modes are merged to the
            denser one.

    Returns:
        The modes, densest first, and their densities. An empty sample has none, and neither has
        a start without any sample near it.
    """
    climbed = images.mean_shift(
        np.ascontiguousarray(boxes, dtype=float),
        np.ascontiguousarray(weights, dtype=float),
        np.ascontiguousarray(start_boxes, dtype=float),
        bandwidth,
        ITERATIONS,
        TOLERANCE,
    )
    found, densities = climbed.boxes, climbed.densities
    order = np.argsort(-densities, kind="stable")
    kept = images.keep_apart(found, densities, order, merge_distance, len(order))
    return found.take(kept, 0), densities.take(kept)


SUFFICIENT_TRUST = 0.9
"""Trust in the foreground at a person below which shapes are used as well."""

FITTING = 0.25
"""Least mean intersection over union of templates and people by shape for shapes to be used: boxes
drawn by hand around heads and trunks have 0.4 to 0.5, around bodies 0.6."""

_SHAPES = ShapesParams()
"""The default parameters of people by shape: the method ``shapes`` alone reads those of a run."""

PEAK_EVEN = 0.45
"""Distance to a template at which a peak at a shape is equally likely of a person and of something
else: at a peak colours are most similar, so those of plants, screens and walls are near as well."""

SHAPE_EVEN = 0.56
"""Distance to a template at which a shape without a peak at its place is equally likely of a person
and of something else, by the colours in the shape's own box."""

LARGEST = 2.0
"""Bound of the log likelihood ratio of a peak at a shape. Changes of light, and sides of a person
without a template, change it by as much."""

UNLIKE = 1.0
"""Bound of the log likelihood ratio against a shape with other colours than the templates, which
people without a template have."""


@dataclass(frozen=True, slots=True, eq=False)
class Passed:
    """People by colour and by shape, as they are passed to the fusion."""

    boxes: Float[ndarray, "N 4"]
    """Centre and half sizes, pixels."""
    scores: Float[ndarray, " N"]
    """Score of the colours, 0 … 1."""
    sigmas: Float[ndarray, "N 4"]
    """Standard deviations of the four numbers of each box, pixels."""
    log_ratios: Float[ndarray, " N"]
    """Log likelihood ratios, :attr:`tracker.single_view.protocol.ViewResult.log_ratios`."""


@dataclass(frozen=True, slots=True, eq=False)
class Peaks:
    """The M peaks of one image, and the samples of which they are the modes."""

    boxes: Float[ndarray, "M 4"]
    """Centre and half sizes, pixels."""
    scores: Float[ndarray, " M"]
    """Likelihood of each relative to that of a template's own colours, 0 … 1."""
    samples: Float[ndarray, "S 4"]
    """Sampled boxes, pixels."""
    sample_weights: Float[ndarray, " S"]
    """Weight of each sample relative to the largest, 0 … 1."""
    mask: UInt8[ndarray, "h w"] | None
    """The foreground mask, where it is used."""
    information: dict[str, float]
    """Numbers about this step for display, by name."""
    dropped: Dropped
    """Candidates that were rejected."""
    passed: Passed | None = None
    """The boxes for the fusion instead of the peaks, where shapes are used as well."""


class PeakFinder:
    """A detector of peaks in the images of one camera, by mean shift over weighted samples.

    Boxes are sampled from an intensity and weighted by the likelihood, ṽ = l_z(x) v(x);
    the peaks of ṽ that are similar enough to a person are accepted, one at each place. Where
    the parameters enable it, part of the samples is drawn from the foreground, with
    the sizes that the calibrated camera allows there, and the likelihood is multiplied
    by that of the foreground in the box.
    """

    def __init__(
        self,
        sequence: Sequence,
        camera_index: int,
        parameters: ColourPeakParams,
        foreground: ForegroundParams,
        reader: Pictures,
    ) -> None:
        """Read the templates and learn the background of one camera.

        Raises:
            ValueError: If there are no pictures or templates, or a template cannot be read.
        """
        self._parameters = p = parameters
        self._half_extents = sequence.target_half_extents
        self._appearance = Appearance(
            sequence,
            camera_index,
            reader,
            colour_space=p.colour_space,
            histogram_kernel=p.histogram_kernel,
            size_jitter=p.size_jitter,
            foreground=foreground if p.asks_foreground else None,
            carry_templates=p.carry_templates,
        )
        wanted = p.shapes == "always"
        self._fits = False
        """Whether people by shape are at the places of the templates."""
        if p.shapes in ("unsure", "fitting") and p.asks_foreground:
            # a person not seen by one camera's foreground is detected by shape in all cameras
            wanted = any(
                trust < SUFFICIENT_TRUST
                for camera in range(len(sequence.views))
                for trust in template_trust(sequence, camera, reader, foreground).values()
            )
        guessed = p.shapes == "unsure" and not templates_suffice(sequence)
        if p.shapes == "fitting" or wanted or guessed:
            by_shape = shapes_of_templates(sequence, reader)
            self._fits = by_shape.fit >= FITTING
            wanted = wanted or self._fits
        self._shapes = ShapeFinder.of(sequence, camera_index, reader) if wanted else None
        self._instead = np.zeros(len(self._appearance.model.names))
        """Weight with which the shape replaces the foreground at each person, 0 … 1."""
        self._by_shape = np.zeros(len(self._appearance.model.names))
        """Trust in the shapes at each person, 0 … 1."""
        if self._shapes is not None:
            names = self._appearance.model.names
            self._by_shape = np.array([by_shape.trust[name] for name in names])
            self._instead = (1.0 - self._appearance.trust) * self._by_shape

    @property
    def sizes(self) -> BoxSizes:
        """The possible sizes of a target."""
        return self._appearance.sizes

    def start(self) -> Any:
        """The state of the foreground model and of the shapes before the first image."""
        shapes = None if self._shapes is None else self._shapes.start()
        return self._appearance.start(), shapes

    def find(
        self,
        state: Any,
        picture: UInt8[ndarray, "h w 3"],
        intensity: GaussianMixture,
        rng: np.random.Generator,
    ) -> tuple[Any, Peaks]:
        """Find the peaks of one image.

        Args:
            state: The state of :meth:`start`, or after the image before.
            picture: The image, BGR.
            intensity: The predicted intensity of people, over boxes.
            rng: The generator of the samples.

        Returns:
            The state for the next image, and the peaks.
        """
        background, shape_state = state
        p = self._parameters
        background, scene = self._appearance.prepare(background, picture)
        shapes: Shapes | None = None
        if self._shapes is not None:
            least = min(_SHAPES.passed_odds, p.shape_odds) if self._fits else p.shape_odds
            shape_state, shapes = self._shapes.find(shape_state, picture, least, _SHAPES.overlap)
        samples = self._sample(intensity, scene, rng)
        scores, _, _ = self._score(scene, shapes, samples)
        candidates = self._climb(samples, scores)
        boxes, distances, person, dropped = self._accept(scene, shapes, candidates)
        passed = None
        if shapes is not None:
            if self._fits:
                passed = self._passed(scene, shapes, boxes, distances, person)
            new = np.flatnonzero(~self._near(shapes, boxes).any(axis=1))
            more = shapes.boxes[new[shapes.log_odds[new] >= p.shape_odds]]
            boxes = np.concatenate([boxes, more])
            distances = np.concatenate([distances, self._nearest(scene, more)])
        return (background, shape_state), Peaks(
            boxes=boxes,
            scores=self._likelihood(distances),
            samples=samples,
            sample_weights=(
                np.exp(scores.max(axis=1) - scores.max()) if len(scores) else np.zeros(0)
            ),
            mask=scene.mask,
            information={
                **dropped.information(len(candidates) - len(dropped.gates)),
                "least distance": float(distances.min()) if len(distances) else 1.0,
                "foreground share": scene.foreground_share,
                TRUST: float(self._appearance.trust.mean()),
            },
            dropped=dropped,
            passed=passed,
        )

    def _passed(
        self,
        scene: Scene,
        found: Shapes,
        peaks: Float[ndarray, "N 4"],
        distances: Float[ndarray, " N"],
        person: Int[ndarray, " N"],
    ) -> Passed:
        """Combine people by shape with peaks, and add peaks at places without a shape.

        A peak supports the most likely shape at its place: others there are parts of the same
        person. The likelihood ratio of the colours multiplies that of the shape; the foreground
        does not, for parts of people, shadows and plants are foreground as well. For a peak
        without a shape ln (t Λ + 1 - t) is the ratio of not being detected by shape, with the
        trust t in the shapes at the person whose colours it has.
        """
        s = _SHAPES
        near = self._near(found, peaks)
        surest = np.where(near, found.log_odds[:, None], -np.inf)
        supported = near & (surest == surest.max(axis=0, initial=-np.inf))
        behind = self._behind(found, peaks, person, supported)
        alone = np.flatnonzero(~near.any(axis=0) | behind)
        supported &= ~behind
        own = self._nearest(scene, found.boxes)
        ratios = log_ratios(found.log_odds, s.even_odds, s.odds_weight, s.largest_ratio)
        ratios += colour_ratios(supported, distances, own, self._parameters.likelihood_sigma)
        least = log_ratios(np.array(s.passed_odds), s.even_odds, s.odds_weight, s.largest_ratio)
        trust = self._by_shape[person[alone]]
        of_alone = np.log(trust * np.exp(least) + 1.0 - trust)
        # the foreground replaces the shape for a person occluded by another one's shape
        seen = np.where(behind[alone], self._trusted(person[alone]), 0.0)
        return Passed(
            np.concatenate([found.boxes, peaks[alone]]),
            self._likelihood(np.concatenate([own, distances[alone]])),
            np.concatenate(
                [
                    shape_sigmas(found.boxes, self._half_extents, s),
                    self.sigmas(peaks[alone]),
                ]
            ),
            np.concatenate([ratios, _discount(of_alone, seen)]),
        )

    @staticmethod
    def _behind(
        found: Shapes,
        peaks: Float[ndarray, "N 4"],
        person: Int[ndarray, " N"],
        supported: Bool[ndarray, "K N"],
    ) -> Bool[ndarray, " N"]:
        """Whether each peak is of another person than the one nearest in colours to the shape:
        two people in front of each other have one shape in the image."""
        behind = np.zeros(len(peaks), dtype=bool)
        for k in np.flatnonzero(supported.any(axis=1)):
            own = np.flatnonzero(supported[k])
            apart = np.abs(peaks[own, :2] - found.boxes[k, :2]) / found.sizes[k]
            nearest = own[(apart**2).sum(axis=1).argmin()]
            behind[own] |= person[own] != person[nearest]
        return behind

    def _nearest(self, scene: Scene, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, " N"]:
        """The distance of each box to the nearest template, D."""
        if not len(boxes):
            return np.zeros(0)
        return np.asarray(self._appearance.model.distances(scene.bins, boxes).min(axis=1))

    def _likelihood(self, distances: Float[ndarray, " N"]) -> Float[ndarray, " N"]:
        return np.asarray(np.exp(-0.5 * (distances / self._parameters.likelihood_sigma) ** 2))

    @staticmethod
    def _near(found: Shapes, boxes: Float[ndarray, "N 4"]) -> Bool[ndarray, "K N"]:
        """Whether each box is at the place of each person by shape."""
        apart = (found.boxes[:, None, :2] - boxes[None, :, :2]) / found.sizes[:, None]
        return np.asarray((np.abs(apart) < SAME_PERSON).all(axis=2))

    def sigmas(self, boxes: Float[ndarray, "N 4"]) -> Float[ndarray, "N 4"]:
        """Standard deviations of peaks: proportional to the box, with an upper bound."""
        p = self._parameters
        return box_sigmas(boxes, p.centre_sigma, p.size_sigma, largest=p.sigma_height)

    def _sample(
        self, intensity: GaussianMixture, scene: Scene, rng: np.random.Generator
    ) -> Float[ndarray, "S 4"]:
        """Sample boxes from the intensity and from the foreground."""
        p = self._parameters
        everywhere = round(p.samples * p.foreground_samples)
        if intensity.size == 0 and p.foreground_samples > 0.0:
            everywhere = p.samples
        on_foreground = round(everywhere * float(self._appearance.trust.mean()))
        parts = [
            self._appearance.draw_on_foreground(on_foreground, scene, rng),
            self._appearance.draw_anywhere(everywhere - on_foreground, rng),
        ]
        count = p.samples - everywhere
        if intensity.size and count:
            chosen = rng.choice(
                intensity.size, count, p=intensity.weights / intensity.weights.sum()
            )
            factors = np.linalg.cholesky(intensity.covariances)
            offsets = np.einsum("nab,nb->na", factors[chosen], rng.standard_normal((count, 4)))
            parts.append(intensity.means[chosen] + offsets)
        return self._appearance.within(np.concatenate(parts))

    def _score(
        self, scene: Scene, shapes: Shapes | None, boxes: Float[ndarray, "N 4"]
    ) -> tuple[Float[ndarray, "N G"], Float[ndarray, "N G"], Float[ndarray, " N"]]:
        """Log likelihood and distance D of each box for each person, and share of foreground.

        At a person whom the foreground does not show, the shape replaces it:
        a ln(P + ε), with the probability P of a person by shape, in place of the share inside.
        """
        p = self._parameters
        distances = self._appearance.model.distances(scene.bins, boxes)
        trust, instead = self._appearance.trust[None, :], self._instead[None, :]
        if not p.peaks_per_person:
            trust, instead = (each.min(axis=1, keepdims=True) for each in (trust, instead))
            distances = distances.min(axis=1, keepdims=True)
        scores = -0.5 * (distances / p.likelihood_sigma) ** 2
        factors, inside = self._appearance.shape_scores(
            scene,
            boxes,
            inside_weight=p.foreground_weight,
            around_weight=p.surroundings_weight,
        )
        scores = scores + trust * factors[:, None]
        if shapes is not None and instead.any():
            likely = np.log(expit(shapes.support(boxes)) + LEAST_SHARE)
            scores += p.foreground_weight * instead * likely[:, None]
        return scores, distances, inside

    def _trusted(self, person: Int[ndarray, " N"]) -> Float[ndarray, " N"]:
        """Trust in the foreground at the person of each box, 0 … 1."""
        trust = self._appearance.trust
        if not self._parameters.peaks_per_person:
            trust = np.full(1, trust.min())
        return np.asarray(trust[person])

    def _climb(
        self, samples: Float[ndarray, "S 4"], scores: Float[ndarray, "S G"]
    ) -> Float[ndarray, "M 4"]:
        """Climb to the peaks of the weighted samples, separately for each person's colours."""
        p = self._parameters
        found = [np.zeros((0, 4))]
        for person in range(scores.shape[1] if len(samples) else 0):
            weights = np.exp(scores[:, person] - scores[:, person].max())
            starts = heaviest_samples(samples, weights, p.mean_shift_starts, spread=p.spread_starts)
            peaks, _ = modes(
                samples,
                weights,
                samples[starts],
                bandwidth=p.bandwidth,
                merge_distance=p.merge_distance,
            )
            found.append(peaks)
        return np.concatenate(found)

    def _accept(
        self, scene: Scene, shapes: Shapes | None, candidates: Float[ndarray, "M 4"]
    ) -> tuple[Float[ndarray, "K 4"], Float[ndarray, " K"], Int[ndarray, " K"], Dropped]:
        """Select the peaks similar enough to a person, one at each place.

        Returns:
            The peaks, their distances D, their persons, and the rejected candidates.
        """
        p = self._parameters
        scores, distances, inside = self._score(scene, shapes, candidates)
        best, nearest, person = scores.max(axis=1), distances.min(axis=1), scores.argmax(axis=1)
        coloured = nearest <= p.acceptance_distance
        likely = best >= -0.5 * (p.acceptance_distance / p.likelihood_sigma) ** 2
        covered = np.ones(len(candidates), dtype=bool)
        if scene.mask is not None:
            covered = inside >= p.acceptance_foreground * self._trusted(person)
        good = likely & covered
        kept: list[int] = []
        for i in np.argsort(-best, kind="stable"):
            apart = (candidates[kept, :2] - candidates[i, :2]) / candidates[kept, 2:]
            least = np.where(person[kept] == person[i], p.same_person_distance, p.merge_distance)
            if good[i] and np.all((apart**2).sum(axis=1) >= least**2):
                kept.append(int(i))
        rejected = ~good & coloured & covered
        by_shape = self._instead[person] > self._trusted(person)
        gates = {
            "colour": ~good & ~coloured,
            "foreground": ~good & coloured & ~covered,
            "surroundings": rejected & ~by_shape,
            "shape": rejected & by_shape,
            "another at its place": good & ~np.isin(np.arange(len(good)), kept),
        }
        return candidates[kept], nearest[kept], person[kept], Dropped.of(candidates, gates)


def _discount(
    log_ratios: Float[ndarray, " N"], share: Float[ndarray, " N"]
) -> Float[ndarray, " N"]:
    """Compute ln (t + (1 - t) Λ) of likelihood ratios Λ below 1, which are uninformative with
    probability t."""
    mixed = np.log(share + (1.0 - share) * np.exp(np.minimum(log_ratios, 0.0)))
    return np.asarray(np.where(log_ratios < 0.0, mixed, log_ratios))


def colour_ratios(
    supported: Bool[ndarray, "K N"],
    of_peaks: Float[ndarray, " N"],
    of_shapes: Float[ndarray, " K"],
    sigma: float,
) -> Float[ndarray, " K"]:
    """Compute ln Λ of the colours of people by shape, to be added to that of the shape itself.

    With the distance D to the nearest template and the spread σ of the colour likelihood, for a
    shape with a peak at its place and for one without

        ln Λ = (D_p - D) / σ  within ±2,      ln Λ = (D_s - D) / σ  within -1 … 0.

    In rendered rooms the logarithm of the ratio of people and other things at such places
    decreases by about 1 / σ per unit of D, whatever the shape's odds: the two are independent,
    and their ratios multiply. A false shape near a person has that person's colours, so its
    own colours are no evidence for it: only a peak is.

    Args:
        supported: Whether each of N peaks is at the place of each of K shapes.
        of_peaks: D of each peak.
        of_shapes: D of each shape's box.
        sigma: σ, in units of D.
    """
    nearest = np.where(supported, of_peaks, np.inf).min(axis=1, initial=np.inf)
    by_peak = np.clip((PEAK_EVEN - nearest) / sigma, -LARGEST, LARGEST)
    by_box = np.clip((SHAPE_EVEN - of_shapes) / sigma, -UNLIKE, 0.0)
    return np.asarray(np.where(supported.any(axis=1), by_peak, by_box))
